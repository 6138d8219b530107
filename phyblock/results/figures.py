r"""Figures of a run for papers: forest, levels, shares, cost, sensitivity."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from phyblock.files import OutFolder
from phyblock.resources import cache_dir
from phyblock.results.compare import compare_models
from phyblock.results.estimates import (
    Value,
    headline_columns,
    headline_of,
    main_column,
    main_measure,
)
from phyblock.results.load import Run
from phyblock.results.sensitivity import ITEMS, factor_name, sensitivity_frame, sizes_text
from phyblock.results.tables import cost_frame, filled, layouts_of
from phyblock.results.text import between, escape, level_name, number
from phyblock.text import counted
from phyblock.tracks.base import kind_of
from phyblock.tracks.measures import in_unit

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK = "#1b1f24"
MUTED = "#5c6670"
GRID = "#e3e6ea"
PALE = "#c3cad2"
ACCENT = "#0b62a4"

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#1b1f24")
"""Okabe and Ito's colors, the yellow replaced: it does not print on white."""

MARKERS = ("o", "s", "^", "D", "v", "P", "X", "h")

WIDTH_IN = 7.0
"""Width of the text of a two-column paper."""
COLUMN_IN = 3.35
"""Width of one of its columns."""

Font = Literal["sans", "serif"]
_FAMILIES: dict[Font, tuple[str, str]] = {
    "sans": ("sans-serif", "DejaVu Sans"),
    "serif": ("serif", "STIXGeneral"),
}
"""Generic family and the font that stands for it; matplotlib brings both."""


@dataclass(frozen=True)
class Look:
    """Width [inches], font, and whether figures have their title inside."""

    width_in: float = WIDTH_IN
    font: Font = "sans"
    titled: bool = True


ROW_PT, PANEL_PT = 7.5, 8.5
"""Sizes of the names of rows and of panels."""
_TITLE_PT, _SUBTITLE_PT, _LEGEND_PT, _AXIS_PT = 10.5, 7.5, 7.5, 8.0
_LINES_IN = {_TITLE_PT: 0.19, _SUBTITLE_PT: 0.14}
_MARGIN_IN = 0.08
_CHARACTER_IN = 0.0083
"""Width of a character of text of 1 pt, as wide letters have it."""
_LEGEND_ROW_IN, _LEGEND_HANDLE_IN = 0.17, 0.5
_ROW_IN = 0.19
_FORMATS: dict[str, tuple[int, dict[str, Any]]] = {
    "pdf": (300, {"Creator": "phyblock", "CreationDate": None, "ModDate": None}),
    "svg": (72, {"Creator": "phyblock", "Date": None}),
    "png": (200, {"Software": "phyblock"}),
}
"""Dots per inch and metadata: without a date, the same numbers give the same bytes."""
_SALT = "phyblock"
_RC: dict[str, Any] = {
    "font.size": 8,
    # A name is a name, whatever signs are in it.
    "text.parse_math": False,
    "axes.titlesize": PANEL_PT,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": _AXIS_PT,
    "axes.labelcolor": INK,
    "axes.edgecolor": MUTED,
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": ROW_PT,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "hatch.linewidth": 0.5,
    "legend.frameon": False,
    "legend.fontsize": _LEGEND_PT,
    "svg.hashsalt": _SALT,
    "svg.fonttype": "none",
    "pdf.fonttype": 42,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@contextmanager
def styled(look: Look) -> Iterator[None]:
    """Within it, figures are made and saved in the project's style, whatever the user's is.

    The list of fonts that matplotlib keeps goes into our cache folder, not into the home folder.
    """
    os.environ.setdefault("MPLCONFIGDIR", str(cache_dir() / "matplotlib"))
    import matplotlib as mpl

    family, font = _FAMILIES[look.font]
    chosen = {**_RC, "font.family": [family], f"font.{family}": [font]}
    chosen["figure.figsize"] = (look.width_in, look.width_in)
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(chosen)  # type: ignore[arg-type]
        yield


def new_figure(height_in: float) -> Figure:
    """Return an empty figure of the chosen width; no window, no global state."""
    import matplotlib as mpl
    from matplotlib.figure import Figure

    return Figure(figsize=(mpl.rcParams["figure.figsize"][0], height_in), layout="constrained")


def add_title(figure: Figure) -> None:
    """Put the two lines of the label above all axes at the left, the second smaller.

    They make the figure higher; without them, they stand in the caption alone.
    """
    title, _, subtitle = str(figure.get_label()).partition("\n")
    width = figure.get_figwidth()
    lines = [
        (line, size, weight)
        for text, size, weight in ((title, _TITLE_PT, "bold"), (subtitle, _SUBTITLE_PT, "normal"))
        for line in wrap(text, int((width - 2 * _MARGIN_IN) / (_CHARACTER_IN * size)))
    ]
    above = 0.17 + sum(_LINES_IN[size] for _, size, _ in lines)
    height = figure.get_figheight() + above
    figure.set_figheight(height)
    engine = figure.get_layout_engine()
    assert engine is not None
    engine.set(rect=(0, 0, 1, 1 - above / height))  # type: ignore[call-arg]
    top = 0.06
    for line, size, weight in lines:
        color = INK if size == _TITLE_PT else MUTED
        place = (_MARGIN_IN / width, 1 - top / height)
        figure.text(*place, line, fontsize=size, fontweight=weight, color=color, va="top")
        top += _LINES_IN[size] + (0.02 if size == _TITLE_PT else 0)


def legend_below(figure: Figure, handles: Sequence[Artist], labels: Sequence[str]) -> None:
    """A legend under all axes, in as many columns as fit; it makes the figure that much higher."""
    longest = max(map(len, labels))
    widest = _CHARACTER_IN * _LEGEND_PT * longest + _LEGEND_HANDLE_IN
    columns = max(1, min(len(labels), int(figure.get_figwidth() / widest)))
    rows = -(-len(labels) // columns)
    columns = -(-len(labels) // rows)
    figure.set_figheight(figure.get_figheight() + 0.08 + _LEGEND_ROW_IN * rows)
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, columnspacing=1.4)


def bare_axes(axes: Sequence[Axes], grid: str = "x") -> None:
    """Take the frame away but for the bottom line and put a light grid behind the data."""
    for ax in axes:
        for side in ("top", "right", "left"):
            ax.spines[side].set_visible(False)
        ax.tick_params(axis="y", length=0)
        ax.grid(axis=grid)  # type: ignore[arg-type]


def _named_rows(ax: Axes, names: Sequence[str]) -> None:
    """Name the rows of a plot from its top."""
    ax.set_yticks(range(len(names)), list(names))
    ax.set_ylim(len(names) - 0.4, -0.6)


def _ranked(run: Run, track: str) -> dict[str, Value]:
    """Return the main value of each model that has one, the best first."""
    main = main_column(run, track).heading
    sign = -1 if main_measure(run, track).better == "higher" else 1
    values = {
        model: value
        for (model, heading), value in headline_of(run, track).items()
        if heading == main and not math.isnan(value.value)
    }
    return dict(sorted(values.items(), key=lambda item: (sign * item[1].value, item[0])))


def _describe(run: Run, figure: Figure, title: str, how: str) -> None:
    """Label a figure with a title, and the suite and what was measured."""
    suite = f"Suite {run.design.suite.name}; " if run.design.suite.name else ""
    figure.set_label(f"{title}\n{suite}{how}")


_MOST_MODELS = 6
"""Of more models than these, all are held against the best one alone."""


def forest(run: Run, *, track: str) -> Figure | None:
    """A row a pair of models under the better one's name, the difference with its 95 % interval.

    All pairs of up to six models; of more, the best one and each of the others; of two, a row a
    part of the track. Of the same samples, as `phyblock compare` has them; None for fewer than two
    models that answered.
    """
    models = list(_ranked(run, track))
    if len(models) < 2:
        return None
    found = compare_models(run, models, track)
    table = found.table.dropna(subset=["difference"])
    if table.empty:
        return None
    if len(models) == 2:
        table = pd.concat([table.iloc[-1:], table.iloc[:-1]])
        labels = [level_name(part.replace("_", " ")) for part in table["part"]]
        head = f"{table.iloc[0]['a']} minus {table.iloc[0]['b']}"
    else:
        firsts = models[: 1 if len(models) > _MOST_MODELS else None]
        order = {name: place for place, name in enumerate(models)}
        table = table[table["a"].isin(firsts)]
        order_of = pd.concat(
            [table["a"].map(order), table["b"].map(order)], axis=1, keys=["a", "b"]
        )
        table = table.loc[order_of.sort_values(["a", "b"]).index]
        labels = [f"{row['a']} - {row['b']}" for row in table.to_dict("records")]
        head = f"{kind_of(track).title}: paired differences of {found.name}"
    figure = new_figure(0.7 + _ROW_IN * len(table))
    ax = figure.subplots()
    ax.axvline(0, color=MUTED, linewidth=0.8)
    places = np.arange(len(table))
    ax.hlines(places, table["lo"], table["hi"], color=ACCENT, linewidth=1.2)
    is_found = (table["p_holm"] < 0.05).to_numpy()
    for chosen, face, label in (
        (is_found, ACCENT, "difference found"),
        (~is_found, "white", "cannot tell"),
    ):
        look: dict[str, Any] = {
            "color": ACCENT,
            "markerfacecolor": face,
            "markersize": 4,
            "label": label,
        }
        ax.plot(table["difference"][chosen], places[chosen], "o", **look)
    edge = ax.get_yaxis_transform()
    for place, row in enumerate(table.to_dict("records")):
        ends = between(row["lo"], row["hi"], signed=True)
        text = f"{number(row['difference'], signed=True)} {ends}"
        ax.text(1.02, place, text, transform=edge, va="center", fontsize=6.5, color=MUTED)
    _named_rows(ax, labels)
    ax.set_xlabel(in_unit("Difference", "points" if found.unit == "%" else found.unit))
    bare_axes([ax])
    legend_below(figure, *ax.get_legend_handles_labels())
    most = table.loc[table["n_scenes"].idxmax()]
    how = (
        f"{counted(int(most['n_samples']), 'sample')} that both have; 95 % intervals over "
        f"{counted(int(most['n_clusters']), 'base scene')}; filled: p < 0.05 after Holm's "
        f"correction for {counted(len(found.table), 'test')}"
    )
    _describe(run, figure, head, how)
    return figure


_NAMED = len(COLORS)
"""Models that have a color and a name; the others are pale."""


def levels(run: Run, *, track: str) -> Figure | None:
    """A line a model over the cells of the headline; None for fewer than two cells."""
    main, measure = main_column(run, track), main_measure(run, track)
    columns = [
        column
        for column in headline_columns(run, track)
        if column.measure == main.measure and column.cell != main.cell
    ]
    models, values = list(_ranked(run, track)), headline_of(run, track)
    if len(columns) < 2 or not models:
        return None
    figure = new_figure(3.2)
    ax = figure.subplots()
    for place, model in reversed(list(enumerate(models))):
        known = [values.get((model, column.heading)) for column in columns]
        line = [math.nan if value is None else value.value for value in known]
        look: dict[str, Any] = {"color": PALE, "linewidth": 0.8, "zorder": 1}
        if place < _NAMED:
            look = {"color": COLORS[place], "marker": MARKERS[place], "label": model}
            look |= {"linewidth": 1.4, "markersize": 4}
        ax.plot(range(len(columns)), line, **look)
    ax.set_xticks(range(len(columns)), [column.heading for column in columns])
    ax.set_ylabel(measure.heading_in_unit)
    if measure.unit == "%":
        ax.set_ylim(0, 102)
    bare_axes([ax], "y")
    handles, labels = ax.get_legend_handles_labels()
    legend_below(figure, handles[::-1], labels[::-1])
    more = f"; the other {len(models) - _NAMED} pale" if len(models) > _NAMED else ""
    title = f"{kind_of(track).title}: {measure.heading} by part"
    _describe(run, figure, title, f"the best of all first{more}")
    return figure


def shares(run: Run, *, track: str, table: str) -> Figure | None:
    """Stacked shares of a table, a row a model, of all cells together; None without a share."""
    layout = layouts_of(track)[table]
    filled_in = filled(run, track, layout)
    frame = filled_in.frame
    if frame.empty:
        return None
    whole = kind_of(track).report().cells(run)[-1].name
    measures = {one.name: one for one in kind_of(track).report().measures}
    if layout.rows == "cell":
        frame = frame[frame["part"] == whole]
    if isinstance(layout.rows, tuple):
        names = list(layout.rows)
        key = whole if whole in frame else ""
        if not key:
            return None
        frame = frame.pivot(index="model", columns="part", values=key)
    else:
        names = [name for spec in layout.columns for name in spec.measures]
        frame = frame.set_index("model")
    frame = frame[[name for name in names if name in frame]].dropna(how="all").fillna(0.0)
    models = [model for model in _ranked(run, track) if model in frame.index]
    if not models or not frame.to_numpy().any():
        return None
    frame = frame.loc[models]
    figure = new_figure(0.6 + _ROW_IN * len(models))
    ax = figure.subplots()
    left = np.zeros(len(models))
    for place, name in enumerate(map(str, frame)):
        values = frame[name].to_numpy(np.float64)
        color = COLORS[place % len(COLORS)]
        ax.barh(models, values, left=left, color=color, height=0.66, label=measures[name].heading)
        for row, value in enumerate(values):
            if value >= 6:
                middle = left[row] + value / 2
                ax.text(middle, row, f"{value:.0f}", ha="center", va="center", color="white",
                        fontsize=6.5)  # fmt: skip
        left += values
    _named_rows(ax, models)
    ax.set(xlim=(0, 100), xlabel="%")
    bare_axes([ax])
    legend_below(figure, *ax.get_legend_handles_labels())
    title = layout.caption.removesuffix(" (%)")
    _describe(run, figure, title, f"{kind_of(track).title}, all parts together")
    return figure


_CALLOUTS = 4


def cost(run: Run, *, track: str) -> Figure | None:
    """The main value against dollars for 100 replies; None where no cost is known."""
    ranked, measure = _ranked(run, track), main_measure(run, track)
    table = cost_frame(run)
    prices = table[table["track"] == track].set_index("model")["cost_per_100_usd"].to_dict()
    models = [model for model in ranked if prices.get(model, 0.0) > 0]
    if not models:
        return None
    figure = new_figure(3.2)
    ax = figure.subplots()
    for model in models:
        value = ranked[model]
        ax.vlines(prices[model], value.lo, value.hi, color=PALE, linewidth=2.2)
        ax.plot(prices[model], value.value, "o", color=ACCENT, markersize=5)
    cheapest = sorted(models, key=lambda model: prices[model])
    named = models if len(models) <= _NAMED else [*models[: _CALLOUTS - 1], cheapest[0]]
    for model in dict.fromkeys(named):
        at = (prices[model], ranked[model].value)
        ax.annotate(model, at, xytext=(5, 3), textcoords="offset points", fontsize=6.5)
    ax.set_xscale("log")
    ax.set(xlabel="Cost of 100 replies (USD, log scale)", ylabel=measure.heading_in_unit)
    ax.set_xlim(prices[cheapest[0]] / 1.7, prices[cheapest[-1]] * 4)
    bare_axes([ax], "both")
    lacking = len(ranked) - len(models)
    how = (
        f"lines: 95 % intervals; {lacking} of unknown cost left out"
        if lacking
        else "lines: 95 % intervals"
    )
    _describe(run, figure, f"{kind_of(track).title}: {measure.heading} by cost", how)
    return figure


def sensitivity(run: Run, *, track: str) -> Figure | None:
    """A panel a factor, a row a model, dots for shift and single items; None where nothing varies.

    What differs between items is left out: it is an order larger, and no way of asking.
    """
    table = sensitivity_frame(run)
    table = table[(table["track"] == track) & (table["factor"] != ITEMS)]
    if not len(table):
        return None
    factors, models = list(table["factor"].unique()), list(table["model"].unique())
    figure = new_figure(0.9 + 0.3 * len(models))
    axes = figure.subplots(1, len(factors), sharey=True, sharex=True, squeeze=False)[0]
    parts = {"shift": ("shift of all items", ACCENT), "single": ("single items", COLORS[1])}
    for ax, factor in zip(axes, factors, strict=True):
        rows = table[table["factor"] == factor].set_index("model").loc[models]
        for n, (name, (label, color)) in enumerate(parts.items()):
            places = np.arange(len(models)) + (n - 0.5) * 0.32
            values = rows[[name, f"{name}_lo", f"{name}_hi"]].to_numpy(np.float64)
            ax.hlines(places, values[:, 1], values[:, 2], color=color, linewidth=1.3)
            look: dict[str, Any] = {
                "color": color,
                "markersize": 4,
                "label": label,
                "clip_on": False,
            }
            ax.plot(values[:, 0], places, MARKERS[n], **look)
        ax.set(title=factor_name(factor).replace(" ", "\n"), xlabel="SD")
    _named_rows(axes[0], models)
    axes[0].set_xlim(left=0)
    bare_axes(axes)
    legend_below(figure, *axes[0].get_legend_handles_labels())
    what = f"Standard deviation of {main_measure(run, track).heading_in_unit}"
    how = f"{what}; lines: 95 % intervals, {sizes_text(table)}"
    _describe(run, figure, f"{kind_of(track).title}: what the way of asking changes", how)
    return figure


PAPER = "paper"
"""The folder in a run's folder where figures for papers are, unless another is named."""
_STACKED = {"full_planning": ("errors", "losses"), "step_planning": ("moves",),
            "pose_planning": ("pose_errors",)}  # fmt: skip
"""Tables whose shares are drawn, by track."""


def _makers(tracks: Sequence[str]) -> dict[str, tuple[str, Callable[[Run], Figure | None]]]:
    """Return titles and makers of the figures of tracks, by name."""
    makers: dict[str, tuple[str, Callable[[Run], Figure | None]]] = {}
    for track in tracks:
        title, dashed = kind_of(track).title, track.replace("_", "-")
        makers[f"levels-{dashed}"] = f"{title} by part", partial(levels, track=track)
        for table in _STACKED.get(track, ()):
            caption = layouts_of(track)[table].caption.removesuffix(" (%)")
            makers[table.replace("_", "-")] = caption, partial(shares, track=track, table=table)
        makers[f"cost-{dashed}"] = f"{title}: value and cost", partial(cost, track=track)
        moved = f"{title}: what the way of asking changes"
        makers[f"sensitivity-{dashed}"] = moved, partial(sensitivity, track=track)
        makers[f"forest-{dashed}"] = f"{title}: paired differences", partial(forest, track=track)
    return makers


def figure_titles(run: Run) -> dict[str, str]:
    """Return the names of all figures that a run may have, with their titles."""
    return {name: title for name, (title, _) in _makers(run.design.suite.tracks).items()}


def write_paper_figures(
    run: Run, names: Sequence[str], look: Look, out: Path | None = None
) -> tuple[Path, ...]:
    """Draw figures for a paper into `out`, else into `paper/` of the run's folder.

    Each is NAME.pdf, NAME.svg and NAME.png, its caption NAME.txt, and NAME.tex a float that
    includes it. All figures where no names are given; those without numbers are left out. The
    same records give the same bytes. Raises StoreError for a folder that cannot be written, and,
    before anything is drawn, naming every file in the way that we never wrote.
    """
    makers = _makers(run.design.suite.tracks)
    wanted = list(names) or list(makers)
    folder = OutFolder(out or run.path)
    below = f"{PAPER}/" if out is None else ""
    endings = (*_FORMATS, "txt", "tex")
    folder.check(f"{below}{name}.{ending}" for name in wanted for ending in endings)
    files: list[Path] = []
    with styled(look):
        for name in wanted:
            figure = makers[name][1](run)
            if figure is None:
                continue
            if look.titled:
                add_title(figure)
            made: dict[str, bytes | str] = {}
            for ending, (dpi, metadata) in _FORMATS.items():
                drawn = io.BytesIO()
                figure.savefig(drawn, format=ending, dpi=dpi, metadata=metadata)
                made[f"{below}{name}.{ending}"] = drawn.getvalue()
                # Laid out once: the next format takes what the first has found.
                figure.set_layout_engine("none")
            captions = _captions(run, name, figure)
            made |= {f"{below}{name}.{ending}": text for ending, text in captions.items()}
            files += folder.write(made)
    return tuple(files)


def _captions(run: Run, name: str, figure: Figure) -> Mapping[str, str]:
    """Return the caption as text, and a LaTeX float, which spans both columns if it is wide."""
    title, _, subtitle = str(figure.get_label()).partition("\n")
    tracks = run.design.suite.tracks
    words = [word for track in tracks for word in kind_of(track).report().showing(run)]
    sentences = [title, subtitle[:1].upper() + subtitle[1:]]
    sentences += [", ".join(dict.fromkeys((*words, *run.varied_words)))]
    text = " ".join(f"{sentence}." for sentence in sentences if sentence)
    star = "*" if figure.get_figwidth() > COLUMN_IN + 0.1 else ""
    lines = (
        "% Needs \\usepackage{graphicx}.",
        rf"\begin{{figure{star}}}[t]",
        r"\centering",
        r"\resizebox{!}{\ifdim\height>.85\textheight.85\textheight\else\height\fi}{%",
        r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{%",
        rf"\includegraphics{{{name}.pdf}}}}}}",
        rf"\caption{{{escape(text)}}}",
        rf"\label{{fig:phyblock-{name}}}",
        rf"\end{{figure{star}}}",
    )
    return {"txt": text + "\n", "tex": "\n".join(lines) + "\n"}
