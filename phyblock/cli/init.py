"""`phyblock init`: a working folder to start from."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path

import click

from phyblock.cli.console import make_console, shown_path
from phyblock.errors import Problem, StoreError
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
@click.argument("folder", type=click.Path(path_type=Path))
def command(folder: Path) -> None:
    """Lay out FOLDER with a suite, a models file and a prompt to change.

    Files that are already there are never written over.
    """
    (template, *_) = (kind.template for kind in kinds().values() if kind.template is not None)
    files = (*_FILES, ("prompts", template.name))
    taken = [folder.joinpath(*parts) for parts in files if folder.joinpath(*parts).exists()]
    if taken:
        hint = "choose another folder"
        raise StoreError([Problem(str(path), "is already there", hint=hint) for path in taken])
    console = make_console()
    try:
        for parts in files:
            target = folder.joinpath(*parts)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(bundled(*parts), target)
            if target.name == _SUITE:
                with target.open("a", encoding="utf-8") as suite:
                    suite.write(f"prompt: ../prompts/{template.name}   # change it as you like\n")
            console.print(f"  {shown_path(target)}")
    except OSError as error:
        problem = Problem(str(folder), f"cannot be written: {error.strerror}")
        raise StoreError(problem) from error
    console.print(
        f"\nNext: cd {shlex.quote(shown_path(folder))} && phyblock run benchmarks/quick.yaml\n"
        "Add a model with one line in models.yaml, then name it under models in the suite.",
        markup=False,
    )
