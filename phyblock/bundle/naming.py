"""What goes wrong with a run that was unpacked, said of the file that it came in."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from phyblock.errors import InputError

__all__ = ["named"]


@contextlib.contextmanager
def named(folder: Path, where: str) -> Iterator[None]:
    """Let problems name `where` in the place of `folder`, which nobody has seen."""
    try:
        yield
    except InputError as error:
        place = str(folder)
        raise type(error)(
            replace(
                problem,
                where=problem.where.replace(place, where),
                message=problem.message.replace(place, where),
            )
            for problem in error.problems
        ) from error
