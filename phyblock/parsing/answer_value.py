"""What a short piece of a reply names: a letter, an option's text, its number, or an order.

A reader gives the letters that a text names, `CONTRADICTION` for a text that names something that
is no answer (two options, or none of those shown), and None for a text that names nothing.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from phyblock.parsing.answer_patterns import REJECTS
from phyblock.parsing.speech import PLACES, words
from phyblock.parsing.text_forms import plain_forms, unmarked

__all__ = ["CONTRADICTION", "EDGES", "LETTERS", "ChoiceReader", "plain"]

CONTRADICTION = ""

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
_SPACE = re.compile(r"\s+")
_NOUN = r"(?:option|choice|answer|letter|alternative|picture|image|figure|place|position|spot)"
_LEAD = words(
    rf"(?:(?:(?:the|la|correct|best|right|definitely|clearly|likely|most|selected)\s{{1,3}}){{0,3}}"
    rf"(?P<noun>{_NOUN})\s{{0,3}}(?P<is>is\s{{1,3}})?:?\s{{0,3}}"
    rf"|(?:la|le|el|die|il|(?-i:[ao]))\s(?=\(?[A-Z]\)?(?:[\s.,:]|\Z))"
    rf"|(?:la\s|a\s)?(?:选项|选|選択肢|вариант|opción|opção)\s{{0,3}})"
)
_LETTER = re.compile(
    r"(?P<open>[(\[<{]{0,2})\s?(?P<letter>[A-Za-z])(?![A-Za-z0-9\-]|['\u2019][a-z])"
)
_CLOSERS = re.compile(r"[\s)\]}>.:,;!。\uff0e、]*")
_ALSO = words(
    r"[\s)\]}.]{0,4}(?:(?:,|/|&|\+|\bor\b|\band\b|\bund\b|\boder\b|\bou\b|\bo\b|\by\b|或|和|、)"
    r"[\s(\[]{0,3}){1,2}(?:option\s|choice\s)?[(\[]?(?P<letter>[A-Za-z])(?![A-Za-z0-9\-'])"
)
_AFTER_LETTER = words(
    r"(?:because|since|as|is|was|would|which|with|due|for|from|given|based|matches|shows|if|and"
    r"|but|not|over|rather|instead|\()\b"
)
_NEGATION = words(
    r"\b(?:not|no|neither|nor|never|isn't|aren't|wrong|incorrect|none|cannot|can't|except|nicht"
    r"|kein\w*)\b|不是|n't\b"
)
_SENTENCE_END = re.compile(r"[.!?。](?:\s|\Z)")
_ARTICLES = re.compile(r"^(?:the|an|a)\s")
EDGES = " \t\n.,:;!?()[]{}<>-\u2013\u2014。，"  # noqa: RUF001
_NUMBERED = words(
    r"(?:the\s)?(?:option|choice|alternative)\s{0,2}(?:number\s{1,2}|no\.?\s{0,2}|#)?"
    r"\(?(?P<number>\d{1,2})(?![\d.,]?\d)"
)
_BARE_NUMBER = re.compile(r"[(\[]?(?P<number>\d{1,2})[)\].]{0,2}\s{0,3}\Z")
_ORDINAL = words(
    rf"\b(?:the\s{{1,2}})?(?P<word>{'|'.join(PLACES)})\s{{1,2}}(?:(?:of\s(?:the\s)?(?:\w+\s)?)?(?:"
    r"option|choice|answer|alternative|opción|opção|opzione|antwort)s?\b|one(?=\W*\Z))"
)
_SAYS_MORE = words(r"\s(?!from|in|of|on|with|since|because|as|where|which|that|for)[a-z]")
_AGREES = words(
    r"\s(?:is|must be|seems|appears to be|looks|fits|matches|shows|ist|es|est|è"
    r"|é)\b(?![^.;\n]*\b(?:not|less|too|but|yet)\b)[^.;\n]{0,30}?(?:\b(?:correct[ae]?|right|best"
    r"|answer|one|picture|goal|it|richtig\w*|bonne|giusta)\b|\Z|(?<=fits)|(?<=matches))"
)
"""What is said of an option by its place: more than where it stands is agreed to, or it is none."""
_DIGITS = re.compile(r"(?<![\w.,/])\d{1,6}(?:\.\d{1,6})?(?![\d/]|[.,]\d)")
_UNIT = re.compile(r"(?P<space>\s?)(?P<unit>[a-z\"]*)")
_LENGTHS = re.compile(r"(?:[mdk]?m|(?:milli|deci|kilo)?met\w+|in|inch\w*|ft|feet|foot|\")\Z")
_SPELLED = (
    (re.compile(r"(?<=[a-z])-(?=[a-z])"), " "),
    (re.compile(r"\b(?:counter|anti) ?clockwise\b"), "counterclockwise"),
    (re.compile(r" ?°"), " degrees"),
)
"""Ways of writing that tell no options apart."""
_HEDGE = words(
    r"(?:(?:most|very|almost)\s)?(?:probably|likely|certainly|surely|clearly|definitely|therefore"
    r"|thus|hence|indeed|simply|obviously|evidently|actually)[\s,]{1,3}"
)
_TAKEN_BACK = words(
    r"[)\]]?\s?(?:\?|\.{2,}|…)\s{0,3}(?:no|wait|or|hmm+|actually)\b|(?:(?!because|since|as\b|while"
    r"|but|not)[^.,;\n]){0,40}?\b(?:and|or)\s{1,2}(?:option\s)?[(\[]?[A-Z][)\]]"
)
_COUNTS = re.compile(r"(?<![a-z])\d|\b(?:half|twice|once|quarter)\b")
_WORD_NUMBERS = {
    **{"zero": "0", "one": "1", "two": "2", "three": "3", "four": "4", "five": "5", "six": "6"},
    **{"seven": "7", "eight": "8", "nine": "9", "ten": "10", "eleven": "11", "twelve": "12"},
}
_WORD = re.compile(r"[^\W\d_]+")


class ChoiceReader:
    """Reads one option out of a short text, given the options shown, the first one being A."""

    def __init__(self, options: Sequence[str]) -> None:
        self.letters = LETTERS[: len(options)]
        self._texts = [plain(option) for option in options]
        self._numbers = [_only_number(text) for text in self._texts]
        self._unit = _unit(self._texts[0]) if self._texts else ""
        self._has_digits = any(_COUNTS.search(text) for text in self._texts)
        by_length = sorted({text for text in self._texts if text}, key=len, reverse=True)
        alternatives = "|".join(re.escape(text) for text in by_length) or r"(?!)"
        # "5 cm" is not in "7.5 cm", and a half cylinder is no cylinder.
        self._any_text = re.compile(
            rf"(?<!\w)(?<!\d[.,/])(?<!half )(?<!semi )(?:{alternatives})(?!\w|[.,/]\d)"
        )
        self._not_this = re.compile(
            rf", (?:and )?(?:not|nicht) (?:\w{{1,4}} )?(?:{alternatives})(?!\w)"
        )

    def read(self, text: str) -> str | None:
        """What a text names by letter, else by the option's text, else by its number."""
        value = unmarked(text)
        found = self.letter(value)
        if found is None:
            value = _SENTENCE_END.split(value, maxsplit=1)[0]
            found = self.option_text(value)
        return self.number(value) if found is None else found

    def letter(self, text: str) -> str | None:
        """What a text names when it begins with a letter that is no word."""
        value = _HEDGE.sub("", unmarked(text), count=1)
        head, named = _head(value)
        if head is None:
            return None
        rest = value[head.end() :]
        if _TAKEN_BACK.match(rest):
            return CONTRADICTION
        after = rest[len(_closers(rest)) :]
        if _is_word(head, rest, after, named=named) and plain(after) != self._text_of(head):
            return None
        letter = head["letter"].upper()
        also = _ALSO.match(rest)
        second = also["letter"] if also else ""
        is_word = second in "aA" or (second == "I" and "I" not in self.letters)
        if second and not (is_word and re.match(r"\s\w", rest[also.end() :] if also else "")):
            return letter if second.upper() == letter in self.letters else CONTRADICTION
        if letter not in self.letters:
            return CONTRADICTION
        named_text = self._exact(after)
        return letter if named_text in (None, letter) else CONTRADICTION

    def letter_or_place(self, text: str) -> str | None:
        """What a text names by a letter that it begins with, else by a place."""
        found = self.letter(text)
        return self.number(_SENTENCE_END.split(text, maxsplit=1)[0]) if found is None else found

    def option_text(self, text: str, *, exact: bool = False) -> str | None:
        """What a text names by the words of an option: all of it, its beginning, or a part."""
        value = plain(unmarked(text))
        found = self._exact(value)
        if found is not None or exact:
            return found
        if _NUMBERED.match(value) and self._has_digits:
            # "Option 3" where 3 is also the text of another option.
            return CONTRADICTION
        value = self._not_this.sub("", value)
        if _NEGATION.search(value):
            return None
        matches = {match.group() for match in self._any_text.finditer(value)}
        if not matches:
            return self._by_number(value)
        return self._letter_of(matches.pop()) if len(matches) == 1 else CONTRADICTION

    def number(self, text: str) -> str | None:
        """What a text names by the option's number, where numbers cannot mean anything else."""
        value = unmarked(text).strip()
        ordinal = _ORDINAL.search(value)
        if (
            ordinal
            and not REJECTS.search(value, 0, ordinal.start())
            and (not _SAYS_MORE.match(value, ordinal.end()) or _AGREES.match(value, ordinal.end()))
        ):
            return self._nth(PLACES[ordinal["word"].lower()])
        if self._has_digits:
            return None
        numbered = _NUMBERED.match(value) or _BARE_NUMBER.match(value)
        return self._nth(int(numbered["number"])) if numbered else None

    def exact(self, text: str) -> str | None:
        """What a whole text is: a letter alone, a letter with its option, or an option alone."""
        value = _HEDGE.sub("", unmarked(text), count=1)
        head, _ = _head(value)
        if head is not None:
            after = plain(value[head.end() :])
            if not after:
                letter = head["letter"].upper()
                return letter if letter in self.letters else CONTRADICTION
            if self._exact(after) is not None:
                return self.letter(value)
        return self.option_text(value, exact=True)

    def _text_of(self, head: re.Match[str]) -> str | None:
        letter = head["letter"].upper()
        return self._texts[self.letters.index(letter)] if letter in self.letters else None

    def _exact(self, text: str) -> str | None:
        value = plain(text)
        if not value:
            return None
        hits = [i for i, option in enumerate(self._texts) if option and option == value]
        return self.letters[hits[0]] if len(hits) == 1 else None

    def _letter_of(self, option: str) -> str:
        return self.letters[self._texts.index(option)]

    def _by_number(self, value: str) -> str | None:
        """`5` for `5 cm`: where every option has a number and one alone that of the text."""
        found = list(_DIGITS.finditer(value))
        if None in self._numbers or len({float(number.group()) for number in found}) != 1:
            return None
        if any(self._is_of_other_unit(value, number.end()) for number in found):
            return None
        hits = [i for i, number in enumerate(self._numbers) if number == float(found[0].group())]
        return self.letters[hits[0]] if len(hits) == 1 else None

    def _is_of_other_unit(self, value: str, end: int) -> bool:
        """Whether what follows a number makes it another one: `10 mm` beside `10 cm`, or `3D`."""
        follows = _UNIT.match(value, end)
        assert follows is not None
        if self._unit:
            return follows["unit"] != self._unit and bool(_LENGTHS.match(follows["unit"]))
        return bool(follows["unit"]) and not follows["space"]

    def _nth(self, number: int) -> str:
        return self.letters[number - 1] if 1 <= number <= len(self.letters) else CONTRADICTION


def plain(text: str) -> str:
    """A text as options are compared: no case, no markup, no article, digits for numbers."""
    value = _SPACE.sub(" ", plain_forms(text).casefold())
    for spelled, as_usual in _SPELLED:
        value = spelled.sub(as_usual, value)
    value = _ARTICLES.sub("", unmarked(value).strip(EDGES))
    return _WORD.sub(lambda word: _WORD_NUMBERS.get(word[0], word[0]), value)


def _closers(text: str) -> str:
    match = _CLOSERS.match(text)
    return match.group() if match else ""


def _head(value: str) -> tuple[re.Match[str] | None, bool]:
    """The letter that a text begins with, and whether a noun says that it is an option's."""
    lead = _LEAD.match(value)
    head = _LETTER.match(value, lead.end()) if lead else None
    named = lead is not None and not lead["is"] and (lead["noun"] or "").lower() != "answer"
    return (head, named) if head else (_LETTER.match(value), False)


def _is_word(head: re.Match[str], rest: str, after: str, *, named: bool) -> bool:
    """Whether a letter is a word of the sentence ("A cube") or of another language."""
    closed = bool(re.match(r"\s?[)\]}>.:,;!。．，、：\n]|\s?\Z|\s[\-\u2013\u2014]", rest))  # noqa: RUF001
    if head["open"] or closed:
        return False
    if head["letter"] == "a":
        return True
    if head["letter"] == "A":
        follows = re.match(r"\s\(?[a-z0-9]", rest)
        return follows is not None and not named and _AFTER_LETTER.match(after) is None
    return head["letter"].islower() and not named


def _only_number(text: str) -> float | None:
    found = _DIGITS.findall(text)
    return float(found[0]) if len(found) == 1 else None


def _unit(text: str) -> str:
    """What stands behind the number of an option: `cm` of `5 cm`."""
    number = _DIGITS.search(text)
    follows = _UNIT.match(text, number.end()) if number else None
    return follows["unit"] if follows else ""
