"""The two matchers on valid orders and of recorded replies: the evidence for `optimal`.

    python benchmarks/evidence/matchers.py CHECKOUT [--orders 200] [--seed 0]

CHECKOUT is a checkout of the official repository.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from phyblock.data.official import read_official, recorded_models
from phyblock.domain.scene import AssemblyTask, Plan
from phyblock.models.client import read_raw_reply
from phyblock.parsing.plan import parse_plan
from phyblock.scoring.plan import Counts, Goal, match_plan
from phyblock.types import MATCHERS, SETTINGS


def valid_plans(task: AssemblyTask, orders: int, rng: np.random.Generator) -> Iterator[Plan]:
    """Random valid orders of a scene as the candidate numbers that a perfect model would name."""
    number = [task.candidates.index_of(block.look) for block in task.scene.blocks]
    for _ in range(orders):
        order = task.scene.graph.random_order(rng)
        yield Plan(tuple(index for v in order if (index := number[v]) is not None))


def print_valid_orders(tasks: tuple[AssemblyTask, ...], orders: int, seed: int) -> None:
    """Scenes in which some valid order scores below F1 = 1, and the lowest score."""
    rng = np.random.default_rng(seed)
    plans = [list(valid_plans(task, orders, rng)) for task in tasks]
    print(f"{orders} random valid orders a scene, {len(tasks)} scenes, seed {seed}")
    for setting in SETTINGS:
        goals = [Goal(task.scene, task.candidates, setting) for task in tasks]
        for matcher in MATCHERS:
            lowest = [
                min(match_plan(goal, plan, matcher).counts.f1 or 0.0 for plan in of_scene)
                for goal, of_scene in zip(goals, plans, strict=True)
            ]
            below = sum(f1 < 1 for f1 in lowest)
            print(
                f"  setting {setting}, {matcher:7}: {below:3} scenes with an order below F1 = 1, "
                f"lowest {min(lowest):.3f}"
            )


def print_recordings(tasks: tuple[AssemblyTask, ...], checkout: Path) -> None:
    """Micro F1 of recorded replies under both matchers, and how many replies gain."""
    by_id = {task.scene.id: task for task in tasks}
    print("recorded replies, parser official: F1 paper -> optimal (replies that gain)")
    for model, folder in recorded_models(checkout).items():
        cells = []
        for setting in SETTINGS:
            counts = {matcher: [] for matcher in MATCHERS}
            for path in sorted(folder.glob("*.json")):
                task = by_id[path.stem]
                text = read_raw_reply(json.loads(path.read_bytes()), str(path)).text
                plan = parse_plan(text, len(task.candidates), "official").plan
                goal = Goal(task.scene, task.candidates, setting)
                for matcher in MATCHERS:
                    counts[matcher].append(match_plan(goal, plan, matcher).counts)
            f1 = {matcher: 100 * (sum(counts[matcher], Counts()).f1 or 0.0) for matcher in MATCHERS}
            gain = sum(
                best.tp > first.tp
                for first, best in zip(counts["paper"], counts["optimal"], strict=True)
            )
            cells.append(f"{setting} {f1['paper']:.2f} -> {f1['optimal']:.2f} ({gain})")
        print(f"  {model:24} {'   '.join(cells)}")


def main() -> None:
    """Read the arguments and print both."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("checkout", type=Path)
    arguments.add_argument("--orders", type=int, default=200)
    arguments.add_argument("--seed", type=int, default=0)
    args = arguments.parse_args()
    tasks = read_official(args.checkout).tasks
    print_valid_orders(tasks, args.orders, args.seed)
    print_recordings(tasks, args.checkout)


if __name__ == "__main__":
    main()
