"""A finished or unfinished run as data frames: one row a sample, one row a score."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from phyblock.errors import Problem, StoreError
from phyblock.run.reading import MANIFEST, RecordLines, read_manifest
from phyblock.tables.design import Design, read_design
from phyblock.tables.flat import TEXTS, flat_record, flat_scores, frame_of

__all__ = ["Frames", "Run", "frames_of", "load_run", "once_per_run"]


class Frames(NamedTuple):
    """The two frames of a run; `Run` says what they hold."""

    records: pd.DataFrame
    scores: pd.DataFrame


@dataclass(frozen=True, eq=False)
class Run:
    """A run folder, read: `manifest` is its `run.yaml`, `design` the part that tables need.

    `records` has one row a sample: track, model, scene, levels, parents, n_blocks, seed, outcome,
    the reply's text, tokens, cost_usd, latency_s and so on, error, prompt, parsed plan. `scores`
    has one row a sample, criterion, matcher ("" where a criterion knows none) and setting with the
    counts tp, fp, fn and the four error types (missing where there are none). `is_cut` says
    that the last line was cut off by a kill and therefore ignored.
    """

    path: Path
    manifest: dict[str, Any] = field(repr=False)
    design: Design = field(repr=False)
    records: pd.DataFrame = field(repr=False)
    scores: pd.DataFrame = field(repr=False)
    is_cut: bool = False
    made: dict[str, pd.DataFrame] = field(default_factory=dict, repr=False, init=False)


def once_per_run(make: Callable[[Run], pd.DataFrame]) -> Callable[[Run], pd.DataFrame]:
    """A function of a run that works once and returns copies of its frame after that."""

    @functools.wraps(make)
    def made(run: Run) -> pd.DataFrame:
        name = f"{make.__module__}.{make.__qualname__}"
        if name not in run.made:
            run.made[name] = make(run)
        return run.made[name].copy()

    return made


def load_run(path: str | Path, *, texts: bool = True) -> Run:
    """Read a run folder; without `texts` the replies' texts are left on disk.

    Raises StoreError for a folder that is no run, a broken `run.yaml`, or a corrupt line of
    `records.jsonl` other than an unfinished last one.
    """
    folder = Path(path)
    manifest = read_manifest(folder)
    design = read_design(manifest, str(folder / MANIFEST))
    lines = RecordLines(folder)
    records, scores = frames_of(lines, design, texts=texts)
    return Run(folder, manifest, design, records, scores, lines.is_cut)


def frames_of(
    records: Iterable[tuple[str, Mapping[str, Any]]], design: Design, *, texts: bool = True
) -> Frames:
    """Frames of records, each with where it stands; a later record of a sample replaces it.

    Raises StoreError for a record that lacks what tables need.
    """
    samples: dict[str, tuple[dict[str, Any], list[dict[str, Any]]]] = {}
    for where, record in records:
        row, scores = _flatten(where, record)
        if not texts:
            row.update(dict.fromkeys(TEXTS))
        samples[row["sample"]] = (row, scores)
    order = {name: place for place, name in enumerate(design.model_names)}
    rows = sorted(
        samples.values(),
        key=lambda sample: (
            sample[0]["track"],
            order.get(sample[0]["model"], len(order)),
            sample[0]["model"],
            sample[0]["scene"],
            sample[0]["seed"],
            sample[0]["sample"],
        ),
    )
    return Frames(
        frame_of("records", [row for row, _ in rows]),
        frame_of("scores", [score for _, scores in rows for score in scores]),
    )


def _flatten(where: str, record: Mapping[str, Any]) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    try:
        return flat_record(record), flat_scores(record)
    except KeyError as error:
        problem = Problem(where, f"the record has no {error}", hint=_HINT)
    except (TypeError, ValueError, AttributeError) as error:
        problem = Problem(where, f"the record is not in the run format: {error}", hint=_HINT)
    raise StoreError(problem)


_HINT = "remove this line; the next `phyblock run` asks for the sample again"
