from __future__ import annotations

import csv
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import stats

from phyblock.datasets import read_official
from phyblock.scoring.uncertainty import (
    Clusters,
    Floats,
    bootstrap,
    f1_of,
    holm,
    precision_of,
    ratio_of,
    recall_of,
    resample_weights,
)
from tests.scoring.worlds import World

NAMES = st.lists(st.sampled_from("abcdefg"), min_size=1, max_size=3)
MEMBERS = st.lists(NAMES, min_size=2, max_size=12)
P_VALUES = hnp.arrays(float, st.integers(1, 8), elements=st.floats(0, 1))


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def alone(n: int) -> Clusters:
    return Clusters.of([[str(i)] for i in range(n)])


@given(MEMBERS)
def test_a_unit_weighs_the_product_of_the_draws_of_its_base_scenes(
    parents: list[list[str]],
) -> None:
    clusters = Clusters.of(parents)
    times = rng().multinomial(clusters.size, np.full(clusters.size, 1 / clusters.size), size=20)
    names = list(dict.fromkeys(name for unit in parents for name in unit))
    drawn = [dict(zip(names, row, strict=True)) for row in times]
    wanted = [[np.prod([row[name] for name in set(unit)]) for unit in parents] for row in drawn]
    assert np.array_equal(np.concatenate(list(resample_weights(clusters, rng(), 20))), wanted)


def test_units_of_one_base_scene_each_weigh_as_many_as_there_are() -> None:
    weights = np.concatenate(list(resample_weights(alone(7), rng(), 1200)))
    assert weights.shape == (1200, 7)
    assert np.array_equal(weights.sum(axis=1), np.full(1200, 7.0))


@given(hnp.arrays(np.int64, (6, 3), elements=st.integers(0, 9)), st.integers(2, 5))
def test_counts_a_whole_number_of_times_as_large_change_nothing(
    counts: np.ndarray, times: int
) -> None:
    for metric in (precision_of, recall_of, f1_of):
        once, often = (
            bootstrap(counts * k, alone(6), metric, rng(), resamples=200) for k in (1, times)
        )
        for name in ("value", "se", "lo", "hi", "p"):
            a, b = getattr(once, name), getattr(often, name)
            assert np.allclose(a, b, equal_nan=True)


@given(hnp.arrays(np.int64, (8, 3), elements=st.integers(0, 9)))
def test_an_interval_holds_its_median_draw_and_stays_in_the_range_of_f1(counts: np.ndarray) -> None:
    found = bootstrap(counts, alone(8), f1_of, rng(), resamples=400)
    if np.isnan(found.value):
        assert all(np.isnan([found.se, found.lo, found.hi, found.p]))
    else:
        assert 0 <= found.lo <= found.hi <= 1


@given(hnp.arrays(np.int64, (8, 3), elements=st.integers(0, 9)))
def test_nothing_differs_from_itself(counts: np.ndarray) -> None:
    counts[0] = (1, 0, 0)
    pair = np.stack([counts, counts], axis=1)
    found = bootstrap(
        pair, alone(8), lambda sums: np.diff(f1_of(sums))[..., 0], rng(), resamples=200
    )
    assert (found.value, found.se, found.lo, found.hi, found.p) == (0, 0, 0, 0, 1)


def test_a_difference_and_its_opposite_mirror_each_other() -> None:
    counts, clusters, _ = World(bases=20, pairs=15).draw(rng(3), models=2)

    def difference(sums: Floats) -> Floats:
        return f1_of(sums)[..., 0] - f1_of(sums)[..., 1]

    one = bootstrap(counts, clusters, difference, rng(), resamples=2000)
    other = bootstrap(counts[:, ::-1], clusters, difference, rng(), resamples=2000)
    assert one.value == -other.value
    assert one.lo == pytest.approx(-other.hi)
    assert one.p == pytest.approx(other.p)


def test_standard_error_and_interval_agree_with_scipy_for_lone_scenes() -> None:
    right = rng(1).binomial(10, 0.3, size=80)
    counts = np.stack([right, 10 - right, 10 - right], axis=1)
    ours = bootstrap(counts, alone(80), f1_of, rng(2), resamples=20_000)
    theirs = stats.bootstrap(
        (right,), lambda x, axis: x.mean(axis=axis) / 10, method="percentile", n_resamples=20_000
    )
    assert ours.value == pytest.approx(right.mean() / 10)
    assert ours.se == pytest.approx(theirs.standard_error, rel=0.03)
    assert ours.lo == pytest.approx(theirs.confidence_interval.low, abs=0.003)
    assert ours.hi == pytest.approx(theirs.confidence_interval.high, abs=0.003)


@pytest.mark.parametrize("n", [3, 5, 12])
def test_few_clusters_give_intervals_as_wide_as_students(n: int) -> None:
    x = rng(n).normal(100, 1, n)
    found = bootstrap(np.stack([x, np.ones(n)], 1), alone(n), ratio_of, rng(), resamples=20_000)
    se = x.std(ddof=1) / np.sqrt(n)
    # Draws reach no further than the least and the greatest value.
    lo = max(x.mean() + stats.t.ppf(0.025, n - 1) * se, x.min())
    assert found.lo == pytest.approx(lo, abs=0.35 * se)


def test_no_interval_comes_from_a_single_base_scene() -> None:
    found = bootstrap([[1, 1, 0]] * 4, Clusters.of([["a"]] * 4), f1_of, rng(), resamples=10_000)
    assert found.value == pytest.approx(2 / 3)
    assert all(np.isnan([found.se, found.lo, found.hi, found.p]))
    assert found.n_clusters == 1


def test_nothing_measured_is_no_value() -> None:
    found = bootstrap(np.zeros((0, 2, 3)), Clusters.of([]), f1_of, rng())
    assert found.value.shape == (2,)
    assert np.isnan([found.value, found.se, found.lo, found.hi, found.p]).all()


def test_a_unit_without_a_base_scene_is_refused() -> None:
    with pytest.raises(ValueError, match="needs a base scene"):
        Clusters.of([["a"], []])


def test_macro_means_are_recomputed_in_every_resample() -> None:
    counts = np.zeros((40, 2, 2))
    counts[:30, 0] = [[n % 3 == 0, 1] for n in range(30)]
    counts[30:, 1] = [[1, 1]] * 10
    found = bootstrap(
        counts, alone(40), lambda sums: ratio_of(sums).mean(axis=-1), rng(), resamples=10_000
    )
    assert found.value == pytest.approx((1 / 3 + 1) / 2)
    assert found.se == pytest.approx(np.sqrt(1 / 3 * 2 / 3 / 30) / 2, rel=0.06)


def test_holm_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, np.nan, 0.7]) == pytest.approx([1, np.nan, 1], nan_ok=True)


@given(P_VALUES)
def test_holm_only_raises_and_keeps_the_order_and_the_least_is_bonferronis(p: np.ndarray) -> None:
    corrected = holm(p)
    assert (corrected >= p).all()
    assert (np.diff(corrected[np.argsort(p, kind="stable")]) >= 0).all()
    assert corrected.min() == pytest.approx(min(1, len(p) * p.min()))


@pytest.fixture(scope="module")
def official(official_dir: Path) -> tuple[dict[str, Floats], Clusters, Clusters]:
    """Counts of setting A by model, clusters by base scene, and every scene a cluster."""
    scenes = [task.scene for task in read_official(official_dir / "PhyBlock").tasks]
    place = {scene.id: n for n, scene in enumerate(scenes)}
    counts: dict[str, Floats] = defaultdict(lambda: np.zeros((len(scenes), 3)))
    with (official_dir / "expected" / "assembly_counts.csv").open(newline="") as file:
        for row in csv.DictReader(file):
            if (row["setting"], row["criterion"]) == ("A", "aov"):
                numbers = [int(row[name]) for name in ("tp", "fp", "fn")]
                counts[row["model"]][place[row["scene"]]] = numbers
    return counts, Clusters.of([s.parents for s in scenes]), alone(len(scenes))


def test_recorded_scenes_of_common_origin_double_the_naive_standard_error(
    official: tuple[dict[str, Floats], Clusters, Clusters],
) -> None:
    counts, clusters, naive = official
    gpt_4o = counts["gpt-4o"]
    assert clusters.size == 150
    assert 100 * bootstrap(gpt_4o, naive, f1_of, rng(), resamples=10_000).se == pytest.approx(
        1.3, abs=0.1
    )
    assert 100 * bootstrap(gpt_4o, clusters, f1_of, rng(), resamples=10_000).se == pytest.approx(
        2.7, abs=0.1
    )


def test_recorded_models_are_compared_in_pairs(
    official: tuple[dict[str, Floats], Clusters, Clusters],
) -> None:
    counts, clusters, _ = official
    pair = np.stack([counts["gpt-4o"], counts["gemini-2.0-flash"]], axis=1)
    found = bootstrap(
        pair, clusters, lambda s: f1_of(s)[..., 0] - f1_of(s)[..., 1], rng(), resamples=10_000
    )
    assert 100 * found.value == pytest.approx(-0.5, abs=0.1)
    assert 100 * found.se == pytest.approx(2.2, abs=0.1)
    assert found.p > 0.5


def covered(world: World, worlds: int) -> float:
    """The share of worlds whose interval holds the true F1."""
    draw = rng(20261121)
    truth = world.true_f1(draw)
    hits = 0
    for _ in range(worlds):
        counts, clusters, _ = world.draw(draw)
        found = bootstrap(counts[:, 0], clusters, f1_of, draw, resamples=500)
        hits += bool(found.lo <= truth <= found.hi)
    return hits / worlds


@pytest.mark.slow
@pytest.mark.parametrize(
    "world",
    [
        World(bases=150, pairs=0),
        World(bases=40, pairs=0),
        World(bases=12, pairs=0),
        World(bases=150, pairs=250),
        World(bases=40, pairs=60),
    ],
    ids=str,
)
def test_intervals_hold_the_truth_as_often_as_they_say(world: World) -> None:
    assert 0.90 <= covered(world, 600) <= 0.98
