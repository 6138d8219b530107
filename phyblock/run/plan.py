"""The plan of a run: its files found, its suite with its data read, models and tracks resolved."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from pathlib import Path

from phyblock.config.models import RECORDED, ModelConfig, resolve_models, with_members
from phyblock.config.suite import Suite, Variant
from phyblock.config.yaml import read_yaml
from phyblock.data import SCENES_FILE, Dataset, read_builtin, read_official, recorded_models
from phyblock.data.official import match_published
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models import Request, known_providers, server_address, takes_format
from phyblock.records.files import RECORDS, RecordLines
from phyblock.records.manifest import Manifest
from phyblock.registry import track_baselines
from phyblock.resources import bundled, bundled_sets
from phyblock.run.manifest import make_manifest
from phyblock.stable import drawn_bytes
from phyblock.text import did_you_mean
from phyblock.tracks import AnyTrack, EpisodeTrack, Item, Opening, kind_of, open_tracks
from phyblock.tracks.base import template_prompt
from phyblock.tracks.items import interleaved, select_tasks
from phyblock.types import AnswerFormat, CandidateOrder

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
    models: tuple[ModelConfig, ...]
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
    people: Sequence[ModelConfig] = (),
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
    asks = any(model.kind != "replay" for model in models)
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


def _check_models(models: Sequence[ModelConfig], tracks: Sequence[AnyTrack], suite: Suite) -> None:
    """Every model can answer what every track asks, means the numbers that are shown, and is not
    taken for another; a recording was asked in the form in which it is read.
    """
    problems = _alike(models)
    order, asked = suite.candidates.order, suite.answer_format
    for model in models:
        if model.kind == "replay" and suite.vary.factors:
            message = "is a recording, which was asked in one way"
            factors = ", ".join(suite.vary.factors)
            problems.append(Problem(f"model {model.name}", message, "vary", factors))
            continue
        where, recorded = f"model {model.name}", model.recording
        if recorded is not None:
            found, form = recorded_as(recorded)
            if found != order:
                message = f"is a recording of candidates in the order {found}"
                problems.append(Problem(where, message, "candidates.order", order, found))
            if form != asked:
                message = f"is a recording of answers that were asked for as {form}"
                problems.append(Problem(where, message, "answer_format", asked, form))
        for track in tracks:
            if model.kind == "replay" and isinstance(track, EpisodeTrack):
                message = f"is a recording, which cannot answer in {track.name}"
                problems.append(Problem(where, message, "tracks", track.name))
            if model.batch and isinstance(track, EpisodeTrack):
                message = f"is asked in batches, and {track.name} plays episodes of several turns"
                hint = "each turn waits for the one before: take batch: true out, or the track"
                problems.append(Problem(where, message, "batch", track.name, hint=hint))
            if model.kind == "human" and kind_of(track.name).by_hand is None:
                message = f"is a person, who cannot answer in {track.name}"
                hint = f"leave {track.name} out of tracks"
                problems.append(Problem(where, message, "tracks", track.name, hint=hint))
            able = track_baselines(kind_of(track.name))
            if model.kind != "baseline" or model.name in able:
                continue
            message = f"has no rule for {track.name}"
            problems.append(Problem(where, message, "models", allowed=", ".join(able)))
    if problems:
        raise SpecError(problems)


def _alike(models: Sequence[ModelConfig]) -> list[Problem]:
    """Models that replies could not be told apart by, though they are asked at other addresses."""
    problems = []
    for earlier, later in combinations(models, 2):
        is_other_place = set(earlier.addresses) != set(later.addresses)
        if earlier.identity() == later.identity() and is_other_place:
            message = f"is {earlier.name} at another address: they would share their replies"
            hint = "give one of them a revision, or run one alone"
            where = f"model {later.name}"
            found = ", ".join(sorted(set(later.addresses)))
            problems.append(Problem(where, message, "api_base", found, hint=hint))
    return problems


def open_dataset(format_name: str, path: Path) -> Dataset:
    """Read a data set; DataError when it is not there or broken."""
    if format_name == "official":
        return read_official(path)
    if path.is_dir():
        return read_builtin(path)
    names = ", ".join(bundled_sets(SCENES_FILE))
    allowed = f"a folder with {SCENES_FILE}, or a bundled data set: {names}"
    raise DataError(Problem(str(path), "is no data set", "dataset.path", allowed=allowed))


def plan_models(
    suite: Suite, known: Mapping[str, ModelConfig], only: Sequence[str]
) -> tuple[ModelConfig, ...]:
    """The suite's models in its order, or those that `only` names, in its order.

    `only` may name any known model or group, in the suite or not; of recordings, any that is there.
    Raises SpecError for a name that is not known, DataError where no recordings are found.
    """
    if suite.models == RECORDED:
        folders = recorded_models(suite.files.dataset)
        message, allowed = "is not among the recordings", ", ".join(folders)
        if unknown := [name for name in only if name not in folders]:
            raise SpecError(Problem("--models", message, "", one, allowed) for one in unknown)
        return tuple(
            ModelConfig(name=name, replay=str(folders[name]), published=match_published(name))
            for name in dict.fromkeys(only) or folders
        )
    if only:
        models = resolve_models(only, known, lambda _: "--models")
    else:
        models = resolve_models(suite.models, known, lambda at: suite.where("models", at))
    return tuple(_planned(name, config, suite) for name, config in models.items())


def with_baselines(
    models: Sequence[ModelConfig], suite: Suite, known: Mapping[str, ModelConfig]
) -> tuple[ModelConfig, ...]:
    """Return models with the suite's `baselines` beside them.

    They are scored in every run of plans in which a model or a recording is asked, where all tracks
    know them: what rules reach that never see the goal is what a score has to be held against.
    """
    asks = any(model.kind in ("litellm", "replay") for model in models)
    if not asks or "full_planning" not in suite.tracks:
        return tuple(models)
    named = {model.name for model in models}
    kinds = [kind_of(name) for name in suite.tracks]
    able = [name for name in suite.baselines if all(name in kind.baselines for kind in kinds)]
    more = [name for name in able if name not in named]
    found = resolve_models(more, known, lambda _: "models")
    return (*models, *(_planned(name, config, suite) for name, config in found.items()))


def plan_extractor(suite: Suite, known: Mapping[str, ModelConfig]) -> ModelConfig | None:
    """Return the model that a suite has unread replies copied by, or None.

    Raises SpecError for a name that no model of the models file has.
    """
    name = suite.scoring.extractor
    if name is None:
        return None
    if name not in known or known[name].kind != "litellm":
        names = [other for other, config in known.items() if config.kind == "litellm"]
        where, message = suite.where("scoring", "extractor"), "is no model that can be asked"
        field, hint = "scoring.extractor", did_you_mean(name, names)
        raise SpecError(Problem(where, message, field, name, ", ".join(names), hint))
    config = to_config(name, known[name], suite.model_copy(update={"answer_format": "text"}))
    return config.model_copy(update={"batch": False})


def recorded_as(folder: Path) -> tuple[CandidateOrder, AnswerFormat]:
    """Return the order in which candidates were shown to a recorded model, and the form in which it
    was asked to answer.

    A run of our own says so in its records, a varied one in those of its reference; raw replies are
    texts that name numbers of the file.
    """
    order: CandidateOrder | None = None
    form: AnswerFormat = "text"
    if (folder / RECORDS).is_file():
        for _, record in RecordLines(folder):
            if record.variant:
                continue
            if order is None and record.shown:
                is_sorted = list(record.shown.order) == sorted(record.shown.order)
                order = "file" if is_sorted else "shuffled"
            if record.asked:
                form = "json_schema"
    return order or "file", form


def _planned(name: str, known: ModelConfig, suite: Suite) -> ModelConfig:
    config = to_config(name, known, suite)
    published = config.published or match_published(name)
    return config.model_copy(update={"name": name, "published": published})


def to_config(name: str, known: ModelConfig, suite: Suite) -> ModelConfig:
    """A model as a suite asks it."""
    if known.kind != "litellm":
        return known
    limits = suite.limits.model_dump(include={"timeout_s", "max_concurrency"})
    config = known.with_defaults({"name": name, **suite.sampling.model_dump(), **limits})
    if not config.has_address:
        config = config.at(server_address(config.id))
    mode = "always" if _sends_format(config, suite) else "never"
    return config.model_copy(update={"response_format": mode})


def _sends_format(config: ModelConfig, suite: Suite) -> bool:
    """True if the JSON schema of answers is sent; SpecError for a model that says its own."""
    if suite.answer_format == "text" or config.response_format == "never":
        return False
    if config.response_format == "auto" and not takes_format(config):
        return False
    if "response_format" in config.extra_body:
        message = "says its own response_format, where the suite asks for one"
        hint = "take it out of extra_body, or set response_format: never to send it all the same"
        field = "extra_body.response_format"
        raise SpecError(Problem(f"model {config.name}", message, field, hint=hint))
    return True


def model_problems(
    path: Path, known: Mapping[str, ModelConfig], names: Iterable[str]
) -> Iterator[Problem]:
    """Return what is wrong with the models and groups of these names in a models file: recordings
    that are not there, providers that nobody knows.
    """
    source = read_yaml(path)
    for name in (name for name in with_members(tuple(names), known) if name in known):
        config = known[name]
        if config.replay is not None and not os.path.isdir(config.replay):
            where, message = source.where((name, "replay")), "recordings not found"
            hint = "the path is taken relative to the models file"
            yield Problem(where, message, f"{name}.replay", config.replay, "a folder", hint)
        if (problem := provider_problem(config, source.where((name, "id")))) is not None:
            yield problem


def provider_problem(config: ModelConfig, where: str) -> Problem | None:
    """That a model is asked through litellm, which does not know its provider, or None."""
    if config.kind != "litellm" or config.is_direct:
        return None
    providers = known_providers(config)
    if config.provider in providers:
        return None
    message, hint = "is of no provider that is known", did_you_mean(config.provider, providers)
    if config.has_address:
        hint = f"a server of your own that speaks OpenAI's chat protocol: hosted_vllm/{config.id}"
    allowed = "provider/model, as litellm names them"
    return Problem(where, message, f"{config.name}.id", config.id, allowed, hint)


def bundled_suites() -> list[str]:
    """Names of the suites that come with the project, sorted."""
    return sorted(path.stem for path in bundled("benchmarks").glob("*.yaml"))


def find_suite(name: str) -> Path:
    """The suite file that `name` means: a path, or the name of a bundled suite.

    Raises SpecError that lists the bundled suites when there is no such file, or for a prompt.
    """
    path = Path(name)
    if os.path.isfile(path):
        if path.suffix == ".j2":
            hint = "name the suite that uses it: its prompts are rendered"
            raise SpecError(Problem(name, "is a prompt, not a suite", hint=hint))
        return path
    if not name.strip():
        allowed = "a suite file, or a bundled suite: " + ", ".join(bundled_suites())
        raise SpecError(Problem("suite", "is empty", found=repr(name), allowed=allowed))
    if path.suffix in ("", ".yaml") and path.parent == Path():
        inside = bundled("benchmarks", f"{path.stem}.yaml")
        if os.path.isfile(inside):
            return inside
    names = bundled_suites()
    hint = did_you_mean(path.stem, names)
    allowed = "a suite file, or a bundled suite: " + ", ".join(names)
    message = _what_it_is(path) or "there is no such suite"
    raise SpecError(Problem(name, message, allowed=allowed, hint=hint))


def _what_it_is(path: Path) -> str:
    """Return why something that is no file cannot be read; "" where there is nothing at all."""
    if os.path.isdir(path):
        return "is a folder"
    return "is not a regular file" if os.path.exists(path) else ""


def find_models_file(named: str | None, suite: Path | None) -> Path:
    """The models file: the one named, else models.yaml here, near the suite, or the bundled one.

    Raises SpecError when the one named is not there.
    """
    if named is not None:
        if os.path.isfile(named):
            return Path(named)
        message = _what_it_is(Path(named)) or "there is no such models file"
        raise SpecError(Problem(named, message))
    for folder in _near(suite):
        if os.path.isfile(folder / "models.yaml"):
            return folder / "models.yaml"
    return bundled("models.yaml")


def prompt_dirs(suite: Path) -> list[Path]:
    """Folders of prompts of one's own: where the models file is looked for, too."""
    return [folder / "prompts" for folder in _near(suite)]


def _near(suite: Path | None) -> list[Path]:
    """Here, and near the suite."""
    return [Path(), *([] if suite is None else [suite.parent, suite.parent.parent])]


def asking_remarks(suite: Suite, plan: RunPlan) -> list[str]:
    """Return which prompts of one's own are sent, and who copies replies that cannot be read."""
    own = []
    if any(model.kind == "litellm" for model in plan.models):
        for variant in dict.fromkeys(variant.shown for variant in plan.variants):
            asked = suite.at(variant)
            for track, path in asked.files.templates.items():
                prompt = template_prompt(asked, track)
                files = ", ".join(map(str, (path, *(file.name for file in prompt.included))))
                line = prompt.unsent_line
                lost = f"; the text outside of its blocks (line {line}) is NOT sent" if line else ""
                own.append(f"prompt of {track}: {files}{lost}")
        if plan.extractor is not None:
            own.append(f"replies that cannot be read are sent to {plan.extractor.name}, as text")
    return list(dict.fromkeys(own))


def moved_remarks(begun: Manifest, plan: RunPlan) -> list[str]:
    """Return the models served elsewhere than when the run began: its replies still stand."""
    before = {model.name: model.served_at for model in begun.models}
    return [
        f"{model.name} was asked at {', '.join(before[model.name])} and is now at "
        f"{', '.join(model.addresses)}: taken to be the same weights (other ones need "
        "another revision in the models file)"
        for model in plan.models
        if before.get(model.name) and model.addresses
        if set(before[model.name]).isdisjoint(model.addresses)
    ]
