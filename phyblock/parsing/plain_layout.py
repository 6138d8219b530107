"""A reply in the layouts that are read: calls, elements, YAML and tables as lines or JSON."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

from phyblock.parsing.alike_lines import counted_lines
from phyblock.parsing.line_patterns import STEP_WORD
from phyblock.parsing.plan_patterns import OPTION
from phyblock.parsing.speech import REVISED, words
from phyblock.parsing.text_forms import number_of_word
from phyblock.parsing.text_tables import markdown_tables
from phyblock.parsing.yaml_text import yaml_as_json

__all__ = ["plain_layout"]

_KEYCAP = re.compile(r"(\d)\ufe0f?\u20e3\s{0,3}")
_NTH_STEP = re.compile(
    r"^(?P<before>[ \t>*_#-]{0,8})(?P<n>\d{1,2})(?:\.|º|ª|°|-?[a-zа-я]{1,3})?\s?"
    r"(?:단계|schritt\b|paso\b|passo\b|étape\b|шаг\b|adım\b|stap\b|krok\b)",
    re.IGNORECASE | re.MULTILINE,
)
_COUNTED_OUT = re.compile(
    r"^[^\n]{0,80}?(?:\(?1\)|1st:) [^\n]{1,400}?\s(?:\(?2\)|2nd:) [^\n]{1,2000}", re.MULTILINE
)
_COUNT = re.compile(r"(?<!\S)(?:\((?=\d+\)))?(?P<n>\d{1,2})(?:\)|(?:st|nd|rd|th):)(?= )")
_SPELLED_STEP = words(rf"\b(?P<step>{STEP_WORD}\s?)(?P<n>[^\W\d_]{{1,10}})(?=\s?[:.)\u2013-])")
_ARRAY_REMARK = re.compile(r"\]\s{1,4}#\s[^\n\d]{0,80}$", re.MULTILINE)
_NAME = r"(?:block|candidate|piece|cube|index|idx|id|number|n)"
_STEP_ELEMENT = words(
    r"<(?P<name>step|move|action)[_ -]?(?P<n>\d{1,2})>\s{0,9}(?P<held>[^<>\n]{1,200}?)\s{0,9}"
    r"</(?P=name)[_ -]?(?P=n)>"
)
_INDEX_ELEMENT = words(
    rf"<(?:(?:parameter|param|arg|argument)(?:\s?=\s?|\sname=)[\"']?(?:{_NAME}[_ ]?){{1,2}}[\"']?"
    rf"|(?:{_NAME}[_ ]?){{1,2}})>\s{{0,9}}(?P<number>\d{{1,6}})\s{{0,9}}</\w{{1,20}}>"
)
_CALL_ELEMENT = words(r"</?(?:function|invoke|tool|parameter)[^<>\n]{0,80}>")
_CALL = re.compile(
    r"^(?P<indent>[ \t>\-]{0,12})(?:await )?(?:\w{1,20}\.){0,3}(?P<name>[a-z_]{3,30})\("
    r"(?P<held>[^()\n]{0,120}(?:\([^()\n]{0,60}\)[^()\n]{0,60}){0,4})\)[ \t]*;?[ \t]*"
    r"(?:(?:#|//)[^\n]{0,200})?$",
    re.MULTILINE | re.IGNORECASE,
)
_COMMENT = re.compile(r"^[ \t]*(?:#|//)[^\n\d]{0,200}\n", re.MULTILINE)
_TAKES = words(r"pick|grab|grasp|lift|take|get|select")
_PUTS = words(r"place|put|move|stack|drop|release|add|insert|set")
_FIRST = words(
    rf"\s{{0,3}}\{{?\s{{0,3}}[\"']?(?:(?:{_NAME}_?){{1,2}}[\"']?\s?[:=]\s?)?[\"']?(?:{_NAME}[_ "
    r"#-]?){0,2}(?P<number>\d{1,6})[\"']?\s{0,3}(?=[,})]|\Z)"
)


def plain_layout(text: str) -> str:
    """A text without layouts of its own; everything else stands as it stood."""
    text = _KEYCAP.sub(r"\1. ", text)
    text = _NTH_STEP.sub(r"\g<before>Step \g<n>", text)
    text = _SPELLED_STEP.sub(lambda s: f"{s['step']}{number_of_word(s['n']) or s['n']}", text)
    text = _ARRAY_REMARK.sub("]", text)
    text = counted_lines(text)
    text = _COUNTED_OUT.sub(_line_by_line, text)
    if "<" in text:
        text = _STEP_ELEMENT.sub(r"\nStep\g<n>: \g<held>\n", text)
        text, n_calls = _INDEX_ELEMENT.subn(r"\nMove block \g<number>\n", text)
        text = _CALL_ELEMENT.sub("", text) if n_calls else text
    return markdown_tables(yaml_as_json(_plain_calls(text)))


def _line_by_line(line: re.Match[str]) -> str:
    """A line that counts (1) ... (2) ... as lines, where it counts from 1 without a gap."""
    counted = [int(count["n"]) for count in _COUNT.finditer(line[0])]
    return _COUNT.sub(r"\n\g<n>)", line[0]) if counted == [*range(1, len(counted) + 1)] else line[0]


def _plain_calls(text: str) -> str:
    """Calls of functions that move a block, a line each; what is taken is what is then put."""
    calls = [call for call in _CALL.finditer(text) if _verb(call)]
    if not calls:
        return text
    takes = any(_verb(call) == "takes" for call in calls)

    def moved(call: re.Match[str]) -> str:
        if not _verb(call):
            return call[0]
        first = _FIRST.match(call["held"])
        if takes and _verb(call) == "puts":
            return ""
        return f"{call['indent']}Move block {first['number']}" if first else call[0]

    first, last = calls[0].start(), calls[-1].end()
    program = _COMMENT.sub(_unless_it_chooses, text[first:last])
    return text[:first] + _CALL.sub(moved, program) + text[last:]


def _unless_it_chooses(comment: re.Match[str]) -> str:
    return comment[0] if OPTION.search(comment[0]) or REVISED.search(comment[0]) else ""


def _verb(call: re.Match[str]) -> str:
    """Whether a function takes a block or puts it somewhere; one that does both puts it."""
    if _PUTS.search(call["name"]):
        return "puts"
    return "takes" if _TAKES.search(call["name"]) and _FIRST.match(call["held"]) else ""
