"""The models of a run: from names in a suite to configurations that can be called."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from phyblock.config.models import RECORDED, ModelConfig, resolve_models, with_members
from phyblock.config.suite import Suite
from phyblock.config.yaml import read_yaml
from phyblock.data import recorded_models
from phyblock.data.official import match_published
from phyblock.errors import Problem, SpecError
from phyblock.models import known_providers, server_address, takes_format
from phyblock.records.files import RECORDS, RecordLines
from phyblock.text import did_you_mean
from phyblock.tracks.base import kind_of
from phyblock.types import AnswerFormat, CandidateOrder


@dataclass(frozen=True)
class PlannedModel:
    """A model of a run: how to call it, its row in the paper's tables, its size if known."""

    name: str
    config: ModelConfig
    published: str | None = None
    size_b: float | None = None


def plan_models(
    suite: Suite, known: Mapping[str, ModelConfig], only: Sequence[str]
) -> tuple[PlannedModel, ...]:
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
            PlannedModel(
                name, ModelConfig(name=name, replay=str(folders[name])), match_published(name)
            )
            for name in dict.fromkeys(only) or folders
        )
    if only:
        models = resolve_models(only, known, lambda _: "--models")
    else:
        models = resolve_models(suite.models, known, lambda at: suite.where("models", at))
    return tuple(_planned(name, config, suite) for name, config in models.items())


def with_baselines(
    models: Sequence[PlannedModel], suite: Suite, known: Mapping[str, ModelConfig]
) -> tuple[PlannedModel, ...]:
    """Return models with the suite's `baselines` beside them.

    They are scored in every run of plans in which a model or a recording is asked, where all tracks
    know them: what rules reach that never see the goal is what a score has to be held against.
    """
    asks = any(model.config.kind in ("litellm", "replay") for model in models)
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


def _planned(name: str, known: ModelConfig, suite: Suite) -> PlannedModel:
    config = to_config(name, known, suite)
    published = config.published or match_published(name)
    return PlannedModel(name, config, published, config.size_b)


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
