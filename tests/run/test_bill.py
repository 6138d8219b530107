"""A dry run expects what a provider bills, as far as it can be known before."""

from __future__ import annotations

import asyncio
import io
from contextlib import ExitStack
from importlib.metadata import version
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from phyblock.cli.run import print_estimate
from phyblock.config.models import ModelConfig, Tariff, load_models
from phyblock.config.suite import load_suite
from phyblock.models import Estimate as CallEstimate
from phyblock.models.costs import text_tokens
from phyblock.resources import bundled
from phyblock.run.estimate import Estimate, estimate
from phyblock.run.plan import RunPlan, make_plan
from phyblock.run.runner import Session
from tests.models.factory import ROUTES
from tests.servers.billing import (
    COMPLETION,
    PROVIDERS,
    Billing,
    BillingOpenAI,
    o200k_tokens,
    tile_tokens,
)
from tests.servers.chassis import Running, Seen
from tests.servers.step_agent import said
from tests.vqa_set import questions, write_questions
from tests.workspace import Workspace

PRICE = {"input": 3.0, "output": 15.0}
WITHIN = 0.05
CALLS = 4


@pytest.fixture(autouse=True)
def _environment(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    """A key, and a cache without pictures: what is not drawn yet is counted, too."""
    monkeypatch.setenv("PHYBLOCK_TEST_KEY", "sk-not-a-real-key-1234")
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.root / "nothing"))


def planned(workspace: Workspace) -> RunPlan:
    loaded = load_suite(workspace.root / "suite.yaml", data_dir=bundled("benchmarks", "data"))
    return make_plan(loaded, load_models(workspace.root / "models.yaml"))


def begin(workspace: Workspace, stack: ExitStack) -> dict[str, Billing]:
    """Write a suite and its models, each behind a server that bills as its provider does."""
    servers: dict[str, Billing] = {}
    entries = {}
    for model_id, make in PROVIDERS.items():
        provider, _, name = model_id.partition("/")
        running = stack.enter_context(Running(servers.setdefault(name, make())))
        entries[name] = {
            "id": model_id,
            "api_base": running.url + ROUTES.get(provider, ROUTES["openai"]).path,
            "api_key_env": "PHYBLOCK_TEST_KEY",
            "temperature": None,
            "price": PRICE,
        }
    workspace.write_yaml("models.yaml", entries)
    workspace.write_scenes()
    write_questions(workspace.root / "questions", questions())
    workspace.write_suite(
        tracks=["full_planning", "vqa"],
        vqa={"path": "./questions"},
        images={"size_px": 512},
        models=list(servers),
        limit=CALLS // 2,
    )
    return servers


def printed(plan: RunPlan, rows: list[Estimate]) -> str:
    console = Console(file=io.StringIO(), width=150)
    print_estimate(console, plan, rows)
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def asked(workspace: Workspace, plan: RunPlan) -> None:
    """Ask everything of a plan; no tables are made."""

    async def ask() -> None:
        result = await Session(plan, workspace.out, lambda _: None, use_cache=False).run()
        assert (result.left, result.failed) == (0, 0), result

    asyncio.run(ask())


def dollars(prompt_tokens: int, replies: int) -> float:
    return (prompt_tokens * PRICE["input"] + replies * COMPLETION * PRICE["output"]) / 1e6


def test_a_dry_run_is_near_the_bill_of_every_provider(workspace: Workspace) -> None:
    with ExitStack() as stack:
        servers = begin(workspace, stack)
        plan = planned(workspace)
        rows = estimate(plan, workspace.out, use_cache=False)
        asked(workspace, plan)
        left = estimate(plan, workspace.out, use_cache=False)
    prompts, replies = sum(row.prompt_usd for row in rows), sum(row.replies[1] for row in rows)
    assert f"(prompts ${prompts:.2f}, replies ${replies:.2f})" in printed(plan, rows)
    records = workspace.records()
    for row in rows:
        billed = servers[row.model.name].billed
        assert (row.calls, len(billed)) == (CALLS, CALLS)
        assert row.prompt_tokens == pytest.approx(sum(billed), rel=WITHIN), row.model.name
        assert row.prompt_usd == pytest.approx(dollars(sum(billed), 0), rel=WITHIN), row.model.name
        paid = sum(r["reply"]["cost_usd"] for r in records if r["model"] == row.model.name)
        assert paid == pytest.approx(dollars(sum(billed), CALLS))
        assert row.most_usd is not None
        assert paid < row.most_usd
    assert [(row.calls, row.done) for row in left] == [(0, CALLS)] * len(left)


@given(
    st.lists(
        st.tuples(st.sampled_from("ab"), st.integers(1, 500), st.integers(1, 500)), min_size=1
    ),
    st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 2000)), max_size=80),
)
def test_replies_of_one_kind_say_nothing_of_another_and_none_is_longer_than_it_can_be(
    calls: list[tuple[str, int, int]], replies: list[tuple[str, int]]
) -> None:
    row = Estimate(ModelConfig(name="m", id="openai/m"), 100, Tariff(input=0.0, output=10.0))
    for kind, usual, more in calls:
        row.add_call(CallEstimate(100, usual, usual + more), kind)
    for kind, tokens in replies:
        row.add_reply(tokens, kind)
    assert row.cost_usd is not None
    assert row.most_usd is not None
    assert row.cost_usd <= row.most_usd * (1 + 1e-9)
    expected = 0.0
    for kind, usual, more in calls:
        known = [tokens for other, tokens in replies if other == kind]
        expected += usual if len(known) < 20 else min(sum(known) / len(known), usual + more)
    assert row.replies[0] == pytest.approx(expected)


@pytest.mark.parametrize("track", ["full_planning", "step_planning"])
def test_texts_count_as_the_public_vocabulary_does(workspace: Workspace, track: str) -> None:
    workspace.write_models("http://localhost:1", "m")
    suite = {"name": "s", "tracks": [track], "models": ["m"], "limit": 4}
    workspace.write_yaml("suite.yaml", suite)
    (opened,) = planned(workspace).tracks
    texts = [
        part
        for item in opened.items
        for request in opened.outlines(item)
        for message in request.messages
        for part in message.parts
        if isinstance(part, str)
    ]
    counted = sum(text_tokens("openai/m", text) for text in texts)
    assert counted == pytest.approx(sum(map(o200k_tokens, texts)), rel=0.02)


class BillingAgent(BillingOpenAI):
    """Plays episodes, and bills each turn."""

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        body["choices"][0]["message"]["content"] = said(seen)
        return body


def test_episodes_are_billed_no_more_than_a_dry_run_expects(workspace: Workspace) -> None:
    server = BillingAgent(o200k_tokens, tile_tokens, 3)
    with Running(server) as running:
        entry = {"id": "openai/gpt-4o-2024-08-06", "api_base": f"{running.url}/v1", "price": PRICE}
        entry["api_key_env"] = "PHYBLOCK_TEST_KEY"
        workspace.write_yaml("models.yaml", {"m": entry})
        workspace.write_scenes()
        workspace.write_suite(tracks=["step_planning"], models=["m"], limit=2)
        plan = planned(workspace)
        (row,) = estimate(plan, workspace.out, use_cache=False)
        asked(workspace, plan)
    assert len(server.billed) <= row.calls
    assert sum(server.billed) <= row.prompt_tokens * (1 + WITHIN)
    a_call, expected = sum(server.billed) / len(server.billed), row.prompt_tokens / row.calls
    assert a_call == pytest.approx(expected, rel=WITHIN)


def test_a_dry_run_says_where_prices_are_from(workspace: Workspace) -> None:
    workspace.write_scenes()
    priced = {"id": "openai/gpt-4o", "price": {"input": 1.0, "output": 2.0}}
    workspace.write_yaml("models.yaml", {"a": priced, "b": {"id": "openai/gpt-4o"}})
    workspace.write_suite(models=["a", "b"])
    plan = planned(workspace)
    told = " ".join(printed(plan, estimate(plan, workspace.out, use_cache=False)).split())
    assert f"Prices: the models file (a); litellm {version('litellm')} map (b)." in told
