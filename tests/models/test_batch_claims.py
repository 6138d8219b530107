"""Runs on one cache that ask the same in batches: each question is asked by one of them."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from phyblock.errors import SampleError
from phyblock.models import ModelEvent, Reply, ReplyCache, SharedCache
from phyblock.models.leases import LEASE_S, Lease, Leases
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
            single = await asyncio.wait_for(
                asyncio.gather(*(model.ask(one) for one in requests), return_exceptions=True),
                LIMIT_S,
            )
            await model.aclose()
        return await batch, single

    with Running(server) as running:
        ended, single = asyncio.run(both(running.url))
    assert isinstance(ended[1], SampleError)
    assert [one.batched for one in single if isinstance(one, Reply)] == [True, False, True]
    assert [event.message for event in told if event.kind == "batch"] == [
        "waiting for what another run asks in a batch"
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
        assert ours.renew(group)
        now += LEASE_S / 2 + 1
        assert theirs.is_grouped("b")
        assert not ours.is_taken("a")
        now += LEASE_S
        assert theirs.take("b") is not None
        assert theirs.add(rival, ["c"])
