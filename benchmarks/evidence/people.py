"""How wide intervals of a study with people may be, with recorded models in the place of people.

    python -m benchmarks.evidence.people CHECKOUT

CHECKOUT is a checkout of the official repository. F1 of single scenes in setting A, matcher
`optimal`, parser `steps`: standard deviations of scenes, of models and of what is left, by the
method of moments for a crossed design without repeats (Searle, Casella and McCulloch 1992,
"Variance components", chapter 4). The half width of a 95 % interval of the mean is Student's t
times sqrt(s^2 / S + p^2 / P + e^2 / (S P)); for one person, p is left out: the interval is for that
person. Detectable: the median over pairs of models of the difference that a paired test over S
scenes finds in four of five cases (phyblock.scoring.statistics.detectable), its standard error
taken from all scenes by base scenes left out in turn, times sqrt(400 / S).
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.special import stdtrit  # type: ignore[import-untyped]

from benchmarks.evidence.subsets import recorded_counts
from phyblock.datasets import read_official
from phyblock.scoring.counts import Floats, f1_of
from phyblock.scoring.statistics import Clusters, detectable, jackknife

SCENES = (8, 12, 24, 48, 96)
PEOPLE = (1, 4, 8, 16, 32)


@dataclass(frozen=True)
class Spread:
    """Standard deviations of scenes, of people and of what is left [points]."""

    scenes: float
    people: float
    rest: float

    def half_width(self, n_scenes: int, n_people: int) -> float:
        """Half of a 95 % interval of the mean of people on scenes [points]."""
        people = self.people**2 / n_people if n_people > 1 else 0.0
        rest = self.rest**2 / (n_scenes * n_people)
        degrees = (min(n_scenes, n_people) if n_people > 1 else n_scenes) - 1
        se = np.sqrt(self.scenes**2 / n_scenes + people + rest)
        return float(stdtrit(degrees, 0.975) * se)


def spread_of(values: Floats) -> Spread:
    """Of values [points] of people (rows) on scenes (columns), every one of each."""
    n_people, n_scenes = values.shape
    rest = values - values.mean(axis=0) - values.mean(axis=1, keepdims=True) + values.mean()
    left = (rest**2).sum() / ((n_people - 1) * (n_scenes - 1))
    of_scenes = values.mean(axis=0).var(ddof=1) - left / n_people
    of_people = values.mean(axis=1).var(ddof=1) - left / n_scenes
    return Spread(*(float(np.sqrt(max(0.0, one))) for one in (of_scenes, of_people, left)))


def paired_errors(counts: Floats, clusters: Clusters) -> Floats:
    """Standard errors of differences of pairs of models on all scenes [points]."""
    pairs = list(combinations(range(len(counts)), 2))
    both = np.stack([counts[list(pair)].swapaxes(0, 1) for pair in pairs], axis=1)
    found = jackknife(both, clusters, lambda sums: f1_of(sums)[..., 0] - f1_of(sums)[..., 1])
    return np.asarray(100 * found.se)


def main() -> None:
    """Read the arguments and print spreads, half widths and detectable differences."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("checkout", type=Path)
    checkout = arguments.parse_args().checkout
    models, _, _, counts = recorded_counts(checkout)
    spread = spread_of(100 * np.nan_to_num(f1_of(counts)))
    print(f"{len(models)} models, {counts.shape[1]} scenes; standard deviations [points]:")
    print(f"  scenes {spread.scenes:.1f}, models {spread.people:.1f}, rest {spread.rest:.1f}")
    print("half width of a 95 % interval [points], scenes down, people across")
    print(f"{'':4}" + "".join(f"{people:>8}" for people in PEOPLE))
    for scenes in SCENES:
        cells = "".join(f"{spread.half_width(scenes, people):8.1f}" for people in PEOPLE)
        print(f"{scenes:4}{cells}")
    tasks = read_official(checkout).tasks
    clusters = Clusters.of([task.scene.parents or (task.scene.id,) for task in tasks])
    errors = paired_errors(counts, clusters)
    print("detectable difference of two models on the same scenes [points], median over pairs")
    for scenes in SCENES:
        se = errors * np.sqrt(counts.shape[1] / scenes)
        print(f"{scenes:4}{float(np.median(detectable(se, scenes, 0.05))):8.1f}")


if __name__ == "__main__":
    main()
