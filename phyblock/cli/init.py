"""`phyblock init`: a working folder to start from."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import UserPath
from phyblock.files import check_free, writing
from phyblock.resources import bundled

__all__ = ["command"]

_SUITE = "quick.yaml"
_OWN_PROMPT = "prompt: ../prompts/full_planning.j2   # change it as you like\n"
_FILES = (
    ("models.yaml",),
    ("benchmarks", _SUITE),
    ("benchmarks", "schemas", "suite.schema.json"),
    ("benchmarks", "schemas", "models.schema.json"),
    ("prompts", "full_planning.j2"),
)


@click.command("init")
@click.argument("folder", type=UserPath())
def command(folder: Path) -> None:
    """Lay out FOLDER with a suite, a models file and a prompt to change.

    Files that are already there are never written over.
    """
    files = [folder.joinpath(*parts) for parts in _FILES]
    check_free(files, "choose another folder")
    console = make_console()
    with writing(folder):
        for target, parts in zip(files, _FILES, strict=True):
            target.parent.mkdir(parents=True, exist_ok=True)
            more = _OWN_PROMPT if target.name == _SUITE else ""
            with target.open("xb") as file:
                file.write(bundled(*parts).read_bytes() + more.encode())
            console.print(f"  {shown_path(target)}")
    console.print(
        f"\nNext: cd {shlex.quote(shown_path(folder))} && phyblock run benchmarks/quick.yaml\n"
        "Add a model with one line in models.yaml, then name it under models in the suite.",
        markup=False,
    )
