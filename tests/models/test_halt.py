"""Ending a run: nothing is sent afterwards, and no reply that is in hand is lost."""

from __future__ import annotations

import asyncio
import contextlib

import pytest

from phyblock.models import (
    Budget,
    Halt,
    HaltedError,
)
from tests.models.factory import make_model, make_request, run
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Running


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")


@pytest.mark.parametrize("in_wait_for", [False, True])
def test_a_wait_that_ends_together_with_the_run_is_given_up_too(in_wait_for: bool) -> None:
    async def main() -> None:
        halt = Halt()
        done: asyncio.Future[int] = asyncio.get_running_loop().create_future()

        async def swallowing() -> int:
            with contextlib.suppress(asyncio.CancelledError):
                await done
            return 1

        async def request() -> int:
            with halt.giving_up():
                return await (asyncio.wait_for(done, 60) if in_wait_for else swallowing())

        waiting = asyncio.create_task(request())
        while not halt.waiting:
            await asyncio.sleep(0)
        done.set_result(1)
        halt.set()
        with pytest.raises(HaltedError):
            await waiting

    run(main)


def test_a_run_that_ends_while_money_is_reserved_sends_nothing_and_holds_none() -> None:
    """The switch is set in the last moment, when the reservation is already made."""
    halt, budget = Halt(), Budget(100.0)

    class Late(Budget):
        async def reserve(self, most_usd: object) -> int:
            held = await budget.reserve(most_usd)  # type: ignore[arg-type]
            asyncio.get_running_loop().call_soon(halt.set)
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.sleep(60)
            return held

        def settle(self, reservation: int, usd: float | None) -> float:
            return budget.settle(reservation, usd)

    async def main() -> None:
        with Running(server) as running:
            config = ROUTES["direct"].config(running.url, price={"input": 1.0, "output": 1.0})
            model = make_model(config, budget=Late(100.0), halt=halt)
            with pytest.raises(HaltedError):
                await model.ask(make_request())
            await model.aclose()

    server = ROUTES["direct"].server()
    run(main)
    assert server.requests == 0
    assert budget.spent_usd == 0.0
    run(lambda: budget.reserve(lambda: 100.0))
