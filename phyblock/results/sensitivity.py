"""Sensitivity of each model to the presentation, in runs that vary it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from phyblock.config.suite import REPEAT, Variant, VarySpec
from phyblock.results.compare import Comparable, comparable
from phyblock.results.estimates import base_scenes, parents_of
from phyblock.results.load import Run
from phyblock.results.text import (
    Column,
    TextTable,
    track_column,
    track_text,
    with_interval,
)
from phyblock.scoring.counts import Floats
from phyblock.scoring.statistics import (
    NO_COMPONENT,
    Clusters,
    Component,
    interaction,
    shift,
    spread_of_items,
    within,
)
from phyblock.tracks.base import kind_of

ITEMS = "items"
"""The row of what differs from item to item, to hold factors against."""
_COLUMNS = (
    *("track", "model", "factor", "levels"),
    *(f"{name}{end}" for name in ("shift", "single") for end in ("", "_lo", "_hi")),
    *("n_items", "n_clusters"),
)


def sensitivity_frame(run: Run) -> pd.DataFrame:
    """One row a track, model and factor: how far it moves scores, in the measure's unit.

    `shift` is the standard deviation of the means of the `levels` of a factor, `single` that of the
    scores of single items over levels beyond the shift; of repeats, that of one question asked
    again; in the row `items`, that between items. `*_lo` and `*_hi` bound 95 % intervals over the
    `n_clusters` base scenes of the `n_items` items that the model has in every way of asking.
    See `phyblock.scoring.statistics`. Empty where the run varies nothing.
    """
    rows: list[dict[str, Any]] = []
    vary = run.design.suite.vary
    for track in run.design.suite.tracks if vary.factors else ():
        what = comparable(run, track)
        for model, scores, clusters in _scores(run, what):
            for factor in (*vary.factors, ITEMS):
                levels = len(scores) if factor == ITEMS else len(vary.names(factor))
                row = {"track": track, "model": model, "factor": factor, "levels": levels}
                parts = _components(vary, factor, scores, clusters)
                for name, part in zip(("shift", "single"), parts, strict=True):
                    scale = what.measure.scale
                    row |= {name: scale * part.sd, f"{name}_lo": scale * part.lo}
                    row[f"{name}_hi"] = np.minimum(scale * part.hi, what.measure.most_apart)
                rows.append(row | {"n_items": len(scores), "n_clusters": clusters.size})
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _scores(run: Run, what: Comparable) -> Iterator[tuple[str, Floats, Clusters]]:
    """Yield each model with its scores by the main measure, (items, seeds, variants), and the base
    scenes of these items: those that it has in every way of asking. Models may have different ones.
    """
    suite, part, parents = run.design.suite, what.parts[-1], parents_of(run)
    samples = what.samples(run, part, run.design)
    ways = [(seed, one.key) for seed in suite.seeds for one in suite.vary.variants]
    for model in (name for name in run.design.model_names if name in samples):
        mine = samples[model]
        sizes = mine.groupby(level=["scene", "item"]).size()
        names = sorted((str(scene), str(item)) for scene, item in sizes.index[sizes == len(ways)])
        if names:
            wanted = pd.MultiIndex.from_tuples([(*name, *way) for name in names for way in ways])
            counts = what.counts_of(mine.loc[wanted], part)
            counts = counts.reshape(len(names), len(suite.seeds), suite.vary.n_variants, -1)
            clusters = Clusters.of(base_scenes(parents, [scene for scene, _ in names]))
            yield model, np.nan_to_num(what.each(part)(counts)), clusters


def _components(
    vary: VarySpec, factor: str, scores: Floats, clusters: Clusters
) -> tuple[Component, Component]:
    """The shift of a factor, and what it does to single items."""
    if factor == ITEMS:
        return NO_COMPONENT, spread_of_items(scores, clusters)
    # (items, levels, blocks with each seed, repeats)
    of_levels = np.moveaxis(scores[:, :, _places(vary, factor)], 1, 3)
    of_levels = of_levels.reshape(*of_levels.shape[:2], -1, of_levels.shape[-1])
    if factor == REPEAT:
        return NO_COMPONENT, within(np.moveaxis(of_levels[..., 0], 1, 2), clusters)
    # Repeats tell noise apart where nothing else was varied.
    cells = of_levels.mean(axis=3) if of_levels.shape[2] > 1 else of_levels[:, :, 0]
    return shift(cells, clusters), interaction(cells, clusters)


def _places(vary: VarySpec, factor: str) -> np.ndarray:
    """Numbers of the variants in which a factor has all its levels while all else stays, of shape
    (levels, blocks, repeats).
    """
    levels, repeats = vary.names(factor), vary.names(REPEAT) or ("1",)
    places: dict[Variant, dict[tuple[str, str], int]] = {}
    for place, variant in enumerate(vary.variants):
        here = dict(variant.levels)
        level = here.pop(factor, levels[0])
        again = level if factor == REPEAT else here.pop(REPEAT, "1")
        places.setdefault(Variant(tuple(here.items())), {})[level, again] = place
    # Of repeats each level is one: all others stand beside it as blocks.
    pairs = [[(n, again) for again in ((n,) if factor == REPEAT else repeats)] for n in levels]
    every = {pair for row in pairs for pair in row}
    whole = [found for found in places.values() if every <= set(found)]
    numbers = [[[found[pair] for pair in row] for found in whole] for row in pairs]
    return np.array(numbers, dtype=np.intp)


_NAMES = {REPEAT: "asked again", ITEMS: "between items"}


def factor_name(factor: str) -> str:
    """Return the name of a factor for people."""
    return _NAMES.get(factor, factor.replace("_", " "))


def sensitivity_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Standard deviations with intervals out of `sensitivity_frame`, a row a model and factor."""
    rows = [
        (
            row["model"],
            *track_text(row["track"], run.design.suite.tracks),
            factor_name(row["factor"]),
            *with_interval(row, "shift"),
            *with_interval(row, "single"),
        )
        for row in table.to_dict("records")
    ]
    pairs = [
        Column(n, group) for group in ("Shift of all", "Single items") for n in ("SD", "95 % CI")
    ]
    groups = [group for _, group in table.groupby("track", sort=False)]
    notes = []
    for group in groups:
        track = str(group["track"].iloc[0])
        measure = comparable(run, track).measure
        title = kind_of(track).title
        notes.append(f"{title}: {measure.heading_in_unit}, {sizes_text(group)}.")
    notes += [
        "Shift: standard deviation of the means of a factor's levels. Single items: of one item's "
        "score over levels, beyond the shift and noise; asked again: of one question repeated.",
    ]
    if table.loc[~table["factor"].isin([REPEAT, ITEMS]), "single"].isna().any():
        notes.append("One factor alone without repeats cannot be told from noise in single items.")
    return TextTable(
        f"What the way of asking changes{run.design.of_suite}",
        (
            Column("Model", is_text=True),
            *track_column(run.design.suite.tracks),
            Column("Factor", is_text=True),
            *pairs,
        ),
        tuple(rows),
        tuple(notes),
    )


def sizes_text(table: pd.DataFrame) -> str:
    """Return how many items, of how many base scenes, are behind rows of `sensitivity_frame`: from
    the model that has fewest to the one that has most.
    """
    ends = [(int(table[name].min()), int(table[name].max())) for name in ("n_items", "n_clusters")]
    items, scenes = (f"{a}" if a == b else f"{a} to {b}" for a, b in ends)
    return f"{items} items of {scenes} base scenes"
