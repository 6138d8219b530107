"""Figures of a run: for its report and for papers, for color-blind readers too."""

from phyblock.report.figures.choice import of_models
from phyblock.report.figures.write import (
    PAPER,
    PaperFigures,
    Wanted,
    figure_files,
    figure_names,
    figure_titles,
    write_figures,
    write_paper_figures,
)

__all__ = [
    "PAPER",
    "PaperFigures",
    "Wanted",
    "figure_files",
    "figure_names",
    "figure_titles",
    "of_models",
    "write_figures",
    "write_paper_figures",
]
