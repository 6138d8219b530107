"""The bundled suites asked through real serving software; skipped where it is not there."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.fork_server import Done
from tests.servers.chassis import Running
from tests.serving.real_server import (
    PICTURE_TOKENS,
    CountingProxy,
    missing_software,
    serving,
)
from tests.workspace import Raw, Workspace

pytestmark = pytest.mark.slow

MAX_TOKENS = 64
AT_ONCE = 3
_SUITES = {"full": "full_planning", "steps": "step_planning", "vqa": "vqa"}


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, str]]:
    """The address of the server and the id of its model."""
    why = missing_software()
    if why:
        pytest.skip(why)
    with serving(tmp_path_factory.mktemp("serving")) as there:
        yield there


@pytest.fixture
def proxied(served: tuple[str, str]) -> Iterator[tuple[CountingProxy, str, str]]:
    """A proxy before the server, its address, and the id of the model."""
    address, model = served
    proxy = CountingProxy(address)
    with Running(proxy) as running:
        yield proxy, running.url, model


def write_model(workspace: Workspace, url: str, model: str, **fields: Any) -> None:
    entry = {"id": f"hosted_vllm/{model}", "api_base": f"{url}/v1", "max_tokens": MAX_TOKENS,
             "max_concurrency": AT_ONCE, "price": {"input": 1, "output": 1}, **fields}  # fmt: skip
    workspace.write_yaml("models.yaml", {"tiny": entry})


def run(workspace: Workspace, suite: str, *args: str | Path) -> Done:
    words = ["run", suite, "--models", "tiny", "--out", workspace.out, "--no-report", "--yes"]
    sets = ["--set", "images.size_px=128", "--limit", "2"]
    return workspace.phyblock(*words, *sets, *args)


def ask(url: str, body: Raw) -> Raw:
    """What a server answers to this body."""
    request = urllib.request.Request(
        f"{url}/v1/chat/completions",
        json.dumps(body).encode(),
        {"Content-Type": "application/json"},
    )
    with urllib.request.urlopen(request, timeout=120) as answer:
        return json.load(answer)


def texts(records: list[Raw]) -> dict[str, str]:
    """Replies by what was asked."""
    return {record["key"]: record["reply"]["text"] for record in records}


@pytest.mark.parametrize(
    ("suite", "transport"),
    [*((suite, "direct") for suite in _SUITES), ("full", "litellm")],
)
def test_a_bundled_suite_is_asked_counted_and_resumed(
    workspace: Workspace, proxied: tuple[CountingProxy, str, str], suite: str, transport: str
) -> None:
    proxy, url, model = proxied
    write_model(workspace, url, model, transport=transport)
    done = run(workspace, suite, "--set", "seeds=[0]")
    assert done.code == 0, done.out + done.err
    records = workspace.records()
    assert [record["track"] for record in records] == [_SUITES[suite]] * 2
    assert {record["reply"]["finish"] for record in records} == {"stop"}
    assert {exchange.status for exchange in proxy.seen} == {200}
    assert all(exchange.pictures for exchange in proxy.seen)
    assert 1 <= proxy.most_at_once <= AT_ONCE

    told = [exchange.answer["usage"] for exchange in proxy.seen]
    for exchange, usage in zip(proxy.seen, told, strict=True):
        assert usage["prompt_tokens"] > PICTURE_TOKENS * exchange.pictures
    for name in ("prompt_tokens", "completion_tokens"):
        counted = sum(record["reply"]["usage"][name] for record in records)
        assert counted == sum(usage[name] for usage in told)

    asked = len(proxy.seen)
    assert run(workspace, suite, "--set", "seeds=[0]").code == 0
    workspace.out = workspace.root / "elsewhere"
    assert run(workspace, suite, "--set", "seeds=[0]").code == 0
    assert len(proxy.seen) == asked, "what was answered was asked again"
    assert texts(workspace.records()) == texts(records)


def test_every_picture_that_is_sent_reaches_the_model(
    workspace: Workspace, proxied: tuple[CountingProxy, str, str]
) -> None:
    """What is sent without its pictures takes fewer tokens, by those of the pictures."""
    proxy, url, model = proxied
    write_model(workspace, url, model, max_tokens=1)
    assert run(workspace, "full", "--set", "seeds=[0]").code == 0
    for exchange in list(proxy.seen):
        assert exchange.pictures
        with_pictures = exchange.answer["usage"]["prompt_tokens"]
        without = ask(url, exchange.without_pictures())["usage"]["prompt_tokens"]
        assert with_pictures - without == PICTURE_TOKENS * exchange.pictures


def test_replies_follow_from_the_seed(
    workspace: Workspace, proxied: tuple[CountingProxy, str, str]
) -> None:
    proxy, url, model = proxied
    found: dict[tuple[float, int, str], dict[str, str]] = {}
    for temperature in (0.0, 1.0):
        # One after the other: this server draws from one source for all requests.
        write_model(workspace, url, model, temperature=temperature, max_concurrency=1)
        for seed in (1, 2):
            for repeat in ("first", "again"):
                workspace.out = workspace.root / f"{temperature}-{seed}-{repeat}"
                sets = ["--set", f"seeds=[{seed}]", "--no-cache"]
                assert run(workspace, "vqa", *sets).code == 0
                found[temperature, seed, repeat] = texts(workspace.records())
    for temperature in (0.0, 1.0):
        for seed in (1, 2):
            assert found[temperature, seed, "first"] == found[temperature, seed, "again"]
    assert found[1.0, 1, "first"] != found[1.0, 2, "first"]
    assert [exchange.body["seed"] for exchange in proxy.seen] == [1, 1, 1, 1, 2, 2, 2, 2] * 2
    assert proxy.most_at_once == 1


def test_limits_are_kept_and_used(
    workspace: Workspace, proxied: tuple[CountingProxy, str, str]
) -> None:
    proxy, url, model = proxied
    write_model(workspace, url, model, max_tokens=3)
    done = run(workspace, "vqa", "--set", "seeds=[0, 1, 2]")
    assert done.code == 0
    assert proxy.most_at_once == AT_ONCE
    records = workspace.records()
    assert {record["reply"]["usage"]["completion_tokens"] for record in records} == {3}
    assert {record["outcome"] for record in records} == {"truncated"}
    assert "Truncated" in done.out


def test_a_server_of_another_model_stops_the_model_at_once(
    workspace: Workspace, proxied: tuple[CountingProxy, str, str]
) -> None:
    proxy, url, _ = proxied
    for number, fields in enumerate(({"id": "hosted_vllm/other"}, {"extra_body": {"top_k": 5}})):
        write_model(workspace, url, proxied[2], **fields)
        workspace.out = workspace.root / f"stopped{number}"
        proxy.seen.clear()
        done = run(workspace, "vqa", "--set", "seeds=[0, 1, 2, 3]", "--no-cache")
        assert done.code == 1
        assert "tiny stopped: " in done.out
        assert len(proxy.seen) <= AT_ONCE
        assert workspace.records() == []
