"""What scenes are worth in the recorded replies, and what of the models' ranks few scenes keep.

    python -m benchmarks.evidence.subsets CHECKOUT [--draws 1000] [--seed 0]

CHECKOUT is a checkout of the official repository. F1 in setting A, matcher `optimal`, parser
`steps`. Kendall's tau-a of the models' ranks on the subset and on all 400 scenes, and on the scenes
that are not in it. Informative scenes are chosen with the scores of all models but the two that are
compared; evenly spread and random ones (the same number of each level) with none. "From halves":
the mean over random halves of the scenes, from which alone either is chosen.
"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.evidence.losses import recorded_plans, scores
from phyblock.datasets import read_official, recorded_models
from phyblock.domain import Plan
from phyblock.run.informative import most_informative
from phyblock.scoring.counts import Floats, f1_of
from phyblock.scoring.statistics import (
    discrimination,
    explained,
    least_correlation,
    pairs_kept,
    pairs_kept_by_choice,
)
from phyblock.tracks.selection import evenly, stratified

SIZES = (20, 40, 60, 100)


def recorded_counts(checkout: Path) -> tuple[list[str], list[int], list[int], Floats]:
    """Models, and of all scenes the levels, numbers of blocks and counts (models, scenes, 3)."""
    folders = recorded_models(checkout)
    tasks = read_official(checkout).tasks
    counts = np.zeros((len(folders), len(tasks), 3))
    for place, task in enumerate(tasks):
        plans = recorded_plans(task, folders)
        for number, model in enumerate(folders):
            found = scores(task, plans.get(model, Plan(())))[0].counts
            counts[number, place] = found.tp, found.fp, found.fn
    levels = [task.scene.level for task in tasks]
    return list(folders), levels, [len(task.scene.blocks) for task in tasks], counts


def drawn(levels: list[int], limit: int, rng: np.random.Generator) -> list[int]:
    """Random scenes, as many of each level as evenly spread ones."""
    names = sorted(set(levels))
    members = [np.flatnonzero(np.array(levels) == name) for name in names]
    shares = stratified([len(one) for one in members], limit)
    parts = [
        rng.choice(one, share, replace=False) for one, share in zip(members, shares, strict=True)
    ]
    return sorted(int(place) for part in parts for place in part)


def from_halves(
    levels: list[int], counts: Floats, size: int, halves: int, rng: np.random.Generator
) -> tuple[float, float]:
    """Mean tau with all scenes of informative and of random ones out of random halves."""
    taus = []
    for _ in range(halves):
        half = drawn(levels, len(levels) // 2, rng)
        of_half = [levels[place] for place in half]

        def choose(some: Floats, half: list[int] = half, of_half: list[int] = of_half) -> list[int]:
            return [half[i] for i in most_informative(f1_of, of_half, size, some[:, half])]

        random = [half[i] for i in drawn(of_half, size, rng)]
        kept = pairs_kept_by_choice(counts, f1_of, choose), pairs_kept(counts, f1_of, random)
        taus.append([one.mean() for one in kept])
    informative, spread = np.mean(taus, axis=0)
    return float(informative), float(spread)


def main() -> None:
    """Read the arguments and print what scenes are worth, then a line a size of subset."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("checkout", type=Path)
    arguments.add_argument("--draws", type=int, default=1000)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    rng = np.random.default_rng(given.seed)
    models, levels, n_blocks, counts = recorded_counts(given.checkout)
    by_scene = f1_of(counts)
    worth, least = discrimination(by_scene), least_correlation(len(models))
    print(f"{len(models)} models, {len(levels)} scenes; discrimination {np.nanmean(worth):.2f}")
    print(
        f"  below 0: {(worth < 0).sum()}; below {-least:.2f}: {(worth < -least).sum()}; "
        f"above {least:.2f}: {(worth > least).sum()}"
    )
    means = by_scene.mean(axis=0)
    for name, groups, audit in (("level", levels, 7), ("number of blocks", n_blocks, 16)):
        share = 100 * explained(means, groups)
        print(f"  {name} explains {share:.1f} % of the variance of scenes' F1 (audit: {audit})")
    print(
        "tau with all scenes (with the scenes that are left); F1 of all models on the subset less"
    )
    print("on all, mean over models, in points")
    print(f"{'':6} {'informative':>14} {'evenly spread':>14} {'random':>14}  random ones as good")
    whole = 100 * f1_of(counts.sum(axis=1)).mean()
    for size in SIZES:
        choose = partial(most_informative, f1_of, levels, size)
        taus = [pairs_kept_by_choice(counts, f1_of, choose, rest).mean() for rest in (False, True)]
        even = evenly(levels, size)
        spread = [pairs_kept(counts, f1_of, even, rest).mean() for rest in (False, True)]
        random = np.array(
            [
                [pairs_kept(counts, f1_of, some, rest).mean() for rest in (False, True)]
                for some in (drawn(levels, size, rng) for _ in range(given.draws))
            ]
        )
        cells = (f"{all_:.2f} ({left:.2f})" for all_, left in (taus, spread, random.mean(axis=0)))
        as_good = 100 * (random[:, 0] >= taus[0] - 1e-9).mean()
        line = " ".join(f"{cell:>14}" for cell in cells)
        print(f"{size:6} {line}  {as_good:.0f} %", end="; ")
        shifts = [
            100 * f1_of(counts[:, list(chosen)].sum(axis=1)).mean() - whole
            for chosen in (choose(counts), even)
        ]
        print(f"F1 {shifts[0]:+.1f}, evenly spread {shifts[1]:+.1f}", end="; ")
        best, random_best = from_halves(levels, counts, size, given.draws // 10, rng)
        print(f"from halves {best:.2f}, random {random_best:.2f}")


if __name__ == "__main__":
    main()
