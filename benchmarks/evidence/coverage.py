"""Coverage of 95 % intervals, and the error rate and power of tests.

    python -m benchmarks.evidence.coverage [--worlds 1000] [--resamples 1000] [--seed 0]

Run from the root of a checkout. Worlds of scenes are made up in which the true F1 is known
(tests/scoring/cases.py): 150 base scenes and 250 scenes made of two of them, as in the official
data. `jackknife` is what phyblock does (phyblock/scoring/statistics.py); `pigeonhole` is the
bootstrap that it did before (Owen, Annals of Applied Statistics 1, 2007), `naive` takes scenes as
independent.
"""

from __future__ import annotations

import argparse
from collections import defaultdict

import numpy as np
from scipy.special import ndtr, ndtri, stdtr, stdtrit  # type: ignore[import-untyped]

from phyblock.scoring.plan import Floats, Metric
from phyblock.scoring.statistics import Clusters, in_range, jackknife
from tests.scoring.cases import World, f1_of

WORLDS = {
    "like the recorded models": World(),
    "half base scene, half scene": World(base_sd=0.8, scene_sd=0.8),
    "scenes alone": World(base_sd=0.0, scene_sd=1.0),
    "no combined scenes": World(pairs=0),
    "15 base scenes, 20 combined": World(bases=15, pairs=20),
    "the same, F1 of 5 %": World(bases=15, pairs=20, ease=-3),
}
LOST = 0.12
"""Share of the blocks placed rightly that the weaker model of a pair loses."""


def difference_of(sums: Floats) -> Floats:
    """F1 of the first model minus that of the second."""
    return np.asarray(f1_of(sums)[..., 0] - f1_of(sums)[..., 1])


def weights(clusters: Clusters, rng: np.random.Generator, resamples: int) -> Floats:
    """Return each unit's count in each resample: base scenes are drawn, a scene of several counts
    the product of their draws; shape (resamples, units).
    """
    n = clusters.size
    times = np.ones((resamples, n + 1))
    times[:, :-1] = rng.multinomial(n, np.full(n, 1 / n), size=resamples)
    return np.asarray(np.prod([times[:, member] for member in clusters.members.T], axis=0))


def p_of_draws(draws: Floats, n: int) -> float:
    """The p value of what was drawn of a difference, with `n` base scenes."""
    below = (draws < 0).sum() + 0.5 * (draws == 0).sum()
    share = (min(below, len(draws) - below) + 0.5) / (len(draws) + 1)
    return float(min(2 * stdtr(n - 1, ndtri(share) * np.sqrt((n - 1) / n)), 1.0))


def pigeonhole(
    counts: Floats, clusters: Clusters, metric: Metric, rng: np.random.Generator, resamples: int
) -> tuple[float, float, float]:
    """Interval and p value of the bootstrap over base scenes."""
    n = clusters.size
    draws = metric(np.tensordot(weights(clusters, rng, resamples), counts, axes=1))
    tail = float(ndtr(np.sqrt(n / (n - 1)) * stdtrit(n - 1, 0.025)))
    lo, hi = np.quantile(draws, [tail, 1 - tail])
    return float(lo), float(hi), p_of_draws(draws, n)


def weaker(counts: Floats, rng: np.random.Generator) -> Floats:
    """The same counts, of which the second model loses `LOST` of what it placed."""
    lost = rng.binomial(counts[:, 1, 0].astype(int), LOST)
    after = counts.copy()
    after[:, 1] += np.stack([-lost, lost, lost], axis=-1)
    return after


def main() -> None:
    """Print a block a world, a line a way of estimating."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--worlds", type=int, default=1000)
    parser.add_argument("--resamples", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for title, world in WORLDS.items():
        rng = np.random.default_rng(given.seed)
        truth = world.true_f1(rng)
        held: dict[str, list[bool]] = defaultdict(list)
        widths: dict[str, list[float]] = defaultdict(list)
        tests: dict[tuple[str, str], list[bool]] = defaultdict(list)
        gaps = []
        for _ in range(given.worlds):
            counts, clusters, _ = world.draw(rng, models=2)
            alone = Clusters.of([[str(n)] for n in range(len(counts))])
            apart = weaker(counts, rng)
            gaps.append(float(difference_of(apart.sum(axis=0))))
            for name, groups in (("naive", alone), ("jackknife", clusters)):
                one = in_range(jackknife(counts[:, 0], groups, f1_of))
                held[name].append(bool(one.lo <= truth <= one.hi))
                widths[name].append(float(one.hi - one.lo))
                for case, pair in (("alike", counts), ("apart", apart)):
                    p = jackknife(pair, groups, difference_of).p
                    tests[name, case].append(bool(p < 0.05))
            lo, hi, _ = pigeonhole(counts[:, 0], clusters, f1_of, rng, given.resamples)
            held["pigeonhole"].append(lo <= truth <= hi)
            widths["pigeonhole"].append(hi - lo)
            for case, pair in (("alike", counts), ("apart", apart)):
                p = pigeonhole(pair, clusters, difference_of, rng, given.resamples)[2]
                tests["pigeonhole", case].append(p < 0.05)
        print(f"{title}: true F1 {100 * truth:.1f}; a gap of {100 * np.mean(gaps):.1f} points")
        for name, hits in held.items():
            print(
                f"  {name:<10} holds the truth {np.mean(hits):6.1%}, width "
                f"{100 * np.mean(widths[name]):5.2f}; errs {np.mean(tests[name, 'alike']):5.1%}, "
                f"finds the gap {np.mean(tests[name, 'apart']):5.1%}"
            )


if __name__ == "__main__":
    main()
