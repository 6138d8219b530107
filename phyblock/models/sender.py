"""Sending one request by a transport: with the seed and the format of the answer that the provider
takes, and within the budget.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, UnavailableError
from phyblock.models.base import Request
from phyblock.models.costs import Budget, Estimate, counted, may_be_billed
from phyblock.models.formats import FORMAT_HINT, refuses_format
from phyblock.models.halt import Halt
from phyblock.models.payload import wire_params
from phyblock.models.prices import Prices, reply_cost_usd, today
from phyblock.models.transport import Call, SeedRefusedError, Transport
from phyblock.records.reply import Reply

__all__ = ["Outlay", "Sender"]


@dataclass
class Outlay:
    """What a request is expected to take, how often it was sent, and what that cost."""

    expected: Estimate
    sent: int = 0
    billed_usd: float | None = None


class Sender:
    """Sends the requests of one model, and learns which fields its provider takes; `say_seedless`
    is called when it is found to take no seed.
    """

    def __init__(
        self,
        config: ModelConfig,
        budget: Budget | None,
        prices: Prices | None,
        halt: Halt,
        say_seedless: Callable[[], None],
    ) -> None:
        self._config = config
        self._budget = budget
        self._prices = prices
        self._halt = halt
        self._say_seedless = say_seedless
        self._takes_seed = config.seed != "never"
        self._took_format = False

    def cost_usd(self, reply: Reply) -> float | None:
        """US dollars of a reply that comes today."""
        return reply_cost_usd(self._prices, reply, today())

    async def send(self, request: Request, outlay: Outlay, transport: Transport) -> Reply:
        """Send with the seed, or without where the provider is known or found to take none;
        `outlay` grows by every sending.

        That an error speaks of a seed proves nothing, as some repeat the whole request: only a
        reply to the same request without a seed does. Raises what transports do, BudgetReachedError
        when the call does not fit, HaltedError when the run ends before it is sent.
        """
        params = wire_params(self._config, request)
        seed = request.seed if self._takes_seed else None
        call = Call(request.messages, params, seed)
        try:
            reply = await self._send_formed(call, outlay, transport)
        except SeedRefusedError as refusal:
            outlay.sent -= not refusal.sent
            if self._config.seed == "always":
                raise UnavailableError("the provider takes no seed, and seed is `always`") from None
            call = replace(call, seed=None)
            reply = await self._send_formed(call, outlay, transport)
            if self._takes_seed:
                self._takes_seed = False
                self._say_seedless()
        return reply.model_copy(update={"seed_sent": call.seed is not None})

    async def _send_formed(self, call: Call, outlay: Outlay, transport: Transport) -> Reply:
        """Send; a provider that refuses the format of the answer would refuse it every time.

        One that has taken it once means something else, as where it repeats the whole request.
        """
        try:
            reply = await self._send_paid(call, outlay, transport)
        except ModelError as error:
            is_sent = "response_format" in call.params and not self._took_format
            if not is_sent or not refuses_format(error):
                raise
            why = f"{error} ({FORMAT_HINT})"
            raise UnavailableError(why, status=error.status, sent=error.sent) from None
        self._took_format = True
        return reply

    async def _send_paid(self, call: Call, outlay: Outlay, transport: Transport) -> Reply:
        """Send with the call's greatest cost reserved in the budget.

        A failure that may have been billed counts in full; a model that is found unable before
        anything is sent costs nothing.
        """
        budget, prices, expected = self._budget, self._prices, outlay.expected
        if budget is None or prices is None:
            outlay.sent += 1
            return counted(await transport.send(call), expected)
        held: int | None = None
        spent_usd: float | None = 0.0
        try:
            with self._halt.giving_up():
                held = await budget.reserve(
                    lambda: budget.most_usd(self._config.name, prices, expected, today())
                )
            spent_usd = None
            outlay.sent += 1
            reply = counted(await transport.send(call), expected)
            spent_usd = self.cost_usd(reply)
            budget.learn(self._config.name, expected, reply.usage)
            return reply
        except (SeedRefusedError, UnavailableError):
            spent_usd = 0.0
            raise
        except ModelError as error:
            spent_usd = None if may_be_billed(error) else 0.0
            raise
        finally:
            if held is not None:
                counted_usd = budget.settle(held, spent_usd)
                outlay.billed_usd = (outlay.billed_usd or 0.0) + counted_usd
