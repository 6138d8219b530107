"""How often the default and the official parser read different plans, and what it changes.

    python benchmarks/evidence/parsers.py CHECKOUT [--list]

CHECKOUT is a checkout of the official repository; `--list` names every difference.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from pathlib import Path

from phyblock.datasets import read_official, recorded_models
from phyblock.domain import Plan
from phyblock.models.raw_replies import read_raw_reply
from phyblock.parsing import parse_plan
from phyblock.scoring import Goal, match_plan, micro
from phyblock.words import PLAN_PARSERS


def kind_of_difference(default: tuple[int, ...], official: tuple[int, ...]) -> str:
    """What the official rule did where the two plans differ."""
    if not official:
        return "official reads nothing"
    if official[-len(default) :] == default:
        return "official reads mentions before the plan"
    if len(default) > len(official):
        return "official misses steps"
    return "official reads mentions inside the plan"


def main() -> None:
    """Print the rules that matched, the differences and micro F1 by model."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("checkout", type=Path)
    arguments.add_argument("--list", action="store_true")
    args = arguments.parse_args()
    tasks = {task.scene.id: task for task in read_official(args.checkout).tasks}
    for model, folder in recorded_models(args.checkout).items():
        rules: Counter[str] = Counter()
        kinds: Counter[str] = Counter()
        counts = {parser: [] for parser in PLAN_PARSERS}
        for path in sorted(folder.glob("*.json")):
            task = tasks[path.stem]
            text = read_raw_reply(json.loads(path.read_bytes()), str(path)).text
            goal = Goal(task.scene, task.candidates, "A")
            plans: dict[str, Plan] = {}
            for parser in PLAN_PARSERS:
                parsed = parse_plan(text, len(task.candidates), parser)
                plans[parser] = parsed.plan
                counts[parser].append(match_plan(goal, parsed.plan, "optimal").counts)
                if parser == "steps":
                    rules[parsed.rule or "parse failure"] += 1
            default, official = plans["steps"].steps, plans["official"].steps
            if default != official:
                kinds[kind_of_difference(default, official)] += 1
                if args.list:
                    print(f"    {model} {path.stem}: {list(default)} | {list(official)}")
        f1 = {parser: 100 * (micro(counts[parser]).f1 or 0.0) for parser in PLAN_PARSERS}
        print(f"{model}: {sum(rules.values())} replies, {sum(kinds.values())} plans differ")
        print(f"  F1 (A, optimal): official {f1['official']:.2f}, steps {f1['steps']:.2f}")
        print(f"  rules: {', '.join(f'{rule} {n}' for rule, n in rules.most_common())}")
        for kind, n in kinds.most_common():
            print(f"  {n:3} {kind}")


if __name__ == "__main__":
    main()
