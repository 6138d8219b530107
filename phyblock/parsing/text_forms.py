"""What of a reply is read: the answer behind the thinking, in plain forms of its characters."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re
import unicodedata

__all__ = [
    "BOX",
    "SENTENCES",
    "TAG",
    "answer_of",
    "number_of_word",
    "plain_forms",
    "plain_line",
    "unmarked",
]

_NOT_ASCII = re.compile(r"[^\x00-\x7f]")
_TAGS = r"(?:think(?:ing)?|thoughts?|reasoning|scratchpad|analysis|reflection)"
_THINKING = re.compile(
    rf"(?P<closes></{_TAGS}>|\[/THINK\]|◁/think▷|<\|channel\|>final<\|message\|>)"
    rf"|(?P<opens><{_TAGS}>|\[THINK\]|◁think▷|<\|channel\|>analysis<\|message\|>)",
    re.IGNORECASE,
)
_NEXT_TURN = re.compile(
    r"</s>|<\|(?:im_end|endoftext|eot_id|end|user)\|>|<end_of_turn>|<｜end▁of▁sentence｜>"
)
"""What a server should have stopped at: behind it a model plays the next turn."""
_STRUCK_OUT = re.compile(
    r"~~[^~\n]{1,400}~~|<(?:del|s)>[^<>\n]{1,400}</(?:del|s)>|<!--(?:(?!<!--).){0,4000}?-->"
)
_FRAMED = re.compile(r"<\|begin_of_box\|>((?:[^<{}]|<(?!\|)){1,4000})(?:<\|end_of_box\|>|\Z)")
_DEFINED = re.compile(
    r"(?P<before>(?:\(|: ?))(?P<name>[NX])(?P<between>\)?)"
    r",? (?:where|with) (?P=name) ?= ?(?P<value>\d{1,3}|[A-Z])\b"
)
"""An answer in the words of the prompt, "Move(N) with N = 3", and what its letter stands for."""
TAG = re.compile(
    r"<(?:final_)?answer>(?P<value>(?:(?!</?(?:final_)?answer>).){1,20000})",
    re.IGNORECASE | re.DOTALL,
)
BOX = re.compile(r"\\boxed\s{0,2}\{(?P<value>(?:[^{}]|\{[^{}]{0,200}\}){1,4000})\}", re.DOTALL)
"""Frames in which an answer stands."""
SENTENCES = re.compile(r"(?<=[^\d\s][.;!?])\s|(?<=\d[.;!?])\s(?=\D)|(?<=[。；！？])|\n")
"""Where one sentence ends and the next begins; a number with a full stop may count an item."""
_QUOTES = re.compile(
    r"[*`$\"\u201c\u201d\u00ab\u00bb\u201e]|(?<!\w)['\u2018\u2019]|['\u2018\u2019](?!\w)"
)
_LATEX = re.compile(
    r"\\(?:text|textbf|mathrm|mathbf)\s{0,2}\{([^{}\n]{0,80})\}|\\(?:,|;|quad|[()\[\] ])"
)
_BOXED = re.compile(r"\\boxed\s{0,2}\{|\\[()\[\]]|~")
_LATEX_ARROW = re.compile(r"\\(?:long)?(?:right)?(?:arrow|to)\b")

_NUMBER_WORDS = {
    word: number
    for number, words in enumerate(
        (
            "one eins un une uno uno um один 一",
            "two zwei deux dos due dois duas два две 二 两",
            "three drei trois tres tre três три 三",
            "four vier quatre cuatro quattro quatro четыре 四",
            "five fünf cinq cinco cinque пять 五",
            "six sechs seis sei шесть 六",
            "seven sieben sept siete sette sete семь 七",
            "eight acht huit ocho otto oito восемь 八",
            "nine neun neuf nueve nove девять 九",
            "ten zehn dix diez dieci dez десять 十",
            "eleven elf onze once undici одиннадцать 十一",
            "twelve zwölf douze doce dodici двенадцать 十二",
            "thirteen dreizehn treize trece tredici 十三",
            "fourteen vierzehn quatorze catorce 十四",
            "fifteen fünfzehn quinze quince quindici 十五",
            "sixteen sechzehn seize dieciséis sedici 十六",
        ),
        start=1,
    )
    for word in words.split()
}


def answer_of(text: str) -> str | None:
    """What a reply says after its thoughts, or before thoughts that never end, in plain forms.

    None where it consists of thoughts alone: they hold no answer, closed or not.
    """
    start, is_thinking, opened = 0, False, 0
    for mark in _THINKING.finditer(text):
        if mark["closes"]:
            start, is_thinking = mark.end(), False
        elif not is_thinking:
            opened, is_thinking = mark.start(), True
    answer = text[start:opened] if is_thinking else text[start:]
    ends = _NEXT_TURN.search(answer)
    if ends and answer[: ends.start()].strip():
        answer = answer[: ends.start()]
    if not answer.strip():
        return None if start or is_thinking else ""
    answer = _DEFINED.sub(r"\g<before>\g<value>\g<between>", answer)
    return plain_forms(_FRAMED.sub(r"\\boxed{\1}", _STRUCK_OUT.sub(" ", answer)))


def number_of_word(word: str) -> int | None:
    """The number from one to sixteen that a word of some language is."""
    return _NUMBER_WORDS.get(word.lower())


def plain_line(line: str) -> str:
    """A line without emphasis, quotation marks and LaTeX; underscores are spaces."""
    value = _LATEX.sub(r" \1 ", _LATEX_ARROW.sub("→", line)) if "\\" in line else line
    return _QUOTES.sub("", value).replace("_", " ")


def unmarked(text: str) -> str:
    """A text as `plain_line`, without the marks of boxes and formulas either."""
    return _BOXED.sub("", plain_line(text)).strip()


def plain_forms(text: str) -> str:
    """A text in compatibility form (NFKC, as full-width digits), but with exponents left alone.

    Superscripts, subscripts and fractions are no digits: "5 cm²" is not "5 cm2".
    """
    return unicodedata.normalize("NFC", _NOT_ASCII.sub(_plain_form, text))


def _plain_form(found: re.Match[str]) -> str:
    character = found[0]
    tag = unicodedata.decomposition(character).partition(" ")[0]
    kept = tag in ("<super>", "<sub>", "<fraction>")
    return character if kept else unicodedata.normalize("NFKC", character)
