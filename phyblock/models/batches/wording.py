"""Requests as lines of a batch and answers as replies, by the transports of direct calls."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.models.base import Request
from phyblock.models.batches.capture import AnsweringClient, CapturingClient
from phyblock.models.batches.ledger import Batch
from phyblock.models.batches.protocol import BatchProtocol
from phyblock.models.costs import counted, estimate
from phyblock.models.formats import FORMAT_HINT, refuses_format
from phyblock.models.http_client import Answer, Client
from phyblock.models.payload import wire_params
from phyblock.models.transport import Call, SeedRefusedError, Transport
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

    `transport` makes a transport that sends through a client.
    """

    def __init__(
        self,
        config: ModelConfig,
        protocol: BatchProtocol,
        transport: Callable[[Client], Transport],
        on_seedless: Callable[[], None],
    ) -> None:
        self._config = config
        self._protocol = protocol
        self._transport = transport
        self._on_seedless = on_seedless
        self._takes_seed = config.seed != "never"

    async def write(self, request: Request) -> Written:
        """The request as a direct call would send it; raises as that does before it sends."""
        params = wire_params(self._config, request)
        while True:
            client, seed = CapturingClient(), request.seed if self._takes_seed else None
            try:
                await self._transport(client).send(Call(request.messages, params, seed))
            except SeedRefusedError:
                self._go_without_seed()
                continue
            except ModelError:
                if client.body is None:
                    raise
            assert client.body is not None, "a transport answered without asking"
            return Written(client.body, client.headers, seeded=seed is not None)

    async def read(self, key: str, request: Request, batch: Batch) -> Reply:
        """What a direct call would have made of the answer; raises as that does.

        RetryableError also where there is no answer, or none that can be read.
        """
        answer = await self._answer(key, batch)
        params = wire_params(self._config, request)
        call = Call(request.messages, params, request.seed if batch.intent.seeded else None)
        try:
            reply = await self._transport(AnsweringClient(answer)).send(call)
        except SeedRefusedError:
            self._go_without_seed()
            raise RetryableError("the provider takes no seed", sent="answered") from None
        except ModelError as error:
            if "response_format" in params and refuses_format(error):
                why = f"{error} ({FORMAT_HINT})"
                raise UnavailableError(why, status=error.status, sent=error.sent) from None
            raise
        reply = counted(reply, estimate(self._config, request))
        return reply.model_copy(
            update={"seed_sent": call.seed is not None, "latency_s": 0.0, "batched": True}
        )

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
