"""`phyblock init`: a working folder to start from."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.files import check_free, writing
from phyblock.resources import bundled
from phyblock.tracks import kinds

__all__ = ["command"]

_SUITE = "quick.yaml"
_FILES = (
    ("models.yaml",),
    ("benchmarks", _SUITE),
    ("benchmarks", "schemas", "suite.schema.json"),
    ("benchmarks", "schemas", "models.schema.json"),
)


@click.command("init")
@click.argument("folder", type=UserPath())
def command(folder: Path) -> None:
    """Lay out FOLDER with a suite, a models file and a prompt to change.

    Files that are already there are never written over.
    """
    (template, *_) = (kind.template for kind in kinds().values() if kind.template is not None)
    names = (*_FILES, ("prompts", template.name))
    files = [folder.joinpath(*parts) for parts in names]
    check_free(files, "choose another folder")
    console = make_console()
    own_prompt = f"prompt: ../prompts/{template.name}   # change it as you like\n"
    with writing(folder):
        for target, parts in zip(files, names, strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            more = own_prompt if target.name == _SUITE else ""
            with target.open("xb") as file:
                file.write(bundled(*parts).read_bytes() + more.encode())
            console.print(f"  {shown_path(target)}")
    console.print(
        f"\nNext: cd {shlex.quote(shown_path(folder))} && phyblock run benchmarks/quick.yaml\n"
        "Add a model with one line in models.yaml, then name it under models in the suite.",
        markup=False,
    )
