"""Writing a site: its data first, its page last."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from phyblock.errors import Problem, SpecError, StoreError
from phyblock.files import LIST, OutFolder, digest_of_file, writing
from phyblock.records.files import RECORDS
from phyblock.records.manifest import MANIFEST
from phyblock.site.alike import check_runs_alike
from phyblock.site.board import all_values, board_of
from phyblock.site.chunks import write_chunk
from phyblock.site.entries import entries_of
from phyblock.site.page import render_page
from phyblock.site.runs import SiteRun, open_runs
from phyblock.site.samples import write_samples
from phyblock.stable import hex_digest
from phyblock.tracks.pictures import kit

__all__ = ["INDEX", "SiteWritten", "write_site"]

INDEX = "index.html"
_DATA = "data/"
_LAYOUT = 1
"""Version of the data's layout."""
_PARTIAL = re.compile(r"\.[0-9a-f]{32}\.part")


@dataclass(frozen=True)
class SiteWritten:
    """A site: its page, how many models and samples it shows, and its size without pictures."""

    path: Path
    models: int
    samples: int
    size_bytes: int
    lacking: str


def write_site(
    paths: Sequence[Path], out: Path, data: Sequence[Path] = (), title: str = "PhyBlock leaderboard"
) -> SiteWritten:
    """Put run folders and bundles into one static folder, the same bytes for the same runs.

    The page is written last and whole, so that a build that was stopped never looks like a site,
    and one that was there stays as it is until then. Raises SpecError for runs that cannot stand in
    one table, StoreError for what is no run, a bundle that does not verify, or a folder that holds
    what we did not write, DataError for a bundle whose data are not at hand.
    """
    if not paths:
        raise SpecError(Problem("site", "needs a run", allowed="run folders and bundles"))
    folder = OutFolder(out)
    _check_place(folder)
    with ExitStack() as kept:
        runs = open_runs(paths, data, kept)
        check_runs_alike(runs)
        entries = entries_of(runs)
        values = all_values(runs)
        board = board_of(runs, entries, values)
        build = _build(runs, title)
        own = f"{_DATA}{build}/"
        with folder.alone(), writing(out):
            with folder.making(own) as new:
                samples = write_samples(new, build, runs, entries, values)
                write_chunk(new, "board", build, {**board, "title": title})
                write_chunk(new, "samples", build, {**samples, "kit": kit()})
                size = sum(path.stat().st_size for path in new.iterdir())
            page = render_page(title, f"{_DATA}{build}", build)
            (path,) = folder.write({INDEX: page})
            folder.remove(name for name in folder.names(_DATA) if not name.startswith(own))
    n_samples = len(samples["rows"]["entry"])
    lacking = str(samples["lacking"])
    return SiteWritten(path, len(entries), n_samples, size + len(page.encode()), lacking)


def _check_place(folder: OutFolder) -> None:
    """Raise StoreError unless the folder is new, empty, or one that a site was written into."""
    out = folder.path
    with writing(out, "choose another folder with --out"):
        try:
            found = {entry.name for entry in os.scandir(out)}
        except FileNotFoundError:
            return
        except NotADirectoryError as error:
            raise StoreError(Problem(str(out), "is no folder")) from error
    strangers = sorted(n for n in found if n != LIST and not _PARTIAL.fullmatch(n))
    if strangers and INDEX not in folder.names(INDEX) and not folder.names(_DATA):
        shown = ", ".join(strangers[:3]) + (", ..." if len(strangers) > 3 else "")
        message, hint = "is not empty and holds no site", "name a new or an empty folder with --out"
        raise StoreError(Problem(str(out), message, found=shown, hint=hint))
    folder.check([INDEX, _DATA])


def _build(runs: Sequence[SiteRun], title: str) -> str:
    """A name for what the site shows: the same runs, written again, have the same files."""
    told: list[Any] = [_LAYOUT, version("phyblock"), title]
    for one in runs:
        digests = [digest_of_file(one.run.path / name) for name in (MANIFEST, RECORDS)]
        if one.is_verified:
            # Its manifest names this machine's data.
            digests[0] = one.run.manifest.identity
        told.append([*digests, one.is_verified, bool(one.sources.lacking)])
    return hex_digest(json.dumps(told))[:12]
