"""Preparation of replies for parsers: reasoning removed, fences opened, Markdown stripped; JSON.

Every function here and in the parsers is linear in the text: no pattern nests one repetition in
another over the same characters, and each line is examined a fixed number of times.
"""

from __future__ import annotations

import json
import re
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

READER_VERSION = 8  # Of all parsers; increased when a reply may be parsed differently.

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
    """Return a reply without its reasoning, or None if it is only reasoning.

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

    An answer in a box or a tag becomes a separate line after "Answer:".
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
    """Return a character in compatibility form; superscripts and fractions are not digits."""
    character = odd[0]
    if unicodedata.category(character) == "Cf":
        return ""
    is_small = unicodedata.decomposition(character).startswith(("<super>", "<sub>", "<fraction>"))
    return character if is_small else unicodedata.normalize("NFKC", character)


REASONING = "reasoning"  # Key before that of the answer, under which a model may think first.
_MOST_OBJECTS = 128  # Objects that are tried, from the end: a plan with poses has one a step.
_DECODER = json.JSONDecoder(strict=False)
MeaningT = TypeVar("MeaningT")


@dataclass(frozen=True)
class AnswerForm(Generic[MeaningT]):
    """A form of answers, in keywords of JSON schema that all providers know.

    `key` holds the answer, `value` is its schema, `meaning` parses it and returns None for none.
    `example_value` shows the form with letters as placeholders, so that it is no answer itself.
    """

    key: str
    value: Mapping[str, Any]
    meaning: Callable[[Any], MeaningT | None]
    example_value: str
    reasons: bool = True

    @property
    def schema(self) -> dict[str, Any]:
        """The JSON schema of the whole object."""
        first = {REASONING: {"type": "string"}} if self.reasons else {}
        properties = {**first, self.key: dict(self.value)}
        return {
            "type": "object",
            "properties": properties,
            "required": list(properties),
            "additionalProperties": False,
        }

    @property
    def response_format(self) -> dict[str, Any]:
        """The field `response_format` of the OpenAI chat protocol."""
        asked = {"name": self.key, "schema": self.schema, "strict": True}
        return {"type": "json_schema", "json_schema": asked}

    @property
    def example(self) -> str:
        """The form as shown in prompts."""
        first = f'"{REASONING}": "...", ' if self.reasons else ""
        return f'{{{first}"{self.key}": {self.example_value}}}'

    def read(self, answer: str) -> MeaningT | None:
        """Return the answer of the last JSON object that holds one, anywhere in it, or None."""
        starts = [brace.start() for brace in re.finditer(r"\{", answer)]
        for start in reversed(starts[-_MOST_OBJECTS:]):
            try:
                found, _ = _DECODER.raw_decode(answer, start)
            except (ValueError, RecursionError):
                continue
            meaning = self.meaning(found[self.key]) if self.key in found else None
            if meaning is not None:
                return meaning
        return None


def whole_number(value: object) -> int | None:
    """Return a whole number of at most six digits, given as a JSON number or text, or None."""
    if isinstance(value, str) and re.fullmatch(r"\s{0,9}-?[0-9]{1,6}\s{0,9}", value):
        return int(value)
    if isinstance(value, bool) or not isinstance(value, int):
        return None
    return value if abs(value) < 10**6 else None
