"""How much the way of asking moves each model, and whether the ranking of models survives it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from phyblock.config.suite import REPEAT
from phyblock.report.varied import Blocks, Varied, varied
from phyblock.scoring.counts import Floats, Metric
from phyblock.scoring.statistics import (
    CONFIDENCE,
    NO_COMPONENT,
    Component,
    bounded,
    detectable,
    holm,
    interaction,
    jackknife,
    shift,
    spread_of_items,
    within,
)
from phyblock.tables.load import Run, made_once

__all__ = [
    "ITEMS",
    "components_frame",
    "levels_frame",
    "pairs_frame",
    "ranks_frame",
]

ITEMS = "items"
"""The row of what differs from item to item, to hold factors against."""
_LEVEL = 1 - CONFIDENCE
_KEYS = ["track", "factor", "level"]
_ONE_LEVEL = ["model", "factor", "level"]
_TEST = ("lo", "hi", "se", "p", "detectable")
_COMPONENTS = (
    *("track", "model", "factor", "levels"),
    *(f"{name}{end}" for name in ("shift", "single") for end in ("", "_lo", "_hi")),
    *("n_items", "n_clusters"),
)
_LEVELS = (
    *("track", "model", "factor", "level", "value", "rank", "difference"),
    *(*_TEST, "p_holm", "n_items"),
)
_PAIRS = (
    *(*_KEYS, "a", "b", "reference", "here", "change"),
    *(*_TEST, "p_holm", "flips", "is_sure"),
)
_RANKS = (*_KEYS, "models", "tau", "pairs", "flips", "sure", "detectable", "n_items")


@made_once
def components_frame(run: Run) -> pd.DataFrame:
    """One row a track, model and factor: how far it moves scores, in the measure's unit.

    `shift` is the standard deviation of the means of the `levels` of a factor, `single` that of the
    scores of single items over levels beyond the shift; of repeats, that of one question asked
    again; in the row `items`, that between items. `*_lo` and `*_hi` bound 95 % intervals over the
    `n_clusters` base scenes of the `n_items` items that the model has in every way of asking.
    See `phyblock.scoring.statistics`. Empty where the run varies nothing.
    """
    rows = []
    for found in _of_tracks(run):
        for model, items in found.asked.items():
            size = {"n_items": len(items.names), "n_clusters": items.clusters.size}
            for factor in (*found.vary.factors, ITEMS):
                levels, *parts = _components(found, model, factor)
                row: dict[str, Any] = {"track": found.track, "model": model, "factor": factor}
                row["levels"] = levels
                for name, part in zip(("shift", "single"), parts, strict=True):
                    scale = found.what.measure.scale
                    row |= {name: scale * part.sd}
                    high = np.minimum(scale * part.hi, found.what.measure.most_apart)
                    row |= {f"{name}_lo": scale * part.lo, f"{name}_hi": high}
                rows.append(row | size)
    return pd.DataFrame(rows, columns=list(_COMPONENTS))


def _of_tracks(run: Run) -> list[Varied]:
    found = [varied(run, track) for track in run.design.suite.tracks]
    return [one for one in found if one is not None]


def _components(found: Varied, model: str, factor: str) -> tuple[int, Component, Component]:
    """Levels of a factor, its shift, and what it does to single items."""
    clusters = found.asked[model].clusters
    if factor == ITEMS:
        scores = np.nan_to_num(found.what.each(found.part)(found.asked[model].counts))
        return len(scores), NO_COMPONENT, spread_of_items(scores, clusters)
    blocks = found.blocks(factor)
    scores = found.scores(model, blocks)
    if factor == REPEAT:
        ways = np.moveaxis(scores[..., 0], 1, 2)
        return len(blocks.levels), NO_COMPONENT, within(ways, clusters)
    # Repeats tell noise apart where nothing else was varied.
    cells = scores.mean(axis=3) if scores.shape[2] > 1 else scores[:, :, 0]
    return len(blocks.levels), shift(cells, clusters), interaction(cells, clusters)


@made_once
def levels_frame(run: Run) -> pd.DataFrame:
    """One row a track, model, factor and level: the pooled measure, and how it differs.

    `value` is of all samples with this level of the `n_items` items that the model has in every way
    of asking, `difference` what it lies above that of the factor's first level, on the same items,
    with its 95 % interval (`lo`, `hi`), standard error, p value and `p_holm`, corrected for all
    rows of the track; `detectable` is the difference that a single test finds in four of five
    cases. In the measure's unit. `rank` is 1 for the best model, on the items that all ranked
    models have (`Varied.ranked`); NaN for a model that has too few.
    """
    parts = []
    for found in _of_tracks(run):
        rows = [
            row
            for factor in found.vary.factors
            if factor != REPEAT
            for row in _level_rows(found, found.blocks(factor))
        ]
        table = pd.DataFrame(rows)
        if len(table):
            ranks = _ranks(found, list(table["factor"].unique()))
            rank = [ranks.get(key, np.nan) for key in table[_ONE_LEVEL].itertuples(index=False)]
            parts.append(table.assign(p_holm=holm(table["p"]), rank=rank))
    return _joined(parts, _LEVELS)


def _joined(parts: Sequence[pd.DataFrame], columns: Sequence[str]) -> pd.DataFrame:
    whole = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=list(columns))
    return whole[list(columns)]


def _ranks(found: Varied, factors: Sequence[str]) -> dict[tuple[str, ...], float]:
    """Ranks by model, factor and level, 1 for the best, of the models that are ranked."""
    ranked = found.ranked()
    ranks: dict[tuple[str, ...], float] = {}
    sign = -1 if found.what.measure.better == "higher" else 1
    for factor in factors if ranked.asked else ():
        blocks = found.blocks(factor)
        places = pd.DataFrame(_values(ranked, blocks), index=blocks.levels).mul(sign)
        for level, row in places.rank(axis=1, method="min").iterrows():
            ranks |= {(str(model), factor, str(level)): rank for model, rank in row.items()}
    return ranks


def _values(found: Varied, blocks: Blocks) -> dict[str, Floats]:
    """What each model reaches with each level of a factor."""
    return {
        model: found.whole(model)(found.sums(model, blocks).sum(axis=0)) for model in found.asked
    }


def _level_rows(found: Varied, blocks: Blocks) -> list[dict[str, Any]]:
    measure, rows = found.what.measure, []
    scale, most = measure.scale, measure.most_apart
    for model, items in found.asked.items():
        metric = found.whole(model)

        def values(total: Floats, metric: Metric = metric) -> Floats:
            value = metric(total)
            return np.stack([value, value - value[..., :1]], axis=-1)

        # (items, levels, counts) gives (levels, 2).
        estimate = bounded(
            jackknife(found.sums(model, blocks), items.clusters, values), most / scale
        )
        for n, level in enumerate(blocks.levels):
            row: dict[str, Any] = {"track": found.track, "model": model}
            row |= {"factor": blocks.factor, "level": level}
            row["value"] = scale * estimate.value[n, 0]
            is_reference = n == 0
            for name in ("value", "lo", "hi", "se"):
                number = np.nan if is_reference else scale * getattr(estimate, name)[n, 1]
                row["difference" if name == "value" else name] = number
            row["p"] = np.nan if is_reference else estimate.p[n, 1]
            row["detectable"] = float(detectable(row["se"], items.clusters.size, _LEVEL, most))
            row["n_items"] = len(items.names)
            rows.append(row)
    return rows


@made_once
def pairs_frame(run: Run) -> pd.DataFrame:
    """One row a track, factor, level but the first, and pair of models: does their order hold?

    `reference` and `here` are the differences a minus b with the first level and with this one,
    `change` the second less the first, with its 95 % interval, standard error, p value and
    `p_holm`, corrected for all rows of the track, and `detectable`. `flips` says that the other
    model is the better one here, `is_sure` that moreover the change is found.
    """
    parts = []
    for found in _of_tracks(run):
        ranked = found.ranked()
        factors = [name for name in found.vary.factors if name != REPEAT]
        rows = [row for factor in factors for row in _pair_rows(ranked, found.blocks(factor))]
        table = pd.DataFrame(rows)
        if len(table):
            table["p_holm"] = holm(table["p"])
            table["flips"] = table["reference"] * table["here"] < 0
            table["is_sure"] = table["flips"] & (table["p_holm"] < _LEVEL)
            parts.append(table)
    return _joined(parts, _PAIRS)


def _pair_rows(found: Varied, blocks: Blocks) -> list[dict[str, Any]]:
    models = list(found.asked)
    if len(models) < 2:
        return []
    metric, clusters = found.whole(models[0]), found.asked[models[0]].clusters
    measure, rows = found.what.measure, []
    scale, most = measure.scale, 2 * measure.most_apart
    sums = np.stack([found.sums(model, blocks) for model in models], axis=1)
    for a, b in combinations(range(len(models)), 2):
        # (items, 2, levels, counts) gives (levels - 1).
        estimate = jackknife(sums[:, [a, b]], clusters, lambda total: _changes(metric(total)))
        estimate = bounded(estimate, most / scale)
        value = metric(sums[:, [a, b]].sum(axis=0))
        apart = value[0] - value[1]
        for n, level in enumerate(blocks.levels[1:]):
            row: dict[str, Any] = {"track": found.track, "factor": blocks.factor, "level": level}
            row |= {"a": models[a], "b": models[b]}
            row |= {"reference": scale * apart[0], "here": scale * apart[n + 1]}
            for name in ("value", "lo", "hi", "se"):
                row["change" if name == "value" else name] = scale * getattr(estimate, name)[n]
            row["p"] = estimate.p[n]
            row["detectable"] = float(detectable(row["se"], clusters.size, _LEVEL, most))
            rows.append(row)
    return rows


def _changes(values: Floats) -> Floats:
    """From values (..., 2, levels) to changes of their difference (..., levels - 1)."""
    apart = values[..., 0, :] - values[..., 1, :]
    return np.asarray(apart[..., 1:] - apart[..., :1])


def ranks_frame(run: Run) -> pd.DataFrame:
    """One row a track, factor and level but the first: does the ranking of models survive?

    `tau` is Kendall's rank correlation (tau-b) of the models' values with those of the first level;
    of `pairs` of models, `flips` change places and `sure` do so beyond noise. `detectable` is the
    change of a difference that the test of a pair finds in four of five cases, the median of pairs.
    All is of the `n_items` items that the ranked models have in common.
    """
    pairs = pairs_frame(run)
    rows = []
    for found in _of_tracks(run):
        ranked = found.ranked()
        mine = pairs[pairs["track"] == found.track]
        for factor, of_factor in mine.groupby("factor", sort=False):
            blocks = found.blocks(str(factor))
            values = np.array(list(_values(ranked, blocks).values()))
            for place, level in enumerate(blocks.levels[1:], 1):
                part = of_factor[of_factor["level"] == level]
                row: dict[str, Any] = {"track": found.track, "factor": factor, "level": level}
                row |= {"models": len(values), "tau": _tau(values[:, 0], values[:, place])}
                row |= {"pairs": len(part), "flips": int(part["flips"].sum())}
                row |= {"sure": int(part["is_sure"].sum())}
                row["detectable"] = float(part["detectable"].dropna().median())
                row["n_items"] = len(next(iter(ranked.asked.values())).names)
                rows.append(row)
    return pd.DataFrame(rows, columns=list(_RANKS))


def _tau(a: Floats, b: Floats) -> float:
    """Kendall's tau-b (Biometrika 33, 1945); NaN where all of one are alike."""
    upper = np.triu_indices(len(a), 1)
    signs = [np.sign(np.subtract.outer(x, x))[upper] for x in (a, b)]
    scale = np.sqrt((signs[0] ** 2).sum() * (signs[1] ** 2).sum())
    return float((signs[0] * signs[1]).sum() / scale) if scale else float("nan")
