"""The plan of a run: suite, data, models, tracks and cost; nothing is called or rendered."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from itertools import combinations, product
from operator import attrgetter
from pathlib import Path

from phyblock.config.models import RECORDED, ModelConfig, Tariff, resolve_models, with_members
from phyblock.config.suite import Suite, Variant, load_suite
from phyblock.config.yaml import YamlSource
from phyblock.data.base import Dataset
from phyblock.data.lookup import open_dataset
from phyblock.data.official import match_published, recorded_models
from phyblock.errors import Problem, SpecError
from phyblock.files import bundled, reply_cache_file
from phyblock.models import costs
from phyblock.models.cache import ReplyCache, reply_key
from phyblock.models.client import api_key_status, server_address
from phyblock.models.model import takes_format
from phyblock.models.request import Request
from phyblock.records import files
from phyblock.records.files import BatchLines, Manifest
from phyblock.registry import track_baselines
from phyblock.run.manifest import make_manifest
from phyblock.run.store import held_run
from phyblock.text import did_you_mean, drawn_bytes
from phyblock.tracks import base
from phyblock.tracks.base import Item, Track
from phyblock.tracks.pictures import Workshop

_SEEDS = 2**31
"""Providers accept no larger seeds."""


@dataclass(eq=False)
class Sample:
    """One item of a track, asked of one model with one seed; `track` is that of the variant.

    `id` is its name in the run; a repeat is sent with another seed, so that it is not cached.
    """

    track: Track
    model: ModelConfig
    item: Item
    seed: int
    variant: Variant = field(default_factory=Variant)

    def __post_init__(self) -> None:
        self.id = f"{self.track.name}/{self.model.name}/{self.item.key}/s{self.seed}"
        self.sent_seed = self.seed
        if self.variant.levels:
            self.id += f"/{self.variant.key}"
            if (repeat := self.variant.repeat) != 1:
                digest = drawn_bytes("repeat", self.seed, repeat)
                self.sent_seed = int.from_bytes(digest[:8], "big") % _SEEDS


@dataclass(frozen=True)
class RunPlan:
    """Everything a run needs; `variants` has all conditions with the tracks of each."""

    suite: Suite
    models: tuple[ModelConfig, ...]
    dataset: Dataset
    variants: Mapping[Variant, tuple[Track, ...]]
    manifest: Manifest

    @property
    def tracks(self) -> tuple[Track, ...]:
        """The tracks under the reference condition."""
        return next(iter(self.variants.values()))

    @property
    def samples_per_model(self) -> int:
        """Number of items of all tracks times seeds times conditions."""
        repeats = len(self.suite.seeds) * len(self.variants)
        return sum(len(track.items) for track in self.tracks) * repeats

    def folder_in(self, root: Path) -> Path:
        """Return the run's default folder below `root`, which the same command finds again."""
        return root / f"{self.suite.name}-{self.manifest.identity[:8]}"

    def sample_ids(self) -> frozenset[str]:
        """The ids of all samples of all models."""
        return frozenset(sample.id for model in self.models for sample in self.samples(model))

    def samples(self, model: ModelConfig) -> Iterator[Sample]:
        """Yield samples by seed, condition, track and item, interleaved over levels and scenes."""
        asked = [
            (variant, track, base.interleaved(track.items))
            for variant, tracks in self.variants.items()
            for track in tracks
        ]
        for seed in self.suite.seeds:
            for variant, track, items in asked:
                for item in items:
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

    `only` names models to run instead of the suite's; `people` are asked instead of models.
    `limit`, else the suite's, keeps that many items of each track, spread over levels or subtasks.
    Raises SpecError, DataError, StoreError or PromptError with all problems.
    """
    dataset = open_dataset(suite.dataset.format, suite.files.dataset)
    models = _planned_models(suite, known, only, people)
    if suite.models != RECORDED:
        # A group stands for its members: the run is the same as one that names them.
        suite = suite.model_copy(update={"models": with_members(suite.models, known)})
    limit = suite.limit if limit is None else limit
    asks = any(model.kind != "replay" for model in models)
    variants: dict[Variant, tuple[Track, ...]] = {}
    shop = Workshop() if asks else None
    for variant in suite.vary.variants:
        # Repeats share their tracks.
        shown = variants.get(variant.shown)
        variants[variant] = shown or base.open_tracks(suite.at(variant), dataset, limit, shop)
    tracks = variants[Variant()]
    if problems := list(_conflicts(models, tracks, suite)):
        raise SpecError(problems)
    if not any(track.items for track in tracks):
        found = f"levels {', '.join(map(str, suite.levels))}; limit {limit or 'none'}"
        have = sorted({level for task in dataset.tasks for level in task.scene.levels})
        allowed = f"the levels of {dataset.name}: {', '.join(map(str, have))}"
        message = "the suite has no samples"
        raise SpecError(Problem(str(suite.files.path), message, "", found, allowed))
    for track in (track for opened in variants.values() for track in opened if asks):
        # PromptError where a prompt cannot be rendered for the first item, before anything is.
        next(iter(track.outlines(track.items[0])), None) if track.items else None
    selected = replace(dataset, tasks=base.select_tasks(dataset.tasks, suite, limit))
    manifest = make_manifest(suite, models, selected, variants, limit)
    return RunPlan(suite, models, selected, variants, manifest)


def _conflicts(
    models: Sequence[ModelConfig], tracks: Sequence[Track], suite: Suite
) -> Iterator[Problem]:
    """Yield the reasons why a model cannot answer a track, or is ambiguous."""
    for earlier, later in combinations(models, 2):
        is_elsewhere = set(earlier.addresses) != set(later.addresses)
        if is_elsewhere and earlier.identity() == later.identity():
            message = f"is {earlier.name} at another address: they would share their replies"
            found = ", ".join(sorted(later.addresses))
            hint = "give one of them a revision, or run one alone"
            yield Problem(f"model {later.name}", message, "api_base", found, hint=hint)
    for model in models:
        where, is_replay = f"model {model.name}", model.kind == "replay"
        if is_replay and (varied := ", ".join(suite.vary.factors)):
            yield Problem(where, "is a recording, which cannot be varied", "vary", varied)
            continue
        if model.replay is not None and os.path.isdir(model.replay):
            # Raw replies were made as in the paper.
            made = {"candidates.order": "file", "answer_format": "text"}
            if (path := Path(model.replay, files.MANIFEST)).is_file():
                recorded = files.suite_of(files.read_manifest(path.parent), str(path))
                made = {field: attrgetter(field)(recorded.at(Variant())) for field in made}
            for field, was in made.items():
                if was != (now := attrgetter(field)(suite)):
                    message = f"is a recording that was made with {field}: {was}"
                    yield Problem(where, message, field, now, was)
        for track in tracks:
            name, plays, able = track.name, track.plays, track_baselines(base.kind_of(track.name))
            if is_replay and plays:
                message = f"is a recording, which cannot answer in {name}"
                yield Problem(where, message, "tracks")
            if model.batch and plays:
                message = f"is asked in batches, and {name} plays episodes of several turns"
                hint = "each turn waits for the one before: remove batch: true, or the track"
                yield Problem(where, message, "batch", name, hint=hint)
            if model.kind == "human" and track.by_hand is None:
                message = f"is a person, who cannot answer in {name}"
                yield Problem(where, message, "tracks", hint=f"remove {name} from tracks")
            if model.kind == "baseline" and model.name not in able:
                yield Problem(where, f"has no rule for {name}", "models", allowed=", ".join(able))


def _planned_models(
    suite: Suite,
    known: Mapping[str, ModelConfig],
    only: Sequence[str],
    people: Sequence[ModelConfig],
) -> tuple[ModelConfig, ...]:
    """Return the suite's models in its order, or those of `only` in its order, or people.

    If any of them is not a baseline, the suite's `baselines` that all its tracks know are added, to
    compare scores with. `only` may name any known model, group or recording, in the suite or not.
    Raises SpecError for an unknown name, DataError if no recordings are found.
    """
    if people:
        found = {one.name: one for one in people}
    elif suite.models == RECORDED:
        folders = recorded_models(suite.files.dataset)
        message, allowed = "is not among the recordings", ", ".join(folders)
        if unknown := [name for name in only if name not in folders]:
            raise SpecError(Problem("--models", message, "", one, allowed) for one in unknown)
        chosen = dict.fromkeys(only) or folders
        found = {name: ModelConfig(name=name, replay=str(folders[name])) for name in chosen}
    elif only:
        found = resolve_models(only, known, lambda _: "--models")
    else:
        found = resolve_models(suite.models, known, lambda at: suite.where("models", at))
    asks = any(model.kind != "baseline" for model in found.values())
    if asks and "full_planning" in suite.tracks:
        able = set.intersection(*(set(base.kind_of(name).baselines) for name in suite.tracks))
        more = [name for name in suite.baselines if name in able and name not in found]
        found = {**found, **resolve_models(more, known, lambda _: "models")}
    return tuple(
        to_config(name, config, suite).model_copy(
            update={"name": name, "published": config.published or match_published(name)}
        )
        for name, config in found.items()
    )


def to_config(name: str, known: ModelConfig, suite: Suite) -> ModelConfig:
    """Return a model with the settings of a suite."""
    if known.kind != "litellm":
        return known
    limits = suite.limits.model_dump(include={"timeout_s", "max_concurrency"})
    config = known.with_defaults({"name": name, **suite.sampling.model_dump(), **limits})
    if not config.addresses:
        config = config.at(server_address(config.id))
    sends = suite.answer_format == "json_schema" and config.response_format != "never"
    sends = sends and (config.response_format == "always" or takes_format(config))
    return config.model_copy(update={"response_format": "always" if sends else "never"})


def check_models(
    models: Iterable[ModelConfig], source: YamlSource, *, needs_keys: bool = False
) -> None:
    """Raise SpecError naming all models that cannot be asked: missing recordings, unknown
    providers, and with `needs_keys` keys that are not set. `source` is the models file.
    """
    problems: list[Problem] = []
    for config in models:
        name, where = config.name, f"model {config.name}"
        if (name,) in source.places:
            where = source.where((name, "replay" if config.replay is not None else "id"))
        if config.replay is not None and not os.path.isdir(config.replay):
            message, hint = "recordings not found", "the path is relative to the models file"
            found, allowed = config.replay, "a folder"
            problems.append(Problem(where, message, f"{name}.replay", found, allowed, hint))
        if config.kind != "litellm":
            continue
        if not config.is_direct:
            # litellm, slow to import, is imported only for the models it asks.
            from phyblock.models.litellm_client import known_providers

            if config.provider not in (providers := known_providers(config)):
                message, hint = "has an unknown provider", did_you_mean(config.provider, providers)
                if config.addresses:
                    hint = f"a server that speaks OpenAI's chat protocol: hosted_vllm/{config.id}"
                allowed = "provider/model, as litellm names them"
                problems.append(Problem(where, message, f"{name}.id", config.id, allowed, hint))
                continue
        status = api_key_status(config)
        if needs_keys and status.is_needed and not status.key:
            variables = " or ".join(status.variables)
            hint = f"set {variables} in the environment, or exclude the model with --models"
            message = "needs an API key, and none is set"
            problems.append(Problem(where, message, f"{name}.id", config.id, hint=hint))
    if problems:
        raise SpecError(problems)


@dataclass
class Estimate:
    """The estimate of one model.

    `done` samples have a record, `cached` ones a reply in the cache, `waiting` ones are in batches;
    `calls` are to be made, none for recordings and baselines. `cost_usd` is the price of the calls,
    `most_usd` that if every reply were as long as allowed and no call repeated; None if unknown.
    """

    model: ModelConfig
    samples: int
    tariff: Tariff | None
    done: int = 0
    cached: int = 0
    waiting: int = 0
    calls: int = 0
    prompt_tokens: int = 0
    reply_tokens: int = 0
    cost_usd: float | None = None
    most_usd: float | None = None

    def __post_init__(self) -> None:
        if self.tariff is not None:
            self.cost_usd = self.most_usd = 0.0

    def add_call(self, expected: costs.Estimate) -> None:
        """Count one call to be made, with a reply of typical length."""
        self.calls += 1
        prompt, reply = expected.prompt_tokens, expected.completion_tokens
        self.prompt_tokens += prompt
        self.reply_tokens += reply
        if self.tariff is not None and self.cost_usd is not None and self.most_usd is not None:
            batched, most = self.model.batch, expected.most_completion_tokens
            price = costs.price_at(self.tariff, batched=batched)
            self.cost_usd += (prompt * price.input + reply * price.output) / 1_000_000
            self.most_usd += costs.most_usd(self.tariff, prompt, most, batched=batched)

    @property
    def may_cost(self) -> bool:
        """True if there are calls to make that are not known to be free."""
        return self.calls > 0 and costs.is_billed(self.model)


def estimate(
    plan: RunPlan, folder: Path, *, use_cache: bool, retry_failed: bool = False
) -> list[Estimate]:
    """Return estimates in the order of the plan's models.

    With `retry_failed`, rejected requests count. Raises StoreError for another run's folder.
    """
    rows = {m.name: Estimate(m, plan.samples_per_model, costs.tariff_of(m)) for m in plan.models}
    settled: dict[str, bool] = {}
    waiting: set[str] = set()
    if held_run(folder, plan.manifest) is not None:
        for _, record in files.run_records(folder, plan.manifest, plan.sample_ids()):
            settled[record.sample] = record.is_answered if retry_failed else record.is_final
        if lines := tuple(line for _, line in BatchLines(folder)):
            from phyblock.models.batch import under_way

            batches = [one for m in plan.models if m.batch for one in under_way(lines, m.name)]
            waiting = {key for one in batches for key in one.most_usd}
    path = reply_cache_file()
    with ReplyCache(path) if use_cache and path.exists() else nullcontext() as cache:
        for sample, outlines in _samples(plan):
            row = rows[sample.model.name]
            if settled.get(sample.id):
                row.done += 1
                continue
            for outline in outlines if row.model.kind == "litellm" else ():
                # A picture that is not known yet is empty.
                is_known = all(picture.data for picture in outline.images)
                asked = replace(outline, seed=sample.sent_seed, params=row.model.params)
                key = reply_key(row.model, asked) if is_known else ""
                if cache is not None and is_known and cache.get(key) is not None:
                    row.cached += 1
                elif key in waiting:
                    row.waiting += 1
                else:
                    row.add_call(costs.estimate(row.model, asked))
    return list(rows.values())


def may_bill(
    plan: RunPlan, folder: Path, *, use_cache: bool, retry_failed: bool = False
) -> list[Estimate]:
    """Return the estimates of a plan if any of its models may cost money, else none."""
    if not any(costs.is_billed(model) for model in plan.models):
        return []
    rows = estimate(plan, folder, use_cache=use_cache, retry_failed=retry_failed)
    return rows if any(row.may_cost for row in rows) else []


def _samples(plan: RunPlan) -> Iterator[tuple[Sample, Sequence[Request]]]:
    """Yield samples with the requests known before any reply, outlining identical ones once."""
    for shown_in, tracks in plan.variants.items():
        repeats = [variant for variant in plan.variants if variant.shown == shown_in]
        asked = [(track, item) for track in tracks for item in track.items]
        for track, item in asked if repeats else ():
            plain = None
            for seed in plan.suite.seeds:
                shown = track.shown(item, seed)
                if shown is item:
                    outlines = plain = plain or list(track.outlines(item))
                else:
                    outlines = list(track.outlines(shown))
                for variant, model in product(repeats, plan.models):
                    yield Sample(track, model, item, seed, variant), outlines


def bundled_suites() -> list[str]:
    """Return the names of the bundled suites, sorted."""
    return sorted(path.stem for path in bundled("benchmarks").glob("*.yaml"))


def find_suite(name: str) -> Path:
    """Return the file of a suite by its path or bundled name. Raises SpecError if there is none."""
    path, suites = Path(name), bundled_suites()
    if os.path.isfile(path):
        return path
    if name.removesuffix(".yaml") in suites:
        return bundled("benchmarks", f"{path.stem}.yaml")
    message, hint = "there is no such suite file", did_you_mean(path.stem, suites)
    allowed = f"a suite file, or a bundled suite: {', '.join(suites)}"
    raise SpecError(Problem(name or "suite", message, allowed=allowed, hint=hint))


def read_suite(name: str, overrides: Sequence[str] = ()) -> Suite:
    """Return the suite that `name` means, with custom prompts near it; raises as `load_suite`."""
    path = find_suite(name)
    return load_suite(path, overrides, prompt_dirs=prompt_dirs(path))


def find_models_file(named: str | None, suite: Path | None) -> Path:
    """Return the models file: the named one, else models.yaml here, near the suite, or bundled.

    Raises SpecError if the named one does not exist.
    """
    if named is not None and not os.path.isfile(named):
        raise SpecError(Problem(named, "there is no such models file"))
    near = prompt_dirs(suite or Path("suite.yaml"))
    paths = [Path(named)] if named else [folder.parent / "models.yaml" for folder in near]
    return next((path for path in paths if os.path.isfile(path)), bundled("models.yaml"))


def prompt_dirs(suite: Path) -> list[Path]:
    """Folders of custom prompts, here and near the suite; a models file may be beside each."""
    return [folder / "prompts" for folder in (Path(), suite.parent, suite.parent.parent)]
