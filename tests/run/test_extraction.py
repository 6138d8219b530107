"""Replies that cannot be read, copied by another model: asked, kept, counted, and asked once."""

from __future__ import annotations

import csv
import io
from typing import Any

import pytest

from phyblock.errors import InputError
from tests.run.test_asked_runs import call
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Raw, Workspace

PROSE = "I would begin with the red arch and put the blue cube upon it"
PRICE = {"input": 1.0, "output": 1.0}


class Talking(OpenAIChat):
    """Models answer in prose, each third in the asked form; `copier` copies what prose says."""

    def __init__(self) -> None:
        super().__init__()
        self.copied: list[str] = []

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        text = f"{PROSE}."
        if seen.model == "copier":
            (prompt,) = seen.parts
            self.copied.append(str(prompt))
            text = "NONE" if f"{PROSE}!" in str(prompt) else "Step1: Move block with index 3"
        elif int(seen.sample, 16) % 3 == 0:
            text = "Step1: Move block with index 5"
        elif int(seen.sample, 16) % 3 == 1:
            text = f"{PROSE}!"
        body["choices"][0]["message"]["content"] = text
        return body


@pytest.fixture
def talking(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    monkeypatch.setattr("sys.argv", ["phyblock"])
    workspace.write_suite(
        models=["alpha", "random"],
        seeds=[0, 1, 2],
        scoring={"extractor": "copier"},
        limits={"max_cost_usd": 1.0},
    )
    return workspace


def run(out: str) -> int:
    return call("run", "suite.yaml", "--out", out, "--no-report", "--yes")


def read(records: list[Raw]) -> list[tuple[Any, ...]]:
    return [(r["outcome"], r["parse"]["rule"], r["parse"]["plan"]) for r in records]


def test_an_unread_reply_is_copied_kept_and_counted_and_asked_about_once(
    talking: Workspace,
) -> None:
    server = Talking()
    with Running(server) as running:
        talking.write_models(running.url, "alpha", "copier", price=PRICE, max_tokens=100)
        assert run("out") == 0
        asked = server.requests
        assert run("again") == 0
        assert server.requests == asked  # All of it is in the cache.
    records = [r for r in talking.records() if r["model"] == "alpha"]
    texts = {
        f"{PROSE}.": "ok",
        f"{PROSE}!": "parse_failure",
        "Step1: Move block with index 5": "ok",
    }
    assert {r["reply"]["text"] for r in records} == set(texts)
    for record in records:
        text = record["reply"]["text"]
        assert record["outcome"] == texts[text]
        said = {f"{PROSE}.": ("extractor", [3]), f"{PROSE}!": (None, [])}.get(text, ("steps", [5]))
        assert (record["parse"]["rule"], record["parse"]["plan"]) == said
        assert ("extraction" in record) == text.startswith(PROSE)
        assert record.get("extraction", {"model": "copier"})["model"] == "copier"
    # Text alone is sent, and of unread replies alone.
    assert all(PROSE in prompt and prompt.startswith("Below") for prompt in server.copied)
    assert len(server.copied) <= len([r for r in records if "extraction" in r])

    copied = sum(r["parse"]["rule"] == "extractor" for r in records)
    coverage = talking.tables()["coverage.md"].decode()
    assert f"Read by extractor: alpha {copied} of {len(records)}." in coverage
    replies = [r["reply"] for r in records] + [
        r["extraction"]["reply"] for r in records if "extraction" in r
    ]
    paid = sum(reply["cost_usd"] for reply in replies if not reply["cached"])
    (cost,) = (
        row
        for row in csv.DictReader(io.StringIO(talking.tables()["cost.csv"].decode()))
        if row["model"] == "alpha"
    )
    assert float(cost["cost_usd"]) == pytest.approx(paid)

    before = read(talking.records())
    assert call("score", "out") == 0
    assert read(talking.records()) == before


def test_an_extraction_model_that_fails_loses_no_reply(talking: Workspace) -> None:
    class Failing(Talking):
        def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
            body = super().reply(seen, ending)
            if seen.model == "copier":
                body["choices"] = []
            return body

    server = Failing()
    with Running(server) as running:
        talking.write_models(running.url, "alpha", "copier", price=PRICE, max_tokens=100)
        talking.write_suite(
            models=["alpha"],
            scoring={"extractor": "copier"},
            limits={"max_attempts": 1, "retry_for_s": 0.0},
        )
        assert run("out") == 0
    records = talking.records()
    assert records
    assert all(r["reply"]["text"] for r in records)
    assert {r["parse"]["rule"] for r in records} <= {"steps", None}
    assert not any("extraction" in r for r in records)


def test_an_extractor_that_is_no_model_is_named(talking: Workspace) -> None:
    talking.write_models("http://127.0.0.1:9", "alpha", "kopier")
    with pytest.raises(InputError, match=r"(?s)scoring\.extractor.*copier.*kopier"):
        run("out")
