"""How many pairs of models a comparison tells apart: as it was, and as it is.

    python -m benchmarks.evidence.comparisons CHECKOUT [--resamples 10000] [--seed 0]

CHECKOUT is a checkout of the official repository. F1 in setting A, matcher `optimal`, parser
`steps`, on the official scenes. "Before" is the pigeonhole bootstrap over base scenes, of which no
p value is less than what one resample more than there were would give; "now" is the test of
phyblock (docs/statistics.md). Both are corrected for all pairs (Holm). 26 models are made of the
eight recorded ones, by losing the more of their right blocks the later they come.
"""

from __future__ import annotations

import argparse
from itertools import combinations
from pathlib import Path

import numpy as np

from benchmarks.evidence.coverage import difference_of, p_of_draws, weights
from benchmarks.evidence.estimates import clusters_of
from benchmarks.evidence.subsets import recorded_counts
from phyblock.datasets import read_official
from phyblock.scoring.counts import Floats, f1_of
from phyblock.scoring.statistics import Clusters, detectable, holm, jackknife, least_p

MODELS, LEVEL = 26, 0.05
GAPS = (0, 5, 10, 25)


def as_many(counts: Floats, rng: np.random.Generator) -> Floats:
    """Counts (26, scenes, 3) of models as scattered as in a large comparison."""
    lost = np.linspace(0, 0.55, MODELS)
    made = np.stack([counts[n % len(counts)] for n in range(MODELS)])
    gone = rng.binomial(made[..., 0].astype(int), lost[:, None])
    return made + np.stack([-gone, gone, gone], axis=-1)


def print_pairs(title: str, counts: Floats, clusters: Clusters, drawn: Floats) -> None:
    """How many pairs of models are told apart before and now, by how far they are apart."""
    pairs = np.array(list(combinations(range(len(counts)), 2)))
    both = np.moveaxis(counts[pairs], 2, 0)
    now = jackknife(both, clusters, difference_of)
    draws = np.stack([f1_of(np.tensordot(drawn, model, axes=1)) for model in counts], axis=1)
    before = np.array([p_of_draws(draws[:, a] - draws[:, b], clusters.size) for a, b in pairs])
    gaps = 100 * np.abs(now.value)
    floor = float(p_of_draws(np.ones(len(drawn)), clusters.size))
    least = float(least_p(clusters.size))
    print(f"{title}: {len(pairs)} pairs, gaps up to {gaps.max():.1f} points")
    print(
        f"  least p that can be: before {floor:.2e}, corrected {min(1, floor * len(pairs)):.3f}; "
        f"now {least:.1e}, corrected {least * len(pairs):.1e}"
    )
    print(f"  least p of these: before {before.min():.2e}, now {now.p.min():.2e}")
    for gap in GAPS:
        far = gaps >= gap
        told = (str((holm(p)[far] < LEVEL).sum()) for p in (before, now.p))
        print(f"  of {far.sum()} that are {gap} points apart: before, now {', '.join(told)}")
    for name, level in (("one test", LEVEL), ("Holm's first step", LEVEL / len(pairs))):
        found = 100 * np.median(detectable(now.se, clusters.size, level))
        print(f"  found in four of five cases by {name}: {found:.1f} points (before: not said)")


def main() -> None:
    """Read the arguments and print the recorded models, then the 26."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("checkout", type=Path)
    arguments.add_argument("--resamples", type=int, default=10_000)
    arguments.add_argument("--seed", type=int, default=0)
    given = arguments.parse_args()
    rng = np.random.default_rng(given.seed)
    clusters = clusters_of(read_official(given.checkout).tasks)
    counts = recorded_counts(given.checkout)[3]
    drawn = weights(clusters, rng, given.resamples)
    print_pairs("the recorded models", counts, clusters, drawn)
    print_pairs(f"{MODELS} models", as_many(counts, rng), clusters, drawn)


if __name__ == "__main__":
    main()
