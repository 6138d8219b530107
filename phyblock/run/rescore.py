"""Reading and scoring stored replies again: no model is called, nothing stored is changed."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import ValidationError

from phyblock.datasets import AssemblyTask, Dataset
from phyblock.errors import DataError, Problem, SpecError, StoreError
from phyblock.parsing import READER_VERSION, reader_version
from phyblock.plain_text import counted
from phyblock.records import MANIFEST, RECORDS, Manifest, Record, read_manifest
from phyblock.records.reading import read_records
from phyblock.run.data import asked_about, recorded_dataset
from phyblock.run.folder import check_place, run_folder
from phyblock.run.judging import judged_apart
from phyblock.run.kept_floors import kept_floors
from phyblock.run.records import about_item
from phyblock.run.reopen import reopen_tracks
from phyblock.run.replayed import counted_again
from phyblock.run.rewritten import write_run
from phyblock.specs import SuiteSpec, suite_model
from phyblock.tracks import AnyTrack, EpisodeTrack, kind_of, shown_item
from phyblock.tracks.counting import counts_samples
from phyblock.variants import Variant
from phyblock.words import Matcher, PlanParser

if TYPE_CHECKING:
    from phyblock.run.floors import FloorValues

__all__ = ["judged_anew", "recorded_suite", "rescore"]


def rescore(
    folder: Path,
    parser: PlanParser | None,
    matcher: Matcher | None,
    out: Path | None,
    data: Path | None = None,
    tell: Callable[[str], object] = lambda _: None,
) -> Path:
    """Score a run again, with another parser or headline matcher, into a run folder of its own.

    The new folder (`<run>/scores/<parser>-<matcher>` when `out` is None) holds a manifest and
    records like any run, so that tables and notebooks read it. Parser and matcher are those of
    plans. Of other tracks, what measures count of each sample is counted again; where nothing is,
    their records are taken over as they are, unless an earlier version of the readers read them.
    `data` is where the data set is now, if it has moved. `tell` is called with what could not be
    read again and stays as it was.
    Raises SpecError for a parser that cannot read what was asked for, StoreError for a folder that
    is no run or cannot be written, DataError when the data are not what the run was made on.
    """
    manifest = read_manifest(folder)
    suite = recorded_suite(folder, manifest, parser, matcher)
    name = f"scores/{suite.parser}-{suite.scoring.matchers[0]}"
    target = out or folder / name
    by = f"{suite.parser} {reader_version(suite.parser)}, {suite.scoring.matchers[0]}"
    identity = f"{manifest.identity} scored by {by}"
    if out is None:
        run_folder(folder).check([f"{name}/"])
    _check_target(target, identity)
    dataset = recorded_dataset(folder, manifest, suite.levels, data)
    names = [name for name in suite.tracks if kind_of(name).rescored or counts_samples(name)]
    if _read_otherwise(manifest):
        names += _read_anew(folder, manifest, suite, names, dataset, tell)
    scored = _scored(folder, manifest, suite, names, dataset, tell)
    told = {"identity": identity, "suite": suite.model_dump(mode="json"), "floors": scored.floors}
    write_run(target, manifest.model_copy(update=told), scored.records)
    return target


def judged_anew(folder: Path) -> tuple[Manifest, list[Record]]:
    """The manifest and the newest records of a run, made again of its replies and its data.

    All tracks are judged, and what records say of their items is taken from the data, as is how
    much was to be asked. Physics is not carried out: what became of blocks that were let go is
    taken from the records. Nothing is written.
    Raises as `rescore`.
    """
    manifest = read_manifest(folder)
    suite = recorded_suite(folder, manifest)
    scored = _scored(folder, manifest, suite, suite.tracks, None, anew=True)
    scenes = [task.scene for task in scored.asked]
    told = {
        "floors": scored.floors,
        "items": scored.items,
        "scenes": len(scenes),
        "scenes_by_level": {
            level: sum(level in scene.levels for scene in scenes) for level in suite.levels
        },
    }
    return manifest.model_copy(update=told), scored.records


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
    suite: SuiteSpec,
    names: Collection[str],
    dataset: Dataset,
    tell: Callable[[str], object] | None,
) -> _Scored:
    """The records of a run, those of the tracks in `names` judged again; see `_judged_again`."""

    def reopened(name: str, one: SuiteSpec) -> AnyTrack:
        return reopen_tracks(folder, manifest, one, [name], dataset)[name]

    tracks = {
        variant.key: reopen_tracks(folder, manifest, suite.at(variant), names, dataset)
        for variant in dict.fromkeys(variant.shown for variant in suite.vary.variants)
    }
    records = asyncio.run(_judged_again(folder, manifest, tracks, tell))
    told = {"suite": suite.model_dump(mode="json")}
    floors = kept_floors(manifest.model_copy(update=told), suite, reopened, dataset)
    asked = asked_about(manifest, suite.levels, dataset).tasks
    items = {name: len(track.items) for name, track in tracks[""].items()}
    return _Scored(records, floors, asked, items)


async def _judged_again(
    folder: Path,
    manifest: Manifest,
    variants: Mapping[str, Mapping[str, AnyTrack]],
    tell: Callable[[str], object] | None,
) -> list[Record]:
    """The records of a run, those of the tracks of `variants` judged again.

    Without `tell` they are made anew, as `judged_anew` says. Else it is told of episodes that stay
    as they were, since readers of this version would have played them otherwise.
    """
    anew = tell is None
    or_kept = not anew and _read_otherwise(manifest)
    kept: Counter[str] = Counter()
    where = str(folder / RECORDS)
    tracks = variants[""]
    items = {(name, item.key): item for name, track in tracks.items() for item in track.items}
    records: list[Record] = []
    for record in read_records(folder, manifest):
        track = variants[_variant(record, variants, where).shown.key].get(record.track)
        if track is None:
            records.append(record)
            continue
        item = items.get((track.name, record.item))
        if item is None:
            message, hint = "names an item that the run has not", "restore the file from a copy"
            raise StoreError(Problem(where, message, "key", record.item, hint=hint))
        item = shown_item(track, item, record.seed)
        about = {**about_item(item), **track.about(item)} if anew else None
        if isinstance(track, EpisodeTrack):
            again = await counted_again(track, item, record, where, about, or_kept=or_kept)
            kept[track.name] += again is record
            records.append(again)
            continue
        text = None if record.reply is None else record.reply.text
        given = {**record.as_given(), **(about or {})}
        earlier: Record | None = record
        if not record.is_judged:
            # What it holds is of no plan that was carried out.
            given["error"] = earlier = None
        records.append(await judged_apart(track, item, text, given, earlier))
    for name, count in kept.items():
        if count and tell is not None:
            tell(
                f"{kind_of(name).title}: {counted(count, 'episode')} of the run would go otherwise "
                f"under readers {READER_VERSION}, and stay as they were: what was asked next "
                "followed from what was read. A run in another folder asks on from there."
            )
    return records


def _read_otherwise(manifest: Manifest) -> bool:
    """Whether readers of another version read the replies of a run."""
    return manifest.versions.get("readers") != str(READER_VERSION)


def _read_anew(
    folder: Path,
    manifest: Manifest,
    suite: SuiteSpec,
    known: Collection[str],
    dataset: Dataset,
    tell: Callable[[str], object],
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


def _variant(record: Record, known: Collection[str], where: str) -> Variant:
    """The way of asking of a record; StoreError for one that the run has not."""
    variant = record.way
    if variant.shown.key not in known:
        message, hint = "was asked in no way of the run", "restore the file from a copy"
        raise StoreError(Problem(where, message, "variant", variant.key, hint=hint))
    return variant


def _check_target(target: Path, identity: str) -> None:
    """Raise StoreError unless `target` is new, empty or holds these scores."""
    check_place(target)
    if (target / MANIFEST).exists() and read_manifest(target).identity != identity:
        hint = "choose another folder with --out: what a run stored is never changed"
        raise StoreError(Problem(str(target), "holds another run", hint=hint))


def recorded_suite(
    folder: Path,
    manifest: Manifest,
    parser: PlanParser | None = None,
    matcher: Matcher | None = None,
) -> SuiteSpec:
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
