"""A finished or unfinished run as data frames: one row a sample, one row a score."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import pandas as pd

from phyblock.records.files import run_records
from phyblock.records.manifest import MANIFEST, Manifest, read_manifest
from phyblock.records.record import Record
from phyblock.tables.design import Design, SectionT, read_design, read_section
from phyblock.tables.flat import Flattened

__all__ = ["Frames", "Run", "frames_of", "load_run", "made_once", "made_once_copied"]


class Frames(NamedTuple):
    """The two frames of a run; `Run` says what they hold."""

    records: pd.DataFrame
    scores: pd.DataFrame


@dataclass(frozen=True, eq=False)
class Run:
    """A run folder, read: `manifest` is its `run.yaml`, `design` the plan in it.

    `records` has one row a sample: track, model, scene, levels, parents, n_blocks, seed, outcome,
    the reply's text, tokens, cost_usd, latency_s and so on, error, prompt, parsed plan. `scores`
    has one row a sample, criterion, matcher ("" where a criterion knows none) and setting with the
    counts tp, fp, fn, the four error types, what became of the goal's blocks and the steps that
    the nearest valid order keeps (missing where there are none). `is_cut` says that the last line
    was cut off by a kill and therefore ignored.
    """

    path: Path
    manifest: Manifest = field(repr=False)
    design: Design = field(repr=False)
    records: pd.DataFrame = field(repr=False)
    scores: pd.DataFrame = field(repr=False)
    is_cut: bool = False
    made: dict[str, pd.DataFrame] = field(default_factory=dict, repr=False, init=False)

    def section(self, key: str, model: type[SectionT]) -> SectionT:
        """A section of the run's suite, with the defaults of what it does not say.

        Fields that only another version knows are left out; StoreError for a value that is wrong.
        """
        return read_section(self.manifest.suite, key, model, str(self.path / MANIFEST))


def made_once(make: Callable[[Run], pd.DataFrame]) -> Callable[[Run], pd.DataFrame]:
    """A function of a run that works once; all its callers share the frame."""

    @functools.wraps(make)
    def made(run: Run) -> pd.DataFrame:
        name = f"{make.__module__}.{make.__qualname__}"
        if name not in run.made:
            run.made[name] = make(run)
        return run.made[name]

    return made


def made_once_copied(make: Callable[[Run], pd.DataFrame]) -> Callable[[Run], pd.DataFrame]:
    """A function of a run that works once and returns copies of its frame."""
    kept = made_once(make)

    @functools.wraps(make)
    def made(run: Run) -> pd.DataFrame:
        return kept(run).copy()

    return made


def load_run(path: str | Path, *, texts: bool = True) -> Run:
    """Read a run folder; without `texts` the replies' texts are left on disk.

    Raises StoreError for a folder that is no run, a broken `run.yaml`, or a line of `records.jsonl`
    that is corrupt, other than an unfinished last one, or of another run.
    """
    folder = Path(path)
    manifest = read_manifest(folder)
    design = read_design(manifest.fields(), str(folder / MANIFEST))
    lines = run_records(folder, manifest)
    records, scores = frames_of((record for _, record in lines), design, texts=texts)
    return Run(folder, manifest, design, records, scores, lines.is_cut)


def frames_of(records: Iterable[Record], design: Design, *, texts: bool = True) -> Frames:
    """Frames of records, each taken in and let go; a later record of a sample replaces it."""
    flattened = Flattened(texts=texts)
    for record in records:
        flattened.add(record)
    order = {name: place for place, name in enumerate(design.model_names)}
    return Frames(*flattened.frames(lambda model: order.get(model, len(order))))
