"""`phyblock export`: runs, scenes and questions as files for other tools."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

import click

from phyblock.cli.console import NAME_OR_PATH, UserPath, make_console, print_path

_HELP = "Of a run: csv, hf; of scenes: hf; of questions: hf, vlmevalkit; else lmms-eval."


@click.command()
@click.argument("run", type=UserPath(), required=False)
@click.option("--to", "form", required=True, metavar="FORMAT", help=_HELP)
@click.option(
    "--questions",
    is_flag=False,
    flag_value="phyblock-vqa",
    metavar="[SET]",
    help="Write questions with their pictures: a folder, or a bundled set.",
)
@click.option("--scenes", is_flag=True, help="Write scenes with their pictures.")
@click.option("--out", type=UserPath(), metavar="DIR", help="Folder. [default: RUN/export/FORMAT]")
@click.option(
    "--data", type=NAME_OR_PATH, default="phyblock-400", help="The scenes, and those of questions."
)
@click.option("--limit", type=click.IntRange(min=1), help="N, spread over levels or subtasks.")
def export(
    run: Path | None,
    form: str,
    questions: str | None,
    scenes: bool,
    out: Path | None,
    data: str,
    limit: int | None,
) -> None:
    """Write records of the folder RUN, or scenes or questions with pictures, for other tools.

    hf: Parquet and a card, for `datasets.load_dataset`. csv: one row per sample. vlmevalkit: a TSV
    file. lmms-eval: a folder for --include_path.
    """
    from phyblock.integrations import files
    from phyblock.results.load import load_run
    from phyblock.results.tables import export_frame, write_csv

    named = (run is not None) + scenes + (questions is not None)
    if form == "lmms-eval" and named:
        raise click.UsageError("lmms-eval gets tasks: name no run, --scenes or --questions.")
    if form != "lmms-eval" and named != 1:
        raise click.UsageError("Name the folder of a run, --scenes or --questions.")
    if run is not None and limit is not None:
        raise click.UsageError("--limit is for scenes, questions and tasks.")
    makers: dict[str, Callable[[], Sequence[Path]]] = {}
    if run is not None:
        loaded, folder = load_run(run), out or run / "export" / form
        makers["csv"] = partial(write_csv, loaded, folder)
        makers["hf"] = lambda: files.write_parquet(folder, "records", export_frame(loaded))
    elif out is None:
        raise click.UsageError("--out is missing: the folder to write.")
    elif scenes:
        makers["hf"] = partial(files.write_scenes, out, data, limit)
    elif questions is not None:
        asked = (out, questions, data, limit)
        makers["hf"] = partial(files.write_questions, *asked)
        makers["vlmevalkit"] = partial(files.write_vlmevalkit, *asked)
    else:
        makers["lmms-eval"] = partial(files.write_lmms_eval, out, limit)
    if form not in makers:
        raise click.BadParameter(f"{form!r} is not one of {', '.join(makers)}.", param_hint="--to")
    for file in makers[form]():
        print_path(make_console(), file)
