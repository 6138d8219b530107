"""Text of a reply as readers take it: reasoning cut, fences opened, Markdown stripped.

Every function here and in the readers is linear in the text: no pattern nests one repetition in
another over the same characters, and each line is looked at a fixed number of times.
"""

from __future__ import annotations

import re
import unicodedata

READER_VERSION = 7  # Of all readers; it goes up when any reply can be read otherwise than before.

_NAMES = r"(?:think(?:ing)?|thoughts?|reasoning|scratchpad|analysis|reflection)"
_THINKING = re.compile(
    rf"(?i)(?P<closes></{_NAMES}>|\[/THINK\]|◁/think▷|<\|channel\|>final<\|message\|>)"
    rf"|(?P<opens><{_NAMES}>|\[THINK\]|◁think▷|<\|channel\|>analysis<\|message\|>)",
)
_TURN_END = re.compile(r"</s>|<\|(?:im_end|endoftext|eot_id|end)\|>|<end_of_turn>")
_ODD = re.compile(r"[^\x00-\x7f]")
_QUOTES = str.maketrans("\u2018\u2019\u201c\u201d\u00ab\u00bb\u2212", '\'\'""""-')
_FENCE = re.compile(r"(?:```|~~~)[\w+-]{0,16}")
_FRAME = re.compile(
    r"(?i)\\boxed\s?\{(?:\\text\s?\{)?([^{}\n]{0,200})\}{1,2}|<\|begin_of_box\|>|<(?:final_)?answer>",
)
_FRAME_END = re.compile(r"<\|end_of_box\|>|</(?:final_)?answer>|<br ?/?>", re.I)
_LATEX = re.compile(r"\\(?:text|textbf|mathrm|mathbf)\s?\{([^{}\n]{0,200})\}")
_STRUCK = re.compile(r"~~[^~\n]{1,400}~~")
_EMPHASIS = re.compile(r"\*\*|`|\$|\*(?=\S)|(?<=\S)\*")
_ESCAPED = re.compile(r"\\n(?![a-z])")


def answer_of(text: str) -> str | None:
    """Return what a reply says outside of its reasoning, or None where it is reasoning alone.

    Digits, quotation marks and blanks of other scripts become plain ones.
    """
    start, opened = 0, -1
    for mark in _THINKING.finditer(text):
        if mark["closes"]:
            start, opened = mark.end(), -1
        elif opened < 0:
            opened = mark.start()
    answer = text[start:opened] if opened >= 0 else text[start:]
    end = _TURN_END.search(answer)
    if end and answer[: end.start()].strip():
        answer = answer[: end.start()]
    if not answer.strip():
        return None if start or opened >= 0 else ""
    return _ODD.sub(_plain, answer.replace("\r\n", "\n").translate(_QUOTES))


def plain_lines(answer: str) -> list[str]:
    """Return the lines of an answer without fences, emphasis and LaTeX.

    An answer in a frame (a box, a tag) stands on a line of its own behind "Answer:".
    """
    opened = _ESCAPED.sub("\n", _STRUCK.sub("", answer)).replace('\\"', '"')
    opened = _FRAME.sub(
        lambda frame: f"\nAnswer: {frame[1]}\n" if frame[1] else "\nAnswer: ", opened
    )
    opened = _LATEX.sub(r"\1", _FRAME_END.sub("\n", _FENCE.sub(" ", opened)))
    return _EMPHASIS.sub("", opened).replace("_", " ").split("\n")


def is_open(answer: str) -> bool:
    """True if an answer breaks off within a fence, a bracket or a quotation."""
    pairs = any(answer.count(opens) > answer.count(closes) for opens, closes in ("{}", "[]"))
    last = answer.rstrip().rsplit("\n", 1)[-1]
    return pairs or answer.count("```") % 2 == 1 or last.count('"') % 2 == 1


def _plain(odd: re.Match[str]) -> str:
    """Return a character in compatibility form; superscripts and fractions are no digits."""
    character = odd[0]
    if unicodedata.category(character) == "Cf":
        return ""
    is_small = unicodedata.decomposition(character).startswith(("<super>", "<sub>", "<fraction>"))
    return character if is_small else unicodedata.normalize("NFKC", character)
