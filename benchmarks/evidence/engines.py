"""Agreement of the physics engines: on every built-in scene, order and question that needs one.

    python benchmarks/evidence/engines.py [--all] [--every 20] [--orders 1] [--seed 0] [--list]

Both engines must be installed (Python 3.11, `pip install -e '.[mujoco]'`). Every 20th scene and
question is tried, or with `--all` each of them. A scene is let go as it is, after every step of
random valid orders, and without each of its blocks, as strict step planning lets it go: a verdict
is whether all blocks stand. A question's answer is derived again from its scene, as `phyblock
questions verify` does, which wants four settings of the engine to agree: it is found again, it is
not sure in this engine, or another answer is. `same` counts equal verdicts, `opposite` those of
which one says no where the other says yes (a question that is not sure says neither), `detail`
those that are equal to the last block that falls.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from phyblock.data.questions import read_questions
from phyblock.data.scenes import read_builtin
from phyblock.domain.scene import Block, Scene
from phyblock.files import bundled
from phyblock.making.questions.production import problem_of
from phyblock.sim.dynamics import settle
from phyblock.sim.engine import PHYSICS_VARIABLE, described_engine, installed_engines

DYNAMIC = "dynamic_reasoning"
"""The category of questions whose answers physics decides."""
HEADINGS = ("stands, or answer found again", "tried", "same", "opposite", "detail")
WIDTHS = (31, 7, 10, 10, 8, 10, 8)


@dataclass
class Agreement:
    """Numbers tried, numbers to which each engine says yes, and their agreement."""

    tried: int = 0
    yes: tuple[int, ...] = (0, 0)
    same: int = 0
    opposite: int = 0
    detail: int = 0

    def add(self, verdicts: Sequence[bool | None], is_same_in_detail: bool) -> bool:
        """Count one that was tried; whether the engines agree on it."""
        self.tried += 1
        self.yes = tuple(n + bool(one) for n, one in zip(self.yes, verdicts, strict=True))
        is_same = len(set(verdicts)) == 1
        self.same += is_same
        self.opposite += {True, False} <= set(verdicts)
        self.detail += is_same_in_detail
        return is_same


def states(
    scene: Scene, orders: int, rng: np.random.Generator
) -> Iterator[tuple[str, str, tuple[Block, ...]]]:
    """Yield the trials of a scene: its row in the table, its name, and the blocks."""
    yield "scenes as they are", scene.id, scene.blocks
    for number in range(orders):
        order = scene.graph.random_order(rng)
        for count in range(1, len(order)):
            placed = set(order[:count])
            blocks = tuple(b for v, b in enumerate(scene.blocks) if v in placed)
            yield "steps of valid orders", f"{scene.id}, order {number + 1}, step {count}", blocks
    for taken in scene.blocks:
        blocks = tuple(block for block in scene.blocks if block is not taken)
        yield "scenes without a block", f"{scene.id} without {taken.order}", blocks


def is_found(problem: str | None) -> bool | None:
    """Return True if the answer was found again; None where none was sure."""
    return None if problem is not None and not problem.startswith("the answer is") else not problem


def row(*cells: object) -> str:
    """A line of the table."""
    first, *rest = (str(cell) for cell in cells)
    return first.ljust(WIDTHS[0]) + "".join(
        cell.rjust(width) for cell, width in zip(rest, WIDTHS[1:], strict=False)
    )


def main() -> None:
    """Try all and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--all", action="store_true", help="every scene and question")
    parser.add_argument("--every", type=int, default=20)
    parser.add_argument("--orders", type=int, default=1, help="random valid orders of each scene")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--list", action="store_true", help="name what they do not agree on")
    args = parser.parse_args()
    every = 1 if args.all else args.every
    engines = installed_engines()
    if len(engines) < 2:
        parser.exit(2, f"both engines must be installed, here is {' and '.join(engines)}\n")
    rng = np.random.default_rng(args.seed)
    scenes = read_builtin(bundled("benchmarks", "data", "phyblock-400"))
    tasks = read_questions(bundled("benchmarks", "data", "phyblock-vqa"), scenes).tasks
    table: dict[str, Agreement] = {}
    seconds = dict.fromkeys(engines, 0.0)

    for task in scenes.tasks[::every]:
        for what, name, blocks in states(task.scene, args.orders, rng):
            fallen = []
            for engine in engines:
                os.environ[PHYSICS_VARIABLE] = engine
                begun = time.process_time()
                fallen.append(settle(blocks).fallen)
                seconds[engine] += time.process_time() - begun
            stands = [not one for one in fallen]
            one = table.setdefault(what, Agreement())
            if not one.add(stands, len(set(fallen)) == 1) and args.list:
                print(f"{name}: {dict(zip(engines, fallen, strict=True))}")
    dynamic = [task.question for task in tasks if task.question.category == DYNAMIC]
    for question in dynamic[::every]:
        problems = []
        for engine in engines:
            os.environ[PHYSICS_VARIABLE] = engine
            problems.append(problem_of(question))
        one = table.setdefault(f"questions, {question.subtask}", Agreement())
        if not one.add([*map(is_found, problems)], len(set(problems)) == 1) and args.list:
            print(f"{question.id}: {dict(zip(engines, problems, strict=True))}")

    names = []
    for engine in engines:
        os.environ[PHYSICS_VARIABLE] = engine
        names.append(described_engine())
    took = ", ".join(
        f"{name} {took_s:.0f}" for name, took_s in zip(names, seconds.values(), strict=True)
    )
    print(f"CPU seconds for the scenes: {took}")
    print(row(*HEADINGS[:2], *engines, *HEADINGS[2:]))
    for what, one in table.items():
        print(row(what, one.tried, *one.yes, one.same, one.opposite, one.detail))


if __name__ == "__main__":
    main()
