"""Putting a model together from its configuration."""

from __future__ import annotations

import asyncio
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.errors import Problem, SpecError
from phyblock.models.batch import BatchFiles, BatchModel
from phyblock.models.cache import ReplyCache
from phyblock.models.client import Client, HttpClient, OpenAIClient
from phyblock.models.costs import Budget, tariff_of
from phyblock.models.limits import Limits
from phyblock.models.litellm_client import LitellmClient
from phyblock.models.model import ChatModel, Observer, RetryPolicy, Tell
from phyblock.models.replay import open_baseline, open_replay
from phyblock.models.request import Journal, Model
from phyblock.models.servers import Server, Servers


def build_model(
    config: ModelConfig,
    *,
    cache: ReplyCache | None,
    overall: asyncio.Semaphore | None = None,
    budget: Budget | None = None,
    journal: Journal | None = None,
    observer: Observer = lambda _: None,
    tell: Tell = lambda _: None,
    policy: RetryPolicy | None = None,
    batches: BatchFiles | None = None,
) -> Model:
    """Return the model that a configuration describes; nothing is imported or sent before it asks.

    `overall` bounds what all models of a run have under way together; `observer` hears of the
    model, `tell` of its servers. `batches` is where a model that is asked so keeps them. Raises
    SpecError for an unknown baseline, a model without a price under a limit or a provider without
    batches, DataError for missing recordings.
    """
    if config.kind == "baseline":
        return open_baseline(config)
    if config.kind == "replay":
        return open_replay(config)
    if not config.provider:
        where, hint = f"model {config.name}", "for example openai/gpt-4o-2024-08-06"
        raise SpecError(Problem(where, "needs a provider", "id", config.id, hint=hint))
    policy = policy or RetryPolicy()
    tariff = tariff_of(config)
    own = (budget or Budget()).of(config.name, tariff, config.max_cost_usd)
    if own.is_limited and tariff is None:
        hint = "give it a price in models.yaml, or run without max_cost_usd"
        message = "has no known price, so that max_cost_usd cannot be kept"
        raise SpecError(Problem(f"model {config.name}", message, "price", config.id, hint=hint))

    def client(at: ModelConfig, http: HttpClient | None = None) -> Client:
        return (OpenAIClient if at.is_direct else LitellmClient)(at, http)

    shared: dict[str, Any] = {"config": config, "cache": cache, "budget": own, "policy": policy,
                              "observer": observer}  # fmt: skip
    if config.batch:
        assert batches is not None, "batches are kept in a run"
        return BatchModel(client=lambda http: client(config, http), files=batches, **shared)
    each = [
        Server(_origin(address) or config.provider, client(config.at(address)))
        for address in config.addresses or (None,)
    ]
    servers = Servers(each, policy, tell)
    limits = Limits(
        config.max_concurrency,
        overall or asyncio.Semaphore(config.max_concurrency),
        config.rpm,
        config.tpm,
        rest_s=servers.rest_s,
        clock=policy.clock,
    )
    return ChatModel(servers=servers, limits=limits, journal=journal, **shared)


def _origin(address: str | None) -> str:
    """Return scheme, host and port of an address."""
    return "/".join((address or "").split("/")[:3]).lower()
