"""Reply text -> the option that was chosen, with the rule that matched.

Strict rules come first: a reply that is nothing but an answer, an answer in tags, a box or JSON, a
line or a sentence that says "the answer is". Then the last or the first line, a letter that the
reply begins with, the one option that is named at all. A rule that finds a statement decides: where
statements contradict each other and nothing says which is the last word, where one names an option
that is not shown, or where the model says that it cannot tell, nothing is read. That is a parse
failure, and no later rule is tried. Nothing raises on any text.
"""

from __future__ import annotations

import re
import unicodedata
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from phyblock.parsing.answer_value import CONTRADICTION, ChoiceReader, OrderReader, Reader
from phyblock.parsing.reasoning import after_reasoning

__all__ = ["ParsedAnswer", "parse_answer"]


@dataclass(frozen=True)
class ParsedAnswer:
    """What was read out of a reply: one letter, or for ordering all letters in order.

    `rule` names the rule that matched; both are None where nothing could be read.
    """

    letters: str | None
    rule: str | None


def parse_answer(text: str, options: Sequence[str], is_ordering: bool) -> ParsedAnswer:
    """Read the answer out of a reply to a question that shows `options`, the first one as A."""
    answer = unicodedata.normalize("NFKC", after_reasoning(text)).strip()
    reader = OrderReader(len(options)) if is_ordering else ChoiceReader(options)
    for rule, find in _ORDER_RULES if is_ordering else _CHOICE_RULES:
        found = find(answer, reader)
        if found is not None:
            return ParsedAnswer(found, rule) if found else ParsedAnswer(None, None)
    return ParsedAnswer(None, None)


@dataclass(frozen=True)
class _Statement:
    """A place that states an answer: where it begins and ends, what it names, how firmly."""

    start: int
    end: int
    letters: str
    weight: int


_WORDS = (
    r"answer|antwort|l(?:ö|oe)sung|respuesta|resposta|r[ée]ponse|risposta|ответ|答案|回答|答え|解答|正解"
    r"|정답|답|jawaban|cevap|odpowied[źz]|antwoord|svar|đáp án"
)
_IS = r"(?::|=|\bis\b|\bist\b|\bes\b|\best\b|\bè\b|\bé\b|是|为|為|は|은|는|[\-\u2013\u2014](?=\s))"
_QUALIFIED = (
    r"(?:(?:my|the|your|final|correct|best|right|so|thus|therefore|overall|la|le|die|el|a)"
    r"\s{1,3}){0,4}"
)
_VALUE = r"[ \t*_`#>]{0,8}\n?[ \t]{0,4}(?=(?P<value>[^\n]{1,240}))"
_LINE = re.compile(
    rf"^[ \t>*_#`\-]{{0,12}}(?P<lead>{_QUALIFIED}(?:{_WORDS})(?:\s(?:choice|option|key))?)"
    rf"[ \t]?[*_`]{{0,3}}[ \t]{{0,2}}(?:{_IS}|(?=[*_ ]{{0,4}}\n))[ \t*_`]{{0,6}}:?{_VALUE}",
    re.IGNORECASE | re.MULTILINE,
)
_SENTENCE = re.compile(
    rf"(?<![a-z])(?P<lead>(?:final\s)?(?:{_WORDS}))"
    rf"(?:\s(?:choice|option|key|correcta|correcte|correta|corretta))?"
    rf"(?:\sto\s(?:the|this|your)\squestion)?[ \t*_`]{{0,4}}"
    rf"(?:{_IS}|\bwould be\b|\bshould be\b|\bmust be\b)[ \t*_`:]{{0,6}}{_VALUE}",
    re.IGNORECASE,
)
_CHOSEN = re.compile(
    r"(?:\bI(?:['\u2019]ll|['\u2019]d| will| would| am going to)?"
    r" (?:choose|pick|select|go with|answer)"
    r"|\bmy (?:choice|pick|guess|selection) (?:is|would be)"
    r"|\b(?:correct|right|best) (?:option|choice|one|picture|image|letter|place|match)"
    r" (?:is|would be|must be|should be)"
    r"|应?(?:该)?选(?:择|项)?(?:是|为)?)[ \t*_`:]{0,6}(?=(?P<value>[^\n]{1,80}))",
    re.IGNORECASE,
)
_IS_RIGHT = re.compile(
    r"(?<![A-Za-z0-9'\-])(?P<value>[A-Z])[)\]*_`\"]{0,4}(?:\s?[(:][^()\n]{1,60}\))?"
    r"\s{1,2}(?:is|must be|seems|appears to be) (?:therefore |clearly |definitely |likely )?"
    r"(?:the )?(?:most )?"
    r"(?:correct|right|best|likely|plausible|answer|only (?:one|option|correct))\b"
)
_ORDER = re.compile(
    rf"\b(?:order|ordering|sequence|arrangement)(?:\s(?:of|in)\s[^\n.:]{{1,60}}?)?[ \t*_`]{{0,4}}"
    rf"(?::|=|\bis\b|\bwould be\b|\bshould be\b|\bmust be\b)[ \t*_`:]{{0,6}}{_VALUE}",
    re.IGNORECASE,
)
_CONCLUDED = re.compile(
    r"\b(?i:(?:it|this|that|which|answer|option|choice|picture|image|place)"
    r"(?: must be| has to be| should be| is|['\u2019]s| leaves| matches| corresponds to)"
    r"(?: (?:the |with )?(?:option|picture|image|choice|place))?)[ *_`]{0,4}"
    r"(?P<value>\(?[A-Z]\)?)[*_`]{0,3}(?=[\s.!,;]{0,3}(?:\Z|\n|[.!;]))",
)
_TAG = re.compile(r"<(?:final_)?answer>\s{0,20}(?P<value>[^<>]{1,400})", re.IGNORECASE)
_BOX = re.compile(r"\\boxed\s{0,2}\{(?P<value>[^\n]{1,80}?)\}{1,3}(?=[^}]|\Z)")
_JSON = re.compile(
    r"[\"'](?:final[_ ]?)?(?:answer|choice|option|selected_option|order|ordering|letter)[\"']"
    r"\s{0,4}:\s{0,4}(?P<value>\[[^\[\]]{1,120}\]|\"[^\"\n]{0,200}\"|'[^'\n]{0,200}'|\d{1,4}\b)",
    re.IGNORECASE,
)
_REVISED = re.compile(
    r"\b(?:wait|actually|instead|rather|however|but|correct(?:ion|ed|ing)|revis\w+|mistake\w*|wrong"
    r"|incorrect|re-?(?:check|think|consider|examin|evaluat|look|assess)\w*|second thought|hmm+|no,"
    r"|final(?:ly)?|therefore|thus|hence|so|overall|conclusion|conclude|doch|aber|sondern|因此|所以|但)\b"
    r"|因此|所以|但是?|不过",
    re.IGNORECASE,
)
_UNSURE = re.compile(
    r"\b(?:cannot|can['\u2019]?t|could not|couldn['\u2019]t|unable to|not able to|impossible to"
    r"|not possible to|insufficient|not enough|don['\u2019]t know|do not know"
    r"|i['\u2019]m sorry|i am sorry|i apologi[sz]e|no (?:image|picture)|not sure|unclear"
    r"|none of the|neither)\b|无法|抱歉|не могу",
    re.IGNORECASE,
)
_BRANDED = re.compile(
    r"\((?P<a>[A-Z])\)|\*\*\(?(?P<b>[A-Z])[).:]?\*\*"
    r"|\b(?:[Oo]ption|[Cc]hoice|[Pp]icture|[Ii]mage|[Ll]etter|[Pp]osition|[Ss]pot|[Ll]ocation)s?"
    r"[ *_`(\"']{1,4}(?P<c>[A-Z])(?![A-Za-z0-9'\-])"
)
_LABEL = re.compile(r"(?:^|\n|\s)[*_(\[]{0,3}(?P<letter>[A-Z])[)\].:]")
_LEADING = re.compile(
    r"[\s*_`(\[\"']{0,6}(?P<letter>[A-Za-z])(?:[)\]*_`\"']{1,4}|(?=[\s.,:;\u2013\u2014!-])|[.,:;])"
)
_WHOLE_CHARS = 300
_LINE_CHARS = 240
_REVISION_CHARS = 4000
_MOST_STATEMENTS = 100
"""Of each kind, from the end: a reply that repeats itself for pages is still read at once."""


def _whole(text: str, reader: Reader) -> str | None:
    return reader.exact(text) if len(text) <= _WHOLE_CHARS else None


def _marked(pattern: re.Pattern[str]) -> Callable[[str, Reader], str | None]:
    """A rule for answers in a mark of their own: tags, a box, a field."""

    def find(text: str, reader: Reader) -> str | None:
        return _settle(text, list(_statements(text, pattern, reader.read, 0)))

    return find


def _stated(text: str, reader: Reader) -> str | None:
    """Lines and sentences that say what the answer is; a line outweighs a sentence."""
    stated = list(_statements(text, _LINE, reader.read, 1))
    lines = {statement.end for statement in stated}
    for statement in _statements(text, _SENTENCE, reader.read, 0):
        if statement.end not in lines:
            stated.append(statement)
    if isinstance(reader, ChoiceReader):
        stated += _statements(text, _CHOSEN, reader.letter, 0)
        stated += _statements(text, _IS_RIGHT, reader.exact, 0)
    else:
        stated += _statements(text, _ORDER, reader.read, 0)
    return _settle(text, sorted(stated, key=lambda statement: statement.start))


def _statements(
    text: str, pattern: re.Pattern[str], read: Callable[[str], str | None], weight: int
) -> Iterator[_Statement]:
    for match in deque(pattern.finditer(text), maxlen=_MOST_STATEMENTS):
        letters = read(match["value"])
        if letters is not None:
            lead = match.groupdict().get("lead") or ""
            firm = weight + ("final" in lead.lower())
            yield _Statement(match.start(), match.end(), letters, firm)


def _settle(text: str, stated: Sequence[_Statement]) -> str | None:
    """The last word: what all say, or what the last says where it outweighs or revises others."""
    if not stated:
        return None
    last = stated[-1]
    for other in reversed(stated):
        if other.letters != last.letters and other.weight >= last.weight:
            between = text[max(other.end, last.start - _REVISION_CHARS) : last.end]
            return last.letters if _REVISED.search(between) else CONTRADICTION
    return last.letters


def _outer_line(text: str, reader: Reader) -> str | None:
    """The last or the first line, where it is an answer and nothing else."""
    found = [reader.exact(line) for line in (_first_line(text), _last_line(text))]
    named = {letters for letters in found if letters is not None}
    if not named:
        return None
    return named.pop() if len(named) == 1 else CONTRADICTION


def _leading(text: str, reader: Reader) -> str | None:
    """A letter that the reply begins with, when no other option is labeled so."""
    head = _LEADING.match(text)
    if head is None or not isinstance(reader, ChoiceReader):
        return None
    found = reader.letter(_first_line(text))
    labels = {match["letter"] for match in _LABEL.finditer(text)} & set(reader.letters)
    return found if found is None or labels <= {found} else None


def _concluded(text: str, reader: Reader) -> str | None:
    found = [reader.exact(match["value"]) for match in _CONCLUDED.finditer(text)]
    return found[-1] if found and not _UNSURE.search(text) else None


def _only_one_named(text: str, reader: Reader) -> str | None:
    """The one option that is named by a marked letter anywhere."""
    if _UNSURE.search(text):
        return None
    named = {match["a"] or match["b"] or match["c"] for match in _BRANDED.finditer(text)}
    named &= set(reader.letters)
    return named.pop() if len(named) == 1 else None


def _only_text(text: str, reader: Reader) -> str | None:
    """The one option whose words a short reply, or the last line of a long one, holds."""
    if not isinstance(reader, ChoiceReader) or _UNSURE.search(text):
        return None
    last = _last_line(text)
    for piece in (last, text[:_LINE_CHARS]) if len(text) <= _LINE_CHARS else (last,):
        found = CONTRADICTION if reader.letter(piece) == CONTRADICTION else None
        found = reader.option_text(piece) if found is None else found
        if found is not None:
            return found
    return reader.number(last)


def _only_order(text: str, reader: Reader) -> str | None:
    """The one order in the text; listing the pictures as they were shown is none."""
    if not isinstance(reader, OrderReader) or _UNSURE.search(text):
        return None
    for piece in (_last_line(text), text):
        named = set(reader.orders(piece)) - {reader.letters}
        if len(named) == 1:
            return named.pop()
    return None


def _first_line(text: str) -> str:
    return text[:_LINE_CHARS].split("\n", 1)[0]


def _last_line(text: str) -> str:
    return text[-_LINE_CHARS:].rstrip().rsplit("\n", 1)[-1]


def _list(text: str, reader: Reader) -> str | None:
    return reader.listed(text) if isinstance(reader, OrderReader) else None


_Rule = tuple[str, Callable[[str, Reader], str | None]]
_STRICT: tuple[_Rule, ...] = (
    ("whole", _whole),
    ("tag", _marked(_TAG)),
    ("boxed", _marked(_BOX)),
    ("json", _marked(_JSON)),
    ("stated", _stated),
    ("outer_line", _outer_line),
)
_CHOICE_RULES: tuple[_Rule, ...] = (
    *_STRICT,
    ("leading", _leading),
    ("concluded", _concluded),
    ("only_one_named", _only_one_named),
    ("only_text", _only_text),
)
_ORDER_RULES: tuple[_Rule, ...] = (
    *_STRICT,
    ("numbered_list", _list),
    ("only_order", _only_order),
)
