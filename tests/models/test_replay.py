"""Recorded replies in the place of a model."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from pathlib import Path

import pytest

from phyblock.config.models import ModelConfig
from phyblock.errors import DataError, RefusedError, SampleError, StoreError
from phyblock.models import Model, Reply, Usage, build_model
from tests.models.factory import make_request
from tests.records.damage import plan_record

STEPS = "Step1: Move block with index 3"


def replay(folder: Path, model: str = "m") -> Model:
    config = ModelConfig(name=model, replay=str(folder))
    return build_model(config, cache=None)


def answer(model: Model, key: str, seed: int = 0) -> Reply | None:
    return asyncio.run(model.ask(replace(make_request(key, seed), track="full_planning")))


def test_a_reply_is_found_by_key_whatever_the_seed(tmp_path: Path) -> None:
    (tmp_path / "007.json").write_text(json.dumps({"predict": STEPS}))
    model = replay(tmp_path)
    assert not model.needs_messages
    replies = [answer(model, "007", seed) for seed in (0, 1)]
    assert replies == [Reply(text=STEPS, finish="unknown", cost_usd=0.0, attempts=0)] * 2




@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b'{"predict": "a"', r"007\.json:1:\d+: is not JSON"),
        (b"\xff\xfe\x00", r"007\.json:1:1: is not JSON"),
        (b"[" * 100_000, r"007\.json:1:1: is not JSON: is nested more than 64 levels"),
        (b'{"text": ' + b"9" * 100_000 + b"}", "holds a number of 100,000 digits"),
        (b'{"error": "overloaded"}', "no recorded reply of a known shape"),
    ],
)
def test_a_broken_recording_is_an_error_at_its_place(
    tmp_path: Path, content: bytes, said: str
) -> None:
    (tmp_path / "007.json").write_bytes(content)
    with pytest.raises(DataError, match=said):
        answer(replay(tmp_path), "007")


def test_a_folder_that_is_missing_or_empty_is_an_error_at_the_start(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="recordings not found"):
        replay(tmp_path / "nowhere")
    with pytest.raises(DataError, match="no recorded replies"):
        replay(tmp_path)


def record(model: str, scene: str, seed: int, **fields: object) -> str:
    reply = Reply(
        text=STEPS,
        reasoning="red",
        usage=Usage(prompt_tokens=7, completion_tokens=5),
        cost_usd=0.5,
        seed_sent=False,
    ).model_dump()
    named = {"sample": f"full_planning/{model}/{scene}/s{seed}", "scene": scene}
    whole = {"model": model, "key": scene, "seed": seed, "reply": reply, "error": None}
    return json.dumps({**plan_record(), **named, **whole, **fields}) + "\n"


def test_a_run_of_our_own_is_matched_by_model_key_and_seed(tmp_path: Path) -> None:
    (tmp_path / "records.jsonl").write_text(
        record("m", "007", 1)
        + record("n", "007", 1, reply=Reply(text="other").model_dump())
        + record("m", "007", 2, reply=Reply(text="first").model_dump())
        + record("m", "007", 2, reply=Reply(text="last").model_dump())
        + record("m", "008", 1, reply=None)
        + '{"model": "m", "key": "009"'
    )
    model = replay(tmp_path)
    assert not model.needs_messages
    expected = Reply(
        text=STEPS,
        reasoning="red",
        usage=Usage(prompt_tokens=7, completion_tokens=5),
        cost_usd=0.0,
        attempts=0,
        seed_sent=False,
    )
    assert answer(model, "007", 1) == expected
    last = answer(model, "007", 2)
    assert last is not None
    assert last.text == "last"
    assert answer(model, "007", 3) is None
    assert answer(model, "008", 1) is None
    assert answer(model, "009", 1) is None


@pytest.mark.parametrize(("kind", "error"), [("sample", SampleError), ("refused", RefusedError)])
def test_a_recorded_error_is_raised_again(
    tmp_path: Path, kind: str, error: type[SampleError]
) -> None:
    failed = {"kind": kind, "status": 400, "message": "no"}
    (tmp_path / "records.jsonl").write_text(record("m", "007", 1, reply=None, error=failed))
    with pytest.raises(error, match="no") as caught:
        answer(replay(tmp_path), "007", 1)
    assert caught.value.status == 400


@pytest.mark.parametrize("line", ["{", "[]", '{"model": "m"}', "7"])
def test_a_broken_record_is_an_error_at_its_line(tmp_path: Path, line: str) -> None:
    (tmp_path / "records.jsonl").write_text(record("m", "007", 1) + line + "\n")
    with pytest.raises(StoreError, match=r"records\.jsonl:2(:\d+)?: (\w+: )?is not a record"):
        replay(tmp_path)


def test_the_official_recordings_answer_for_their_scenes(official_checkout: Path) -> None:
    model = replay(official_checkout / "outputs" / "claude-3-7-thinking")
    replies = [answer(model, f"{number:03}") for number in range(400)]
    assert sum(reply is not None for reply in replies) == 390
