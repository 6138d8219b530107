"""Figures of a run: SVG and PNG, legible in print, for color-blind readers too."""

from phyblock.report.figures.write import (
    figure_files,
    figure_names,
    figure_titles,
    write_figures,
)

__all__ = ["figure_files", "figure_names", "figure_titles", "write_figures"]
