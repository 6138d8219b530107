"""Requests as lines of a batch and answers as replies, by the clients of direct calls."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.models.batches.capture import AnsweringClient, CapturingClient
from phyblock.models.batches.ledger import Batch
from phyblock.models.batches.protocol import BatchProtocol
from phyblock.models.client import Answer, Client, HttpClient, SeedRefusedError
from phyblock.models.costs import counted, estimate
from phyblock.models.model import FORMAT_HINT, refuses_format
from phyblock.models.request import Request, wire_params
from phyblock.records.reply import Reply

__all__ = ["Wording", "Written"]


@dataclass(frozen=True)
class Written:
    """What a direct call would send, and whether a seed is in it."""

    body: bytes
    headers: Mapping[str, str]
    seeded: bool


class Wording:
    """Writes and reads for one model; `on_seedless` hears once that it takes no seed.

    `client` makes a client that sends through an HTTP client.
    """

    def __init__(
        self,
        config: ModelConfig,
        protocol: BatchProtocol,
        client: Callable[[HttpClient], Client],
        on_seedless: Callable[[], None],
    ) -> None:
        self._config = config
        self._protocol = protocol
        self._client = client
        self._on_seedless = on_seedless
        self._takes_seed = config.seed != "never"

    async def write(self, request: Request) -> Written:
        """The request as a direct call would send it; raises as that does before it sends."""
        while True:
            http, with_seed = CapturingClient(), self._takes_seed
            try:
                await self._client(http).complete(request, with_seed=with_seed)
            except SeedRefusedError:
                self._go_without_seed()
                continue
            except ModelError:
                if http.body is None:
                    raise
            assert http.body is not None, "a client answered without asking"
            return Written(http.body, http.headers, seeded=with_seed)

    async def read(self, key: str, request: Request, batch: Batch) -> Reply:
        """What a direct call would have made of the answer; raises as that does.

        RetryableError also where there is no answer, or none that can be read.
        """
        answer = await self._answer(key, batch)
        with_seed = batch.intent.seeded
        client = self._client(AnsweringClient(answer))
        try:
            reply = await client.complete(request, with_seed=with_seed)
        except SeedRefusedError:
            self._go_without_seed()
            raise RetryableError("the provider takes no seed", sent="answered") from None
        except ModelError as error:
            if "response_format" in wire_params(self._config, request) and refuses_format(error):
                why = f"{error} ({FORMAT_HINT})"
                raise UnavailableError(why, status=error.status, sent=error.sent) from None
            raise
        reply = counted(reply, estimate(self._config, request))
        return reply.model_copy(update={"latency_s": 0.0, "batched": True})

    async def _answer(self, key: str, batch: Batch) -> Answer:
        assert batch.results is not None, "the batch has ended"
        line = await asyncio.to_thread(batch.results.of, batch.places[key])
        if line is None and batch.results.is_empty:
            raise RetryableError(f"batch {batch.shown} ended with no answers", sent="no")
        if line is None:
            why = f"batch {batch.shown} holds no answer that can be read"
            raise RetryableError(why, status=200)
        if isinstance(line.answer, str):
            why = f"batch {batch.shown} ended before this was asked: {line.answer}"
            raise RetryableError(self._protocol.wire.shown(why), sent="no")
        return line.answer

    def _go_without_seed(self) -> None:
        if self._config.seed == "always":
            raise UnavailableError("the provider takes no seed, and seed is `always`")
        if self._takes_seed:
            self._takes_seed = False
            self._on_seedless()
