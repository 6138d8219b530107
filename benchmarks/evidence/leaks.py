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
from pathlib import Path

import numpy as np

from phyblock.datasets import SCENES_FILE, AssemblyTask, read_builtin, read_official
from phyblock.domain import Plan
from phyblock.domain.scene import Kind
from phyblock.making.auditing.tells import Part, Tells, find_tells
from phyblock.resources import bundled
from phyblock.scoring import Goal, match_plan, micro
from phyblock.types import SETTINGS

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


def print_tells(tells: Tells) -> None:
    """How often each place is needed; the first of several poses; kinds in one and in several."""
    shares = " ".join(f"{percent(part):.0f}" for part in tells.places.values())
    print(f"  needed by place 1 to {len(tells.places)} [%]: {shares}")
    first = tells.first_pose
    told = "no kind is in several poses"
    if first.whole:
        told = (
            f"first pose of a needed kind in several is needed: {percent(first):.1f} % of "
            f"{first.whole}, any pose {100 * first.chance:.1f} %"
        )
    print(f"  {told}")
    for name, is_named in (("several poses", lambda n: n > 1), ("one pose", lambda n: n == 1)):
        kinds = [part for poses, part in tells.kinds.items() if is_named(poses)]
        of = Part(sum(part.part for part in kinds), sum(part.whole for part in kinds))
        if of.whole:
            print(f"  kinds in {name} needed: {percent(of):.1f} % of {of.whole}")


def percent(part: Part) -> float:
    """A share in percent, 0 of nothing."""
    return 100 * (part.share or 0.0)


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
        print_tells(find_tells((task.scene, task.candidates) for task in tasks))
        print_floors(tasks, options.seed)


if __name__ == "__main__":
    main()
