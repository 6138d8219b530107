"""The cache under a run: locked, broken, shared by those who ask the same; never in the way."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3
import subprocess
import sys
import time
from collections.abc import Awaitable, Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import StoreError
from phyblock.models import (
    Budget,
    Halt,
    HaltedError,
    ModelConfig,
    Prices,
    Reply,
    ReplyCache,
    SharedCache,
    reply_key,
)
from phyblock.models.leases import LEASE_S, Lease, Leases
from phyblock.models.limits import Clock
from tests.models.factory import make_model, make_request, run
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Faults, Running

REPLY = Reply(text="Step1: Move block with index 3")


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "c.sqlite"


@contextlib.contextmanager
def locked(path: Path, how: str = "IMMEDIATE") -> Iterator[sqlite3.Connection]:
    """Hold the file as another process would."""
    db = sqlite3.connect(path, isolation_level=None)
    db.execute(f"BEGIN {how}")
    try:
        yield db
    finally:
        with contextlib.suppress(sqlite3.OperationalError):
            db.execute("ROLLBACK")
        db.close()


async def beats_during(job: Awaitable[object]) -> int:
    """How often the loop came round while the job went on."""
    task = asyncio.ensure_future(job)
    beats = 0
    while not task.done():
        await asyncio.sleep(0.001)
        beats += 1
    await task
    return beats


def test_a_locked_file_holds_up_one_operation_once_and_never_the_loop(path: Path) -> None:
    said: list[str] = []

    async def main() -> None:
        async with SharedCache(path, said.append, patience_s=0.2) as cache:
            await cache.keep("before", "m", REPLY)
            with locked(path):
                every = asyncio.gather(*(cache.keep(f"k{n}", "m", REPLY) for n in range(50)))
                assert await beats_during(every) > 20
                assert len(said) == 1
                await cache.keep("later", "m", REPLY)
                assert (await cache.look("before")).reply is None
        assert len(said) == 1

    run(main)
    assert "database is locked" in said[0]
    assert "going on without it" in said[0]


def test_a_locked_file_is_used_again_when_it_is_free(path: Path) -> None:
    said: list[str] = []
    now_s = 0.0

    async def main() -> None:
        nonlocal now_s
        clock = Clock(lambda: now_s, asyncio.sleep)
        async with SharedCache(path, said.append, patience_s=0.05, clock=clock) as cache:
            for _ in range(3):
                with locked(path):
                    await cache.keep("a", "m", REPLY)
                    now_s += 61
                    await cache.keep("b", "m", REPLY)
                now_s += 61
                await cache.keep("c", "m", REPLY)
                found = (await cache.look("c")).reply
                assert found is not None
                assert found.text == REPLY.text

    run(main)
    assert ["again" in text and "later" not in text for text in said] == [False, True] * 3


def test_a_run_goes_on_while_the_cache_is_locked(path: Path) -> None:
    said: list[str] = []
    server = ROUTES["direct"].server()

    async def main() -> list[object]:
        async with SharedCache(path, said.append, patience_s=0.1) as cache:
            with Running(server) as running, locked(path):
                model = make_model(ROUTES["direct"].config(running.url), cache=cache)
                asked = (model.ask(make_request(f"{n:03}")) for n in range(30))
                answers = await asyncio.gather(*asked)
                await model.aclose()
                return list(answers)

    assert {type(answer) for answer in run(main)} == {Reply}
    assert server.requests == 30
    assert len(said) == 1


def test_a_file_that_is_locked_at_the_start_is_set_aside(path: Path) -> None:
    said: list[str] = []
    ReplyCache(path).close()
    with contextlib.closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA journal_mode = DELETE")

    async def main() -> None:
        with locked(path, "EXCLUSIVE"):
            async with SharedCache(path, said.append, patience_s=0.05) as cache:
                assert (await cache.look("k")).reply is None

    run(main)
    assert len(said) == 1


@pytest.mark.parametrize("content", [b"this is no database, but long enough " * 40, b"SQLite"])
def test_a_foreign_file_is_an_error_at_the_start(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    with pytest.raises(StoreError, match="delete the file"):
        run(SharedCache(path).open)
    assert path.read_bytes() == content


def test_a_file_that_breaks_later_is_set_aside_and_opened_anew(path: Path) -> None:
    said: list[str] = []
    now_s = 0.0

    async def main() -> None:
        nonlocal now_s
        clock = Clock(lambda: now_s, asyncio.sleep)
        async with SharedCache(path, said.append, clock=clock) as cache:
            await cache.keep("k", "m", REPLY)
            with contextlib.closing(sqlite3.connect(path)) as db, db:
                db.execute("DROP TABLE replies")
            assert (await cache.look("k")).reply is None
            assert "no such table" in said[0]
            path.unlink()
            now_s += 61
            await cache.keep("k", "m", REPLY)
            assert (await cache.look("k")).reply is not None

    run(main)
    assert len(said) == 2


def test_a_row_that_cannot_be_read_is_told_once_and_the_file_stays_in_use(path: Path) -> None:
    said: list[str] = []

    async def main() -> None:
        async with SharedCache(path, said.append) as cache:
            for key in "abc":
                await cache.keep(key, "m", REPLY)
            with contextlib.closing(sqlite3.connect(path)) as db, db:
                db.execute("UPDATE replies SET reply = '{' WHERE key < 'c'")
            assert [(await cache.look(key)).reply is None for key in "abc"] == [True, True, False]
            async with cache.asking("a") as turn:
                assert turn.is_ours
                await cache.keep("a", "m", REPLY)
            assert (await cache.look("a")).reply is not None

    run(main)
    (text,) = said
    assert "holds a broken reply" in text


def test_an_older_file_is_taken_as_it_is_and_stays_one(path: Path) -> None:
    with ReplyCache(path) as cache:
        cache.put("old", "m", REPLY)
    with contextlib.closing(sqlite3.connect(path)) as db:
        assert [row[0] for row in db.execute("SELECT name FROM sqlite_master")] == ["replies"]

    async def main() -> None:
        async with SharedCache(path) as cache:
            assert (await cache.look("old")).reply is not None
            async with cache.asking("new") as turn:
                assert turn.is_ours

    run(main)
    with contextlib.closing(sqlite3.connect(path)) as db:
        assert db.execute("PRAGMA user_version").fetchone() == (1,)
        assert db.execute("SELECT count(*) FROM leases").fetchone() == (0,)
    with ReplyCache(path) as cache:
        assert "old" in cache


def ask_twice(
    path: Path, url: str, requests: int, change: Callable[[ModelConfig], ModelConfig] = lambda c: c
) -> list[list[Reply | BaseException]]:
    """Ask the same through two caches on one file, at the same time."""

    async def one(config: ModelConfig) -> list[Reply | BaseException]:
        async with SharedCache(path) as cache:
            model = make_model(config, cache=cache)
            asked = (model.ask(make_request(f"{n:03}")) for n in range(requests))
            answers = await asyncio.gather(*asked, return_exceptions=True)
            await model.aclose()
            return list(answers)  # type: ignore[arg-type]

    async def main() -> list[list[Reply | BaseException]]:
        config = change(ROUTES["direct"].config(url))
        return list(await asyncio.gather(one(config), one(config)))

    return run(main)


def test_what_two_ask_at_the_same_time_is_asked_once(path: Path) -> None:
    server = ROUTES["direct"].server(
        Faults(latency_s=0.02, rate_limited=0.1, server_error=0.1, reset=0.05)
    )
    with Running(server) as running:
        first, second = ask_twice(path, running.url, 40)
    assert {type(answer) for answer in [*first, *second]} == {Reply}
    assert server.ended["ok"] == 40
    texts = [[a.text for a in answers if isinstance(a, Reply)] for answers in (first, second)]
    assert texts[0] == texts[1]
    cached = [answer.cached for answer in [*first, *second] if isinstance(answer, Reply)]
    assert sum(cached) == 40


def test_what_is_no_whole_reply_is_asked_by_each(path: Path) -> None:
    server = ROUTES["direct"].server(Faults(mode="length", latency_s=0.01))
    with Running(server) as running:
        first, second = ask_twice(path, running.url, 5)
    assert {type(answer) for answer in [*first, *second]} == {Reply}
    assert server.requests == 10


def lease_of_another(path: Path, key: str, at_s: float) -> None:
    """A lease that a process took at a time and never gave back."""
    ReplyCache(path).close()
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
        assert Leases(db, lambda: at_s).take(key)


@pytest.mark.parametrize("age_s", [LEASE_S + 1, 10 * LEASE_S, -3600])
def test_a_lease_that_ran_out_or_comes_from_the_future_holds_nobody_up(
    path: Path, age_s: float
) -> None:
    lease_of_another(path, "k", time.time() - age_s)

    async def main() -> None:
        async with SharedCache(path) as cache:
            assert await cache.await_others("k", 1000) == (None, False)
            async with cache.asking("k") as turn:
                assert turn.is_ours

    run(main)


def test_a_partner_that_hangs_is_waited_for_no_longer_than_a_request_takes(path: Path) -> None:
    server = ROUTES["direct"].server()
    with Running(server) as running:
        config = ROUTES["direct"].config(running.url, timeout_s=0.3)
        lease_of_another(path, reply_key(config, make_request()), time.time())

        async def main() -> Reply | None:
            async with SharedCache(path) as cache:
                model = make_model(config, cache=cache)
                try:
                    return await model.ask(make_request())
                finally:
                    await model.aclose()

        reply = run(main)
    assert isinstance(reply, Reply)
    assert not reply.cached


def test_a_lease_is_renewed_while_the_call_is_under_way(path: Path) -> None:
    ReplyCache(path).close()
    now_s = 0.0
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
        ours, theirs = (Leases(db, lambda: now_s) for _ in range(2))
        lease = ours.take("k")
        assert lease is not None
        for _ in range(20):
            now_s += LEASE_S / 3
            assert not theirs.take("k")
            assert ours.renew(lease)
        ours.give_back(lease)
        assert not ours.renew(lease)
        assert theirs.take("k")
        ours.give_back(lease)
        ours.give_all_back()
        assert ours.is_taken("k")


def test_a_lease_that_another_took_by_force_does_not_come_back(path: Path) -> None:
    ReplyCache(path).close()
    now_s = 0.0
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
        slow, forceful, third = (Leases(db, lambda: now_s) for _ in range(3))
        first = slow.take("k")
        second = forceful.take("k", by_force=True)
        assert first is not None
        assert second is not None
        now_s += LEASE_S / 3
        assert not slow.renew(first)
        slow.give_back(first)
        slow.give_all_back()
        assert third.take("k") is None
        forceful.give_back(second)
        assert third.take("k") is not None


def test_one_who_took_by_force_keeps_the_lease_when_the_first_of_its_process_ends(
    path: Path,
) -> None:
    async def main() -> None:
        async with (
            SharedCache(path) as ours,
            SharedCache(path) as theirs,
            contextlib.AsyncExitStack() as first,
        ):
            await first.enter_async_context(ours.asking("k"))
            async with ours.asking("k", by_force=True) as second:
                assert second.is_ours
                await first.aclose()
                async with theirs.asking("k") as third:
                    assert not third.is_ours

    run(main)


@given(st.lists(st.tuples(st.sampled_from("ab"), st.floats(-100, 100), st.booleans()), max_size=20))
def test_no_two_hold_a_lease_at_once(steps: list[tuple[str, float, bool]]) -> None:
    """Whatever the clock does, one who takes is alone, or the other's lease had run out."""
    now_s = 1000.0
    held: dict[str, float] = {}
    with contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as db:
        leases = {owner: Leases(db, lambda: now_s) for owner in "ab"}
        taken: dict[str, Lease] = {}
        for owner, passes_s, gives_back in steps:
            now_s += passes_s
            if gives_back:
                if owner in taken:
                    leases[owner].give_back(taken.pop(owner))
                held.pop(owner, None)
            elif (lease := leases[owner].take("k")) is not None:
                taken[owner] = lease
                assert all(not now_s < until <= now_s + LEASE_S for until in held.values())
                held = {owner: now_s + LEASE_S}


def test_a_wait_for_another_is_given_up_when_the_run_ends(path: Path) -> None:
    config = ROUTES["direct"].config("http://127.0.0.1:9")
    lease_of_another(path, reply_key(config, make_request()), time.time())

    async def main() -> None:
        halt = Halt()
        async with SharedCache(path) as cache:
            model = make_model(config, cache=cache, halt=halt)
            asked = asyncio.create_task(model.ask(make_request()))
            for _ in range(20):
                await asyncio.sleep(0.01)
            assert halt.waiting == 1
            halt.set()
            with pytest.raises(HaltedError):
                await asked
            await model.aclose()

    run(main)


def test_a_reply_that_another_brought_says_what_attempts_before_it_cost(path: Path) -> None:
    server = ROUTES["direct"].server(Faults(mode="html"))

    async def main() -> Reply | None:
        async with SharedCache(path) as cache:
            with Running(server) as running:
                config = ROUTES["direct"].config(running.url, prices=Prices.flat(10.0, 100.0))
                key = reply_key(config, make_request())
                model = make_model(config, cache=cache, budget=Budget(100.0))
                asked = asyncio.create_task(model.ask(make_request()))
                while not server.requests:
                    await asyncio.sleep(0)
                with ReplyCache(path) as other:
                    other.put(key, config.id, REPLY)
                reply = await asked
                await model.aclose()
                return reply

    reply = run(main)
    assert reply is not None
    assert reply.cached
    assert reply.attempts == server.requests > 0
    assert reply.billed_usd is not None
    assert reply.billed_usd > 0


ASKING = """
import asyncio, os, sys
from pathlib import Path
os.environ["PHYBLOCK_TEST_KEY"] = "sk-not-a-real-key-1234"
from phyblock.models import SharedCache
from tests.models.factory import make_model, make_request
from tests.models.routes import ROUTES
async def main():
    async with SharedCache(Path(sys.argv[1])) as cache:
        model = make_model(ROUTES["direct"].config(sys.argv[2]), cache=cache)
        asked = (model.ask(make_request(f"{n:03}")) for n in range(60))
        print(sum(reply.cached for reply in await asyncio.gather(*asked)))
        await model.aclose()
asyncio.run(main())
"""


def test_what_two_processes_ask_at_the_same_time_is_asked_once(path: Path) -> None:
    server = ROUTES["direct"].server(Faults(latency_s=0.3))
    with Running(server) as running:
        command = [sys.executable, "-c", ASKING, str(path), running.url]
        root = Path(__file__).parents[2]
        both = [
            subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=root) for _ in range(2)
        ]
        cached = [int(process.communicate(timeout=60)[0]) for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert server.requests == 60
    assert sum(cached) == 60
