"""The plan of a run: a suite with its data read, its models and tracks resolved."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path

from phyblock.config.models import RECORDED, ModelConfig, with_members
from phyblock.config.suite import Suite, Variant
from phyblock.data import SCENES_FILE, Dataset, read_builtin, read_official
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models import Request
from phyblock.records.manifest import MANIFEST, Manifest
from phyblock.registry import track_baselines
from phyblock.resources import bundled_sets
from phyblock.run.manifest import make_manifest
from phyblock.run.models import (
    PlannedModel,
    plan_extractor,
    plan_models,
    recorded_as,
    with_baselines,
)
from phyblock.stable import drawn_bytes
from phyblock.tracks import AnyTrack, EpisodeTrack, Item, Opening, kind_of, open_tracks
from phyblock.tracks.items import interleaved, select_tasks

_SEEDS = 2**31
"""Providers take no larger ones."""


@dataclass(frozen=True)
class Sample:
    """One item of a track, asked of one model with one seed; `track` asks as the variant does."""

    track: AnyTrack
    model: str
    item: Item
    seed: int
    variant: Variant = field(default_factory=Variant)

    @property
    def id(self) -> str:
        """Its name inside the run."""
        whole = f"{self.track.name}/{self.model}/{self.item.key}/s{self.seed}"
        return f"{whole}/{self.variant.key}" if self.variant.key else whole

    def asking(self, request: Request) -> Request:
        """Return the request as it is sent: a repeat has another seed, and so is sent once more."""
        seed, repeat = request.seed, self.variant.repeat
        if repeat != 1:
            digest = drawn_bytes("repeat", request.seed, repeat)
            seed = int.from_bytes(digest[:8], "big") % _SEEDS
        return replace(request, seed=seed, sample=self.id)

    def shown(self) -> Sample:
        """Return the sample with its item as its seed shows it."""
        return replace(self, item=self.track.shown(self.item, self.seed))


@dataclass(frozen=True)
class RunPlan:
    """Everything a run needs.

    `manifest` is what `run.yaml` holds; `tracks` are those of the reference, `variants` all
    conditions with the tracks of each; `arranged` gives the order in which the items of a track are
    asked about; `extractor` is asked about replies that cannot be read.
    """

    suite: Suite
    models: tuple[PlannedModel, ...]
    dataset: Dataset
    variants: Mapping[Variant, tuple[AnyTrack, ...]]
    manifest: Manifest
    arranged: Callable[[Sequence[Item]], Sequence[Item]] = interleaved
    extractor: ModelConfig | None = None

    @property
    def tracks(self) -> tuple[AnyTrack, ...]:
        """The tracks as the reference asks."""
        return next(iter(self.variants.values()))

    @property
    def samples_per_model(self) -> int:
        """Number of items of all tracks times seeds times ways of asking."""
        repeats = len(self.suite.seeds) * len(self.variants)
        return sum(len(track.items) for track in self.tracks) * repeats

    def folder_in(self, root: Path) -> Path:
        """Return the run's folder below `root` when none is named: the same command finds it."""
        return root / f"{self.suite.name}-{self.manifest.identity[:8]}"

    def sample_ids(self) -> frozenset[str]:
        """The ids of all samples of all models."""
        return frozenset(sample.id for m in self.models for sample in self.samples(m.name))

    def samples(self, model: str) -> Iterator[Sample]:
        """All samples of a model: seed by seed, in each the ways of asking, in each of these the
        tracks in the suite's order, of each its items as they are arranged.
        """
        for seed in self.suite.seeds:
            for variant, tracks in self.variants.items():
                for track in tracks:
                    for item in self.arranged(track.items):
                        yield Sample(track, model, item, seed, variant)

    def close(self) -> None:
        """Release what tracks hold."""
        for tracks in self.variants.values():
            for track in tracks:
                track.close()


def make_plan(
    suite: Suite,
    known: Mapping[str, ModelConfig],
    *,
    only: Sequence[str] = (),
    limit: int | None = None,
    people: Sequence[PlannedModel] = (),
) -> RunPlan:
    """Resolve a suite against the known models.

    `only` names models to run in place of the suite's, `people` are asked in their place; `limit`,
    else that of the suite, keeps that many items of each track: scenes spread over levels,
    questions over subtasks. Raises SpecError, DataError, StoreError or PromptError with all that is
    wrong.
    """
    dataset = open_dataset(suite.dataset.format, suite.files.dataset)
    models = tuple(people) or with_baselines(plan_models(suite, known, only), suite, known)
    if suite.models != RECORDED:
        # Members in the place of their group: the run is the same by them.
        suite = suite.model_copy(update={"models": with_members(suite.models, known)})
    limit = suite.limit if limit is None else limit
    asks = any(model.config.kind != "replay" for model in models)
    variants = _variants(Opening(suite, dataset, limit, asks))
    tracks = variants[Variant()]
    _check_models(models, tracks, suite)
    tasks = select_tasks(dataset.tasks, suite.levels, limit)
    selected = replace(dataset, tasks=tasks)
    if not any(track.items for track in tracks):
        raise SpecError(_nothing(suite, dataset, limit))
    if asks:
        # PromptError where a prompt cannot be rendered for the first item, before anything is.
        for track in (track for of_variant in variants.values() for track in of_variant):
            for item in track.items[:1]:
                next(iter(track.outlines(item)), None)
    extractor = plan_extractor(suite, known)
    manifest = make_manifest(suite, models, selected, variants, limit, extractor)
    return RunPlan(suite, models, selected, variants, manifest, extractor=extractor)


def _variants(opening: Opening) -> dict[Variant, tuple[AnyTrack, ...]]:
    """All ways of asking, each with its tracks; repeats share them."""
    names = opening.suite.tracks
    opened: dict[Variant, tuple[AnyTrack, ...]] = {}
    for variant in opening.suite.vary.variants:
        if variant.shown not in opened:
            suite = opening.suite.at(variant)
            opened[variant.shown] = open_tracks(replace(opening, suite=suite), names)
        opened[variant] = opened[variant.shown]
    return opened


def _nothing(suite: Suite, dataset: Dataset, limit: int | None) -> Problem:
    found = f"levels {', '.join(map(str, suite.levels))}; limit {limit or 'none'}"
    have = sorted({level for task in dataset.tasks for level in task.scene.levels})
    allowed = f"the levels of {dataset.name}: {', '.join(map(str, have))}"
    return Problem(str(suite.files.path), "the suite has no samples", "", found, allowed)


def _check_models(models: Sequence[PlannedModel], tracks: Sequence[AnyTrack], suite: Suite) -> None:
    """Every model can answer what every track asks, means the numbers that are shown, and is not
    taken for another; a recording was asked in the form in which it is read.
    """
    problems = _alike(models)
    order, asked = suite.candidates.order, suite.answer_format
    for model in models:
        if model.config.kind == "replay" and suite.vary.factors:
            message = "is a recording, which was asked in one way"
            factors = ", ".join(suite.vary.factors)
            problems.append(Problem(f"model {model.name}", message, "vary", factors))
            continue
        where, recorded = f"model {model.name}", model.config.recording
        if recorded is not None:
            found, form = recorded_as(recorded)
            if found != order:
                message = f"is a recording of candidates in the order {found}"
                problems.append(Problem(where, message, "candidates.order", order, found))
            if form != asked:
                message = f"is a recording of answers that were asked for as {form}"
                problems.append(Problem(where, message, "answer_format", asked, form))
        for track in tracks:
            if model.config.kind == "replay" and isinstance(track, EpisodeTrack):
                message = f"is a recording, which cannot answer in {track.name}"
                problems.append(Problem(where, message, "tracks", track.name))
            if model.config.batch and isinstance(track, EpisodeTrack):
                message = f"is asked in batches, and {track.name} plays episodes of several turns"
                hint = "each turn waits for the one before: take batch: true out, or the track"
                problems.append(Problem(where, message, "batch", track.name, hint=hint))
            if model.config.kind == "human" and kind_of(track.name).by_hand is None:
                message = f"is a person, who cannot answer in {track.name}"
                hint = f"leave {track.name} out of tracks"
                problems.append(Problem(where, message, "tracks", track.name, hint=hint))
            able = track_baselines(kind_of(track.name))
            if model.config.kind != "baseline" or model.name in able:
                continue
            message = f"has no rule for {track.name}"
            problems.append(Problem(where, message, "models", allowed=", ".join(able)))
    if problems:
        raise SpecError(problems)


def _alike(models: Sequence[PlannedModel]) -> list[Problem]:
    """Models that replies could not be told apart by, though they are asked at other addresses."""
    problems = []
    for earlier, later in combinations(models, 2):
        one, other = earlier.config, later.config
        if one.identity() == other.identity() and set(one.addresses) != set(other.addresses):
            message = f"is {earlier.name} at another address: they would share their replies"
            hint = "give one of them a revision, or run one alone"
            where = f"model {later.name}"
            found = ", ".join(sorted(set(other.addresses)))
            problems.append(Problem(where, message, "api_base", found, hint=hint))
    return problems


CHANGED = "is not the data set that the run was made on, or it was changed since"
_HINT = "name the folder where it is now with --data"


def open_dataset(format_name: str, path: Path) -> Dataset:
    """Read a data set; DataError when it is not there or broken."""
    if format_name == "official":
        return read_official(path)
    if path.is_dir():
        return read_builtin(path)
    names = ", ".join(bundled_sets(SCENES_FILE))
    allowed = f"a folder with {SCENES_FILE}, or a bundled data set: {names}"
    raise DataError(Problem(str(path), "is no data set", "dataset.path", allowed=allowed))


def recorded_dataset(
    folder: Path, manifest: Manifest, levels: Sequence[int], data: Path | None
) -> Dataset:
    """The whole data set of the run in `folder`, from `data` or from where the run found it.

    Raises DataError where the manifest names none, or where what it was asked about of these
    levels is not what stands there.
    """
    recorded = manifest.dataset
    if recorded is None:
        raise DataError(Problem(str(folder / MANIFEST), "names no data set", "dataset"))
    root = data or Path(recorded.root)
    if not root.is_dir():
        raise DataError(Problem(str(root), "the data set of the run is not there", hint=_HINT))
    dataset = open_dataset(recorded.format, root)
    digest = asked_about(manifest, levels, dataset).sha256
    if digest != recorded.sha256:
        raise DataError(Problem(str(root), CHANGED, "sha256", digest, recorded.sha256, _HINT))
    return dataset


def asked_about(manifest: Manifest, levels: Sequence[int], dataset: Dataset) -> Dataset:
    """Return the part of a data set that a run asks about, whose suite has these levels."""
    tasks = select_tasks(dataset.tasks, levels, manifest.limit)
    return replace(dataset, tasks=tasks)
