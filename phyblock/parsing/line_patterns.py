"""Forms of the lines of a reply: heads of steps, numbers, marks, labels, fences."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import re

from phyblock.parsing.mention import VERB
from phyblock.parsing.speech import words

__all__ = [
    "ARRAY",
    "FENCE",
    "INLINE_STEP",
    "LABELED",
    "LAYER",
    "MARKED",
    "NAMES_FIRST",
    "NOUN_LABEL",
    "NUMBERED",
    "SENTENCE_END",
    "STARTS_MOVING",
    "STEP",
    "STEP_WORD",
    "TAG",
]

STEP_WORD = (
    r"(?:steps?|schritte?|pasos?|étapes?|etape|passo|шаг|stap|krok|adım"
    r"|步骤|步驟|ステップ|手順|단계|第(?=\s?\d))"
)
INLINE_STEP = words(
    rf"(?:(?<=[{{,;])|(?<=[^\d\s]\.)|(?<=[\w)\]] \d\.)|(?<=[\w)\]] \d\d\.))[ \t]{{0,4}}"
    rf"(?=[\"'*]{{0,3}}{STEP_WORD}[\s_#]{{0,3}}\d{{1,3}}[\"'*]{{0,3}}\s?[:.)=\-\u2013\u2014])"
    rf"|(?<=[{{,;])[ \t]{{0,4}}(?=[\"'][^\"'\n:]{{1,40}}:?[ _-]step[\s_#]{{0,3}}\d{{1,3}}[\"'])"
    rf"|(?<=\S)(?<!\d,)(?<![>→&])[ \t](?=\d{{1,2}}[.)] (?:\*\*)?(?:{VERB}))"
)
STEP = words(
    rf"[\s>+\-#({{|\[\d.)•·]{{0,16}}(?:[^\n:.]{{0,40}}?[ :_-]{{1,2}})??"
    rf"{STEP_WORD}[\s_#]{{0,3}}(?P<number>\d{{1,3}})(?!\d)(?:\s?/\s?\d{{1,3}})?\s?步?"
    r"(?:(?:, ?\d{1,3}){0,9} ?(?:&|and|to|through|bis|-|\u2013) ?"
    rf"(?:{STEP_WORD}[\s_#]{{0,3}})?(?P<last>\d{{1,3}})(?![\w.]))?"
    r"\s{0,3}(?:\([^()\n]{0,60}\)\s?)?(?P<sign>[:.)=\-\u2013\u2014→、,\]}>]|(?=\s)|\Z)"
)
NUMBERED = re.compile(
    r"[\s>+\-#({|•·]{0,8}(?P<number>\d{1,3})(?:st|nd|rd|th)?(?:[-\u2013](?P<last>\d{1,3}))?\s?(?:[.):、](?!\d)|\)\.?)\s{0,4}(?=\D|\d)"
)
MARKED = re.compile(
    r"\s{0,40}(?:[-+•·▪–]|>)\s{1,4}(?=\S)|\s{0,40}(?:[a-h][.)]|\d{1,2}(?:\.\d{1,2}){1,2}[.):]?)\s"
)
STARTS_MOVING = words(
    rf"[\s>\[{{(]{{0,12}}(?:(?:first|then|next|finally|now|please|und|dann"
    rf"|zuerst),?\s)?(?:robot\.)?(?:{VERB})"
)
NAMES_FIRST = words(
    r"\s{0,20}(?:(?:the )?block |with |the )?(?:index|block|candidate|积木|#)\W{0,4}\d"
)
LABELED = words(
    r"\s{0,20}[-#>]{0,4}\s{0,3}(?:\d{1,2}[.)]\s)?(?P<label>[^:=：\[\n]{1,80}?)\s{0,3}(?:[:=：]"
    r"|(?<=[^\W\d]\s)(?:→|->)(?=\s)|\b(?:(?:is|are|ist|lautet|est|es|è|é)(?:\s(?:therefore|thus|hence"
    r"|also|daher|donc))?|would be|(?<=\bit)['\u2019]s|(?:(?<=order )|(?<=sequence )|(?<=plan )"
    r"|(?<=\bit ))(?:is\s(?:now|then)|(?:should|must|has to) be))\b:?|是|为"
    r"|は)\s{0,3}(?P<value>[\s(\[{<#]{0,4}(?:(?:first|zuerst|erst|d'abord|primero)\s)?(?:(?:blocks?"
    r"|index|indices|(?<=[:：]\s)candidates?|积木)\s)?\d[^\n]{0,400})"
)
ARRAY = re.compile(
    r"\[\s{0,9}(?:[\"']?\d{1,6}[\"']?\s{0,9},\s{0,9}){1,63}[\"']?\d{1,6}[\"']?\s{0,9}\]"
)
TAG = words(
    r"<(?:step|move|place|action)\b[^<>\n]{0,80}?\b(?:block|candidate)(?:[_-]?(?:id|index))?="
    r"[\"'](?P<block>\d{1,6})[\"'][^<>\n]{0,80}/>"
    r"|<\|[a-z_]{1,30}\|>|</?[a-z_]{1,20}(?:\s[^<>\n]{0,80})?>"
)
NOUN_LABEL = words(
    r"[-\s]{0,4}(?:block|index|id|candidate|piece|number)(?: (?:index|id|number))?\s*"
)
FENCE = re.compile(
    r"\s{0,20}(?:[>*+-]\s{1,4})?(?:`{3,}|~{3,})|\s{0,20}(?:json|plaintext|text)\s*\Z"
)
LAYER = words(
    r"layer|level|step|stage|phase|part|ebene|schicht|层|structure|base|bottom|middle|top|then|next"
)
SENTENCE_END = re.compile(
    r"(?<=[\d)\]])(?:\.\s{1,4}(?=\S)|;\s{1,4}(?!(?:and )?(?:then|dann|finally)\b)(?=[^\s\d]))"
)
