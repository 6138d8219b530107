"""Laws of what scenes are worth, and of what subsets of them keep."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import stats

from phyblock.scoring.counts import Floats
from phyblock.scoring.statistics import (
    discrimination,
    explained,
    least_correlation,
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
