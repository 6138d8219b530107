"""How often 95 % intervals hold the truth, by how scenes of common origin are weighed.

    python -m benchmarks.evidence.coverage [--worlds 400] [--resamples 500] [--seed 0]

Run from the root of a checkout. Worlds of scenes are made up in which the true F1 is known
(tests/scoring/worlds.py): 150 base scenes and 250 scenes made of two of them, as in the official
data. `product` is what phyblock does (phyblock/scoring/uncertainty.py); the others are what it
could have done.
"""

from __future__ import annotations

import argparse

import numpy as np

from phyblock.scoring.uncertainty import Clusters, Floats, bootstrap, f1_of
from tests.scoring.worlds import World

WORLDS = {
    "like the recorded models": World(),
    "half base scene, half scene": World(base_sd=0.8, scene_sd=0.8),
    "scenes alone": World(base_sd=0.0, scene_sd=1.0),
    "no combined scenes": World(pairs=0),
    "15 base scenes, 20 combined": World(bases=15, pairs=20),
}


def difference_of(sums: Floats) -> Floats:
    """F1 of the first model minus that of the second."""
    return np.asarray(f1_of(sums)[..., 0] - f1_of(sums)[..., 1])


def intervals(
    counts: Floats, clusters: Clusters, rng: np.random.Generator, resamples: int
) -> dict[str, tuple[float, float]]:
    """Interval by way of weighing, of F1 of the first model."""
    one = counts[:, 0]
    found = {}
    alone = Clusters.of([[str(n)] for n in range(len(one))])
    for name, groups in (("naive", alone), ("product", clusters)):
        made = bootstrap(one, groups, f1_of, rng, resamples=resamples)
        found[name] = (float(made.lo), float(made.hi))
    for name, weights in linear_weights(clusters, rng, resamples).items():
        found[name] = tuple(np.quantile(f1_of(weights @ one), [0.025, 0.975]))
    f1 = float(f1_of(one.sum(axis=0)))
    whole = 2 * one[:, 0] + one[:, 1] + one[:, 2]
    share = (2 * one[:, 0] - f1 * whole) / whole.sum()
    members = np.zeros((len(one), clusters.size + 1))
    np.put_along_axis(members, clusters.members, 1.0, axis=1)
    common = (members[:, :-1] @ members[:, :-1].T) > 0
    se = float(np.sqrt(max(0.0, share @ common @ share)))
    found["dyadic formula"] = (f1 - 1.96 * se, f1 + 1.96 * se)
    return found


def linear_weights(
    clusters: Clusters, rng: np.random.Generator, resamples: int
) -> dict[str, Floats]:
    """Weights from the mean of the draws of a scene's base scenes, and from their sum less one."""
    even = np.full(clusters.size, 1 / clusters.size)
    times = rng.multinomial(clusters.size, even, size=resamples).astype(np.float64)
    padded = np.hstack([times, np.zeros((resamples, 1))])
    number = (clusters.members < clusters.size).sum(axis=1)
    total = sum(padded[:, member] for member in clusters.members.T)
    return {"mean": total / number, "sum less one": total - number + 1}


def main() -> None:
    """Print a block a world, a line a way of weighing."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--worlds", type=int, default=400)
    parser.add_argument("--resamples", type=int, default=500)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for title, world in WORLDS.items():
        rng = np.random.default_rng(given.seed)
        truth = world.true_f1(rng)
        values, hits, pair_hits = [], {}, 0
        widths: dict[str, list[float]] = {}
        for _ in range(given.worlds):
            counts, clusters, _ = world.draw(rng, models=2)
            values.append(float(f1_of(counts[:, 0].sum(axis=0))))
            for name, (lo, hi) in intervals(counts, clusters, rng, given.resamples).items():
                hits[name] = hits.get(name, 0) + (lo <= truth <= hi)
                widths.setdefault(name, []).append(hi - lo)
            pair = bootstrap(counts, clusters, difference_of, rng, resamples=given.resamples)
            pair_hits += bool(pair.lo <= 0 <= pair.hi)
        print(f"{title}: true F1 {100 * truth:.1f}, its sd over worlds {100 * np.std(values):.2f}")
        for name, count in hits.items():
            width = 100 * np.mean(widths[name])
            print(f"  {name:<16} holds it {100 * count / given.worlds:5.1f} %, width {width:5.2f}")
        print(f"  {'product, paired':<16} holds 0  {100 * pair_hits / given.worlds:5.1f} %")


if __name__ == "__main__":
    main()
