"""Reading and scoring stored replies again: no model is called, nothing stored is changed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import yaml
from pydantic import ValidationError

from phyblock.datasets import AssemblyTask
from phyblock.errors import DataError, Problem, StoreError
from phyblock.files import atomic_write, writing
from phyblock.parsing import reader_version
from phyblock.records import MANIFEST, RECORDS, Manifest, Record, read_manifest
from phyblock.records.reading import read_records
from phyblock.run.data import open_dataset
from phyblock.run.folder import check_place, run_folder
from phyblock.run.records import judged
from phyblock.specs import SuiteSpec, suite_model
from phyblock.tracks import kinds
from phyblock.tracks.selection import select_tasks
from phyblock.words import Matcher, PlanParser

__all__ = ["rescore"]


def rescore(
    folder: Path,
    parser: PlanParser | None,
    matcher: Matcher | None,
    out: Path | None,
    data: Path | None = None,
) -> Path:
    """Score a run again, with another parser or headline matcher, into a run folder of its own.

    The new folder (`<run>/scores/<parser>-<matcher>` when `out` is None) holds a manifest and
    records like any run, so that tables and notebooks read it. Parser and matcher are those of
    plans: records of other tracks are taken over as they are. `data` is where the data set is now,
    if it has moved. Raises StoreError for a folder that is no run or cannot be written, DataError
    when the data set is not what the run was made on.
    """
    manifest = read_manifest(folder)
    suite = _suite(folder, manifest, parser, matcher)
    name = f"scores/{suite.parser}-{suite.scoring.matchers[0]}"
    target = out or folder / name
    by = f"{suite.parser} {reader_version(suite.parser)}, {suite.scoring.matchers[0]}"
    identity = f"{manifest.identity} scored by {by}"
    if out is None:
        run_folder(folder).check([f"{name}/"])
    _check_target(target, identity)
    tasks = _tasks(folder, manifest, suite, data)
    rescored = {kind.name: kind.rescored for kind in kinds().values() if kind.rescored is not None}
    tracks = {name: rescored[name](suite, tasks) for name in suite.tracks if name in rescored}
    items = {(name, item.key): item for name, track in tracks.items() for item in track.items}
    records: list[Record] = []
    for record in read_records(folder, manifest):
        track = tracks.get(record.track)
        if track is None:
            records.append(record)
            continue
        item = items.get((track.name, record.item))
        if item is None:
            where, hint = str(folder / RECORDS), "the file was changed: restore it from a copy"
            raise StoreError(
                Problem(where, "names a scene that the run has not", "scene", record.scene,
                        hint=hint)
            )  # fmt: skip
        judgement = track.judge(item, None if record.reply is None else record.reply.text)
        records.append(judged(record.as_given(), item, judgement))
    told = {"identity": identity, "suite": suite.model_dump(mode="json")}
    _write(target, manifest.model_copy(update=told), records)
    return target


def _check_target(target: Path, identity: str) -> None:
    """Raise StoreError unless `target` is new, empty or holds these scores."""
    check_place(target)
    if (target / MANIFEST).exists() and read_manifest(target).identity != identity:
        hint = "choose another folder with --out: what a run stored is never changed"
        raise StoreError(Problem(str(target), "holds another run", hint=hint))


def _suite(
    folder: Path,
    manifest: Manifest,
    parser: PlanParser | None,
    matcher: Matcher | None,
) -> SuiteSpec:
    """The run's suite with parser and headline matcher replaced."""
    try:
        suite = suite_model().model_validate(manifest.suite)
        matchers = suite.scoring.matchers
        if matcher is not None:
            matchers = (matcher, *(name for name in matchers if name != matcher))
        scoring = suite.scoring.model_copy(update={"matchers": matchers})
        return suite.model_copy(update={"scoring": scoring, "parser": parser or suite.parser})
    except ValidationError as error:
        raise _broken(folder, "suite") from error


def _tasks(
    folder: Path, manifest: Manifest, suite: SuiteSpec, data: Path | None
) -> tuple[AssemblyTask, ...]:
    """The tasks of the run, known to be those that it was made on."""
    recorded = manifest.dataset
    if recorded is None:
        raise _broken(folder, "dataset")
    hint = "name the folder where it is now with --data"
    root = data or Path(recorded.root)
    if not root.is_dir():
        raise DataError(Problem(str(root), "the data set of the run is not there", hint=hint))
    dataset = open_dataset(suite.dataset.format, root)
    dataset = replace(dataset, tasks=select_tasks(dataset.tasks, suite.levels, manifest.limit))
    if dataset.sha256 != recorded.sha256:
        message = "is not the data set that the run was made on, or it was changed since"
        raise DataError(
            Problem(str(root), message, "sha256", dataset.sha256, recorded.sha256, hint)
        )
    return dataset.tasks


def _broken(folder: Path, field: str) -> StoreError:
    hint = "run.yaml is written by `phyblock run` and is never edited"
    return StoreError(Problem(str(folder / MANIFEST), "is missing or wrong", field, hint=hint))


def _write(folder: Path, manifest: Manifest, records: Sequence[Record]) -> None:
    lines = (json.dumps(r.fields(), ensure_ascii=False, separators=(",", ":")) for r in records)
    texts = {
        MANIFEST: yaml.safe_dump(manifest.fields(), sort_keys=False, allow_unicode=True, width=100),
        RECORDS: "".join(line + "\n" for line in lines),
    }
    run_folder(folder).begin()
    with writing(folder):
        for name, text in texts.items():
            atomic_write(folder / name, text)
