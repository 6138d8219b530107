"""`phyblock export`: runs, scenes and questions as files of other tools."""

from __future__ import annotations

from pathlib import Path

import click

from phyblock.cli.console import make_console, print_path
from phyblock.cli.options import NAME_OR_PATH, UserPath

_FORMS = {"a run": "csv, parquet, hf", "scenes": "hf", "questions": "hf, vlmevalkit",
          "tasks": "lmms-eval"}  # fmt: skip


@click.command()
@click.argument("run", type=UserPath(), required=False)
@click.option(
    *("--to", "form"),
    required=True,
    metavar="FORMAT",
    help="; ".join(f"of {what}: {forms}" for what, forms in _FORMS.items()) + ".",
)
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
    """Write the records of the folder RUN, or scenes or questions with their pictures, for others.

    hf: Parquet and a card, as `datasets.load_dataset` reads a folder. csv, parquet: a row a sample.
    vlmevalkit: TSV files. lmms-eval: a folder for --include_path.
    """
    from phyblock.integrations import files, huggingface
    from phyblock.results.export import export_run
    from phyblock.results.load import load_run

    what = "a run" if run else "scenes" if scenes else "questions" if questions else "tasks"
    if (run is not None) + scenes + (questions is not None) > 1:
        raise click.UsageError("Name the folder of a run, --scenes or --questions.")
    if form not in _FORMS[what].split(", "):
        message = f"{form!r} is not one of {_FORMS[what]}, the formats of {what}."
        raise click.BadParameter(message, param_hint="--to")
    if run is not None:
        write = huggingface.write_records if form == "hf" else None
        made = write(load_run(run), out) if write else export_run(load_run(run), form, out)
    elif out is None:
        raise click.UsageError(f"{what.capitalize()} need --out: the folder to write.")
    elif scenes:
        made = huggingface.write_scenes(out, data, limit, size_px)
    elif questions is None:
        made = files.write_lmms_eval(out, limit)
    else:
        write_set = huggingface.write_questions if form == "hf" else files.write_vlmevalkit
        made = write_set(out, questions, data, limit, size_px)
    for file in made:
        print_path(make_console(), file)
