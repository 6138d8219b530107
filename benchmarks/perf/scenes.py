"""States of scenes, decided by statics and by every installed engine: shares, speed, quarrels.

States are scenes of the built-in set and of the endless split, finished and at every step, with a
support taken away, with blocks moved, and with blocks that just do not overlap what bears them.
Exits with 1 when an engine says of a state what a proof says the contrary of.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain, islice

import numpy as np

from phyblock.data.scenes import read_builtin
from phyblock.domain.scene import Block, Scene
from phyblock.files import bundled
from phyblock.making.scenes.production import split_tasks
from phyblock.sim.balance import prove
from phyblock.sim.contact import bounds_m, drop_height_m
from phyblock.sim.dynamics import groups, stands
from phyblock.sim.engine import PHYSICS_VARIABLE, installed_engines

States = Iterator[tuple[str, Sequence[Block]]]


def states(blocks: Sequence[Block], rng: np.random.Generator) -> States:
    """Yield states of a scene by what was done to it."""
    yield "finished", blocks
    yield "step", blocks[: int(rng.integers(1, len(blocks) + 1))]
    if len(blocks) > 1:
        gone = int(rng.integers(len(blocks) - 1))
        yield "support gone", [*blocks[:gone], *blocks[gone + 1 :]]
    yield "moved", let_down(blocks, rng, rng.choice([0.0125, 0.025, 0.05]) * rng.choice([-1, 1], 2))
    yield "moved anywhere", let_down(blocks, rng, rng.uniform(-0.04, 0.04, 2))
    low, high = bounds_m(blocks[-1])
    yield (
        "zero overlap",
        let_down(blocks, rng, np.array([1, 0]) * float(high[0] - low[0]), last=True),
    )


def let_down(
    blocks: Sequence[Block], rng: np.random.Generator, way_m: np.ndarray, last: bool = False
) -> list[Block]:
    """One of the blocks moved along the ground plan and let down on the others."""
    one = blocks[-1 if last else int(rng.integers(len(blocks)))]
    others = [block for block in blocks if block is not one]
    x, y = (round(float(a + b), 6) for a, b in zip(one.position_m[:2], way_m, strict=True))
    above = replace(one, position_m=(x, y, 1.0))
    return [*others, replace(above, position_m=(x, y, 1.0 - drop_height_m(above, others)))]


def drawn(seed: int, spent: Counter[str]) -> Iterator[Scene]:
    """Scenes of the endless split; counts them, and the time that they take."""
    tasks = split_tasks("train", seed)
    next(tasks)  # Imports, and reads the built-in set.
    while True:
        start = time.process_time()
        scene = next(tasks).scene
        spent["making"] += time.process_time() - start
        spent["scenes"] += 1
        yield scene


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--states", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    data = read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks
    known = [data[int(i)].scene for i in rng.permutation(len(data))]
    spent: Counter[str] = Counter()
    made = drawn(options.seed, spent)
    scenes = chain.from_iterable(zip(made, known, strict=False))
    found = islice(
        chain.from_iterable(states(scene.blocks, rng) for scene in scenes), options.states
    )
    counts: Counter[tuple[str, bool | None]] = Counter()
    quarrels = 0
    for kind, blocks in found:
        for group in groups(blocks):
            start = time.process_time()
            proven = prove(group)
            spent["statics"] += time.process_time() - start
            verdict = None if proven is None else proven.stands
            counts[kind, verdict] += 1
            for name in installed_engines():
                os.environ[PHYSICS_VARIABLE] = name
                start = time.process_time()
                has_stood = stands(group)
                spent[name] += time.process_time() - start
                if verdict not in (None, has_stood):
                    quarrels += 1
                    end = "stands" if has_stood else "falls"
                    print(f"{name}: {end}, proven otherwise: {group}")
    total = sum(counts.values())
    for kind in sorted({kind for kind, _ in counts}):
        of = [counts[kind, verdict] for verdict in (True, False, None)]
        print(f"{kind:15}{sum(of):6} groups: {of[0]} stand, {of[1]} fall, {of[2]} undecided")
    undecided = sum(count for (_, verdict), count in counts.items() if verdict is None)
    print(f"undecided: {undecided / total:.1%} of {total}; quarrels with an engine: {quarrels}")
    made_count, made_s = spent.pop("scenes"), spent.pop("making")
    print(f"{made_count:.0f} scenes made, {made_count / made_s:.2f} a CPU second, pictures checked")
    for name, seconds in spent.items():
        ratio = seconds / spent["statics"]
        print(f"{name:10}{total / seconds:8.1f} groups a CPU second, {ratio:.1f} times the statics")
    return 1 if quarrels else 0


if __name__ == "__main__":
    sys.exit(main())
