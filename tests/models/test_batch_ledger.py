"""Laws of what is kept of batches: which one a request is in, and which line answers it."""

from __future__ import annotations

import asyncio
import contextlib
import json
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.models.batch_ledger import (
    Answers,
    Batch,
    BatchFiles,
    Ledger,
    custom_id,
    waiting_keys,
)
from phyblock.models.batch_providers import PROVIDERS, UNREADABLE, _joined
from phyblock.records.record import BatchLine

TOKEN = "pb0"
keys = st.lists(st.sampled_from("abcdef"), unique=True, min_size=1)
fates = st.sampled_from(["intended", "created", "lost", "ended"])
values = st.none() | st.integers() | st.text()
WORDS = (
    *("id", "name", "status", "processing_status", "request_counts", "total", "metadata", "state"),
    *("batchStats", "requestCount", "response", "output", "responsesFile", "error", "code", "body"),
    *("custom_id", "key", "result", "type", "message", "status_code", "created_at", "createTime"),
    *("data", "has_more", "operations", "nextPageToken", "errors", "output_file_id"),
)
json_values = st.recursive(
    values | st.booleans() | st.floats() | st.just("2026-11-23T10:00:00Z"),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(WORDS), inner, max_size=6)
    ),
    max_leaves=12,
)


@given(st.lists(st.tuples(keys, fates)))
def test_a_request_is_in_the_last_batch_that_was_not_lost(
    batches: list[tuple[list[str], str]],
) -> None:
    """So a ledger says that goes on, and one that reads its lines again."""
    lines: list[BatchLine] = []

    async def put(line: BatchLine) -> None:
        lines.append(BatchLine.model_validate_json(line.as_json()))

    async def write() -> Ledger:
        ledger = Ledger("m", BatchFiles((), put, Path()))
        for n, (of_batch, _) in enumerate(batches):
            await ledger.note(f"t{n}", "intended", keys=tuple(of_batch))
        for n, (_, fate) in enumerate(batches):
            if fate in ("created", "ended"):
                await ledger.note(f"t{n}", "created", id=f"id-t{n}")
            if fate in ("lost", "ended"):
                await ledger.note(f"t{n}", fate)  # type: ignore[arg-type]
        return ledger

    async def nowhere(_: BatchLine) -> None: ...

    written = asyncio.run(write())
    read = Ledger("m", BatchFiles(tuple(lines), nowhere, Path()))
    others = Ledger("another", BatchFiles(tuple(lines), nowhere, Path()))
    for key in "abcdef":
        holding = [n for n, (k, fate) in enumerate(batches) if key in k and fate != "lost"]
        expected = f"t{holding[-1]}" if holding else None
        for ledger in (written, read):
            newest = ledger.newest(key)
            assert (newest and newest.token) == expected
        assert others.newest(key) is None
        config = ModelConfig(name="m", id="openai/m")
        assert (key in waiting_keys(config, lines, Path("nowhere"))) == bool(holding)
    assert {b.token: (b.event, b.id) for b in written.batches.values()} == {
        b.token: (b.event, b.id) for b in read.batches.values()
    }


@st.composite
def result_lines(draw: st.DrawFn) -> list[tuple[str, Any]]:
    """Lines with the names of requests of this and of other batches, some of them broken."""
    names = st.integers(0, 5).map(lambda n: custom_id(TOKEN, n)) | st.sampled_from(
        ["pb0-x", "pb0--1", "pb01-1", "pb0-1-1", "pb0-", "-", "", "pb0-٣", "pb0-99999999999"]
    )
    return draw(st.lists(st.tuples(names, st.booleans())))


@given(lines=result_lines(), requests=st.integers(0, 4))
def test_the_first_whole_line_of_a_request_answers_it(
    lines: list[tuple[str, bool]], requests: int
) -> None:
    whole = [
        json.dumps({"custom_id": name, "response": {"status_code": 200, "body": {"n": n}}})
        for n, (name, _) in enumerate(lines)
    ]
    kept = [
        text if is_whole else text[:-9] for text, (_, is_whole) in zip(whole, lines, strict=True)
    ]
    keys = tuple(str(place) for place in range(requests))
    intent = BatchLine(batch=TOKEN, model="m", event="intended", time="", keys=keys)
    provider = PROVIDERS["openai"](ModelConfig(name="m", id="openai/m"))
    answers = Answers("\n\n".join(kept).encode(), provider, Batch(intent))
    for place in range(requests):
        name = custom_id(TOKEN, place)
        first = [n for n, (found, is_whole) in enumerate(lines) if found == name and is_whole]
        answer = answers.found.get(place)
        assert (answer is not None) == bool(first)
        if answer is not None:
            assert json.loads(answer.body) == {"n": first[0]}  # type: ignore[union-attr]
    assert len(answers.found) + sum(answers.faults.values()) == len(lines)


@given(st.sampled_from(["openai", "anthropic", "gemini"]), json_values)
def test_any_line_and_any_status_is_read_or_has_not_its_form(name: str, raw: Any) -> None:
    provider = PROVIDERS[name](ModelConfig(name="m", id=f"{name}/m"))
    for read in (provider.read, provider._read_status, provider._read_page):
        with contextlib.suppress(*UNREADABLE):
            read(raw)


@given(st.dictionaries(st.text(), values, max_size=3), st.text(min_size=1), values)
def test_bodies_stand_in_lines_as_they_are(fields: dict[str, Any], name: str, body: Any) -> None:
    fields.pop(name, None)
    line = _joined(fields, name, json.dumps(body).encode())
    assert json.loads(line) == {**fields, name: body}
    assert b"\n" not in line
