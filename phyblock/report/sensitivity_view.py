"""The tables of what the way of asking changes, as people read them."""

from __future__ import annotations

from collections.abc import Sequence

import pandas as pd

from phyblock.config.suite import REPEAT
from phyblock.report.comparable import comparable
from phyblock.report.compare_view import p_text
from phyblock.report.sensitivity import ITEMS, levels_frame
from phyblock.scoring.statistics import CONFIDENCE
from phyblock.tables.load import Run
from phyblock.tables.text_table import (
    Column,
    TextTable,
    between,
    number,
    track_column,
    track_text,
    with_interval,
)
from phyblock.tracks.kind import kind_of

__all__ = [
    "FACTOR",
    "LEVEL",
    "components_view",
    "factor_name",
    "levels_view",
    "ranks_view",
    "sizes_text",
]

_NAMES = {REPEAT: "asked again", ITEMS: "between items"}
_MODEL = Column("Model", is_text=True)
FACTOR = Column("Factor", is_text=True)
LEVEL = Column("Level", is_text=True)


def factor_name(factor: str) -> str:
    """What people read in the place of a factor's name."""
    return _NAMES.get(factor, factor.replace("_", " "))


def components_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Standard deviations with intervals out of `components_frame`, a row a model and factor."""
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
    whats = _what(run, [str(group["track"].iloc[0]) for group in groups])
    notes = [f"{what}, {sizes_text(group)}." for what, group in zip(whats, groups, strict=True)]
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
    """How many items, of how many base scenes, are behind rows of `components_frame`: from the
    model that has fewest to the one that has most.
    """
    items, scenes = (_from_to(table[name]) for name in ("n_items", "n_clusters"))
    return f"{items} items of {scenes} base scenes"


def _from_to(sizes: pd.Series[int]) -> str:
    least, most = int(sizes.min()), int(sizes.max())
    return f"{most}" if least == most else f"{least} to {most}"


def levels_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Values by level out of `levels_frame`, each beside its difference to the first level."""
    rows = [
        (
            row["model"],
            *track_text(row["track"], run.design.suite.tracks),
            factor_name(row["factor"]),
            row["level"],
            number(row["value"]),
            number(row["rank"], 0),
            number(row["difference"], signed=True),
            between(row["lo"], row["hi"], signed=True),
            p_text(row["p_holm"]),
            number(row["detectable"]),
        )
        for row in table.to_dict("records")
    ]
    names = ("Value", "Rank", "Difference", "95 % CI", "p (Holm)", "Detectable")
    return TextTable(
        f"Every level{run.design.of_suite}, beside the first of its factor",
        (_MODEL, *track_column(run.design.suite.tracks), FACTOR, LEVEL, *map(Column, names)),
        tuple(rows),
        (
            *(f"{what}." for what in _what(run, list(table["track"].unique()))),
            "Detectable: the difference that a single test finds in four of five cases.",
            *_unranked(table),
        ),
    )


def _unranked(levels: pd.DataFrame) -> tuple[str, ...]:
    """Which models were asked about too few items to be ranked, out of `levels_frame`."""
    names = list(levels.loc[levels["rank"].isna(), "model"].unique())
    if not names:
        return ()
    return (
        f"Not ranked, with too few items that were asked in every way: {', '.join(names)}. The "
        "others are ranked on the items that they have in common.",
    )


def ranks_view(table: pd.DataFrame, run: Run) -> TextTable:
    """What becomes of the ranking of models out of `ranks_frame`, a row a level."""
    rows = [
        (
            *track_text(row["track"], run.design.suite.tracks),
            factor_name(row["factor"]),
            row["level"],
            number(row["tau"], 2),
            f"{row['flips']} of {row['pairs']}",
            str(row["sure"]),
            number(row["detectable"]),
        )
        for row in table.to_dict("records")
    ]
    names = ("Kendall's tau", "Pairs that flip", "beyond noise", "Detectable")
    return TextTable(
        f"Does the ranking survive{run.design.of_suite}?",
        (*track_column(run.design.suite.tracks), FACTOR, LEVEL, *map(Column, names)),
        tuple(rows),
        (
            "Against the first level of each factor. Beyond noise: the change of the pair's "
            f"difference is found at {1 - CONFIDENCE:.0%}, corrected for all pairs and levels.",
            "Detectable: the change of a difference that the test of a pair finds in four of five "
            "cases, the median of pairs.",
            *_unranked(levels_frame(run)),
        ),
    )


def _what(run: Run, tracks: Sequence[str]) -> list[str]:
    """What is measured in each track."""
    measures = [comparable(run, track).measure for track in tracks]
    return [
        f"{kind_of(track).title}: {measure.heading_in_unit}"
        for track, measure in zip(tracks, measures, strict=True)
    ]
