"""Runs on one cache that ask the same in batches: each question is asked by one of them."""

from __future__ import annotations

import asyncio
import contextlib
import random
import sqlite3
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from phyblock.errors import SampleError, UnavailableError
from phyblock.models import (
    AskLaterError,
    Gate,
    GatheringModel,
    Halt,
    ModelEvent,
    Reply,
    ReplyCache,
    SharedCache,
    build_model,
    reply_key,
)
from phyblock.models.batches.claims import Claims
from phyblock.models.leases import LEASE_S, Lease, Leases
from phyblock.models.limits import Clock
from tests.models.batching import Disk, command
from tests.models.factory import make_model
from tests.models.routes import KEY_VARIABLE
from tests.models.test_batches import KEY, config_at, requests_of
from tests.servers.batches import BatchFaults
from tests.servers.chassis import Running
from tests.servers.openai_batches import OpenAIBatches

LIMIT_S = 20


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, KEY)


@pytest.mark.parametrize("seed", range(4))
def test_runs_that_share_questions_ask_each_once_and_never_wait_for_each_other(
    tmp_path: Path, seed: int
) -> None:
    """In any order, some of them alone, with failures that are asked for again."""
    draw = random.Random(seed)
    requests = requests_of(8)
    asked = [draw.sample(requests, draw.randint(4, 8)) for _ in range(3)]
    failing = {0: {0: "500"}, 1: {draw.randrange(3): "429"}} if seed % 2 else {}
    server = OpenAIBatches(batch=BatchFaults(lines=failing))

    async def all_of_them(url: str) -> list[list[Reply | Exception]]:
        config = config_at("direct", url)
        disks = [Disk(tmp_path / str(n), tmp_path / "replies.sqlite") for n in range(3)]
        runs = [command(config, disk, own) for disk, own in zip(disks, asked, strict=True)]
        return await asyncio.wait_for(asyncio.gather(*runs), LIMIT_S)

    with Running(server) as running:
        ended = asyncio.run(all_of_them(running.url))
    texts: dict[str, set[str]] = {}
    for own, replies in zip(asked, ended, strict=True):
        for request, reply in zip(own, replies, strict=True):
            assert isinstance(reply, Reply), reply
            texts.setdefault(request.key, set()).add(reply.text)
    assert all(len(one) == 1 for one in texts.values())
    failed = sum(place < len(made.requests) for made in server.made
                 for place in failing.get(made.ordinal, {}))  # fmt: skip
    assert sum(server.asked.values()) == len(texts) + failed


def test_a_single_call_waits_for_the_batch_and_a_failure_there_is_asked_for_itself(
    tmp_path: Path,
) -> None:
    requests = requests_of(3)
    server = OpenAIBatches(batch=BatchFaults(lines={0: {1: "400"}}, looks=8))
    told: list[ModelEvent] = []

    async def both(url: str) -> tuple[Sequence[Reply | Exception], list[object]]:
        config, cache = config_at("direct", url), tmp_path / "replies.sqlite"
        disk = Disk(tmp_path, cache)
        batch = asyncio.create_task(command(config, disk, requests))
        while "created" not in disk.events:
            await asyncio.sleep(0.005)
        async with SharedCache(cache) as shared:
            plain = replace(config, batch=False, timeout_s=0.05)
            model = make_model(plain, cache=shared, events=told)

            async def ask_all() -> list[object]:
                asked = asyncio.gather(*map(model.ask, requests), return_exceptions=True)
                return await asyncio.wait_for(asked, LIMIT_S)

            # The first time, others may be asked before.
            assert [type(one) for one in await ask_all()] == [AskLaterError] * 3
            assert not told
            single = await ask_all()
            await model.aclose()
        return await batch, single

    with Running(server) as running:
        ended, single = asyncio.run(both(running.url))
    assert isinstance(ended[1], SampleError)
    assert [one.batched for one in single if isinstance(one, Reply)] == [True, False, True]
    assert [event.message for event in told if event.kind == "batch"] == [
        "waiting for what another run asks in a batch; --no-cache asks at once, and pays again"
    ]


def test_questions_under_one_lease_are_free_again_with_it(tmp_path: Path) -> None:
    now = 1000.0
    with ReplyCache(tmp_path / "c.sqlite") as file, ReplyCache(tmp_path / "c.sqlite") as other:
        ours, theirs = Leases(file._db, lambda: now), Leases(other._db, lambda: now)
        group, rival = ours.take_group(), theirs.take_group()
        assert ours.add(group, ["a", "b"])
        assert ours.add(group, ["b", "c"])
        assert not theirs.add(rival, ["d", "c"])
        assert theirs.take("a") is None
        assert not theirs.is_taken("d")
        assert isinstance(theirs.take("e"), Lease)
        assert not ours.add(group, ["e"])
        ours.remove(group, "a")
        assert theirs.add(rival, ["a"])
        ours.remove(group, "a")
        assert ours.is_taken("a")
        now += LEASE_S / 2
        ours.hold(group)
        now += LEASE_S / 2 + 1
        assert theirs.asking("b") == (False, True)
        assert not ours.is_taken("a")
        now += LEASE_S
        assert theirs.take("b") is not None
        assert theirs.add(rival, ["c"])


def test_what_others_cleared_away_stands_again_with_the_next_sign_of_life(tmp_path: Path) -> None:
    """As after a sleep of the machine; and nothing is claimed under a lease that is not there."""
    now = 1000.0
    with ReplyCache(tmp_path / "c.sqlite") as file, ReplyCache(tmp_path / "c.sqlite") as other:
        ours, theirs = Leases(file._db, lambda: now), Leases(other._db, lambda: now)
        group = ours.take_group()
        assert ours.add(group, ["a", "b", "c"])
        for sign in (lambda: ours.hold(group), lambda: ours.add(group, ["d"])):
            ours.remove(group, "c")
            now += 2 * LEASE_S
            assert theirs.take("other")
            theirs.give_all_back()
            assert not theirs.is_taken("a")
            sign()
            assert [theirs.is_taken(key) for key in "abc"] == [True, True, False]
        assert theirs.take("d") is None
        ours.give_group_back(group)
        assert file._db.execute("SELECT count(*) FROM grouped_leases").fetchone() == (0,)


def test_claims_outlive_a_while_in_which_the_cache_was_set_aside(tmp_path: Path) -> None:
    now = 0.0
    path = tmp_path / "c.sqlite"

    async def main() -> None:
        nonlocal now
        clock = Clock(lambda: now, asyncio.sleep)
        async with (
            SharedCache(path, patience_s=0.05, clock=clock) as ours,
            SharedCache(path) as theirs,
            ours.group() as group,
        ):
            assert group is not None
            assert await ours.join(group, ["a", "b"])
            with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as db:
                db.execute("BEGIN IMMEDIATE")
                await ours.leave(group, ["a"])
                assert await ours.join(group, ["c"])
                db.execute("ROLLBACK")
                db.execute("DELETE FROM leases")
            now += 61
            assert await ours.join(group, ["d"])
            known = [(await theirs.look(key)).is_batched for key in "abcd"]
            assert known == [False, True, True, True]

    asyncio.run(main())


def test_all_that_one_holds_who_hangs_is_waited_for_no_longer_than_one_batch(
    tmp_path: Path,
) -> None:
    """And what is claimed here is free meanwhile."""
    now, free = 0.0, []

    async def main() -> None:
        async with SharedCache(tmp_path / "c.sqlite") as theirs, theirs.group() as group:
            assert group is not None
            await theirs.join(group, ["a", "b", "c"])

            async def sleep(_: float) -> None:
                nonlocal now
                now += 3600
                free.append((await theirs.look("mine")).is_asked)

            clock = Clock(lambda: now, sleep)
            async with SharedCache(tmp_path / "c.sqlite", clock=clock) as ours:
                claims = Claims(ours, 60.0, Halt(), lambda _: None)
                await claims.begin({"mine"})
                assert not any([await claims.take(key) for key in "abc"])
                await claims.wait_for_others()
                assert all([await claims.take(key) for key in "abc"])
                await claims.aclose()

    asyncio.run(main())
    assert now <= 27 * 3600
    assert free
    assert not any(free)


def test_a_model_that_stops_keeps_nobody_waiting(tmp_path: Path) -> None:
    """Other models of its process may go on for hours."""
    requests = requests_of(3)

    async def main(url: str) -> None:
        config = config_at("direct", url)
        disk = Disk(tmp_path, tmp_path / "replies.sqlite")
        async with SharedCache(tmp_path / "replies.sqlite") as cache:
            model = build_model(config, cache=cache, overall=Gate(8), batches=disk.files())
            assert isinstance(model, GatheringModel)
            await model.begin()
            for request in requests:
                assert await model.gather(request)
            await model.dispatch()
            keys = [reply_key(config, request) for request in requests]
            assert all([(await cache.look(key)).is_batched for key in keys])
            with pytest.raises(UnavailableError):
                await model.ask(requests[0])
            assert not any([(await cache.look(key)).is_asked for key in keys])
            await model.aclose()

    with Running(OpenAIBatches(batch=BatchFaults(calls={"look": ("401",)}))) as running:
        asyncio.run(main(running.url))
