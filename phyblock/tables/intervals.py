"""Counts by scene and cell, with the base scenes of each scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.ratios import Floats
from phyblock.scoring.uncertainty import Clusters
from phyblock.tables.load import Run

__all__ = ["CountCube", "parents_of"]


class CountCube:
    """Counts of scenes x cells, summed over seeds, with the base scenes of each scene.

    `counts` has shape (scenes, cells, counts); `present`, (scenes, cells), says where a cell has a
    sample of the scene; `clusters` are the scenes' base scenes. Scenes and cells are sorted.
    """

    def __init__(
        self,
        table: pd.DataFrame,
        parents: pd.Series[Any],
        by: Sequence[str],
        sums: Sequence[str],
    ) -> None:
        summed = table.groupby([*by, "scene"], sort=True)[list(sums)].sum()
        scenes, names = pd.factorize(summed.index.get_level_values("scene"), sort=True)
        cells, self.cells = pd.factorize(summed.index.droplevel("scene"), sort=True)
        self.scenes = list(names)
        self.counts: Floats = np.zeros((len(self.scenes), len(self.cells), len(sums)))
        self.counts[scenes, cells] = summed.to_numpy(np.float64)
        self.present = np.zeros(self.counts.shape[:2], dtype=bool)
        self.present[scenes, cells] = True
        self.parents = [tuple(parents[scene]) or (scene,) for scene in self.scenes]
        self.clusters = Clusters.of(self.parents)


def parents_of(run: Run) -> pd.Series[Any]:
    """Base scenes by scene."""
    return run.records.drop_duplicates("scene").set_index("scene")["parents"]
