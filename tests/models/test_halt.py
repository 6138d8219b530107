"""Ending a run: nothing is sent afterwards, and no reply that is in hand is lost."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3
from pathlib import Path

import pytest

from phyblock.models import (
    Budget,
    Halt,
    HaltedError,
    Prices,
    Reply,
    ReplyCache,
    SharedCache,
    reply_key,
)
from tests.models.factory import make_model, make_request, run
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Faults, Running


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
            config = ROUTES["direct"].config(running.url, prices=Prices.flat(1.0, 1.0))
            model = make_model(config, budget=Late(100.0), halt=halt)
            with pytest.raises(HaltedError):
                await model.ask(make_request())
            await model.aclose()

    server = ROUTES["direct"].server()
    run(main)
    assert server.requests == 0
    assert budget.spent_usd == 0.0
    run(lambda: budget.reserve(lambda: 100.0))


@pytest.mark.parametrize("cancels", [1, 2])
def test_a_reply_in_hand_is_not_lost_to_a_second_interrupt(tmp_path: Path, cancels: int) -> None:
    """While the cache is locked, and the reply waits to be kept in it."""
    path = tmp_path / "c.sqlite"
    server = ROUTES["direct"].server(Faults(latency_s=0.05))

    async def main(url: str) -> tuple[object, str]:
        config = ROUTES["direct"].config(url)
        async with SharedCache(path, patience_s=5.0) as cache:
            model = make_model(config, cache=cache)
            asked = asyncio.create_task(model.ask(make_request()))
            while not server.requests:
                await asyncio.sleep(0)
            with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
                db.execute("BEGIN IMMEDIATE")
                while not server.answered_by_sample:
                    await asyncio.sleep(0)
                await asyncio.sleep(0.3)
                for _ in range(cancels):
                    asked.cancel()
                    await asyncio.sleep(0.05)
                db.execute("ROLLBACK")
            (answer,) = await asyncio.gather(asked, return_exceptions=True)
            await model.aclose()
        return answer, reply_key(config, make_request())

    with Running(server) as running:
        answer, key = run(lambda: main(running.url))
    assert isinstance(answer, Reply), answer
    assert not answer.cached
    with ReplyCache(path) as cache:
        assert key in cache
