"""Paired differences between models with their intervals: a forest plot of a comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from phyblock.report.compare import compare_models
from phyblock.tables.drawing import (
    ACCENT,
    MUTED,
    ROW_PT,
    bare_axes,
    headed,
    legend_below,
    name_across,
    names_width_in,
    new_figure,
    text_width_in,
)
from phyblock.tables.load import Run
from phyblock.tables.measures import in_unit
from phyblock.tables.text_table import between, level_name, number
from phyblock.text import counted
from phyblock.tracks.estimates import main_measure
from phyblock.tracks.kind import kind_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["difference_forest"]

_ROW_IN = 0.19
_LEAST_PLOT_IN, _NUMBERS_IN, _TICK_IN = 1.0, 1.05, 0.42
_MARGIN_IN = 0.08
_MOST_MODELS = 6
"""Of more models than these, all are held against the best one alone."""
_LEVEL = 0.05
_FOUND, _NOT_FOUND = "difference found", "cannot tell"


@dataclass(frozen=True)
class _Row:
    """A difference; a heading where there is none."""

    label: str
    difference: float = float("nan")
    lo: float = float("nan")
    hi: float = float("nan")
    is_sure: bool = False

    @property
    def is_heading(self) -> bool:
        return self.difference != self.difference


def difference_forest(run: Run, *, track: str) -> Figure | None:
    """A row a pair of models under the better one's name, the difference with its 95 % interval.

    All pairs of up to six models; of more, the best one and each of the others; of two, a row a
    part of the track. As `compare` has them, of the same samples; None for fewer than two models
    that answered.
    """
    from matplotlib.ticker import MaxNLocator

    if len(run.design.model_names) < 2:
        return None
    found = compare_models(run, track=track)
    table = found.table.dropna(subset=["difference"])
    if table.empty:
        return None
    several = table["part"].nunique() > 1
    rows = _of_parts(table) if several else _of_pairs(table, main_measure(run, track).better)
    names_in = names_width_in(row.label for row in rows if not row.is_heading)
    headings_in = max(text_width_in(row.label, ROW_PT, "bold") for row in rows if row.is_heading)
    figure = new_figure(
        1.1 + _ROW_IN * len(rows), max(names_in + _LEAST_PLOT_IN, headings_in + 2 * _MARGIN_IN)
    )
    ax = figure.subplots()
    _draw(figure, ax, rows)
    room_in = figure.get_figwidth() - names_in
    if room_in >= _NUMBERS_IN + _LEAST_PLOT_IN:
        _tell(ax, rows)
        room_in -= _NUMBERS_IN
    ax.xaxis.set_major_locator(MaxNLocator(max(1, int(room_in / _TICK_IN))))
    unit = "points" if found.unit == "%" else found.unit
    name_across(ax, in_unit(f"Difference of {found.name}", unit), room_in)
    handles = ax.get_lines()[1:3]
    legend_below(figure, handles, [str(handle.get_label()) for handle in handles])
    most = table.loc[table["n_scenes"].idxmax()]
    samples = counted(int(most["n_samples"]), "sample")
    how = (
        f"{samples} that both have; lines: 95 % intervals over "
        f"{counted(int(most['n_clusters']), 'base scene')}; filled: p < {_LEVEL} after Holm's "
        f"correction for {counted(len(found.table), 'test')}"
    )
    headed(
        figure,
        f"{kind_of(track).title}: paired differences of {found.name}",
        run.design.after_suite(how, "; "),
    )
    return figure


def _of_parts(table: pd.DataFrame) -> list[_Row]:
    """Two models: a row a part, the whole first."""
    rows = [_row(level_name(row["part"].replace("_", " ")), row) for row in _records(table)]
    pair = table.iloc[0]
    return [_Row(f"{pair['a']} minus {pair['b']}"), rows[-1], *rows[:-1]]


def _of_pairs(table: pd.DataFrame, better: str) -> list[_Row]:
    """Several models: a row a pair, under the name of the one that is ahead."""
    pairs = {(row["a"], row["b"]): row for row in _records(table)}
    values = {row[side]: row[f"value_{side}"] for row in pairs.values() for side in "ab"}
    sign = -1 if better == "higher" else 1
    models = sorted(values, key=lambda name: (sign * values[name], name))
    rows = []
    for place, ahead in enumerate(models[: 1 if len(models) > _MOST_MODELS else None]):
        below = []
        for other in models[place + 1 :]:
            if (ahead, other) in pairs:
                below.append(_row(other, pairs[ahead, other]))
            elif (other, ahead) in pairs:
                below.append(_row(other, pairs[other, ahead], -1))
        rows += [_Row(f"{ahead} minus"), *below] if below else []
    return rows


def _row(label: str, row: Mapping[str, Any], sign: int = 1) -> _Row:
    lo, hi = sorted((sign * row["lo"], sign * row["hi"]))
    return _Row(label, sign * row["difference"], lo, hi, bool(row["p_holm"] < _LEVEL))


def _records(table: pd.DataFrame) -> list[dict[str, Any]]:
    return [{str(name): value for name, value in row.items()} for row in table.to_dict("records")]


def _draw(figure: Figure, ax: Axes, rows: Sequence[_Row]) -> None:
    ax.axvline(0, color=MUTED, linewidth=0.8)
    for is_sure, face, label in ((True, ACCENT, _FOUND), (False, "white", _NOT_FOUND)):
        chosen = [(n, row) for n, row in enumerate(rows) if not row.is_heading]
        places = [n for n, row in chosen if row.is_sure == is_sure]
        for n in places:
            ax.hlines(n, rows[n].lo, rows[n].hi, color=ACCENT, linewidth=1.2)
        ax.plot(
            [rows[n].difference for n in places],
            places,
            "o",
            color=ACCENT,
            markerfacecolor=face,
            markersize=4,
            label=label,
        )
    ax.set_yticks(range(len(rows)), ["" if row.is_heading else row.label for row in rows])
    for n, row in enumerate(rows):
        if row.is_heading:
            _head(figure, ax, n, row.label)
    ax.set_ylim(len(rows) - 0.4, -0.6)
    bare_axes([ax])


def _head(figure: Figure, ax: Axes, place: int, label: str) -> None:
    """A heading from the figure's left edge on, over the plot where it is long."""
    heading = ax.annotate(
        label,
        (_MARGIN_IN / figure.get_figwidth(), place),
        xycoords=("figure fraction", "data"),
        va="center",
        fontsize=ROW_PT,
        fontweight="bold",
        annotation_clip=False,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.8},
        zorder=4,
    )
    heading.set_in_layout(False)


def _tell(ax: Axes, rows: Sequence[_Row]) -> None:
    """The numbers at the right."""
    edge = ax.get_yaxis_transform()
    for n, row in enumerate(rows):
        if not row.is_heading:
            told = f"{number(row.difference, signed=True)} {between(row.lo, row.hi, signed=True)}"
            ax.text(1.02, n, told, transform=edge, va="center", fontsize=6.5, color=MUTED)
