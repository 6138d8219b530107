"""What sends a request once: the contract of the transports, and the guard around every call."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, PhyblockError, RetryableError
from phyblock.models.base import Message
from phyblock.models.http_client import Client, HttpClient
from phyblock.models.keys import hidden
from phyblock.records.reply import Reply
from phyblock.text import well_formed

__all__ = ["Call", "GuardedTransport", "SeedRefusedError", "Transport"]

_LONGEST_MESSAGE = 500


@dataclass(frozen=True)
class Call:
    """One request: messages, sampling parameters by their OpenAI names, and the seed or None."""

    messages: tuple[Message, ...]
    params: Mapping[str, Any]
    seed: int | None


class SeedRefusedError(Exception):
    """The provider takes no seed; `sent` is whether a request was spent on finding out."""

    def __init__(self, *, sent: bool) -> None:
        self.sent = sent
        super().__init__("the provider takes no seed")


class Transport(Protocol):
    """Sends one request, once: retries, limits and caches are above."""

    async def send(self, call: Call) -> Reply:
        """The validated reply, its cost not yet known.

        Raises a ModelError by class, or SeedRefusedError. Neither reply nor error holds a key.
        """

    async def aclose(self) -> None:
        """Release connections."""


class GuardedTransport(ABC):
    """A transport from which nothing comes but replies and errors of ours, with no key in them.

    Whatever the libraries below raise, or our own reading of what a server sent, is a failed call
    and no end of the run. What stops the process passes: cancellation, Ctrl-C.
    """

    def __init__(
        self, config: ModelConfig, secrets: Sequence[str], client: Client | None = None
    ) -> None:
        """`client` sends in the place of a connection of its own."""
        self._config = config
        self._secrets = tuple(secrets)
        self._client: Client = client or HttpClient(config)

    async def send(self, call: Call) -> Reply:
        """Send once; see Transport."""
        try:
            return self._clean(await self._ask(call))
        except ModelError as error:
            error.args = (self._shown(str(error)),)
            raise
        except (PhyblockError, SeedRefusedError):
            raise
        except Exception as error:
            said = f"the call failed: {type(error).__name__}: {error}"
            raise RetryableError(self._shown(said)) from None

    async def aclose(self) -> None:
        """Close all connections."""
        await self._client.aclose()

    @abstractmethod
    async def _ask(self, call: Call) -> Reply:
        """Send once; may raise anything."""

    def _clean(self, reply: Reply) -> Reply:
        """The reply without keys, and without characters that no file can hold."""

        def clean(text: str) -> str:
            return hidden(well_formed(text), self._secrets, guess=False)

        return reply.model_copy(
            update={
                "text": clean(reply.text),
                "reasoning": clean(reply.reasoning),
                "provider_model": clean(reply.provider_model),
            }
        )

    def _shown(self, text: str) -> str:
        """A text for messages and records: keys are taken out before it is cut."""
        return " ".join(hidden(text, self._secrets).split())[:_LONGEST_MESSAGE]
