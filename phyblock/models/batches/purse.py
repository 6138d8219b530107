"""What requests in batches count against a run's cost limit, from before they are sent."""

from __future__ import annotations

from phyblock.config.models import ModelConfig
from phyblock.models.batches.ledger import Batch
from phyblock.models.costs import Budget, estimate, most_usd
from phyblock.models.prices import Prices, today
from phyblock.models.request import Request
from phyblock.records.reply import Reply

__all__ = ["Purse"]


class Purse:
    """One model's part of the budget; without a budget nothing is counted.

    Of each batch the dearest case of its requests is held, and each is settled when its answer is
    read. `billed_usd` is what was counted for a request so far.
    """

    def __init__(self, config: ModelConfig, budget: Budget | None, prices: Prices | None) -> None:
        self._config = config
        self._budget = budget
        self._prices = prices
        self._held: set[tuple[str, str]] = set()
        self._billed_usd: dict[str, float] = {}

    def most_usd(self, request: Request) -> float | None:
        """The most that a request can cost, also without a limit, as the command that reads the
        answer may have one; None where no price is known.
        """
        day = today()
        if self._prices is None or self._prices.on(day) is None:
            return None
        expected, name = estimate(self._config, request), self._config.name
        if self._budget is None:
            return most_usd(self._prices, expected, day, batched=True)
        return self._budget.most_usd(name, self._prices, expected, day, batched=True)

    def fits(self, usd: float | None) -> bool:
        """Whether so much is left; None is nothing, as under a limit prices are known."""
        return self._budget is None or self._budget.fits(usd or 0.0)

    async def wait_for(self, usd: float | None) -> None:
        """Wait for so much to be left; BudgetReachedError where it never will be."""
        if self._budget is not None:
            self._budget.settle(await self._budget.reserve(lambda: usd or 0.0), 0.0)

    def hold(self, key: str, usd: float | None, held: dict[str, int]) -> None:
        """Hold so much for a request, whose reservation is put into `held`."""
        if self._budget is not None:
            held[key] = self._budget.hold(usd or 0.0)

    def hold_again(self, batch: Batch, key: str) -> None:
        """Hold for a request of an earlier command, once."""
        if (batch.token, key) not in self._held:
            self._held.add((batch.token, key))
            self.hold(key, batch.most_usd(key), batch.held)

    def settle(self, key: str, batch: Batch, usd: float | None) -> None:
        """Count what a request cost; None is all that it can have cost."""
        if self._budget is not None and key in batch.held:
            spent_usd = self._budget.settle(batch.held.pop(key), usd)
            self._billed_usd[key] = self._billed_usd.get(key, 0.0) + spent_usd

    def settle_all(self, held: dict[str, int], usd: float | None) -> None:
        """Count what all requests cost that are not settled."""
        while self._budget is not None and held:
            self._budget.settle(held.popitem()[1], usd)

    def billed_usd(self, key: str) -> float | None:
        """What was counted for a request; None where there is no limit."""
        return self._billed_usd.get(key)

    def learn(self, request: Request, reply: Reply) -> None:
        """Compare the estimate with what the provider counted."""
        if self._budget is not None:
            expected = estimate(self._config, request)
            self._budget.learn(self._config.name, expected, reply.usage)
