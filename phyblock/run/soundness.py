"""Whether the models of a file could be asked, as far as that shows without asking."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from phyblock.config.models import ModelConfig, with_members
from phyblock.config.yaml import read_yaml
from phyblock.errors import Problem
from phyblock.models import known_providers
from phyblock.text import did_you_mean

__all__ = ["model_problems", "provider_problem"]


def model_problems(
    path: Path, known: Mapping[str, ModelConfig], names: Iterable[str]
) -> Iterator[Problem]:
    """What is wrong with the models and groups of these names in a models file: recordings that are
    not there, providers that nobody knows.
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
