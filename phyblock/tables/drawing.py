"""How figures look: one type size scale, colors that color-blind readers tell apart, no clutter."""

from __future__ import annotations

import io
import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from phyblock.resources import cache_dir

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "ACCENT",
    "COLORS",
    "COLUMN_IN",
    "GRID",
    "INK",
    "MARKERS",
    "MUTED",
    "PAGE_LOOK",
    "PALE",
    "PANEL_PT",
    "ROW_PT",
    "WIDTH_IN",
    "Font",
    "Heading",
    "Look",
    "bare_axes",
    "drawn_width_in",
    "headed",
    "heading_of",
    "legend_below",
    "name_across",
    "names_width_in",
    "new_figure",
    "pdf_bytes",
    "png_bytes",
    "styled",
    "svg_bytes",
    "text_width_in",
    "wrapped",
]

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
    """What a person may choose of how figures look: width [inches], font, title or none."""

    width_in: float = WIDTH_IN
    font: Font = "sans"
    titled: bool = True


@dataclass(frozen=True)
class Heading:
    """What stands above a figure, or in its caption: a title, and what was measured."""

    title: str
    subtitle: str


PAGE_LOOK = Look()
_LOOK: ContextVar[Look] = ContextVar("_LOOK", default=PAGE_LOOK)
_TITLE_PT, _SUBTITLE_PT, _LEGEND_PT, _AXIS_PT = 10.5, 7.5, 7.5, 8.0
ROW_PT, PANEL_PT = 7.5, 8.5
"""Sizes of the names of rows and of panels."""
_HEAD_IN = 0.5
"""Height that figures leave for a title and one line below it."""
_LINES_IN = {_TITLE_PT: 0.19, _SUBTITLE_PT: 0.14}
_MARGIN_IN = 0.08
_LEGEND_ROW_IN, _LEGEND_HANDLE_IN = 0.17, 0.5
_DPI, _PRINT_DPI = 200, 300
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
def styled(look: Look = PAGE_LOOK) -> Iterator[None]:
    """Within it, figures are made and saved in the project's style, whatever the user's is.

    The list of fonts that matplotlib keeps goes into our cache folder, not into the home folder.
    """
    os.environ.setdefault("MPLCONFIGDIR", str(cache_dir() / "matplotlib"))
    import matplotlib as mpl

    family, font = _FAMILIES[look.font]
    chosen = {**_RC, "font.family": [family], f"font.{family}": [font]}
    token = _LOOK.set(look)
    try:
        with mpl.rc_context():
            mpl.rcdefaults()
            mpl.rcParams.update(chosen)  # type: ignore[arg-type]
            yield
    finally:
        _LOOK.reset(token)


def drawn_width_in(least_in: float = 0.0) -> float:
    """The width of figures as chosen, or the least that this one can be read at [inches]."""
    return max(_LOOK.get().width_in, least_in)


def new_figure(height_in: float, least_in: float = 0.0) -> Figure:
    """An empty figure of the chosen width, no narrower than `least_in`; no window, no global state.

    `height_in` counts half an inch for a title of one line and what stands below it, which
    `headed` gives back where there is none.
    """
    from matplotlib.figure import Figure

    return Figure(figsize=(drawn_width_in(least_in), height_in), layout="constrained")


def names_width_in(names: Iterable[str]) -> float:
    """The room at the left of a figure that names of its rows take [inches]."""
    return max(text_width_in(name, ROW_PT) for name in names) + 0.25


def name_across(ax: Axes, name: str, room_in: float) -> None:
    """Name the axis across of a plot that is `room_in` wide [inches].

    A name wider than the plot ends where the plot ends, so that it is never cut.
    """
    ax.set_xlabel(name, loc="right" if text_width_in(name, _AXIS_PT) > room_in else "center")


def headed(figure: Figure, title: str, subtitle: str) -> None:
    """Put a title and, smaller below it, what was measured, above all axes at the left.

    They make the figure higher where they take several lines; without titles, it is less high, and
    they stand in the caption alone.
    """
    figure.set_label(f"{title}\n{subtitle}")
    engine = figure.get_layout_engine()
    assert engine is not None
    height, width = figure.get_figheight() - _HEAD_IN, figure.get_figwidth()
    lines = [
        (line, size, weight)
        for text, size, weight in ((title, _TITLE_PT, "bold"), (subtitle, _SUBTITLE_PT, "normal"))
        for line in wrapped(text, width - 2 * _MARGIN_IN, size, weight)
    ]
    if not _LOOK.get().titled:
        figure.set_figheight(height)
        return
    above = 0.17 + sum(_LINES_IN[size] for _, size, _ in lines)
    height += above
    figure.set_figheight(height)
    engine.set(rect=(0, 0, 1, 1 - above / height))  # type: ignore[call-arg]
    top = 0.06
    for line, size, weight in lines:
        color = INK if size == _TITLE_PT else MUTED
        place = (_MARGIN_IN / width, 1 - top / height)
        figure.text(*place, line, fontsize=size, fontweight=weight, color=color, va="top")
        top += _LINES_IN[size] + (0.02 if size == _TITLE_PT else 0)


def heading_of(figure: Figure) -> Heading:
    """What `headed` was told of a figure."""
    title, _, subtitle = str(figure.get_label()).partition("\n")
    return Heading(title, subtitle)


def text_width_in(text: str, size_pt: float, weight: str = "normal") -> float:
    """How wide a line of text is in the chosen font [inches]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=size_pt, weight=weight)
    width, _, _ = text_to_path.get_text_width_height_descent(text, font, False)
    return float(width) / 72


def wrapped(text: str, width_in: float, size_pt: float, weight: str = "normal") -> list[str]:
    """A text in lines that are no wider than `width_in` [inches], unless a word alone is."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_width_in(longer, size_pt, weight) <= width_in:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def legend_below(figure: Figure, handles: Sequence[Artist], labels: Sequence[str]) -> None:
    """A legend under all axes, in as many columns as fit; it makes the figure that much higher."""
    widest = max(text_width_in(label, _LEGEND_PT) for label in labels) + _LEGEND_HANDLE_IN
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


def svg_bytes(figure: Figure) -> bytes:
    """The figure as SVG whose text is text, the same bytes for the same numbers."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    file = io.BytesIO()
    # `savefig` would draw twice, the first time for the layout alone, which drawing makes as well.
    canvas = FigureCanvasSVG(figure)
    canvas.print_svg(  # type: ignore[no-untyped-call]
        file, metadata={"Date": None, "Creator": "phyblock"}
    )
    return file.getvalue()


def pdf_bytes(figure: Figure) -> bytes:
    """The figure as PDF with its fonts (TrueType) inside, the same bytes for the same numbers."""
    file = io.BytesIO()
    dates = {"CreationDate": None, "ModDate": None}
    figure.savefig(file, format="pdf", dpi=_PRINT_DPI, metadata={"Creator": "phyblock", **dates})
    return file.getvalue()


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG at 200 dots per inch."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=_DPI, metadata={"Software": "phyblock"})
    return file.getvalue()
