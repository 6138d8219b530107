"""Laws of what scenes are worth, and of what subsets of them keep."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from phyblock.scoring.counts import Floats, ratio_of
from phyblock.scoring.statistics import (
    discrimination,
    explained,
    least_correlation,
    pairs_kept,
    pairs_kept_by_choice,
)

SCORES = arrays(
    np.float64, st.tuples(st.integers(3, 7), st.integers(2, 6)), elements=st.integers(0, 4)
)


@given(SCORES, st.data())
def test_discrimination_is_the_correlation_with_the_mean_of_all_other_scenes(
    scores: Floats, data: st.DataObject
) -> None:
    known = data.draw(arrays(np.bool_, scores.shape, elements=st.booleans()))
    scores = np.where(known, scores, np.nan)
    found = discrimination(scores)
    for item in range(scores.shape[1]):
        pairs = []
        for row in scores:
            others = np.delete(row, item)
            others = others[~np.isnan(others)]
            if not math.isnan(row[item]) and len(others):
                pairs.append((row[item], others.mean()))
        if len(pairs) < 2 or any(len({round(v, 9) for v in column}) < 2 for column in zip(*pairs)):  # noqa: B905
            assert math.isnan(found[item])
        else:
            assert found[item] == pytest.approx(np.corrcoef(np.array(pairs).T)[0, 1], abs=1e-6)


@given(st.lists(st.tuples(st.integers(0, 9), st.integers(0, 3)), min_size=2, max_size=30))
def test_groups_explain_what_an_analysis_of_variance_says(rows: list[tuple[int, int]]) -> None:
    values, groups = [float(value) for value, _ in rows], [group for _, group in rows]
    share = explained(values, groups)
    if len(set(values)) == 1:
        assert math.isnan(share)
        return
    assert explained(values, values) == pytest.approx(1)
    assert explained(values, ["one"] * len(values)) == pytest.approx(0)
    apart = [[v for v, g in rows if g == group] for group in set(groups)]
    within = sum(len(part) * np.var(part) for part in apart)
    assert share == pytest.approx(1 - within / (len(values) * np.var(values)), abs=1e-9)


@pytest.mark.parametrize("models", [4, 8, 26])
def test_a_correlation_at_the_bound_has_a_p_of_5_percent(models: int) -> None:
    r = least_correlation(models)
    t = r * math.sqrt((models - 2) / (1 - r * r))
    assert 2 * stats.t.sf(t, models - 2) == pytest.approx(0.05)


@given(arrays(np.float64, (5, 7, 2), elements=st.integers(0, 9)), st.data())
def test_kept_pairs_are_kendalls_tau_a(counts: Floats, data: st.DataObject) -> None:
    counts[..., 1] += counts[..., 0] + 1
    chosen = data.draw(st.lists(st.integers(0, 6), min_size=1, max_size=6, unique=True))
    for rest in (False, True):
        others = [i for i in range(7) if i not in chosen] if rest else list(range(7))
        subset, whole = (ratio_of(counts[:, of].sum(axis=1)) for of in (chosen, others))
        signs = [
            np.sign((subset[a] - subset[b]) * (whole[a] - whole[b]))
            for a in range(5)
            for b in range(a + 1, 5)
        ]
        assert pairs_kept(counts, ratio_of, chosen, rest).tolist() == signs


def test_no_pair_of_models_has_a_say_in_the_scenes_that_it_is_judged_on() -> None:
    counts = np.random.default_rng(0).integers(1, 9, (5, 6, 2)).astype(float)
    counts[..., 1] += counts[..., 0]
    asked: list[set[float]] = []

    def choose(some: Floats) -> list[int]:
        asked.append({float(model.sum()) for model in some})
        return list(range(len(asked) % 5 + 1))

    kept = pairs_kept_by_choice(counts, ratio_of, choose)
    totals = [float(model.sum()) for model in counts]
    pairs = [(a, b) for a in range(5) for b in range(a + 1, 5)]
    assert len(set(totals)) == 5
    assert asked == [{t for i, t in enumerate(totals) if i not in pair} for pair in pairs]
    for place, (pair, one) in enumerate(zip(pairs, kept, strict=True)):
        chosen = list(range((place + 1) % 5 + 1))
        assert pairs_kept(counts[list(pair)], ratio_of, chosen).tolist() == [one]
