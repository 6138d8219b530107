"""The samples of a run that varies how it asks, by model, in the order of items and variants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from phyblock.report.comparable import Comparable, Part, comparable
from phyblock.scoring.ratios import Floats, Metric
from phyblock.scoring.uncertainty import Clusters
from phyblock.specs.vary import VarySpec
from phyblock.tables.intervals import parents_of
from phyblock.tables.load import Run
from phyblock.variants import REPEAT, Variant

__all__ = ["Blocks", "Varied", "varied"]


@dataclass(frozen=True, eq=False)
class Blocks:
    """The variants in which one factor has all its levels while all else stays.

    `places` has shape (levels, blocks, repeats) and holds numbers of variants.
    """

    factor: str
    levels: tuple[str, ...]
    places: np.ndarray


@dataclass(frozen=True, eq=False)
class Varied:
    """The samples of a track, measured by its first measure as a whole.

    `counts` by model has shape (items, seeds, variants, counts): of items that every model has in
    every way of asking with every seed; models that have none are left out. `clusters` are the base
    scenes of the items.
    """

    track: str
    what: Comparable
    part: Part
    vary: VarySpec
    counts: dict[str, Floats]
    clusters: Clusters

    def scores(self, model: str, blocks: Blocks) -> Floats:
        """Scores of single samples: (items, levels, blocks with each seed, repeats)."""
        each = np.nan_to_num(self.what.each(self.part)(self.counts[model]))
        found = np.moveaxis(each[:, :, blocks.places], 1, 3)
        return found.reshape(*found.shape[:2], -1, found.shape[-1])

    def sums(self, model: str, blocks: Blocks) -> Floats:
        """Counts by item and level of a factor, (items, levels, counts)."""
        chosen = self.counts[model][:, :, blocks.places]
        return np.asarray(chosen.sum(axis=(1, 3, 4)))

    def whole(self) -> Metric:
        """What sums of counts are worth, as tables show it."""
        return self.what.whole(self.part, next(iter(self.counts.values())).sum(axis=(0, 1, 2)))

    def blocks(self, factor: str) -> Blocks:
        """Where a factor has all its levels."""
        vary = self.vary
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
    """The samples of a track of a run; None where it varies nothing or was not asked whole."""
    vary = run.design.suite.vary
    if not vary.factors:
        return None
    what = comparable(run, track)
    part = what.parts[-1]
    samples = what.samples(run, part, run.design)
    ways = [(seed, one.key) for seed in run.design.suite.seeds for one in vary.variants]
    whole = {name: _whole_items(frame, len(ways)) for name, frame in samples.items()}
    names = [name for name in run.design.model_names if whole.get(name)]
    items = sorted(frozenset.intersection(*(whole[name] for name in names))) if names else []
    if not items:
        return None
    shape = (len(items), len(run.design.suite.seeds), vary.n_variants, -1)
    wanted = pd.MultiIndex.from_tuples([(*item, *way) for item in items for way in ways])
    counts = {
        name: what.counts_of(samples[name].loc[wanted], part).reshape(shape) for name in names
    }
    parents = parents_of(run)
    clusters = Clusters.of([tuple(parents[scene]) or (scene,) for scene, _ in items])
    return Varied(track, what, part, vary, counts, clusters)


def _whole_items(samples: pd.DataFrame, ways: int) -> frozenset[tuple[str, str]]:
    """Scene and name of the items of a model that were asked in so many ways: in all of them."""
    sizes = samples.groupby(level=["scene", "item"]).size()
    return frozenset((str(scene), str(item)) for scene, item in sizes.index[sizes == ways])
