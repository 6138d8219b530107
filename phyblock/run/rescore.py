"""Judging stored replies again with today's code: no model is called."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError

from phyblock.config.suite import Suite, suite_model
from phyblock.data import AssemblyTask, Dataset
from phyblock.errors import DataError, Problem, SpecError, StoreError
from phyblock.parsing.plan import reader_version
from phyblock.parsing.text import READER_VERSION
from phyblock.records.files import run_records
from phyblock.records.manifest import MANIFEST, Manifest, read_manifest
from phyblock.records.record import Record
from phyblock.run.data import asked_about, recorded_dataset
from phyblock.run.folder import check_place, locked, run_folder
from phyblock.run.judged_again import Tell, judged_again, untold
from phyblock.run.reopen import reopen_tracks
from phyblock.run.rewritten import write_run
from phyblock.tracks import AnyTrack, kind_of
from phyblock.tracks.counting import counts_samples
from phyblock.types import Matcher, PlanParser

if TYPE_CHECKING:
    from phyblock.run.floors import FloorValues


def rescore(
    folder: Path,
    parser: PlanParser | None,
    matcher: Matcher | None,
    out: Path | None,
    data: Path | None = None,
    tell: Tell = untold,
    watch: Callable[[int], object] = lambda _: None,
) -> Path:
    """Judge every stored reply of a run again with today's code; nobody is asked.

    Without parser, matcher and `out` the records of the run itself are replaced in one step. Else
    they go to a run folder of their own (`<run>/scores/<parser>-<matcher>` when `out` is None), so
    that tables and notebooks read them like any run. Parser and matcher are those of plans.
    `data` is where the data set is now, if it has moved. `tell` is called with what could not be
    judged again and stays as it was, `watch` with the number of samples that are done.
    Raises SpecError for a parser that cannot read what was asked for, StoreError for a folder that
    is no run or cannot be written, DataError when the data are not what the run was made on.
    """
    manifest = read_manifest(folder)
    suite = recorded_suite(folder, manifest, parser, matcher)
    in_place = parser is None and matcher is None and out is None
    name = f"scores/{suite.parser}-{suite.scoring.matchers[0]}"
    target = folder if in_place else out or folder / name
    identity = manifest.identity
    if not in_place:
        by = f"{suite.parser} {reader_version(suite.parser)}, {suite.scoring.matchers[0]}"
        identity = f"{manifest.identity} scored by {by}"
        if out is None:
            run_folder(folder).check([f"{name}/"])
        _check_target(target, identity)
    dataset = recorded_dataset(folder, manifest, suite.levels, data)
    stayed: list[str] = []
    names = [name for name in suite.tracks if kind_of(name).rescored or counts_samples(name)]
    names += _read_anew(folder, manifest, suite, names, dataset, stayed.append)
    scored = _scored(folder, manifest, suite, names, dataset, stayed.append, watch=watch)
    changes = {
        "identity": identity,
        "suite": suite.model_dump(mode="json"),
        "floors": scored.floors,
        "versions": {**manifest.versions, "readers": str(READER_VERSION)},
    }
    again = manifest.model_copy(update=changes)
    with locked(folder) if in_place else nullcontext():
        # Lines that later ones replaced stay: what they cost counts against the limit.
        replaced = _replaced(folder, manifest) if in_place else []
        write_run(target, again, [*replaced, *scored.records])
    for text in stayed:
        tell(text)
    return target


def _replaced(folder: Path, manifest: Manifest) -> list[Record]:
    """Return the records of a run that later records of the same sample replaced."""
    newest: dict[str, Record] = {}
    earlier = []
    for _, record in run_records(folder, manifest):
        if record.sample in newest:
            earlier.append(newest[record.sample])
        newest[record.sample] = record
    return earlier


def judged_anew(folder: Path) -> tuple[Manifest, list[Record]]:
    """The manifest and the newest records of a run, made again of its replies and its data.

    All tracks are judged, and what records say of their items is taken from the data, as is how
    much was to be asked. Physics is not carried out: what became of blocks that were let go is
    taken from the records. Nothing is written.
    Raises as `rescore`.
    """
    manifest = read_manifest(folder)
    suite = recorded_suite(folder, manifest)
    dataset = recorded_dataset(folder, manifest, suite.levels, None)
    scored = _scored(folder, manifest, suite, suite.tracks, dataset, untold, anew=True)
    scenes = [task.scene for task in scored.asked]
    changes = {
        "floors": scored.floors,
        "items": scored.items,
        "scenes": len(scenes),
        "scenes_by_level": {
            level: sum(level in scene.levels for scene in scenes) for level in suite.levels
        },
    }
    return manifest.model_copy(update=changes), scored.records


@dataclass(frozen=True)
class _Scored:
    """Records judged again; what floors reach, the scenes asked about, and items of each track that
    was judged.
    """

    records: list[Record]
    floors: FloorValues
    asked: Sequence[AssemblyTask]
    items: Mapping[str, int]


def _scored(
    folder: Path,
    manifest: Manifest,
    suite: Suite,
    names: Collection[str],
    dataset: Dataset,
    tell: Tell,
    *,
    anew: bool = False,
    watch: Callable[[int], object] = lambda _: None,
) -> _Scored:
    """The records of a run, those of the tracks in `names` judged again; see `judged_again`."""

    # Values of floors are computed in frames of pandas.
    from phyblock.run.floors import floor_values

    def reopened(name: str, one: Suite) -> AnyTrack:
        return reopen_tracks(folder, manifest, one, [name], dataset)[name]

    tracks = {
        variant.key: reopen_tracks(folder, manifest, suite.at(variant), names, dataset)
        for variant in dict.fromkeys(variant.shown for variant in suite.vary.variants)
    }
    records = asyncio.run(judged_again(folder, manifest, tracks, tell, anew=anew, watch=watch))
    changes = {"suite": suite.model_dump(mode="json")}
    floors = floor_values(manifest.model_copy(update=changes), suite, reopened)
    asked = asked_about(manifest, suite.levels, dataset).tasks
    items = {name: len(track.items) for name, track in tracks[""].items()}
    return _Scored(records, floors, asked, items)


def _read_anew(
    folder: Path,
    manifest: Manifest,
    suite: Suite,
    known: Collection[str],
    dataset: Dataset,
    tell: Tell,
) -> list[str]:
    """The tracks beside `known` whose replies can be read again: they are asked one by one, about
    data that are still those of the run.
    """
    names: list[str] = []
    for name in suite.tracks:
        if name in known or kind_of(name).plays:
            continue
        try:
            reopen_tracks(folder, manifest, suite, [name], dataset)
        except (DataError, SpecError) as error:
            tell(f"{kind_of(name).title}: replies stay as they were read: {error}")
        else:
            names.append(name)
    return names


def _check_target(target: Path, identity: str) -> None:
    """Raise StoreError unless `target` is new, empty or holds these scores."""
    check_place(target)
    if (target / MANIFEST).exists() and read_manifest(target).identity != identity:
        hint = "choose another folder with --out"
        raise StoreError(Problem(str(target), "holds another run", hint=hint))


def recorded_suite(
    folder: Path,
    manifest: Manifest,
    parser: PlanParser | None = None,
    matcher: Matcher | None = None,
) -> Suite:
    """The suite of the run in `folder`, with parser and headline matcher replaced where named.

    Raises StoreError for a suite that is none, SpecError for a parser that cannot read what was
    asked for.
    """
    try:
        suite = suite_model().model_validate(manifest.suite)
        matchers = suite.scoring.matchers
        if matcher is not None:
            matchers = (matcher, *(name for name in matchers if name != matcher))
        scoring = suite.scoring.model_copy(update={"matchers": matchers})
        changed = {"scoring": scoring, "parser": parser or suite.parser}
        suite = suite.model_copy(update=changed)
    except ValidationError as error:
        hint = "run.yaml is written by `phyblock run` and is never edited"
        problem = Problem(str(folder / MANIFEST), "is missing or wrong", "suite", hint=hint)
        raise StoreError(problem) from error
    if parser == "official" and suite.answer_format == "json_schema":
        message = "asked for JSON, which the official expression does not read"
        raise SpecError(Problem(str(folder), message, "--parser", parser, "steps"))
    return suite
