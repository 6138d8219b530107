"""Reply text -> one move, with the rule that matched, or a named problem.

A reply to a step of step-by-step planning names one operation: `Move(3)` or `Done`. Strict forms
are tried first, where an answer is expected: the last lines, a JSON object, a line with a label
("Next plan: Move(3)"). Then lenient ones, the last line before the whole text. `Done` counts as an
answer alone, never as a word of the reasoning. A reply that names two different operations is not
guessed at. Nothing here raises on any text, and all of it takes linear time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from phyblock.parsing.json_values import objects
from phyblock.parsing.move_problem import MoveProblem
from phyblock.parsing.operation import (
    ANSWER_LINE,
    CALL,
    DONE,
    INTEGER,
    LABEL,
    MENTION,
    OPERATION,
    Operation,
    is_not_meant,
    mentions,
    named,
    number_of,
    operation_of,
    operations_of,
)
from phyblock.parsing.slips import without_slips
from phyblock.parsing.speech import CONDITIONAL, TAKES_BACK, UNSURE, words
from phyblock.parsing.statement import read_statement
from phyblock.parsing.text_forms import answer_of

__all__ = ["MOVE_RULES", "ParsedMove", "parse_move"]


@dataclass(frozen=True)
class ParsedMove:
    """What was read out of a reply: a candidate's number as it stands there, `Done`, or a problem.

    `move` may be a number that no candidate has; `rule` names the rule that matched, also where
    it found two operations, and is None where none did.
    """

    move: int | None = None
    is_done: bool = False
    rule: str | None = None
    problem: MoveProblem | None = None


_Find = Callable[[str, list[str]], Sequence[Operation]]

_LABELED = words(rf"(?<![\w]){LABEL}[`*\"'_ ]{{0,6}}{OPERATION}(?![\w?])")
_MORE = words(rf"[\s,;&+`*]{{1,4}}(?:(?:and|then|or)\s{{1,3}}){{0,2}}{named(CALL, 'call')}")
"""A further operation behind one, with nothing said between them."""
_TAKES_BACK = words(TAKES_BACK, r"\b(?:actually|instead|no\.)")
_CONCLUDES = words(
    rf"\b(?:so|therefore|thus|hence)\b[:,]?\s(?:[^\d\n.;]{{0,30}}\s)?{named(CALL, 'call')}"
    r"(?:\s(?:is\s)?(?:next|now))?\W{0,3}\Z"
)
_OR = words(r"\b(?:or|oder|ou)\s{1,3}\Z")
"""An operation behind this is one of several, of which the others may be no number at all."""
_FOLLOWS = words(
    rf"\b(?:so|therefore|thus|hence),?\s(?:(?:block|candidate|index)\s){{0,2}}{INTEGER}\s(?:has to"
    r"|must|should|needs to|is to|will)?\s?(?:be next|is next|(?:come|go)(?:e?s)?\s(?:next"
    r"|now))(?=\s{0,2}(?:[.,;!()\u2014]|\Z|\b(?:and|as|because|since|while"
    r"|before)\b))(?![^.;\n]{0,80}(?:\bor\b|\?))"
)
"""What comes next, where that ends the clause: not "next to block 2", and not "is now stable"."""
_ONE_OR_ANOTHER = words(r"\d\s?(?:or|oder|ou|/|或)\s?(?:\w+\s)?\d")
_COUNTED = re.compile(r"\d{1,2}[.)]\s")
_DONE_SENTENCE = words(
    rf"(?:\A|[.!?:\u2014]\s{{1,3}}|\b(?:so|thus|hence|therefore|also|daher|donc)[,:]?\s{{1,3}}"
    rf"|;\s{{0,3}}|(?:->|\u2192|(?P<then>\bthen))\s{{0,3}}){DONE}\s{{0,2}}[.!]?\Z"
)
_DONE_FIRST = re.compile(
    rf"(?:{LABEL})?{DONE}(?:[.!,\n]|\s[\u2013\u2014-])(?!.*(?:{TAKES_BACK}|\b(?:not?|but|next|then"
    rf"|missing|if|with)\b))",
    re.IGNORECASE | re.DOTALL,
)
"""A reply that begins with the answer and says nothing behind it that may undo it."""
_OTHER_CALL = words(
    rf"(?:{LABEL})(?!move|place|put|done)[a-z_]{{3,20}}\s?\([^()\n]{{0,20}}\)\W{{0,3}}"
)
"""An answer that is another operation than those there are."""
_CHOSEN = words(r"\b(?:choose|select|pick|wähle|elijo|choisis)\b|选择?")
_IS_NEXT = words(
    r"\b(?:(?:comes|goes|is) next(?! to)|is (?:still )?missing|go(?:ing)? with|now comes?"
    r"|next (?:block|one|piece|step|move|candidate)(?: \w+)? (?:is|should be|will be)"
    r"|(?:als )?nächste[rs]?\b.{0,30}\b(?:ist|kommt|folgt)|fehlt|siguiente|falta|prochaine?|manque"
    r"|prossimo|próximo|следующ\w{2})\b|\A(?:so |and )?now,? (?:(?:block|candidate) )?\d+\W*\Z|下一"
    r"|次は|다음"
)
"""That the one block named is the next; what already stands is named with a verb of its own."""
_BARE = words(
    rf"(?:{LABEL})?(?:(?:candidate|block)\s)?[#(\[]?{INTEGER}[)\].]?(?:\s\([^()\d]{{1,40}}\)\.?)?"
)
_FENCE = re.compile(r"(?:`{3,}|~{3,})\s{0,3}[\w+-]{0,16}")
_MARKUP = re.compile(r"</?(?:final_)?answer>|[*`_~]{1,3}|\\boxed\{|[{}]")
_EDGES = " \t\r\f\v>#-*+\u2022|\"'"


def parse_move(text: str) -> ParsedMove:
    """Read the one operation that a reply names."""
    answer = without_slips(answer_of(text) or "")
    lines = [line for line in map(_plain, answer.splitlines()) if line]
    if not lines:
        return ParsedMove(problem="no_move" if text.strip() else "empty")
    for rule, find in _RULES:
        if found := find(answer, lines):
            if rule in _LENIENT and CONDITIONAL.search(lines[-1]):
                break
            return _verdict(found, rule)
    return ParsedMove(problem="no_move")


def _plain(line: str) -> str:
    """A line without markup; "" for the fence of a code block."""
    line = line.strip()
    return "" if _FENCE.fullmatch(line) else _MARKUP.sub(" ", line).strip(_EDGES)


def _verdict(found: Iterable[Operation], rule: str) -> ParsedMove:
    operations = set(found)
    if len(operations) > 1:
        return ParsedMove(
            rule=rule, problem="move_and_done" if "done" in operations else "several_moves"
        )
    (operation,) = operations
    if operation == "done":
        return ParsedMove(is_done=True, rule=rule)
    return ParsedMove(move=operation, rule=rule)


def _last_lines(_: str, lines: list[str]) -> list[Operation]:
    """The operations of the lines at the end that say nothing else."""
    found: list[Operation] = []
    for line in reversed(lines):
        match = ANSWER_LINE.fullmatch(line)
        if match is None:
            break
        found.append(operation_of(match))
    return found


def _json(answer: str, _: list[str]) -> list[Operation]:
    return [operation for *_, value in objects(answer) for operation in operations_of(value)]


def _labeled(_: str, lines: list[str]) -> list[Operation]:
    """What labels name; behind words that take it back ("no", "wait") the last of them alone."""
    text = "\n".join(lines)
    found: list[Operation] = []
    end = 0
    for match in _LABELED.finditer(text):
        if is_not_meant(text, match.start()):
            continue
        if not found and _OR.search(text, 0, match.start()):
            return []
        if found and _TAKES_BACK.search(text[end : match.start()]):
            found = []
        more: re.Match[str] | None = match
        while more is not None:
            found.append(operation_of(more))
            end = more.end()
            more = _MORE.match(text, end)
    return found


def _concluded(_: str, lines: list[str]) -> list[Operation]:
    """The operation that the last sentence comes to: "Move(3) failed, so Move(5)"."""
    follows = [number_of(match["number"]) for match in _FOLLOWS.finditer(lines[-1])]
    if follows and not _CHOSEN.search(lines[-1]):
        return [*follows, *_in_last_line(_, lines)]
    concludes = _CONCLUDES.search(lines[-1]) if len({*mentions(lines[-1])}) > 1 else None
    return [operation_of(concludes)] if concludes else []


def _in_last_line(_: str, lines: list[str]) -> list[Operation]:
    is_item = _COUNTED.match(lines[-1])
    mentioned = mentions(lines[-1])
    says_done = _DONE_SENTENCE.search(lines[-1])
    is_later = says_done and says_done["then"] and re.search(r"\d", lines[-1])
    done: list[Operation] = (
        ["done"] if says_done and not is_item and (mentioned or not is_later) else []
    )
    return [*mentioned, *done]


def _anywhere(_: str, lines: list[str]) -> list[Operation]:
    found = [operation for line in lines for operation in mentions(line)]
    return found or (["done"] if _DONE_FIRST.match("\n".join(lines)) else [])


def _loose(_: str, lines: list[str]) -> list[int]:
    """What sentences move or choose, those of the last line first."""
    if _OTHER_CALL.fullmatch(lines[-1]):
        return []
    last = _moved(lines[-1])
    return last or [number for line in lines for number in _moved(line)]


def _moved(line: str) -> list[int]:
    if MENTION.search(line) and not mentions(line):
        return []
    statement = read_statement(line.replace("_", " "), is_item=False)
    if statement.loose - {*statement.numbers} or _ONE_OR_ANOTHER.search(line):
        return []
    is_next = _CHOSEN.search(line) or (_IS_NEXT.search(line) and not UNSURE.search(line))
    return list(statement.numbers) if statement.has_verb or is_next else []


def _bare(_: str, lines: list[str]) -> list[int]:
    match = _BARE.fullmatch(lines[-1])
    is_answer = match is not None and (len(lines) == 1 or not match.start("number") <= 1)
    return [number_of(match["number"])] if match and is_answer else []


_RULES: tuple[tuple[str, _Find], ...] = (
    ("last_lines", _last_lines),
    ("json", _json),
    ("label", _labeled),
    ("concluded", _concluded),
    ("last_line_mention", _in_last_line),
    ("mention", _anywhere),
    ("loose", _loose),
    ("bare_number", _bare),
)
_LENIENT = ("concluded", "last_line_mention", "mention", "loose")
"""Rules that read sentences, which may tie a move to a condition."""
MOVE_RULES: tuple[str, ...] = tuple(name for name, _ in _RULES)
"""Rules in the order in which they are tried."""
