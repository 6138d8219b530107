"""Putting a model together from its configuration."""

from __future__ import annotations

from phyblock.config.models import ModelConfig
from phyblock.models.base import Model
from phyblock.models.baselines import BaselineModel
from phyblock.models.batches import BatchFiles, BatchModel, BatchParts, batch_protocol
from phyblock.models.breaker import Breakers
from phyblock.models.cache import ReplyCache
from phyblock.models.chat import ChatModel, ChatParts
from phyblock.models.costs import Budget
from phyblock.models.direct_call import DirectTransport
from phyblock.models.events import Observer, ignore_event
from phyblock.models.halt import Halt
from phyblock.models.http_client import Client
from phyblock.models.keys import secrets_of
from phyblock.models.limits import Gate, ModelLimiter
from phyblock.models.litellm_call import LitellmTransport
from phyblock.models.prices import prices_of, require_prices
from phyblock.models.replay import open_replay
from phyblock.models.replicas import Replicas
from phyblock.models.retry import RetryPolicy
from phyblock.models.transport import Transport

__all__ = ["build_model"]


def build_model(
    config: ModelConfig,
    *,
    cache: ReplyCache | None,
    overall: Gate,
    budget: Budget | None = None,
    observer: Observer = ignore_event,
    policy: RetryPolicy | None = None,
    breakers: Breakers | None = None,
    halt: Halt | None = None,
    batches: BatchFiles | None = None,
) -> Model:
    """The model that a configuration describes; nothing is imported or sent before it is asked.

    `overall` bounds what all models of a run have under way together, `breakers` are those of their
    servers, `halt` ends their waits. `batches` is where a model that is asked so keeps them. Raises
    SpecError for an unknown baseline, a model without a price under a budget, a list of servers
    that cannot be used or a provider without batches, DataError for missing recordings.
    """
    if config.kind == "baseline":
        return BaselineModel(config)
    if config.kind == "replay":
        return open_replay(config)
    secrets = secrets_of(config)
    policy = policy or RetryPolicy()

    def transport(at: ModelConfig, client: Client | None = None) -> Transport:
        kind = DirectTransport if at.is_direct else LitellmTransport
        return kind(at, secrets, client)

    prices = prices_of(config) if budget is None else require_prices(config)
    halt = halt or Halt()
    if config.batch:
        assert batches is not None, "batches are kept in a run"
        batch_parts = BatchParts(
            protocol=batch_protocol(config, secrets),
            transport=lambda client: transport(config, client),
            files=batches,
            cache=cache,
            budget=budget,
            prices=prices,
            policy=policy,
            observer=observer,
            halt=halt,
        )
        return BatchModel(config, batch_parts)
    replicas = Replicas(config, transport, breakers or Breakers(policy))
    parts = ChatParts(
        replicas=replicas,
        limiter=ModelLimiter(replicas.width, overall, config.rpm, config.tpm),
        cache=cache,
        budget=budget,
        prices=prices,
        policy=policy,
        secrets=secrets,
        observer=observer,
        halt=halt,
    )
    return ChatModel(config, parts)
