"""`phyblock figures`: a run's figures for a paper, drawn from its records."""

from __future__ import annotations

from pathlib import Path
from typing import get_args

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.names import split_names
from phyblock.cli.paths import UserPath, moved_data_option
from phyblock.errors import Problem, SpecError
from phyblock.report.figures import PAPER, Wanted, figure_names, of_models, write_paper_figures
from phyblock.tables.drawing import COLUMN_IN, WIDTH_IN, Font, Look
from phyblock.tables.load import load_run

__all__ = ["command"]

_WIDTHS_IN = {"column": COLUMN_IN, "text": WIDTH_IN}
_LEAST_MM, _MOST_MM, _MM = 60.0, 400.0, 25.4


class _Width(click.ParamType):  # type: ignore[type-arg]
    """A width by its name, or in millimeters."""

    name = "width"

    def convert(
        self, value: object, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Inches; a usage error for what is no width."""
        if isinstance(value, float):
            return value
        if str(value) in _WIDTHS_IN:
            return _WIDTHS_IN[str(value)]
        try:
            width_mm = float(str(value))
        except ValueError:
            width_mm = 0.0
        if not _LEAST_MM <= width_mm <= _MOST_MM:
            allowed = f"column, text, or {_LEAST_MM:g} to {_MOST_MM:g} millimeters"
            self.fail(f"{str(value)!r} is no width (allowed: {allowed})", param, ctx)
        return width_mm / _MM


@click.command("figures")
@click.argument("run", type=UserPath())
@click.option("--only", "names", multiple=True, metavar="NAME", help="Only this figure; repeat.")
@click.option("--models", metavar="A,B", help="Only these models.")
@click.option("--scene", default="", metavar="ID", help="The scene that figures of scenes show.")
@click.option(
    "--width",
    type=_Width(),
    metavar="column|text|MM",
    default="text",
    show_default=True,
    help=f"Width: of a column ({COLUMN_IN:g} in), of the text ({WIDTH_IN:g} in), or millimeters.",
)
@click.option(
    "--font", type=click.Choice(get_args(Font)), default="sans", show_default=True, help="Typeface."
)
@click.option("--no-title", is_flag=True, help="Leave the title to the caption.")
@click.option("--out", type=UserPath(), help=f"Folder for the files. [default: RUN/{PAPER}]")
@moved_data_option
def command(
    run: Path,
    names: tuple[str, ...],
    models: str | None,
    scene: str,
    width: float,
    font: Font,
    no_title: bool,
    out: Path | None,
    data: Path | None,
) -> None:
    """Draw figures of the folder RUN for a paper: PDF and SVG whose text is text, PNG for slides,
    and captions as plain text and as LaTeX floats.

    Draws all figures of numbers, unless you name some with --only. Name figures of scenes
    (inference, subtask-cards, perturbations) to draw them. Leaves out figures that the run has no
    numbers for. Draws a figure that cannot be read at the chosen width as wide as it needs,
    and says so.
    """
    loaded = of_models(load_run(run, texts=False), split_names(models))
    known = figure_names(loaded)
    if unknown := [name for name in names if name not in known]:
        found, allowed = ", ".join(unknown), ", ".join(known)
        raise SpecError(Problem(str(run), "has no such figure", "--only", found, allowed))
    look = Look(width, font, not no_title)
    drawn = write_paper_figures(loaded, Wanted(names, scene, data), look, out)
    console = make_console()
    for file in drawn.files:
        console.print(shown_path(file), markup=False, soft_wrap=True)
    for name, width_in in drawn.wider.items():
        wider = f"{name} is {_MM * width_in:.1f} mm wide instead of {_MM * width:g} mm"
        console.print(f"{wider}: its names and numbers need the room.", soft_wrap=True)
    if not drawn.files:
        console.print("The run has no numbers for a figure.")
