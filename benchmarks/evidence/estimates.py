"""What tables say of the recorded replies where they said something else before.

    python -m benchmarks.evidence.estimates CHECKOUT [--resamples 2000] [--seed 0]

CHECKOUT is a checkout of the official repository; parser `steps`. Ratios above one: Level 1 by the
paper's `membership` under setting B. Intervals of 0 of n: before, quantiles of a bootstrap over
base scenes. Error types, which had no intervals and stood at level 1 as at level 2. One number for
one thing: of several seeds (here the recorded models, as if they were seeds of one), the mean over
seeds, which stood in headlines, and the value of all samples, which stood in figures and under the
intervals.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.evidence.coverage import pigeonhole
from benchmarks.evidence.losses import recorded_plans, scores
from phyblock.datasets import AssemblyTask, read_official, recorded_models
from phyblock.domain import Plan
from phyblock.scoring.counts import Floats, f1_of, ratio_of, recall_of
from phyblock.scoring.plan import ERROR_TYPES, Goal, level1_counts
from phyblock.scoring.statistics import Clusters, in_range, jackknife

Tasks = tuple[AssemblyTask, ...]
LEVEL1 = 2
"""Level 1 is asked of the scenes of level 2."""


def clusters_of(tasks: Sequence[AssemblyTask]) -> Clusters:
    """The base scenes of each task."""
    return Clusters.of([task.scene.parents or (task.scene.id,) for task in tasks])


def print_membership(tasks: Tasks, plans: dict[str, list[Plan]]) -> None:
    """Recall and F1 as they were divided, and as ratios."""
    print("Level 1 by membership, setting B: recall and F1 before, now")
    for model, of_model in plans.items():
        counts = np.zeros(3)
        for task, plan in zip(tasks, of_model, strict=True):
            if task.scene.level == LEVEL1:
                found = level1_counts(Goal(task.scene, task.candidates, "B"), plan, "membership")
                counts += found.tp, found.fp, found.fn
        tp, fp, fn = counts
        before = (tp / (tp + fn), 2 * tp / (2 * tp + fp + fn))
        now = (float(metric(counts)) for metric in (recall_of, f1_of))
        shown = " ".join("blank" if np.isnan(value) else f"{value:.3f}" for value in now)
        print(f"  {model:24} before {before[0]:.3f} {before[1]:.3f}; now {shown} (FN {fn:.0f})")


def print_whole_plans(
    tasks: Tasks, plans: dict[str, list[Plan]], resamples: int, seed: int
) -> None:
    """Intervals of how many plans are wholly right."""
    print("wholly right plans of level 4: share, interval before, now [%]")
    hard = [place for place, task in enumerate(tasks) if task.scene.level == 4]
    clusters = clusters_of([tasks[place] for place in hard])
    for model, of_model in plans.items():
        found = [scores(tasks[place], of_model[place])[0].counts for place in hard]
        rows = np.array([[one.fp == one.fn == 0, 1] for one in found], dtype=np.float64)
        rng = np.random.default_rng(seed)
        lo, hi, _ = pigeonhole(rows, clusters, ratio_of, rng, resamples)
        now = in_range(jackknife(rows, clusters, ratio_of))
        print(
            f"  {model:24} {100 * now.value:4.1f}: before {100 * lo:.1f} to {100 * hi:.1f}, "
            f"now {100 * now.lo:.1f} to {100 * now.hi:.1f}"
        )


def print_errors(tasks: Tasks, plans: dict[str, list[Plan]], clusters: Clusters) -> None:
    """Shares of the error types of all models, with intervals; and the rows of level 1."""
    counts = np.zeros((len(tasks), len(ERROR_TYPES)))
    of_levels = {level: np.zeros(len(ERROR_TYPES), dtype=int) for level in (LEVEL1, 3, 4)}
    for of_model in plans.values():
        for place, (task, plan) in enumerate(zip(tasks, of_model, strict=True)):
            errors = scores(task, plan)[0].errors or {}
            row = np.array([errors[name] for name in ERROR_TYPES])
            counts[place] += row
            of_levels[task.scene.level] += row
    print("error types, all models: share of wrong steps, interval (before: none) [%]")
    for n, name in enumerate(ERROR_TYPES):
        one = np.stack([counts[:, n], counts.sum(axis=1)], axis=-1)
        now = in_range(jackknife(one, clusters, ratio_of))
        print(f"  {name:24} {100 * now.value:.1f}: {100 * now.lo:.1f} to {100 * now.hi:.1f}")
    told = ", ".join(map(str, of_levels[LEVEL1]))
    print(f"  rows of level 2: {told}; of level 1, before: {told}, now: no row")


def print_seeds(tasks: Tasks, plans: dict[str, list[Plan]]) -> None:
    """The two values of what is asked with several seeds, level by level."""
    counts = np.zeros((len(plans), len(tasks), 3))
    for n, of_model in enumerate(plans.values()):
        for place, (task, plan) in enumerate(zip(tasks, of_model, strict=True)):
            found = scores(task, plan)[0].counts
            counts[n, place] = found.tp, found.fp, found.fn
    print(f"F1 over {len(plans)} seeds [%]: mean over seeds, of all samples")
    levels = np.array([task.scene.level for task in tasks])
    for level in (2, 3, 4, None):
        mine: Floats = counts[:, slice(None) if level is None else levels == level].sum(axis=1)
        title = "overall" if level is None else f"level {level}"
        mean, pooled = 100 * f1_of(mine).mean(), 100 * f1_of(mine.sum(axis=0))
        print(f"  {title:8} in the headline before {mean:.2f}, now {pooled:.2f} everywhere")


def main() -> None:
    """Read the arguments and print all four."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("checkout", type=Path)
    arguments.add_argument("--resamples", type=int, default=2000)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    tasks, folders = read_official(given.checkout).tasks, recorded_models(given.checkout)
    of_scene = [recorded_plans(task, folders) for task in tasks]
    plans = {model: [found.get(model, Plan(())) for found in of_scene] for model in folders}
    print_membership(tasks, plans)
    print_whole_plans(tasks, plans, given.resamples, given.seed)
    print_errors(tasks, plans, clusters_of(tasks))
    print_seeds(tasks, plans)


if __name__ == "__main__":
    main()
