"""Sensitivity of each model to the presentation, in runs that vary it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from phyblock.config.suite import REPEAT, Variant, VarySpec
from phyblock.results.compare import Comparable, Part, comparable
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


@dataclass(frozen=True, eq=False)
class Blocks:
    """The variants in which one factor has all its levels while all else stays.

    `places` has shape (levels, blocks, repeats) and holds numbers of variants.
    """

    factor: str
    levels: tuple[str, ...]
    places: np.ndarray


@dataclass(frozen=True, eq=False)
class ItemsAsked:
    """The items that a model has in every way of asking with every seed, in order.

    `counts` has shape (items, seeds, variants, counts); `clusters` are the items' base scenes.
    """

    counts: Floats
    clusters: Clusters


@dataclass(frozen=True, eq=False)
class Varied:
    """The samples of a track, measured by its main measure as a whole.

    `asked` has the items of each model that has any; models need not have the same.
    """

    track: str
    what: Comparable
    part: Part
    vary: VarySpec
    asked: dict[str, ItemsAsked]

    def scores(self, model: str, blocks: Blocks) -> Floats:
        """Scores of single samples: (items, levels, blocks with each seed, repeats)."""
        each = np.nan_to_num(self.what.each(self.part)(self.asked[model].counts))
        found = np.moveaxis(each[:, :, blocks.places], 1, 3)
        return found.reshape(*found.shape[:2], -1, found.shape[-1])

    def blocks(self, factor: str) -> Blocks:
        """Return the places of all levels of a factor."""
        return blocks_of(self.vary, factor)


def blocks_of(vary: VarySpec, factor: str) -> Blocks:
    """Return the places of all levels of a factor."""
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
    return Blocks(factor, levels, np.array(numbers, dtype=np.intp))


def varied(run: Run, track: str) -> Varied | None:
    """The samples of a track of a run; None where it varies nothing or no item was asked whole."""
    vary = run.design.suite.vary
    if not vary.factors:
        return None
    what = comparable(run, track)
    part = what.parts[-1]
    samples = what.samples(run, part, run.design)
    ways = [(seed, one.key) for seed in run.design.suite.seeds for one in vary.variants]
    shape = (len(run.design.suite.seeds), vary.n_variants, -1)
    parents = parents_of(run)
    asked = {}
    for model in run.design.model_names:
        names = _whole_items(samples[model], len(ways)) if model in samples else ()
        if names:
            wanted = pd.MultiIndex.from_tuples([(*name, *way) for name in names for way in ways])
            counts = what.counts_of(samples[model].loc[wanted], part)
            counts = counts.reshape(len(names), *shape)
            clusters = Clusters.of(base_scenes(parents, [scene for scene, _ in names]))
            asked[model] = ItemsAsked(counts, clusters)
    return Varied(track, what, part, vary, asked) if asked else None


def _whole_items(samples: pd.DataFrame, ways: int) -> tuple[tuple[str, str], ...]:
    """Scene and name of the items of a model that were asked in so many ways: in all of them."""
    sizes = samples.groupby(level=["scene", "item"]).size()
    return tuple(sorted((str(scene), str(item)) for scene, item in sizes.index[sizes == ways]))


ITEMS = "items"
"""The row of what differs from item to item, to hold factors against."""
_COMPONENTS = (
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
    rows = []
    of_tracks = [varied(run, track) for track in run.design.suite.tracks]
    for found in filter(None, of_tracks):
        for model, items in found.asked.items():
            size = {"n_items": len(items.counts), "n_clusters": items.clusters.size}
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


_NAMES = {REPEAT: "asked again", ITEMS: "between items"}
_MODEL = Column("Model", is_text=True)
FACTOR = Column("Factor", is_text=True)


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
        (_MODEL, *track_column(run.design.suite.tracks), FACTOR, *pairs),
        tuple(rows),
        tuple(notes),
    )


def sizes_text(table: pd.DataFrame) -> str:
    """Return how many items, of how many base scenes, are behind rows of `sensitivity_frame`: from
    the model that has fewest to the one that has most.
    """
    items, scenes = (_from_to(table[name]) for name in ("n_items", "n_clusters"))
    return f"{items} items of {scenes} base scenes"


def _from_to(sizes: pd.Series[int]) -> str:
    least, most = int(sizes.min()), int(sizes.max())
    return f"{most}" if least == most else f"{least} to {most}"
