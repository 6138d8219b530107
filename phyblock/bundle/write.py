"""Making a bundle of a run."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from phyblock.bundle.about import about_text, describe
from phyblock.bundle.archive import ABOUT, pack
from phyblock.bundle.portable import portable_manifest, portable_records
from phyblock.bundle.tables import digests_of_tables
from phyblock.bundle.verify import Verified, opened_bundle
from phyblock.errors import DataError
from phyblock.files import atomic_write, write_named
from phyblock.records.files import RECORDS, read_records
from phyblock.records.manifest import MANIFEST, read_manifest
from phyblock.run.folder import run_folder
from phyblock.run.rewritten import write_run

__all__ = ["BUNDLE_FILE", "Bundled", "bundle_run"]

BUNDLE_FILE = "bundle.zip"
"""Its name in the run's folder, unless another place is named."""


@dataclass(frozen=True)
class Bundled:
    """A bundle that was written; `verified` is None where it could not be scored again here, and
    `lacking` says why.
    """

    path: Path
    size_bytes: int
    verified: Verified | None
    lacking: str = ""


def bundle_run(folder: Path, out: Path | None = None, data: Sequence[Path] = ()) -> Bundled:
    """Write a bundle of the run in `folder`, the same bytes for the same run.

    It holds the manifest, the newest record of every sample and digests; no prompts, no pictures,
    no paths of this machine, no addresses of servers. Before it is kept it is verified as
    `opened_bundle` does, where its data are at hand; `data` are folders to look for them in, beside
    where the run found them. Raises StoreError for a folder that is no run, a run whose scores do
    not come out again, or a file that cannot be written.
    """
    manifest = read_manifest(folder)
    portable = portable_manifest(manifest)
    held = (manifest.dataset, manifest.questions)
    known = [Path(one.root) for one in held if one is not None and one.root]
    with tempfile.TemporaryDirectory(prefix="phyblock-") as scratch:
        made = Path(scratch) / "run"
        records = portable_records(read_records(folder, manifest), manifest, folder)
        write_run(made, portable, records)
        tables = digests_of_tables(made)
        files = {name: (made / name).read_bytes() for name in (MANIFEST, RECORDS)}
        about = describe(portable, files, tables, version("phyblock"))
        packed = pack({**files, ABOUT: about_text(about).encode()})
        draft = Path(scratch) / BUNDLE_FILE
        atomic_write(draft, packed)
        verified, lacking = None, ""
        try:
            with opened_bundle(draft, [*data, *known], name=str(folder)) as verified:
                pass
        except DataError as error:
            lacking = str(error.problems[0])
    if out is None:
        (path,) = run_folder(folder).write({BUNDLE_FILE: packed})
    else:
        write_named(out, packed)
        path = out
    return Bundled(path, len(packed), verified, lacking)
