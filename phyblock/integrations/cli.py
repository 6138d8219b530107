"""`phyblock export`: runs, scenes and questions as files for other tools."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import cast

import click
from click.core import ParameterSource

from phyblock.cli.console import NAME_OR_PATH, UserPath, make_console, print_path

_OF_RUN, _OF_SCENES, _OF_QUESTIONS = ("csv", "parquet", "hf"), ("hf",), ("hf", "vlmevalkit")
_HELP = "Of a run: csv, parquet, hf; of scenes: hf; of questions: hf, vlmevalkit; else lmms-eval."


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
@click.option(
    *("--size", "size_px"),
    type=click.IntRange(128, 2048),
    default=512,
    help="Edge of a picture in pixels.",
)
def export(
    run: Path | None,
    form: str,
    questions: str | None,
    scenes: bool,
    out: Path | None,
    data: str,
    limit: int | None,
    size_px: int,
) -> None:
    """Write the records of the folder RUN, or scenes or questions with their pictures, for other
    tools.

    hf: Parquet and a card, for `datasets.load_dataset`. csv, parquet: one row per sample.
    vlmevalkit: TSV files. lmms-eval: a folder for --include_path.
    """
    from phyblock.integrations import files, huggingface
    from phyblock.results.export import export_run
    from phyblock.results.load import load_run

    if (run is not None) + scenes + (questions is not None) > 1:
        raise click.UsageError("Name the folder of a run, --scenes or --questions.")
    if run is None and not scenes and questions is None and form != "lmms-eval":
        raise click.UsageError("Name the folder of a run, --scenes or --questions.")
    if run is None and out is None:
        raise click.UsageError("--out is missing: the folder to write.")
    of_others = _OF_QUESTIONS if questions else ("lmms-eval",)
    forms = _OF_RUN if run else _OF_SCENES if scenes else of_others
    if form not in forms:
        raise click.BadParameter(f"{form!r} is not one of {', '.join(forms)}.", param_hint="--to")
    of_text = ("data", "size_px") if form == "lmms-eval" else ()
    for name in ("data", "limit", "size_px") if run else of_text:
        if click.get_current_context().get_parameter_source(name) != ParameterSource.DEFAULT:
            option, kind = name.removesuffix("_px"), "a run" if run else form
            raise click.UsageError(f"--{option} says nothing of {kind}: leave it out.")
    if run is not None:
        write = huggingface.write_records if form == "hf" else partial(export_run, form=form)
        made = write(load_run(run), folder=out)
    elif scenes:
        made = huggingface.write_scenes(cast(Path, out), data, limit, size_px)
    elif questions is not None:
        write_set = huggingface.write_questions if form == "hf" else files.write_vlmevalkit
        made = write_set(cast(Path, out), questions, data, limit, size_px)
    else:
        made = files.write_lmms_eval(cast(Path, out), limit)
    for file in made:
        print_path(make_console(), file)
