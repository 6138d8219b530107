"""Figures of a run for papers: forest, levels, shares, cost, sensitivity."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from phyblock.files import OutFolder, cache_dir
from phyblock.results.compare import compare, sensitivity_frame, sizes_text
from phyblock.results.estimates import Headline, shown_values
from phyblock.results.load import Run
from phyblock.results.tables import coverage_frame
from phyblock.results.text import between, level_name, number
from phyblock.text import counted
from phyblock.tracks.base import kind_of
from phyblock.tracks.measures import in_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_STYLE = Path(__file__).with_name("paper.mplstyle")
_MUTED, _PALE, _ACCENT = "#5c6670", "#c3cad2", "#0b62a4"
_COLORS = (
    *("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#1b1f24"),
)
"""Okabe and Ito's colors, with the yellow replaced, which does not print on white."""
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "h")
_NAMED = len(_COLORS)
"""Number of models with a color and a name; the others are pale."""
WIDTH_IN = 7.0
"""Width of the text of a two-column paper."""
COLUMN_IN = 3.35
"""Width of one of its columns."""
PAPER = "paper"
"""Default folder of figures for papers, in a run's folder."""
_ROW_IN, _TITLE_IN, _LEGEND_IN = 0.19, 0.22, 0.2
_LETTER_IN = 0.062
"""Width of a wide letter in a legend."""
_FORMATS: dict[str, tuple[int, dict[str, Any]]] = {
    "pdf": (300, {"Creator": "phyblock", "CreationDate": None, "ModDate": None}),
    "svg": (72, {"Creator": "phyblock", "Date": None}),
    "png": (200, {"Software": "phyblock"}),
}
"""Dots per inch and metadata; without a date, the same numbers give the same bytes."""


@contextmanager
def _styled(width_in: float) -> Iterator[None]:
    """Apply the project's style to figures, with matplotlib's font list in phyblock's cache."""
    os.environ.setdefault("MPLCONFIGDIR", str(cache_dir() / "matplotlib"))
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rc_file(_STYLE, use_default_template=False)
        mpl.rcParams["figure.figsize"] = (width_in, width_in)
        yield


def _axes(height_in: float, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """Return an empty figure of the chosen width with axes; no window, no global state."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    width_in = mpl.rcParams["figure.figsize"][0]
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    return figure, list(figure.subplots(1, columns, sharex=True, sharey=True, squeeze=False)[0])


def _is_wide(figure: Figure) -> bool:
    """True if a figure is wider than a column of a two-column paper."""
    return bool(figure.get_figwidth() > COLUMN_IN + 0.1)


def _finished(
    figure: Figure, run: Run, title: str, how: str, *, grid: str = "x", reverse: bool = False
) -> Figure:
    """Return a figure with a light grid, a legend below, and its caption."""
    for ax in figure.axes:
        ax.spines[["top", "right", "left"]].set_visible(False)
        ax.tick_params(axis="y", length=0)
        ax.grid(axis=grid)  # type: ignore[arg-type]
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if labels:
        order = slice(None, None, -1 if reverse else 1)
        widest = _LETTER_IN * max(map(len, labels)) + 0.5
        columns = max(1, min(len(labels), int(figure.get_figwidth() / widest)))
        rows = -(-len(labels) // columns)
        figure.set_figheight(figure.get_figheight() + _LEGEND_IN * rows)
        columns = -(-len(labels) // rows)
        figure.legend(handles[order], labels[order], loc="outside lower center", ncols=columns)
    suite = f"Suite {run.design.suite.name}; " if run.design.suite.name else ""
    figure.set_label(f"{title}\n{suite}{how}")
    return figure


def _named_rows(ax: Axes, names: Sequence[str]) -> None:
    """Label the rows of a plot from the top."""
    ax.set_yticks(range(len(names)), list(names))
    ax.set_ylim(len(names) - 0.4, -0.6)


_MOST_MODELS = 6
"""Maximum number of models for all pairs; with more, each is compared with the best one."""


def forest(run: Run, *, track: str) -> Figure | None:
    """Draw the differences of pairs of models, one row each under the better one's name.

    Up to six models give all pairs; more give the best one and each of the others; two give a row
    per part of the track. Wide figures also print the numbers. Values are those of `phyblock
    compare`, with 95 % intervals. None for fewer than two models that answered.
    """
    models = list(Headline(run, track).ranked)
    if len(models) < 2:
        return None
    found = compare(run, None, models, track)
    table = found.table.dropna(subset=["difference"])
    if table.empty:
        return None
    if len(models) == 2:
        table = pd.concat([table.iloc[-1:], table.iloc[:-1]])
        labels = [level_name(part) for part in table["part"]]
        title = f"{table.iloc[0]['a']} minus {table.iloc[0]['b']}"
    elif len(models) > _MOST_MODELS:
        # Pairs are in the order of the given models.
        table = table[table["a"] == models[0]]
        labels = list(table["b"])
        title = f"{kind_of(track).title}: {found.name} of {models[0]} minus that of each other"
    else:
        labels = [f"{a} − {b}" for a, b in zip(table["a"], table["b"], strict=True)]  # noqa: RUF001
        title = f"{kind_of(track).title}: paired differences of {found.name}"
    figure, (ax,) = _axes(0.7 + _ROW_IN * len(table))
    places = np.arange(len(table))
    ax.axvline(0, color=_MUTED, linewidth=0.8)
    ax.hlines(places, table["lo"], table["hi"], color=_ACCENT, linewidth=1.2)
    is_found = (table["p_holm"] < 0.05).to_numpy()
    faces = {_ACCENT: (is_found, "difference found"), "white": (~is_found, "cannot tell")}
    for face, (chosen, label) in faces.items():
        look: dict[str, Any] = {"color": _ACCENT, "markerfacecolor": face, "label": label}
        ax.plot(table["difference"][chosen], places[chosen], "o", **look)
    edge = ax.get_yaxis_transform()
    for place, row in enumerate(table.to_dict("records") if _is_wide(figure) else ()):
        ends = between(row["lo"], row["hi"], signed=True)
        text = f"{number(row['difference'], signed=True)} {ends}"
        ax.text(1.02, place, text, transform=edge, va="center", fontsize=6.5, color=_MUTED)
    _named_rows(ax, labels)
    ax.set_xlabel(in_unit("Difference", "points" if found.unit == "%" else found.unit))
    most = table.loc[table["n_scenes"].idxmax()]
    how = (
        f"{counted(int(most['n_samples']), 'sample')} that both have; 95 % intervals over "
        f"{counted(int(most['n_clusters']), 'base scene')}; filled: p < 0.05 after Holm's "
        f"correction for {counted(len(found.table), 'test')}"
    )
    return _finished(figure, run, title, how)


def levels(run: Run, *, track: str) -> Figure | None:
    """Draw one line per model over the cells of the headline; None for fewer than two cells."""
    headline = Headline(run, track)
    columns, measure, values = headline.parts, headline.measure, headline.values
    models = list(headline.ranked)
    if len(columns) < 2 or not models:
        return None
    figure, (ax,) = _axes(3.2)
    for place, model in reversed(list(enumerate(models))):
        known = [values.get((model, column.heading)) for column in columns]
        line = [math.nan if value is None else value.value for value in known]
        look: dict[str, Any] = {"color": _PALE, "linewidth": 0.8, "zorder": 1}
        if place < _NAMED:
            look = {"color": _COLORS[place], "marker": _MARKERS[place], "label": model}
        ax.plot(range(len(columns)), line, **look)
    ax.set_xticks(range(len(columns)), [column.heading for column in columns])
    ax.set_ylabel(measure.heading_in_unit)
    if measure.unit == "%":
        ax.set_ylim(0, 102)
    more = f"; the other {len(models) - _NAMED} pale" if len(models) > _NAMED else ""
    parts = "category" if kind_of(track).report().part_names else "level"
    title, how = f"{kind_of(track).title}: {measure.heading} by {parts}", "the best of all first"
    return _finished(figure, run, title, f"{how}{more}", grid="y", reverse=True)


def shares(run: Run, *, track: str, table: str) -> Figure | None:
    """Draw stacked shares of a table over all cells, one row per model; None without shares."""
    report, values = kind_of(track).report(), shown_values(run, track)
    layout, whole = report.tables[table], run.cells(track)[-1].name
    names = [name for spec in layout.columns for name in spec.measures]
    names = names if isinstance(layout.rows, str) else list(layout.rows)
    found = {
        model: [getattr(values.get((model, n, whole, "")), "value", math.nan) for n in names]
        for model in Headline(run, track).ranked
    }
    models = [model for model, row in found.items() if not np.isnan(row).all()]
    drawn = np.nan_to_num([found[model] for model in models])
    if not drawn.any():
        return None
    headings = {one.name: one.heading for one in report.measures}
    figure, (ax,) = _axes(0.6 + _ROW_IN * len(models))
    left = np.zeros(len(models))
    for place, (name, widths) in enumerate(zip(names, drawn.T, strict=True)):
        color = _COLORS[place % len(_COLORS)]
        ax.barh(models, widths, left=left, color=color, height=0.66, label=headings[name])
        for row in np.flatnonzero(widths >= 6 * WIDTH_IN / figure.get_figwidth()):
            at = (float(left[row] + widths[row] / 2), float(row))
            middle: dict[str, Any] = {"ha": "center", "va": "center", "color": "white"}
            ax.text(*at, f"{widths[row]:.0f}", fontsize=6.5, **middle)
        left += widths
    _named_rows(ax, models)
    ax.set(xlim=(0, 100), xlabel="%")
    title = layout.caption.removesuffix(" (%)")
    return _finished(figure, run, title, f"{kind_of(track).title}, all parts together")


_CALLOUTS = 4


def cost(run: Run, *, track: str) -> Figure | None:
    """Draw the main value against dollars per 100 replies; None if no cost is known."""
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import NullFormatter

    headline = Headline(run, track)
    ranked, measure = headline.ranked, headline.measure
    table = coverage_frame(run)
    prices = table[table["track"] == track].set_index("model")["cost_per_100_usd"].to_dict()
    models = [model for model in ranked if prices.get(model, 0.0) > 0]
    if not models:
        return None
    figure, (ax,) = _axes(3.2)
    for model in models:
        value = ranked[model]
        ax.vlines(prices[model], value.lo, value.hi, color=_PALE, linewidth=2.2)
        ax.plot(prices[model], value.value, "o", color=_ACCENT)
    cheapest = sorted(models, key=lambda model: prices[model])
    best = _CALLOUTS - 1 if _is_wide(figure) else 1
    named = models if len(models) <= _NAMED else [*models[:best], cheapest[0]]
    for model in dict.fromkeys(named):
        at = (prices[model], ranked[model].value)
        name = ax.annotate(model, at, xytext=(5, 3), textcoords="offset points", fontsize=6.5)
        name.set_path_effects([withStroke(linewidth=2, foreground="white")])
    ax.set_xscale("log")
    # Plain numbers: the style prints no mathematics, and so no powers of ten.
    ax.xaxis.set_major_formatter("{x:g}")
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set(xlabel="Cost of 100 replies (USD, log scale)", ylabel=measure.heading_in_unit)
    ax.set_xlim(prices[cheapest[0]] / 1.7, prices[cheapest[-1]] * 4)
    lacking = len(ranked) - len(models)
    how = "lines: 95 % intervals" + (f"; {lacking} of unknown cost left out" if lacking else "")
    title = f"{kind_of(track).title}: {measure.heading} by cost"
    return _finished(figure, run, title, how, grid="both")


def sensitivity(run: Run, *, track: str) -> Figure | None:
    """Draw the shift by each factor as dots, a panel per factor and a row per model, or None."""
    table = sensitivity_frame(run)
    table = table[table["track"] == track]
    if not len(table):
        return None
    factors, models = list(table["factor"].unique()), list(table["model"].unique())
    figure, axes = _axes(0.9 + _ROW_IN * len(models), len(factors))
    for ax, factor in zip(axes, factors, strict=True):
        rows = table[table["factor"] == factor].set_index("model").loc[models]
        places = range(len(models))
        ax.hlines(places, rows["shift_lo"], rows["shift_hi"], color=_ACCENT, linewidth=1.3)
        ax.plot(rows["shift"], places, "o", color=_ACCENT, clip_on=False)
        name = str(factor).replace("_", "\n")
        ax.set_title(name, fontsize=min(8.5, 40 / len(factors)))
        ax.set_xlabel("SD")
    _named_rows(axes[0], models)
    axes[0].set_xlim(left=0)
    what = f"Standard deviation of the means of {Headline(run, track).measure.heading_in_unit}"
    how = f"{what} by level; lines: 95 % intervals, {sizes_text(table)}"
    return _finished(figure, run, f"{kind_of(track).title}: effect of the presentation", how)


def figures_of(run: Run) -> dict[str, Callable[[Run], Figure | None]]:
    """Return the functions that draw the figures that a run may have, by name."""
    found: dict[str, Callable[[Run], Figure | None]] = {}
    for track in run.design.suite.tracks:
        dashed = track.replace("_", "-")
        found[f"levels-{dashed}"] = partial(levels, track=track)
        for table in [n for n, one in kind_of(track).report().tables.items() if one.drawn]:
            found[table.replace("_", "-")] = partial(shares, track=track, table=table)
        found[f"cost-{dashed}"] = partial(cost, track=track)
        found[f"sensitivity-{dashed}"] = partial(sensitivity, track=track)
        found[f"forest-{dashed}"] = partial(forest, track=track)
    return found


def write_paper_figures(
    run: Run,
    names: Sequence[str] = (),
    out: Path | None = None,
    *,
    width_in: float = WIDTH_IN,
    titled: bool = True,
) -> tuple[Path, ...]:
    """Draw figures for a paper into `out`, else into `paper/` of the run's folder.

    Each is NAME.pdf, NAME.svg and NAME.png, with its caption NAME.txt; without names, all that have
    numbers. The same records give the same bytes. Raises StoreError for a folder that cannot be
    written and, before anything is drawn, naming every file of others that would be overwritten.
    """
    makers = figures_of(run)
    wanted = list(names) or list(makers)
    folder = OutFolder(out or run.path)
    below = f"{PAPER}/" if out is None else ""
    endings = (*_FORMATS, "txt")
    folder.check(f"{below}{name}.{ending}" for name in wanted for ending in endings)
    files: list[Path] = []
    with _styled(width_in):
        for name in wanted:
            figure = makers[name](run)
            if figure is None:
                continue
            title, _, how = str(figure.get_label()).partition("\n")
            if titled:
                lines = wrap(title, int(width_in * 11))
                figure.set_figheight(figure.get_figheight() + _TITLE_IN * len(lines))
                figure.suptitle("\n".join(lines), x=0.01, ha="left")
            made: dict[str, bytes | str] = {}
            for ending, (dpi, metadata) in _FORMATS.items():
                drawn = io.BytesIO()
                figure.savefig(drawn, format=ending, dpi=dpi, metadata=metadata)
                made[f"{name}.{ending}"] = drawn.getvalue()
                # Laid out once: the next formats use the layout of the first.
                figure.set_layout_engine("none")
            words = [word for track in run.design.suite.tracks for word in run.presentation(track)]
            sentences = (title, how[:1].upper() + how[1:], ", ".join(dict.fromkeys(words)))
            made[f"{name}.txt"] = " ".join(f"{one}." for one in sentences if one) + "\n"
            files += folder.write({f"{below}{file}": data for file, data in made.items()})
    return tuple(files)
