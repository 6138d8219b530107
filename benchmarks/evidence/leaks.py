"""What the candidate sets of a data set tell about the goal, place by place and pose by pose.

    python benchmarks/evidence/leaks.py [DATA ...] [--seed 0]

DATA are bundled data sets, folders with scenes.jsonl or checkouts of the official repository;
phyblock-400 unless named. In a set without a tell every place is needed equally often, the pose
that is listed first is right as often as any other, kinds in several poses are needed no more than
others, and it does not matter which pose one takes who knows everything else.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from phyblock.datasets import SCENES_FILE, AssemblyTask, read_builtin, read_official
from phyblock.domain import Plan
from phyblock.domain.scene import Kind
from phyblock.resources import bundled
from phyblock.scoring import Goal, match_plan, micro
from phyblock.words import SETTINGS

Pick = Callable[[Sequence[int]], int]
"""One of the places at which a kind is listed."""


def read(name: str) -> tuple[AssemblyTask, ...]:
    """The scenes of a folder or of a bundled set."""
    folder = Path(name)
    folder = folder if folder.is_dir() else bundled("benchmarks", "data", name)
    reader = read_builtin if (folder / SCENES_FILE).is_file() else read_official
    return reader(folder).tasks


def listed(task: AssemblyTask) -> dict[Kind, list[int]]:
    """The places, from 1, at which each kind is listed."""
    places: dict[Kind, list[int]] = {}
    for place, candidate in enumerate(task.candidates.candidates, 1):
        places.setdefault(candidate.kind, []).append(place)
    return places


def needed(task: AssemblyTask) -> set[int]:
    """The places of the candidates that the goal needs."""
    looks = {block.look for block in task.scene.blocks}
    both = enumerate(task.candidates.candidates, 1)
    return {place for place, candidate in both if candidate.look in looks}


def print_places(tasks: Sequence[AssemblyTask]) -> None:
    """How often each place is needed, of the scenes that have it."""
    shares = []
    most = max(len(task.candidates) for task in tasks)
    for place in range(1, most + 1):
        having = [place in needed(task) for task in tasks if len(task.candidates) >= place]
        shares.append(f"{100 * np.mean(having):.0f}")
    print(f"  needed by place 1 to {most} [%]: {' '.join(shares)}")


def print_poses(tasks: Sequence[AssemblyTask]) -> None:
    """How often the first of several poses of a needed kind is needed, and who is needed at all."""
    first: list[bool] = []
    chance: list[Fraction] = []
    several: list[bool] = []
    single: list[bool] = []
    for task in tasks:
        right = needed(task)
        for places in listed(task).values():
            is_needed = not right.isdisjoint(places)
            (several if len(places) > 1 else single).append(is_needed)
            if is_needed and len(places) > 1:
                first.append(places[0] in right)
                chance.append(Fraction(len(right.intersection(places)), len(places)))
    told = "no kind is in several poses"
    if first:
        told = (
            f"first pose of a needed kind in several is needed: {100 * np.mean(first):.1f} % of "
            f"{len(first)}, any pose {100 * float(sum(chance) / len(chance)):.1f} %"
        )
    print(f"  {told}")
    for name, kinds in (("several poses", several), ("one pose", single)):
        if kinds:
            print(f"  kinds in {name} needed: {100 * np.mean(kinds):.1f} % of {len(kinds)}")


def print_floors(tasks: Sequence[AssemblyTask], seed: int) -> None:
    """F1 of the right kinds in the right order, by which pose is taken; of all candidates once."""
    rng = np.random.default_rng(seed)
    picks: dict[str, Pick] = {
        "first pose": lambda places: places[0],
        "random pose": lambda places: int(rng.choice(places)),
        "last pose": lambda places: places[-1],
    }
    for name, pick in picks.items():
        plans = []
        for task in tasks:
            places = listed(task)
            chosen = [pick(places[b.kind]) for b in task.scene.blocks if b.kind in places]
            plans.append(Plan(tuple(chosen)))
        print(f"  kinds and order known, {name:11} F1 {f1s(tasks, plans)}")
    everything = [Plan(tuple(range(1, len(task.candidates) + 1))) for task in tasks]
    print(f"  every candidate once                F1 {f1s(tasks, everything)}")


def f1s(tasks: Sequence[AssemblyTask], plans: Sequence[Plan]) -> str:
    """Micro F1 of plans in both settings, with the matcher `optimal`."""
    cells = []
    for setting in SETTINGS:
        counts = micro(
            match_plan(Goal(task.scene, task.candidates, setting), plan, "optimal").counts
            for task, plan in zip(tasks, plans, strict=True)
        )
        cells.append(f"{100 * (counts.f1 or 0.0):.1f} ({setting})")
    return ", ".join(cells)


def main() -> None:
    """Print all figures of each data set."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", nargs="*", default=["phyblock-400"])
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for name in options.data:
        tasks = read(name)
        print(f"{name}: {len(tasks)} scenes")
        print_places(tasks)
        print_poses(tasks)
        print_floors(tasks, options.seed)


if __name__ == "__main__":
    main()
