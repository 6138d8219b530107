"""How replies that were written for the tests are read, by the released rule and by the default.

    python -m benchmarks.evidence.replies

Run from the root of a checkout. A reading is wrong where it is not what was meant, and a failure
where nothing is read of a reply that holds a plan. Two tables and the rounds (of plans, answers and
moves) were written before any reader read them; what was read at first sight stands beside, and
for the rounds its parts by kind and by whether their authors meant them to be hard.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from scipy.stats import binomtest

from phyblock.parsing import parse_plan
from phyblock.types import PlanParser
from tests.parsing.fresh_replies import KINDS, Fresh, fresh_replies, tally
from tests.parsing.test_plan_hostile import ALIKE, LAST, LATER, NONE, PLANS
from tests.parsing.test_plan_manners import FAILURES, READ

Rows = list[tuple[str, tuple[int, ...] | None]]
N_CANDIDATES = 16
LATE = 10
"""Rounds from this one on were read at first sight by version 4, or by what became it."""
MET = 15
"""Rounds from this one on met the aim."""
MARKED = 13
"""Rounds from this one on say which replies their authors meant to be hard."""
PAIRS = ((13, 14), (15, 16), (17, 18))
"""Rounds of two authors who knew nothing of each other, read at the same time."""
EARLIER = {
    "written first": {"right": 31, "failed": 4, "wrong": 5},
    "written then": {"right": 14, "failed": 3, "wrong": 3},
}


def tables() -> dict[str, Rows]:
    """Replies with what is meant; None: there is no plan in it."""
    return {
        "today's manners": [*READ, *((text, None) for text, _ in FAILURES)],
        "hard ones": [*PLANS, *((text, None) for text in NONE), *ALIKE],
        "written first": LATER,
        "written then": LAST,
    }


def verdict(text: str, meant: tuple[int, ...] | None, parser: PlanParser) -> str:
    """Whether a reply is read as it is meant."""
    parsed = parse_plan(text, N_CANDIDATES, parser)
    read = None if parsed.rule is None else parsed.plan.steps
    return "right" if read == meant else "failed" if read is None else "wrong"


def main() -> None:
    """Print a line a table and parser."""
    for name, rows in tables().items():
        print(f"{name}: {len(rows)} replies")
        parsers: tuple[PlanParser, ...] = ("official", "steps")
        for parser in parsers:
            counts = Counter(verdict(text, meant, parser) for text, meant in rows)
            print(f"  {parser:9} {_shown(counts)}")
        if name in EARLIER:
            print(f"  then      {_shown(EARLIER[name])}")
    for number, rounds in tally().items():
        print(f"round {number}: {sum(rounds['now'].values())} replies")
        print(f"  then      {_shown(rounds['first'])}")
        print(f"  now       {_shown(rounds['now'])}")
    replies = list(fresh_replies())
    for kind in KINDS:
        late = [reply for reply in replies if reply.kind == kind and reply.round >= LATE]
        print(f"rounds {LATE} and later, {kind}, then: {_then(late)}")
    before = [reply for reply in replies if LATE <= reply.round < MARKED]
    marked = [reply for reply in replies if reply.round >= MARKED]
    print(f"rounds {LATE} to {MARKED - 1}, then: {_then(before)}")
    parts = {f"rounds {MARKED} and later": marked}
    for pair in PAIRS:
        name = " and ".join(map(str, pair))
        parts[f"rounds {name}"] = [reply for reply in marked if reply.round in pair]
    parts[f"rounds {MET} and later"] = [reply for reply in marked if reply.round >= MET]
    for number in sorted({reply.round for reply in marked}):
        parts[f"round {number}"] = [reply for reply in marked if reply.round == number]
    for name, part in parts.items():
        print(f"{name}, then: {_then(part)}")
        print(f"{name}, plain, then: {_then([r for r in part if r.plain])}")
        print(f"{name}, meant to be hard, then: {_then([r for r in part if not r.plain])}")


def _then(replies: Sequence[Fresh]) -> str:
    """What came of replies at first sight, as parts of all and of those that hold an answer."""
    counts = Counter(reply.verdict(reply.first) for reply in replies)
    holding = sum(reply.meant is not None for reply in replies)
    misread, not_read = _share(counts["wrong"], len(replies)), _share(counts["failed"], holding)
    return f"right {counts['right']}, misread {misread}, not read {not_read}"


def _share(part: int, whole: int) -> str:
    """A share with its exact 95 % interval (Clopper and Pearson 1934)."""
    ends = binomtest(part, whole).proportion_ci(method="exact")
    return f"{part} of {whole} ({part / whole:.1%}, {ends.low:.2%} to {ends.high:.1%})"


def _shown(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{kind} {counts[kind]}" for kind in ("right", "failed", "wrong"))


if __name__ == "__main__":
    main()
