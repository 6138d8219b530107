r"""Captions of figures: as text, and as a LaTeX float that is read in by `\input`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phyblock.tables.drawing import COLUMN_IN, heading_of
from phyblock.tables.latex import escape
from phyblock.tables.load import Run
from phyblock.tables.showing import varied_words
from phyblock.tracks.kind import kind_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["caption_files"]

_ROUNDING_IN = 0.1


def caption_files(run: Run, name: str, figure: Figure) -> dict[str, str]:
    """The caption of a figure by ending: `txt` alone, `tex` as a float that includes NAME.pdf.

    What is wider than a column spans both. It is made smaller where the text is narrower, and where
    it would leave the page no room for its caption.
    """
    heading = heading_of(figure)
    words = [*(word for track in run.design.suite.tracks for word in _showing(run, track))]
    sentences = [heading.title, heading.subtitle[:1].upper() + heading.subtitle[1:]]
    sentences += [", ".join(dict.fromkeys((*words, *varied_words(run))))]
    text = " ".join(f"{sentence}." for sentence in sentences if sentence)
    star = "*" if figure.get_figwidth() > COLUMN_IN + _ROUNDING_IN else ""
    float_lines = (
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
    return {"txt": text + "\n", "tex": "\n".join(float_lines) + "\n"}


def _showing(run: Run, track: str) -> tuple[str, ...]:
    return kind_of(track).report().showing(run)
