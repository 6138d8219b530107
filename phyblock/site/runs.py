"""Opening what a site is made of: run folders as they are, bundles that verify."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from phyblock.bundle import named, opened_bundle
from phyblock.errors import DataError, Problem, SpecError
from phyblock.report.html.sources import Sources, open_sources
from phyblock.results.load import Run, load_run

__all__ = ["SiteRun", "open_runs"]


@dataclass(frozen=True, eq=False)
class SiteRun:
    """A run that was opened: `where` is what the user calls it, `is_verified` that it came in a
    bundle and was scored again; `sources` are what can be drawn of it.
    """

    where: str
    run: Run
    is_verified: bool
    sources: Sources

    @property
    def date(self) -> str:
        """The day on which it was begun, UTC."""
        return self.run.manifest.created[:10]


def open_runs(paths: Sequence[Path], data: Sequence[Path], kept: ExitStack) -> tuple[SiteRun, ...]:
    """Open runs in the order given; bundles stay unpacked as long as `kept` is open.

    `data` are folders to look for data in, beside where runs found them and what comes with
    phyblock. Raises SpecError for a run that is given twice, StoreError for what is no run or does
    not verify, and DataError for a bundle whose data are not at hand.
    """
    opened: list[SiteRun] = []
    seen: dict[str, str] = {}
    for path in paths:
        where = str(path)
        if path.is_file():
            verified = kept.enter_context(opened_bundle(path, data))
            with named(verified.folder, where):
                run = load_run(verified.folder, texts=False)
        else:
            run = load_run(path, texts=False)
        identity = run.manifest.identity
        if identity in seen:
            message = f"is the same run as {seen[identity]}"
            raise SpecError(Problem(where, message, "identity", identity[:16], hint="give it once"))
        seen[identity] = where
        opened.append(SiteRun(where, run, path.is_file(), _sources(run, data)))
    return tuple(opened)


def _sources(run: Run, data: Sequence[Path]) -> Sources:
    """What can be drawn, from the first place that has it."""
    found = open_sources(run, None)
    for folder in data if found.lacking else ():
        try:
            return open_sources(run, folder)
        except DataError:
            continue
    return found
