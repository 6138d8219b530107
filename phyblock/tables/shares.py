"""Parts of a whole as counts and shares with intervals: what became of steps, of answers."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.counts import Floats, ratio_of
from phyblock.tables.estimates import estimate_frame
from phyblock.tables.flat import joined_counts
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, SCORED_BY, Cell, Measure, SampleCounts
from phyblock.tables.text_table import between, number
from phyblock.tables.track_report import WHOLE

__all__ = ["joined_shares", "share_texts", "shares_of"]

_WHOLE = "whole"
_ENDS = {"value": "share", "lo": "lo", "hi": "hi"}


def shares_of(
    run: Run,
    rows: pd.DataFrame,
    parts: Sequence[str],
    cells: Sequence[Cell] = (WHOLE,),
    whole: str | None = None,
) -> pd.DataFrame:
    """Shares of `parts` by model and cell, as every estimate is made: see `estimate_frame`.

    `rows` has counts of `parts` by sample with model, scene, seed, replied (whether the model said
    anything), and the cell where there are several. The whole is the column of this name, or the
    sum of the parts. Columns are `whole` and the parts as sums, then `<part>_share`, `<part>_lo`
    and `<part>_hi`, in [0, 1]; a model and cell without a sample have no row.
    """
    counted = SampleCounts("parts", (*parts, _WHOLE))
    measures = [
        Measure(part, part, counted, partial(_share, place)) for place, part in enumerate(parts)
    ]
    total = rows[list(parts)].sum(axis=1) if whole is None else rows[whole]
    about = dict.fromkeys(SCORED_BY, "")
    about |= {} if CELL in rows else {CELL: WHOLE.name}
    counts = rows.assign(**about, **{_WHOLE: total})
    estimates = estimate_frame(run, measures, cells, lambda _: counts)
    shares = {
        f"{part}_{name}": mine[end].astype("float64")
        for part in parts
        for mine in (estimates[estimates["measure"] == part].set_index(["model", CELL]),)
        for end, name in _ENDS.items()
    }
    at = pd.MultiIndex.from_frame(estimates[["model", CELL]].drop_duplicates())
    sums = counts.groupby(["model", CELL])[[_WHOLE, *parts]].sum().reindex(at)
    return sums.join(pd.DataFrame(shares, at))


def joined_shares(table: pd.DataFrame, shares: pd.DataFrame, on: Sequence[str]) -> pd.DataFrame:
    """A table with the columns of `shares_of` at the rows that `on` names; without them, sums 0."""
    wide = table.join(shares.rename_axis(list(on)), on=list(on))
    sums = [name for name in shares if f"{name}_share" in shares or name == _WHOLE]
    return wide.assign(**joined_counts(wide[sums]))


def _share(place: int, sums: Floats) -> Floats:
    return ratio_of(np.stack([sums[..., place], sums[..., -1]], axis=-1))


def share_texts(row: Mapping[Hashable, Any], part: str) -> tuple[str, str]:
    """A share [%] and its interval, out of the columns of `shares_of`."""
    share, lo, hi = (100 * float(row[f"{part}_{name}"]) for name in _ENDS.values())
    return number(share), between(lo, hi)
