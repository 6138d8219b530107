"""How figures look: one type size scale, colors that color-blind readers tell apart, no clutter."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from phyblock.resources import cache_dir

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "ACCENT",
    "COLORS",
    "GRID",
    "INK",
    "MARKERS",
    "MUTED",
    "PALE",
    "WIDTH_IN",
    "bare_axes",
    "headed",
    "new_figure",
    "png_bytes",
    "styled",
    "svg_bytes",
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
"""Of the text of a two-column paper."""

_DPI = 200
_SALT = "phyblock"
_RC: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.titlesize": 8.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
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
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "svg.hashsalt": _SALT,
    "svg.fonttype": "path",
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}


@contextmanager
def styled() -> Iterator[None]:
    """Within it, figures are made and saved in the project's style, whatever the user's is.

    The list of fonts that matplotlib keeps goes into our cache folder, not into the home folder.
    """
    os.environ.setdefault("MPLCONFIGDIR", str(cache_dir() / "matplotlib"))
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update(_RC)  # type: ignore[arg-type]
        yield


def new_figure(height_in: float, width_in: float = WIDTH_IN) -> Figure:
    """An empty figure; no window, no global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width_in, height_in), layout="constrained")


def headed(figure: Figure, title: str, subtitle: str) -> None:
    """Put a title and, smaller below it, what was measured, above all axes at the left."""
    height = figure.get_figheight()
    above_in = 0.5
    engine = figure.get_layout_engine()
    assert engine is not None
    engine.set(rect=(0, 0, 1, 1 - above_in / height))  # type: ignore[call-arg]
    figure.text(0.012, 1 - 0.06 / height, title, fontsize=10.5, fontweight="bold", va="top")
    figure.text(0.012, 1 - 0.27 / height, subtitle, fontsize=7.5, color=MUTED, va="top")


def bare_axes(axes: Sequence[Axes], grid: str = "x") -> None:
    """Take the frame away but for the bottom line and put a light grid behind the data."""
    for ax in axes:
        for side in ("top", "right", "left"):
            ax.spines[side].set_visible(False)
        ax.tick_params(axis="y", length=0)
        ax.grid(axis=grid)  # type: ignore[arg-type]


def svg_bytes(figure: Figure) -> bytes:
    """The figure as SVG, the same bytes for the same numbers."""
    file = io.BytesIO()
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": "phyblock"})
    return file.getvalue()


def png_bytes(figure: Figure) -> bytes:
    """The figure as PNG at 200 dots per inch."""
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=_DPI, metadata={"Software": "phyblock"})
    return file.getvalue()
