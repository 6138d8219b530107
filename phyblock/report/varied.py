"""The samples of a run that varies how it asks, by model, in the order of items and variants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from phyblock.config.suite import REPEAT, Variant, VarySpec
from phyblock.report.comparable import Comparable, Part, comparable
from phyblock.scoring.counts import Floats, Metric
from phyblock.scoring.statistics import Clusters
from phyblock.tables.intervals import parents_of
from phyblock.tables.load import Run

__all__ = ["Blocks", "ItemsAsked", "Varied", "blocks_of", "varied"]

_ENOUGH = 0.5
"""Share of the items of the model that has most, from which on a model is ranked."""


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

    names: tuple[tuple[str, str], ...]
    counts: Floats
    clusters: Clusters

    def only(self, names: Sequence[tuple[str, str]], parents: pd.Series[Any]) -> ItemsAsked:
        """Those of these names."""
        if tuple(names) == self.names:
            return self
        places = [self.names.index(name) for name in names]
        return ItemsAsked(tuple(names), self.counts[places], _clusters(names, parents))


@dataclass(frozen=True, eq=False)
class Varied:
    """The samples of a track, measured by its main measure as a whole.

    `asked` has the items of each model that has any; models need not have the same. `parents` are
    the base scenes of every scene.
    """

    track: str
    what: Comparable
    part: Part
    vary: VarySpec
    asked: dict[str, ItemsAsked]
    parents: pd.Series[Any]

    def ranked(self) -> Varied:
        """The models that have at least half of the items of the one that has most, on the items
        that all of these have; there may be none.
        """
        most = max(len(items.names) for items in self.asked.values())
        kept = {
            model: items
            for model, items in self.asked.items()
            if len(items.names) >= _ENOUGH * most
        }
        common = sorted(frozenset.intersection(*(frozenset(i.names) for i in kept.values())))
        asked = {m: items.only(common, self.parents) for m, items in kept.items()} if common else {}
        return replace(self, asked=asked)

    def scores(self, model: str, blocks: Blocks) -> Floats:
        """Scores of single samples: (items, levels, blocks with each seed, repeats)."""
        each = np.nan_to_num(self.what.each(self.part)(self.asked[model].counts))
        found = np.moveaxis(each[:, :, blocks.places], 1, 3)
        return found.reshape(*found.shape[:2], -1, found.shape[-1])

    def sums(self, model: str, blocks: Blocks) -> Floats:
        """Counts by item and level of a factor, (items, levels, counts)."""
        chosen = self.asked[model].counts[:, :, blocks.places]
        return np.asarray(chosen.sum(axis=(1, 3, 4)))

    def whole(self, model: str) -> Metric:
        """What sums of a model's counts are worth, as tables show it."""
        return self.what.whole(self.part, self.asked[model].counts.sum(axis=(0, 1, 2)))

    def blocks(self, factor: str) -> Blocks:
        """Where a factor has all its levels."""
        return blocks_of(self.vary, factor)


def blocks_of(vary: VarySpec, factor: str) -> Blocks:
    """Where a factor has all its levels."""
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
            asked[model] = ItemsAsked(names, counts, _clusters(names, parents))
    return Varied(track, what, part, vary, asked, parents) if asked else None


def _clusters(names: Sequence[tuple[str, str]], parents: pd.Series[Any]) -> Clusters:
    return Clusters.of([tuple(parents[scene]) or (scene,) for scene, _ in names])


def _whole_items(samples: pd.DataFrame, ways: int) -> tuple[tuple[str, str], ...]:
    """Scene and name of the items of a model that were asked in so many ways: in all of them."""
    sizes = samples.groupby(level=["scene", "item"]).size()
    return tuple(sorted((str(scene), str(item)) for scene, item in sizes.index[sizes == ways]))
