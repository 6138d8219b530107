"""The end of a run as the terminal shows it, kept in its folder to be shown again."""

from __future__ import annotations

import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

from phyblock.files import OutFolder, digest_of_file, load_json, read_bytes
from phyblock.records.files import PROMPTS, RECORDS, STOPPED
from phyblock.records.manifest import MANIFEST
from phyblock.registry import has_additions
from phyblock.results.text import TextTable

TABLES = "tables"
"""The folder of tables in the folder of a run."""
REPORT_FILE = "report.html"
SUMMARY = ".summary.json"
"""The file in the folder of a run that keeps its end."""


@dataclass(frozen=True)
class Summary:
    """The text that the terminal shows at the end of a run.

    Headline tables, the coverage where it is not complete, one sentence a track on the strongest
    blind baseline, and failed calls by model and message, the most frequent first.
    """

    tables: tuple[TextTable, ...] = ()
    blind: tuple[str, ...] = ()
    failures: tuple[tuple[str, str, int], ...] = ()

    def keep(self, folder: Path, made_of: list[str], files: Iterable[Path]) -> None:
        """Write the summary with the `sources` of a run and the files that were made of them."""
        kept = {
            "made_of": made_of,
            "files": [path.relative_to(folder).as_posix() for path in files],
            "tables": [table.plain() for table in self.tables],
            "blind": self.blind,
            "failures": self.failures,
        }
        OutFolder(folder).write({SUMMARY: json.dumps(kept)})


def sources(folder: Path) -> list[str]:
    """Return what tables and page are made of: version and last change of phyblock, digests of the
    files of the run; nothing where one cannot be read.
    """
    names = (MANIFEST, RECORDS, PROMPTS, STOPPED)
    with suppress(OSError, ValueError):
        code = (path for path in Path(__file__).parents[1].rglob("*") if path.suffix != ".pyc")
        changed_ns = max(path.stat().st_mtime_ns for path in code if path.is_file())
        digests = (digest_of_file(folder / name) for name in names)
        return [version("phyblock"), str(changed_ns), *digests]
    return []


def kept_summary(folder: Path, needed: str) -> Summary | None:
    """Return the kept summary; None if the run or phyblock has changed, phyblock was extended, a
    file that was made is missing, or `needed` was not made.
    """
    try:
        if has_additions():
            return None
        kept = load_json(read_bytes(folder / SUMMARY))
        is_there = all((folder / name).is_file() for name in kept["files"])
        made_of = sources(folder)
        if not is_there or not made_of or kept["made_of"] != made_of:
            return None
        if not any(name.startswith(needed) for name in kept["files"]):
            return None
        tables = tuple(TextTable.of_plain(table) for table in kept["tables"])
        failures = tuple((model, message, times) for model, message, times in kept["failures"])
        return Summary(tables, tuple(kept["blind"]), failures)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None
