"""`phyblock init`: a working folder to start from."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.config.suite import suite_tracks
from phyblock.files import check_free, writing
from phyblock.resources import bundled
from phyblock.run.preflight import bundled_suites, find_suite
from phyblock.tracks import kind_of

__all__ = ["command"]

_FILES = (
    ("models.yaml",),
    ("benchmarks", "schemas", "suite.schema.json"),
    ("benchmarks", "schemas", "models.schema.json"),
)


@click.command("init")
@click.argument("folder", type=UserPath())
@click.option(
    "--suite",
    type=click.Choice(bundled_suites()),
    default="quick",
    show_default=True,
    help="Bundled suite to begin with.",
)
def command(folder: Path, suite: str) -> None:
    """Lay out FOLDER with a suite, a models file and prompts to change.

    Never writes over files that are already there.
    """
    file_name = f"{suite}.yaml"
    templates = [kind_of(name).template for name in suite_tracks(find_suite(suite))]
    stems = [template.stem for template in templates if template is not None]
    prompts = [
        ("prompts", path.name)
        for stem in stems
        for path in sorted(bundled("prompts").glob(f"{stem}*.j2"))
    ]
    names = (*_FILES, ("benchmarks", file_name), *prompts)
    files = [folder.joinpath(*parts) for parts in names]
    check_free(files, "choose another folder")
    console = make_console()
    with writing(folder):
        for target, parts in zip(files, names, strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            with target.open("xb") as file:
                file.write(bundled(*parts).read_bytes())
            console.print(f"  {shown_path(target)}")
    console.print(
        f"\nNext: cd {shlex.quote(shown_path(folder))} && phyblock run benchmarks/{file_name}\n"
        "Add a model with one line in models.yaml, then name it under models in the suite.\n"
        "What you change under prompts/ is used by every run from here (NAME_json.j2 where a suite "
        "asks for JSON).",
        markup=False,
        soft_wrap=True,
    )
