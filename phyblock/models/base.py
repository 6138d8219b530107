"""The model seam: what a request, a reply and a model are, whatever answers behind it."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from phyblock.errors import PhyblockError
from phyblock.records.reply import Reply
from phyblock.stable import hex_digest
from phyblock.types import Role

__all__ = [
    "AskLaterError",
    "GatheringModel",
    "Image",
    "Message",
    "Model",
    "Request",
]


@dataclass(frozen=True)
class Image:
    """An encoded picture as sent; `label` says what it shows ("goal", "candidates", ...)."""

    data: bytes = field(repr=False)
    label: str
    width_px: int
    height_px: int

    @functools.cached_property
    def sha256(self) -> str:
        """Hex digest of the encoded bytes."""
        return hex_digest(self.data)


@dataclass(frozen=True)
class Message:
    """One chat message: text and pictures in the order in which they are sent."""

    role: Role
    parts: tuple[str | Image, ...]


@dataclass(frozen=True)
class Request:
    """One question to a model.

    `key` names the question inside its `track` (a scene id for full planning): by both a recording
    is looked up; `seed` is the sample's seed, which also tells repeats apart;
    `params` are sampling parameters by their OpenAI names; `prompt_version` hashes the template.
    `response_format` asks for an answer as JSON, as the OpenAI protocol does; None asks for text.
    `examples` are the keys of worked examples that `messages` show before the question.
    `subject` is what the question is about, of the type that its track says: only the rules of
    baselines look at it.
    """

    key: str
    seed: int
    messages: tuple[Message, ...]
    params: Mapping[str, object]
    prompt_version: str
    subject: object
    response_format: Mapping[str, object] | None = None
    track: str = ""
    examples: tuple[str, ...] = ()


class Model(Protocol):
    """Anything that answers requests: a provider, a recording, a baseline."""

    @property
    def name(self) -> str:
        """The name the tables use."""

    @property
    def needs_messages(self) -> bool:
        """Whether prompts and pictures must be made for it.

        False for recordings, which are looked up by a request's key (what was asked when they were
        made is not known), and for baselines, which look at the request's subject alone.
        """

    async def ask(self, request: Request) -> Reply | None:
        """Answer, or None when a recording holds no reply for the request.

        Raises RetryableError when all attempts failed, SampleError or RefusedError when this
        request cannot succeed, UnavailableError when the model cannot answer at all; a model that
        gathers requests AskLaterError.
        """

    async def aclose(self) -> None:
        """Release connections; the model is not used afterwards."""


class AskLaterError(PhyblockError):
    """The request has to be gathered once more: its answer failed, or it was not sent yet."""


@runtime_checkable
class GatheringModel(Model, Protocol):
    """A model whose requests are gathered, sent together and only then asked for, in rounds.

    A round is `begin`, `gather` of each request that is not answered yet, `dispatch`, `ask` of each
    that was gathered; those whose `ask` raises AskLaterError belong to the next round.
    """

    async def begin(self) -> None:
        """Begin a round. Raises UnavailableError where nothing more can be sent."""

    async def gather(self, request: Request, *, anew: bool = False) -> bool:
        """Take a request in, unless its answer is here or on its way; False where there is no room
        for it in this round.

        `anew` says that its failure has been recorded, so that it is asked again. Raises
        BudgetReachedError where it alone could pass the cost limit.
        """

    async def dispatch(self) -> None:
        """Send what was gathered."""
