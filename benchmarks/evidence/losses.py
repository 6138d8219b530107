"""What became of the goals' blocks in the recorded replies, and what file order changes.

    python -m benchmarks.evidence.losses CHECKOUT [--seed 0]

CHECKOUT is a checkout of the official repository. Setting A, matcher `optimal`, parser `steps`;
beside each share stands the one of an audit of 21 recorded models, which judged blocks otherwise
and told fewer causes apart.
"""

from __future__ import annotations

import argparse
import json
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from phyblock.datasets import AssemblyTask, read_official, recorded_models
from phyblock.domain import Plan
from phyblock.models.raw_replies import read_raw_reply
from phyblock.parsing import parse_plan
from phyblock.scoring.plan import AssemblyScorer, BlockOutcome, Score
from phyblock.types import SETTINGS

GROUPS: dict[str, tuple[tuple[BlockOutcome, ...], float]] = {
    "placed": (("placed",), 29.4),
    "left out, or wrong kind": (("left_out", "wrong_kind"), 29.7),
    "wrong orientation": (("wrong_orientation",), 20.8),
    "support missing": (("support_not_named", "support_turned", "support_both"), 17.3),
    "order": (("order",), 2.8),
}

EARLIER = {"error types": 11}
"""What the same shuffles (seed 0) changed when `optimal` took any of the best choices."""


def recorded_plans(task: AssemblyTask, folders: dict[str, Path]) -> dict[str, Plan]:
    """What each model that has a reply to a scene planned."""
    paths = {model: folder / f"{task.scene.id}.json" for model, folder in folders.items()}
    return {
        model: parse_plan(
            read_raw_reply(json.loads(path.read_bytes()), str(path)).text,
            len(task.candidates),
            "steps",
        ).plan
        for model, path in paths.items()
        if path.exists()
    }


def scores(task: AssemblyTask, plan: Plan) -> tuple[Score, ...]:
    """One score a setting, by the `optimal` matcher."""
    return AssemblyScorer(task.scene, task.candidates, SETTINGS).score(plan, ["optimal"], None)


def main() -> None:
    """Read the arguments and print the shares by model, and what shuffled files change."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("checkout", type=Path)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    rng = np.random.default_rng(given.seed)
    folders = recorded_models(given.checkout)
    by_model: dict[str, Counter[BlockOutcome]] = {model: Counter() for model in folders}
    changed, scored = Counter[str](), 0
    for task in read_official(given.checkout).tasks:
        blocks = task.scene.blocks
        shuffled = replace(
            task,
            scene=replace(
                task.scene, blocks=tuple(blocks[i] for i in rng.permutation(len(blocks)))
            ),
        )
        for model, plan in recorded_plans(task, folders).items():
            for score, other in zip(scores(task, plan), scores(shuffled, plan), strict=True):
                scored += 1
                changed["error types"] += score.errors != other.errors
                changed["outcomes of blocks"] += score.blocks != other.blocks
                changed["distances to a valid order"] += score.kept != other.kept
                if score.setting == "A":
                    by_model[model].update(score.blocks or {})
    total = sum(by_model.values(), Counter())
    print(f"{total.total()} blocks of the goals of {len(folders)} models' plans, in percent")
    print(f"  {'':24} {'here':>6} {'audit':>6}")
    for name, (outcomes, audit) in GROUPS.items():
        here = 100 * sum(total[outcome] for outcome in outcomes) / total.total()
        print(f"  {name:24} {here:6.1f} {audit:6.1f}")
    for model, counted in {**by_model, "all": total}.items():
        parts = [f"{name} {100 * n / counted.total():.1f}" for name, n in counted.items()]
        print(f"{model}: {', '.join(parts)}")
    print(f"{scored} scorings again with the blocks of every file shuffled (seed {given.seed}):")
    for name, n in changed.items():
        before = f" (before: {EARLIER[name]})" if name in EARLIER and not given.seed else ""
        print(f"  {n} with other {name}{before}")


if __name__ == "__main__":
    main()
