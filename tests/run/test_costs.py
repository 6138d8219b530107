"""Costs of a run: expected by a dry run as providers bill, and never above max_cost_usd."""

import base64
import functools
import importlib.util
import io
import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import pytest
import tiktoken
from PIL import Image
from tokenizers import Tokenizer

from phyblock.models.costs import text_tokens
from phyblock.run.plan import estimate
from tests.models.factory import ROUTES
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat, answered
from tests.workspace import CALL_USD, PRICE, TWICE, read_lines, vqa_suite, write_questions

MOST_USD = 0.505
"""Room for 35 calls, and for no 36th, be it as estimated at first or as the run learns to."""


COMPLETION = 40
LITELLM = Path(importlib.util.find_spec("litellm").origin).parent
CARRIED = LITELLM / "litellm_core_utils" / "tokenizers"
TARIFF = {"input": 3.0, "output": 15.0}
WITHIN = 0.05
CALLS = 4


def spent(workspace):
    return sum(record["reply"]["cost_usd"] for record in workspace.records())


def test_the_limit_is_not_passed_and_a_higher_one_goes_on(workspace):
    entry, seeds = {"price": PRICE, "max_tokens": 100}, list(range(12))
    with workspace.served(OpenAIChat(), entry=entry, seeds=seeds) as server:
        assert "60 calls, about $" in workspace.completed("--dry-run").out
        first = workspace.run("--set", f"limits.max_cost_usd={MOST_USD}")
        assert (first.code, first.err) == (1, "")
        assert f"of ${MOST_USD} spent; the next call can cost $" in first.out
        assert spent(workspace) == pytest.approx(CALL_USD * server.requests)
        # It stops no earlier than it must: another two calls at their dearest would pass it.
        least_usd = MOST_USD - 2 * (CALL_USD + 100 * PRICE["output"] / 1e6)
        assert least_usd < spent(workspace) <= MOST_USD

        asked = server.requests
        assert workspace.run("--set", f"limits.max_cost_usd={MOST_USD}").code == 1
        assert server.requests == asked

        assert "All 60 samples" in workspace.completed("--set", "limits.max_cost_usd=5").out
        assert server.requests == 60


@pytest.mark.parametrize("mode", ["usage-null", "html", "reset"])
def test_what_an_earlier_run_may_have_paid_counts_in_the_next(workspace, mode):
    dearest_reply_usd = 1000 * PRICE["output"] / 1e6
    server, entry = OpenAIChat(Faults(mode=mode)), {"price": PRICE, "max_tokens": 1000}
    with workspace.served(server, entry=entry, seeds=list(range(4)), limits=TWICE):
        codes = [workspace.run("--set", "limits.max_cost_usd=1").code for _ in range(3)]
    assert codes == [1, 1, 1]
    assert 2 <= server.requests <= 1 / dearest_reply_usd
    lines = read_lines(workspace.out / "calls.jsonl")
    billed_usd = sum(line.get("billed_usd") or 0.0 for line in lines)
    assert server.requests * dearest_reply_usd < billed_usd <= 1


# Servers that count and bill as providers document it, written from their documents alone: OpenAI,
# guide to images and vision; Anthropic, vision guide; Google, media resolution guide. Texts: OpenAI
# by its public vocabulary o200k and three tokens a message and for the reply; Anthropic by the
# vocabulary that litellm carries of it; Google by four characters a token.


def tile_tokens(width, height):
    """A picture that is shown to GPT-4o: 85 tokens, and 170 for each tile of 512 pixels."""
    if max(width, height) > 2048:
        width, height = (side * 2048 // max(width, height) for side in (width, height))
    if min(width, height) > 768:
        width, height = (side * 768 // min(width, height) for side in (width, height))
    return 85 + 170 * -(-width // 512) * -(-height // 512)


def patch_tokens(width, height):
    """A picture that is shown to GPT-5.6 in full: 1.2 tokens for each patch of 32 pixels."""
    patches = -(-width // 32) * -(-height // 32)
    assert patches <= 30_000, "the API would refuse it"
    return math.ceil(patches * 1.2)


def claude_tokens(width, height):
    """A picture that is shown to Claude: a token for each patch of 28 pixels, none to shrink."""
    assert max(width, height) <= 2576
    return -(-width // 28) * -(-height // 28)


@functools.cache
def o200k():
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TIKTOKEN_CACHE_DIR", str(CARRIED))
        return tiktoken.get_encoding("o200k_base")


def o200k_tokens(text):
    return len(o200k().encode(text))


@functools.cache
def claude():
    return Tokenizer.from_file(str(CARRIED / "anthropic_tokenizer.json"))


def contents(body):
    """Texts and sizes of pictures in a request body of any of the three protocols."""
    for name, value in body.items() if isinstance(body, dict) else enumerate(body):
        if name in ("text", "content", "system") and isinstance(value, str):
            yield value
        elif name in ("url", "data"):
            data = base64.b64decode(value.rpartition(";base64,")[2])
            yield Image.open(io.BytesIO(data)).size
        elif isinstance(value, dict | list):
            yield from contents(value)


@dataclass
class Bill:
    """Counts every prompt as a provider does; `billed` has those of each sample."""

    text_tokens: Callable[[str], float]
    picture_tokens: Callable[[int, int], int]
    a_message: int = 0
    billed: list[int] = field(default_factory=list)

    def __post_init__(self):
        # Vocabularies are read here, not by the thread that serves: while it imports what reads
        # them, litellm finds that half imported.
        self.text_tokens("")

    def __call__(self, seen):
        parts = list(contents(seen.raw))
        texts = sum(self.text_tokens(part) for part in parts if isinstance(part, str))
        pictures = sum(self.picture_tokens(*part) for part in parts if not isinstance(part, str))
        around = self.a_message * (len(seen.raw.get("messages", ())) + 1)
        self.billed.append(math.ceil(texts) + pictures + around)
        return self.billed[-1], COMPLETION


PROVIDERS = {
    "openai/gpt-4o-2024-08-06": (o200k_tokens, tile_tokens, 3),
    "openai/gpt-5.6": (o200k_tokens, patch_tokens, 3),
    "anthropic/claude-opus-5-5": (lambda text: len(claude().encode(text).ids), claude_tokens),
    "gemini/gemini-3.8-flash": (lambda text: len(text) / 4, lambda *_: 1120),
}
"""By model, how its provider counts texts, pictures, and around each message."""


@pytest.fixture(autouse=True)
def _environment(workspace, monkeypatch):
    """A cache without pictures: what is not drawn yet is counted, too."""
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.root / "nothing"))


def dollars(prompt_tokens, replies):
    return (prompt_tokens * TARIFF["input"] + replies * COMPLETION * TARIFF["output"]) / 1e6


def test_a_dry_run_is_near_the_bill_of_every_provider(workspace):
    """Each model is behind a server that bills as its provider does."""
    bills, entries = {}, {}
    with ExitStack() as stack:
        for model_id, counts in PROVIDERS.items():
            provider, _, name = model_id.partition("/")
            route, bills[name] = ROUTES[provider], Bill(*counts)
            url = stack.enter_context(Running(route.server(usage=bills[name]))).url + route.path
            entries[name] = {"id": model_id, "api_base": url, "temperature": None, "price": TARIFF}
        workspace.write_yaml("models.yaml", entries)
        write_questions(workspace.root / "questions")
        fields = vqa_suite() | {"tracks": ["full_planning", "vqa"], "images": {"size_px": 512}}
        workspace.write_suite(**fields, models=list(bills), limit=CALLS // 2)
        plan = workspace.plan()
        rows = estimate(plan, workspace.out, use_cache=False)
        workspace.completed("--yes", "--no-cache")
        left = estimate(plan, workspace.out, use_cache=False)
    records = workspace.records()
    for row in rows:
        billed = bills[row.model.name].billed
        assert (row.calls, len(billed)) == (CALLS, CALLS)
        assert row.prompt_tokens == pytest.approx(sum(billed), rel=WITHIN), row.model.name
        replies = row.reply_tokens / COMPLETION
        assert row.cost_usd == pytest.approx(dollars(row.prompt_tokens, replies)), row.model.name
        paid = sum(r["reply"]["cost_usd"] for r in records if r["model"] == row.model.name)
        assert paid == pytest.approx(dollars(sum(billed), CALLS))
        assert paid < row.most_usd
    assert [(row.calls, row.done) for row in left] == [(0, CALLS)] * len(left)


@pytest.mark.parametrize("track", ["full_planning", "step_planning"])
def test_texts_count_as_the_public_vocabulary_does(workspace, track):
    workspace.write_models("http://localhost:1", "m")
    suite = {"name": "s", "tracks": [track], "models": ["m"], "limit": 4}
    workspace.write_yaml("suite.yaml", suite)
    (opened,) = workspace.plan().tracks
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


def test_episodes_are_billed_no_more_than_a_dry_run_expects(workspace):
    bill = Bill(o200k_tokens, tile_tokens, 3)
    with Running(OpenAIChat(say=answered, usage=bill)) as running:
        entry = {"id": "openai/gpt-4o-2024-08-06", "api_base": f"{running.url}/v1", "price": TARIFF}
        workspace.write_yaml("models.yaml", {"m": entry})
        workspace.write_suite(tracks=["step_planning"], models=["m"], limit=2)
        plan = workspace.plan()
        (row,) = estimate(plan, workspace.out, use_cache=False)
        workspace.completed("--yes", "--no-cache")
    assert len(bill.billed) <= row.calls
    assert sum(bill.billed) <= row.prompt_tokens * (1 + WITHIN)
    a_call, expected = sum(bill.billed) / len(bill.billed), row.prompt_tokens / row.calls
    assert a_call == pytest.approx(expected, rel=WITHIN)


def test_a_run_without_a_limit_counts_once_there_is_one(workspace):
    suite = {"seeds": [0, 1, 2, 3], "limits": {**TWICE, "max_attempts": 1}}
    entry = {"price": PRICE, "max_tokens": 100}
    with workspace.served(OpenAIChat(Faults({"500": 0.5})), entry=entry, **suite) as server:
        assert workspace.run("--yes").code == 1
        asked, answered = server.requests, server.ended["ok"]
        assert 0 < answered < asked == 20
        assert workspace.run("--set", f"limits.max_cost_usd={answered * CALL_USD}").code == 1
        assert server.requests == asked
