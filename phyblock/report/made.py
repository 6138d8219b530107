"""What was made of a run, and from what: a finished run given again makes nothing anew.

The note lies beside the records. It holds only where all that the tables, figures and page were
made from is as it was, and every file of theirs too.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import BaseModel, ConfigDict

from phyblock.files import NotRegularError, read_bytes
from phyblock.report.inputs import digest_of_file
from phyblock.report.summary import Summary
from phyblock.run.code import code_digest
from phyblock.run.store import run_folder

if TYPE_CHECKING:
    from phyblock.report.html.write import PageWritten

__all__ = ["MADE", "PAGE", "TABLES", "Made", "names_to_write", "note_made", "still_made"]

MADE = ".made.json"
PAGE = "report.html"
TABLES = "tables"
_FORMAT = 2


class Made(BaseModel):
    """A note of what was made.

    `inputs` and `code` are digests, `files` digests by name, `kept` names of pictures that only
    have to be there. `names` are those that tables, and those that figures and page may take.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    format: int
    inputs: str
    code: str
    with_page: bool
    files: Mapping[str, str]
    kept: tuple[str, ...]
    names: tuple[tuple[str, ...], tuple[str, ...]]
    summary: Summary


def _read(folder: Path) -> Made | None:
    """The note of a run folder; None where there is none, or none that can be read."""
    path = folder / MADE
    try:
        if path.is_symlink():
            return None
        made = Made.model_validate_json(read_bytes(path))
    except (OSError, ValueError):
        return None
    return made if made.format == _FORMAT else None


def still_made(folder: Path, inputs: str | None, *, page: bool) -> Made | None:
    """The note, where tables (and with `page` figures and page) of these inputs are all there."""
    made = _read(folder)
    if made is None or inputs is None or made.inputs != inputs or (page and not made.with_page):
        return None
    if any((folder / name).is_symlink() for name in (*made.files, *made.kept)):
        return None
    try:
        is_whole = all(digest_of_file(folder / name) == sha for name, sha in made.files.items())
    except (OSError, NotRegularError):
        return None
    return made if is_whole and all((folder / name).is_file() for name in made.kept) else None


def note_made(
    folder: Path,
    inputs: str | None,
    summary: Summary,
    tables: Sequence[Path],
    page: PageWritten | None,
) -> None:
    """Note what was made of `inputs`: unless these are not known, or the page lacks what a later
    writing might find.
    """
    from phyblock.report.files import files_of

    code = code_digest()
    if inputs is None or code is None or not (page is None or page.is_whole):
        return
    files = (*tables, *(page.files if page else ()))
    made = Made(
        format=_FORMAT,
        inputs=inputs,
        code=code,
        with_page=page is not None,
        files={_name(path, folder): digest_of_file(path) for path in files},
        kept=tuple(_name(path, folder) for path in page.pictures) if page else (),
        names=(files_of(page=False), files_of(page=True)),
        summary=summary,
    )
    run_folder(folder).write({MADE: made.model_dump_json()})


def _name(path: Path, folder: Path) -> str:
    return path.relative_to(folder).as_posix()


def names_to_write(folder: Path, *, page: bool) -> Sequence[str]:
    """What `files_of` says; by the note where it was written by this code, as that is quick."""
    made = _read(folder)
    if made is not None and made.code == code_digest():
        return made.names[page]
    from phyblock.report.files import files_of

    return files_of(page=page)
