"""Replies that were written with what they mean before any reader read them, round by round.

`fresh_replies.jsonl` holds a reply a line: its round, what kind of answer it holds, its text, what
is meant (null: nothing may be read), what was read at first sight, before anything was mended, and
whether it is `hard`: a person reads it, a reader may admit that it does not. From round 13 on
`plain` are those that their author did not mean to be hard. After a round the causes of what was
misread were mended, and the next round was written; rounds 13 and 14, of two authors who knew
nothing of each other, were written at the same time, and so were rounds 15 and 16, and 17 and 18.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from phyblock.parsing import parse_answer, parse_plan
from phyblock.parsing.move import parse_move

__all__ = ["KINDS", "Fresh", "fresh_replies", "tally"]

KINDS = ("plan", "choice", "order", "move")
N_CANDIDATES = 16
_FILE = Path(__file__).with_name("fresh_replies.jsonl")


@dataclass(frozen=True)
class Fresh:
    """A reply with what is meant and what was read at first sight; None: nothing."""

    round: int
    kind: str
    text: str
    meant: Any
    first: Any
    options: tuple[str, ...] = ()
    hard: bool = False
    plain: bool = False

    def now(self) -> Any:
        """What is read of it today."""
        if self.kind == "plan":
            plan = parse_plan(self.text, N_CANDIDATES)
            return None if plan.rule is None else list(plan.plan.steps)
        if self.kind == "move":
            move = parse_move(self.text)
            return "done" if move.is_done else move.move
        return parse_answer(self.text, self.options, self.kind == "order").letters

    def verdict(self, read: Any) -> str:
        """Whether a reading is what is meant."""
        return "right" if read == self.meant else "failed" if read is None else "wrong"


def fresh_replies() -> Iterator[Fresh]:
    """All replies, in the order of their rounds."""
    with _FILE.open(encoding="utf-8") as file:
        for line in file:
            row = json.loads(line)
            yield Fresh(**{**row, "options": tuple(row.get("options", ()))})


def tally() -> dict[int, dict[str, Counter[str]]]:
    """Per round, what came of it at first sight and what comes of it now."""
    rounds: dict[int, dict[str, Counter[str]]] = {}
    for reply in fresh_replies():
        counts = rounds.setdefault(reply.round, {"first": Counter(), "now": Counter()})
        counts["first"][reply.verdict(reply.first)] += 1
        counts["now"][reply.verdict(reply.now())] += 1
    return rounds
