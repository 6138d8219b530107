"""How the official, the former default and the present parser read the official recordings.

    python benchmarks/evidence/parsers.py CHECKOUT [--gold tests/parsing/gold.csv] [--list]

CHECKOUT is a checkout of the official repository. The figures of the former default (`steps`,
version 1) are the published ones: its code is gone. `--gold` names readings by eye, by digest of
the reply, of two readers; `--list` names every reply that is not read as the first reads it.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from phyblock.data import AssemblyTask, read_official, recorded_models
from phyblock.domain import Plan
from phyblock.models.raw_replies import read_raw_reply
from phyblock.parsing import ParsedPlan, parse_plan
from phyblock.scoring.counts import Counts, micro
from phyblock.scoring.plan import Goal, match_plan

FORMER_F1 = {
    "claude-3-5-haiku": 27.56,
    "InternVL2.5-4B": 21.87,
    "InternVL2.5-8B": 19.89,
    "gemini-2.0-flash": 40.05,
    "gpt-4o": 39.62,
    "claude-3-7-thinking": 47.59,
    "Qwen-VL-max": 29.12,
    "Qwen2.5-VL-3B-Instruct": 21.23,
}
"""F1 (A, `optimal`) by `steps`, version 1."""
FORMER_MISREAD = 98
"""Replies of the gold set that it read otherwise than by eye."""
Readings = dict[str, tuple[tuple[int, ...], tuple[int, ...]]]
"""What the first reader reads in a reply, and what the second does, by digest."""


@dataclass
class Tally:
    """What came of the replies of one model."""

    counts: dict[str, list[Counts]] = field(
        default_factory=lambda: {"official": [], "steps": [], "as read by eye": []}
    )
    rules: Counter[str] = field(default_factory=Counter)
    problems: Counter[str] = field(default_factory=Counter)
    against_gold: Counter[str] = field(default_factory=Counter)
    against_second: Counter[str] = field(default_factory=Counter)
    n_differ: int = 0


def main() -> None:
    """Print F1, rules, failures and errors against the gold set, by model."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("checkout", type=Path)
    arguments.add_argument("--gold", type=Path, default=Path("tests/parsing/gold.csv"))
    arguments.add_argument("--list", action="store_true")
    args = arguments.parse_args()
    gold = _gold(args.gold)
    tasks = {task.scene.id: task for task in read_official(args.checkout).tasks}
    total: Counter[str] = Counter()
    second: Counter[str] = Counter()
    ranked: dict[str, dict[str, float]] = {}
    for model, folder in recorded_models(args.checkout).items():
        tally = Tally()
        for scene, text in _replies(folder):
            _add(tally, tasks[scene], text, gold, f"{model} {scene}" if args.list else "")
        total += tally.against_gold
        second += tally.against_second
        ranked[model] = _print(model, tally)
    print(f"against {sum(total.values())} replies read by eye: {dict(total)}")
    print(f"  former steps: {FORMER_MISREAD} silently wrong")
    print(f"against the second reader: {dict(second)}")
    for parser in ("official", "steps", "as read by eye"):
        order = sorted(ranked, key=lambda model: -ranked[model][parser])
        print(f"ranking by {parser}: {', '.join(order)}")


def _gold(path: Path) -> Readings:
    with path.open(encoding="utf-8", newline="") as file:
        return {
            row["sha256"]: (_numbers(row["plan"]), _numbers(row["second"]))
            for row in csv.DictReader(file)
        }


def _numbers(text: str) -> tuple[int, ...]:
    return tuple(map(int, text.split()))


def _replies(folder: Path) -> Iterator[tuple[str, str]]:
    for path in sorted(folder.glob("*.json")):
        yield path.stem, read_raw_reply(json.loads(path.read_bytes()), str(path)).text


def _add(tally: Tally, task: AssemblyTask, text: str, gold: Readings, name: str) -> None:
    """Count one reply. What no person read counts as the present parser reads it."""
    n = len(task.candidates)
    official, present = parse_plan(text, n, "official"), parse_plan(text, n)
    readings = gold.get(hashlib.sha256(text.encode()).hexdigest())
    plans_read = [Plan(tuple(i for i in reading if i <= n)) for reading in readings or ()]
    read = plans_read[0] if plans_read else present.plan
    goal = Goal(task.scene, task.candidates, "A")
    plans = {"official": official.plan, "steps": present.plan, "as read by eye": read}
    for parser, plan in plans.items():
        tally.counts[parser].append(match_plan(goal, plan, "optimal").counts)
    tally.rules[present.rule or "parse failure"] += 1
    tally.n_differ += official.plan != present.plan
    if present.problem:
        tally.problems[present.problem] += 1
    if plans_read:
        verdict = _verdict(present, read)
        agree = "as the first" if plans_read[1] == read else "otherwise"
        tally.against_second[agree] += 1
        tally.against_gold[verdict] += 1
        if name and verdict != "right":
            print(f"    {name}: {list(present.plan.steps)}, by eye {list(read.steps)}")


def _verdict(parsed: ParsedPlan, read: Plan) -> str:
    if parsed.plan == read:
        return "right"
    return "failed" if parsed.rule is None else "silently wrong"


def _print(model: str, tally: Tally) -> dict[str, float]:
    f1 = {parser: 100 * (micro(counts).f1 or 0.0) for parser, counts in tally.counts.items()}
    former = FORMER_F1.get(model)
    print(f"{model}: {sum(tally.rules.values())} replies, {tally.n_differ} plans differ")
    print(
        f"  F1 (A, optimal): official {f1['official']:.2f}, "
        f"former steps {'unknown' if former is None else f'{former:.2f}'}, "
        f"steps {f1['steps']:.2f}, as read by eye {f1['as read by eye']:.2f}"
    )
    print(f"  rules: {', '.join(f'{rule} {n}' for rule, n in tally.rules.most_common())}")
    if tally.problems:
        print(f"  failures: {', '.join(f'{p} {n}' for p, n in tally.problems.most_common())}")
    print(f"  against the gold set: {dict(tally.against_gold)}")
    return f1


if __name__ == "__main__":
    main()
