"""Figures of a run: SVG and PNG, legible in print, for color-blind readers too."""

from phyblock.report.figures.write import FIGURES, figure_files, write_figures

__all__ = ["FIGURES", "figure_files", "write_figures"]
