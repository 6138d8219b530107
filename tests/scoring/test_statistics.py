"""Uncertainty: intervals, tests, ranks and variance components, and how often they are right."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import stats

from phyblock.scoring import statistics
from phyblock.scoring.plan import ratio_of
from tests.scoring.cases import World, f1_of

NAMES = st.lists(st.sampled_from("abcdefg"), min_size=1, max_size=3)
P_VALUES = hnp.arrays(float, st.integers(1, 8), elements=st.floats(0, 1))


def rng(seed=0):
    return np.random.default_rng(seed)


def alone(n):
    return statistics.Clusters.of([[str(i)] for i in range(n)])


def ends(found):
    return float(found.lo), float(found.hi)


def jackknife_of_mean(x):
    return statistics.jackknife(np.stack([x, np.ones(len(x))], 1), alone(len(x)), mean_of)


def mean_of(sums):
    return np.asarray(sums[..., 0] / sums[..., 1])


def difference_of(sums):
    return np.asarray(f1_of(sums)[..., 0] - f1_of(sums)[..., 1])


@given(st.lists(NAMES, min_size=2, max_size=12), st.integers(0, 2**32 - 1))
def test_the_variance_sums_over_all_pairs_that_have_a_base_scene_in_common(parents, seed):
    # Of a sum, leaving a group out changes it by the group: the formula can be written out.
    x = rng(seed).normal(size=len(parents))
    clusters = statistics.Clusters.of(parents)
    in_common = [[bool(set(a) & set(b)) for b in parents] for a in parents]
    variance = max(float(x @ np.array(in_common) @ x), float(x @ x))
    found, n = statistics.jackknife(x[:, None], clusters, lambda sums: sums[..., 0]), clusters.size
    wanted = np.nan if n < 2 else np.sqrt(variance * (n - 1) / n)
    assert found.se == pytest.approx(wanted, nan_ok=True)


@given(hnp.arrays(float, st.integers(2, 30), elements=st.floats(-1e3, 1e3, width=32)))
def test_a_mean_of_lone_units_has_students_interval(x):
    found = jackknife_of_mean(x)
    se = x.std(ddof=1) / np.sqrt(len(x))
    assert found.se == pytest.approx(se, abs=1e-9)
    wanted = x.mean() + stats.t.ppf([0.025, 0.975], len(x) - 1) * se
    assert ends(found) == pytest.approx(tuple(wanted), abs=1e-6)


@given(hnp.arrays(np.int64, (6, 3), elements=st.integers(0, 9)), st.integers(2, 5))
def test_counts_a_whole_number_of_times_as_large_change_nothing(counts, times):
    for metric in (ratio_of, f1_of):
        both = [statistics.jackknife(counts * k, alone(6), metric) for k in (1, times)]
        once, often = ([one.value, one.se, one.lo, one.hi, one.p] for one in both)
        assert np.allclose(once, often, equal_nan=True)


@given(hnp.arrays(np.int64, (8, 3), elements=st.integers(0, 9)))
def test_the_interval_of_a_share_holds_it_and_stays_in_its_range(counts):
    found = statistics.in_range(statistics.jackknife(counts, alone(8), f1_of))
    if np.isnan(found.se):
        assert np.isnan([found.lo, found.hi, found.p]).all()
    else:
        assert 0 <= found.lo <= found.value <= found.hi <= 1


@given(st.integers(2, 300), st.booleans())
def test_none_of_n_and_all_of_n_have_wilsons_interval(n, is_right):
    found = statistics.in_range(statistics.jackknife([[int(is_right), 1]] * n, alone(n), ratio_of))
    assert found.hi > found.lo
    quantile = stats.t.ppf(0.975, n - 1) ** 2
    assert found.hi - found.lo == pytest.approx(quantile / (n + quantile))
    assert found.hi == 1 if is_right else found.lo == 0


@given(st.integers(1, 9), st.integers(10, 19), st.integers(2, 40), st.integers(2, 6))
def test_scenes_that_agree_leave_a_share_in_doubt(part, whole, n, k):
    """As much as if each were one sample, also where scenes of several counts have the same."""
    counts = np.array([[part, whole]] * n)
    found, same = (
        statistics.in_range(statistics.jackknife(some, alone(n), ratio_of))
        for some in (counts * np.arange(1, n + 1)[:, None] ** k, counts)
    )
    assert 0 < found.lo < found.value < found.hi < 1
    assert ends(found) == pytest.approx(ends(same))
    p, z = part / whole, stats.t.ppf(0.975, n - 1)
    for end in ends(found):
        assert (p - end) ** 2 == pytest.approx(z**2 * end * (1 - end) / n)


@given(
    hnp.arrays(float, st.integers(2, 12), elements=st.floats(0, 180, width=32)),
    st.sampled_from([180.0, 400.0, np.inf]),
)
def test_an_interval_stays_in_the_range_of_its_measure(x, most):
    student = jackknife_of_mean(x)
    found, without = statistics.in_range(student, most), statistics.in_range(student, np.nan)
    assert (without.lo, without.hi) == (student.lo, student.hi)
    assert 0 <= found.lo <= found.value <= found.hi <= most
    if found.se > 1e-6 * found.value:
        assert found.lo < found.value < found.hi
    if most < np.inf:
        as_share = statistics.in_range(jackknife_of_mean(x / most))
        assert ends(found) == pytest.approx(tuple(most * end for end in ends(as_share)))
    elif found.se > 1e-3 * found.value:
        # A range without end is the limit of one whose end is far away.
        far = statistics.in_range(student, 1e9)
        assert ends(found) == pytest.approx(ends(far), rel=1e-3, abs=1e-6)


@given(hnp.arrays(np.int64, (8, 3), elements=st.integers(0, 9)))
def test_nothing_differs_from_itself(counts):
    counts[0] = counts[1] = (1, 0, 0)
    pair = np.stack([counts, counts], axis=1)
    found = statistics.jackknife(pair, alone(8), difference_of)
    assert (found.value, found.se, found.lo, found.hi, found.p) == (0, 0, 0, 0, 1)


@given(st.integers(2, 12))
def test_a_few_scenes_that_agree_leave_as_much_doubt_as_a_sign_test(n):
    counts = np.array([[[5, 0, 0], [0, 5, 5]]] * n)
    found = statistics.jackknife(counts, alone(n), difference_of)
    assert found.value == 1
    assert found.p == pytest.approx(stats.binomtest(n, n).pvalue)


@given(st.floats(0.001, 10), st.integers(5, 200), st.sampled_from([0.05, 0.01, 0.001]))
def test_what_is_detectable_is_found_in_four_of_five_cases(se, n, level):
    # The estimate, less the effect, over its standard error, is Student's t.
    student, effect = stats.t(n - 1), float(statistics.detectable(se, n, level))
    found = student.sf(student.isf(level / 2) - effect / se)
    assert found == pytest.approx(statistics.POWER, abs=1e-6)


@given(st.integers(1, 7), st.data())
def test_ranks_are_what_the_pairs_allow(n, data):
    strength = data.draw(st.permutations(range(n)))
    sure = data.draw(hnp.arrays(bool, (n, n)))
    is_better = [[sure[a, b] and strength[a] > strength[b] for b in range(n)] for a in range(n)]
    ranks = statistics.rank_ranges(is_better)
    for model in range(n):
        rank = 1 + sum(other > strength[model] for other in strength)
        assert ranks[model, 0] <= rank <= ranks[model, 1]
    if sure.all():
        assert (ranks[:, 0] == ranks[:, 1]).all()


def test_where_nothing_was_measured_or_all_in_one_base_scene_there_is_no_interval():
    alone_in_one = statistics.jackknife([[1, 1, 0]] * 4, statistics.Clusters.of([["a"]] * 4), f1_of)
    assert (alone_in_one.value, alone_in_one.n_clusters) == (pytest.approx(2 / 3), 1)
    nothing = statistics.jackknife(np.zeros((0, 2, 3)), statistics.Clusters.of([]), f1_of)
    assert nothing.value.shape == (2,)
    assert np.isnan(nothing.value).all()
    for found in (alone_in_one, nothing):
        assert np.isnan([found.se, found.lo, found.hi, found.p]).all()
    with pytest.raises(ValueError, match="needs a base scene"):
        statistics.Clusters.of([["a"], []])


def test_holm_by_hand():
    assert statistics.holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert statistics.holm([0.6, np.nan, 0.7]) == pytest.approx([1, np.nan, 1], nan_ok=True)


@given(P_VALUES)
def test_holm_only_raises_and_keeps_the_order_and_the_least_is_bonferronis(p):
    corrected = statistics.holm(p)
    assert (corrected >= p).all()
    assert (np.diff(corrected[np.argsort(p, kind="stable")]) >= 0).all()
    assert corrected.min() == pytest.approx(min(1, len(p) * p.min()))


WORLDS = [
    World(bases=150, pairs=0),
    World(bases=12, pairs=0),
    World(bases=150, pairs=250),
    World(bases=150, pairs=250, base_sd=0, scene_sd=1),
    World(bases=15, pairs=20),
    World(bases=15, pairs=20, ease=-3),
]


@pytest.mark.slow
@pytest.mark.parametrize("world", WORLDS, ids=str)
def test_intervals_hold_the_truth_and_tests_err_as_often_as_they_say(world):
    draw = rng(20261121)
    truth = world.true_f1(draw)
    n, covered, erred = 1000, 0, 0
    for _ in range(n):
        counts, clusters, _ = world.draw(draw, models=2)
        found = statistics.in_range(statistics.jackknife(counts[:, 0], clusters, f1_of))
        covered += bool(found.lo <= truth <= found.hi)
        # Both models are alike in truth.
        erred += bool(statistics.jackknife(counts, clusters, difference_of).p < 0.05)
    assert 0.93 <= covered / n <= 0.97
    assert 0.03 <= erred / n <= 0.07


def drawn(seed):
    return rng(seed).normal(size=(12, 3, 4))


@given(seed=st.integers(0, 10**6))
def test_what_belongs_to_items_and_blocks_is_no_work_of_levels(seed):
    """An effect alike on all items is."""
    scores, draw = drawn(seed), rng(seed + 1)
    other = scores + draw.normal(size=(12, 1, 1)) + draw.normal(size=(1, 1, 4))
    moved = scores + np.array([0.0, 5.0, -1.0])[None, :, None]
    parts = (statistics.shift(one, alone(12)) for one in (scores, other, 100 * scores, moved))
    plain, same, scaled, more = (np.array([part.sd, part.lo, part.hi]) for part in parts)
    np.testing.assert_allclose([same, scaled / 100], [plain, plain], rtol=1e-6, atol=1e-7)
    assert more[0] > plain[0]


def test_a_known_shift_lies_in_its_interval():
    draw, (items, runs), shift = rng(2), (40, 150), 0.04
    hits, square = 0, 0.0
    for _ in range(runs):
        y = draw.normal(0, 0.3, (items, 1, 1))
        y = y + np.array([-1, 1])[None, :, None] * shift / np.sqrt(2)
        y = y + draw.normal(0, 0.08, (items, 2, 1)) + draw.normal(0, 0.1, (items, 2, 16))
        part = statistics.shift(y, alone(items))
        hits += part.lo <= shift <= part.hi
        square += part.sd**2 / runs
    # Three standard errors of a share of 0.95 in so many runs, and of its mean.
    assert hits / runs > 0.89
    assert np.sqrt(square) == pytest.approx(shift, rel=0.15)


def test_nothing_to_tell_has_no_value():
    assert np.isnan(statistics.shift(drawn(1), statistics.Clusters.of([("one",)] * 12)).sd)
    assert statistics.shift(np.ones((12, 3, 4)), alone(12)).hi == 0.0
