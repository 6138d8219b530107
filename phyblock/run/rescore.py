"""Rescoring: judge stored replies with today's code; no model is called."""

from __future__ import annotations

import asyncio
import contextlib
import functools
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import takewhile, tee
from pathlib import Path
from typing import Any

from phyblock.config.suite import Suite, SuiteFiles
from phyblock.config.yaml import YamlSource
from phyblock.data.base import Dataset
from phyblock.data.lookup import open_dataset
from phyblock.errors import DataError, Problem, StoreError
from phyblock.records.files import MANIFEST, Manifest, read_manifest, run_records, suite_of
from phyblock.records.record import AskedTurn, Record, StoredError
from phyblock.run.manifest import asked_counts, code_versions
from phyblock.run.store import about_item, judge_reply, judged, locked, write_run
from phyblock.text import counted
from phyblock.tracks.base import ENGINE, EXECUTION, Item, Track, kind_of, open_tracks, select_tasks
from phyblock.workers import Workers

_CHANGED = "is not the data set that the run was made on, or it was changed since"
_MOVED = "name the folder where it is now with --data"
_STALE = "remove the folder of shards beside the run, and score again"
_Judged = tuple[Record, Record]
"""A stored record, and the rescored one."""
_NO_DATA = ("prompt", "pictures", EXECUTION, ENGINE)
"""Parts of a track's identity that are not the data that it asks about."""


def rescore(
    folder: Path,
    data: Path | None = None,
    report: Callable[[str], object] = lambda _: None,
    watch: Callable[[Iterable[_Judged]], Iterable[_Judged]] = iter,
    workers: Workers | None = None,
) -> None:
    """Rescore every stored reply of a run and replace its records in one step.

    `data` is the data set's new place, if it has moved. An episode in which today's code would ask
    something else is kept, but is no longer final: `report` gets a sentence on their number;
    `watch` wraps records as they are rescored. Of `workers`, only the first shard writes. Raises
    StoreError if the folder is no run or cannot be written, DataError if the data are not its own.
    """
    diverged: Counter[str] = Counter()
    writes = workers is None or workers.shards is None or workers.shards.writes

    def records(judge: _Judge) -> Iterator[Record]:
        share = map if workers is None else workers.map
        work: Callable[[tuple[str, Record]], _Judged] = judge
        if workers is not None and not workers.is_here:
            place = None if data is None else data.resolve()
            work = functools.partial(_judge_there, folder.resolve(), place)
        lines, stored = tee(run_records(folder, judge.manifest, whole=True))
        for record, again in watch(share(work, lines)):
            where, now = next(stored, (str(folder), None))
            # Answers of an earlier job about this run may be kept in its folder of shards.
            if record != now and writes:
                raise StoreError(Problem(where, "is not the record that was scored", hint=_STALE))
            diverged[record.track] += again.error is not None and record.error is None
            yield again
        if writes and next(stored, None) is not None:
            raise StoreError(Problem(str(folder), "has new records", hint=_STALE))

    with contextlib.closing(_Judge(folder, data)) as judge:
        if not writes:
            for _ in records(judge):
                pass
            return
        versions = {**judge.manifest.versions, **code_versions()}
        manifest = judge.manifest.model_copy(update={"versions": versions})
        with locked(folder):
            write_run(folder, manifest, records(judge))
    for name, count in (+diverged).items():
        report(
            f"{kind_of(name).title}: in {counted(count, 'episode')} this version would have asked "
            "something else; phyblock run continues from there"
        )


def rescored(folder: Path) -> tuple[Manifest, Iterator[Record]]:
    """Return the manifest of a run and a rescored record for each line, from replies and data.

    Facts about items come from the data, falls and final poses from the records. Nothing is
    written. Raises as `rescore`, and StoreError if an episode would take another course.
    """
    judge = _Judge(folder, strict=True)

    def records() -> Iterator[Record]:
        with contextlib.closing(judge):
            for line in run_records(folder, judge.manifest):
                yield judge(line)[1]

    changes = asked_counts(judge.suite, judge.asked, judge.tracks[""].values())
    return judge.manifest.model_copy(update=changes), records()


def recorded_dataset(folder: Path, manifest: Manifest, data: Path | None = None) -> Dataset:
    """Return the whole data set of the run in `folder`, from `data` or the path in the manifest.

    Raises DataError if the manifest names none, or the data that the run asked about have changed.
    """
    recorded = manifest.dataset
    if recorded is None:
        raise DataError(Problem(str(folder / MANIFEST), "names no data set", "dataset"))
    root = data or Path(recorded.root)
    if not root.is_dir():
        raise DataError(Problem(str(root), "the data set of the run is not there", hint=_MOVED))
    dataset = open_dataset(recorded.format, root)
    digest = _asked_about(manifest, suite_of(manifest, str(folder / MANIFEST)), dataset).sha256
    if digest != recorded.sha256:
        raise DataError(Problem(str(root), _CHANGED, "sha256", digest, recorded.sha256, _MOVED))
    return dataset


def _asked_about(manifest: Manifest, suite: Suite, dataset: Dataset) -> Dataset:
    """Return the part of a data set that a run asks about."""
    return replace(dataset, tasks=select_tasks(dataset.tasks, suite, manifest.limit))


def reopen_tracks(
    folder: Path, manifest: Manifest, suite: Suite, dataset: Dataset
) -> tuple[Track, ...]:
    """Return a run's tracks without prompts. Raises DataError if data of one are not the run's."""
    path = folder / MANIFEST
    folders: dict[str, Path] = {}
    if manifest.questions is not None:
        own = (name for name in suite.tracks if kind_of(name).has_own_data())
        folders = dict.fromkeys(own, Path(manifest.questions.root))
    suite = suite.with_files(SuiteFiles(path, dataset.root, YamlSource(str(path)), folders))
    tracks = open_tracks(suite, dataset, manifest.limit)
    for track in tracks:
        stored = manifest.tracks.get(track.name, {})
        for key, value in track.identity().items():
            # Prompts and pictures are not data, and are not needed.
            if key not in _NO_DATA and value not in (None, stored.get(key)):
                root, field = folders.get(track.name, dataset.root), f"tracks.{track.name}.{key}"
                was = str(stored.get(key))
                raise DataError(Problem(str(root), _CHANGED, field, str(value), was))
    return tracks


class _Judge:
    """Rescores records of a run; if `strict`, raises StoreError where an episode would differ."""

    def __init__(self, folder: Path, data: Path | None = None, *, strict: bool = False) -> None:
        self.manifest = manifest = read_manifest(folder)
        self.suite = suite = suite_of(manifest, str(folder / MANIFEST))
        dataset = recorded_dataset(folder, manifest, data)
        self.asked = _asked_about(manifest, suite, dataset)
        self.tracks: dict[str, dict[str, Track]] = {}
        for one in dict.fromkeys(variant.shown for variant in suite.vary.variants):
            tracks = reopen_tracks(folder, manifest, suite.at(one), dataset)
            self.tracks[one.key] = {track.name: track for track in tracks}
        self._items = {
            (name, item.key): item for name, one in self.tracks[""].items() for item in one.items
        }
        self._strict = strict
        self._thread = ThreadPoolExecutor(1)  # The thread of a notebook already has a loop.

    def __call__(self, line: tuple[str, Record]) -> _Judged:
        """Return the record of a line, as stored and rescored."""
        where, record = line
        track = self.tracks.get(record.way.shown.key, {}).get(record.track)
        item = self._items.get((record.track, record.item))
        if track is None or item is None:
            message = "names an item or a condition that the run does not have"
            hint = "restore the file from a copy"
            raise StoreError(Problem(where, message, "sample", record.sample, hint=hint))
        shown = track.shown(item, record.seed)
        work = _again(track, shown, record, where, strict=self._strict)
        return record, self._thread.submit(asyncio.run, work).result()

    def close(self) -> None:
        self._thread.shutdown()
        for of_condition in self.tracks.values():
            for track in of_condition.values():
                track.close()


_judge_of = functools.lru_cache(maxsize=1)(_Judge)
"""The judge of a worker process, opened once."""


def _judge_there(folder: Path, data: Path | None, line: tuple[str, Record]) -> _Judged:
    return _judge_of(folder, data)(line)


async def _again(track: Track, item: Item, record: Record, where: str, *, strict: bool) -> Record:
    given = {**record.as_given(), **about_item(track, item)}
    if "engine" in record.model_fields_set:
        # Nothing is simulated again: the record holds what fell, and with which engine.
        given["engine"] = record.as_given()["engine"]
    if not track.plays:
        if record.is_judged:
            return await judge_reply(track, item, given, record)
        # The record holds no executed plan.
        return await judge_reply(track, item, {**given, "error": None})
    episode = track.start(item, record.seed, {}, with_messages=False, earlier=record)
    asked = record.asked_turns
    for turn in asked:
        if await episode.request() is None:
            break
        episode.take(turn.reply, turn.prompt)
    # The effect of the last reply shows at the next request, when blocks are released.
    goes_on = await episode.request() is not None
    again = judged(track, item, given, episode.judgement())
    pairs = zip(map(_decided, asked), map(_decided, again.asked_turns), strict=False)
    same = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    if same == len(asked) and not (goes_on and record.error is None):
        return again
    if strict:
        message = "takes another course: another version of phyblock made it"
        hint = "use the version of phyblock that made the run"
        raise StoreError(Problem(where, message, "turns", record.sample, hint=hint))
    message = f"this version sends other requests from turn {same + 2} on"
    error = StoredError(kind="retryable", message=message)
    return record.model_copy(update={"error": error, "outcome": "api_error"})


def _decided(turn: AskedTurn) -> dict[str, Any]:
    """Return the result of a turn, without the rule that parsed its reply."""
    fields = set(type(turn).model_fields) - {"reply", "prompt"}
    return turn.model_dump(include=fields, exclude={"parse": {"rule"}}, exclude_none=True)
