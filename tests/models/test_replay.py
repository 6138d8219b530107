"""Recorded replies in the place of a model."""

import asyncio
import json
import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.domain.scene import Candidate, CandidateSet
from phyblock.errors import DataError, RefusedError, SampleError
from phyblock.models.client import read_raw_reply
from phyblock.models.model import build_model
from phyblock.records.record import Reply, Usage
from phyblock.tracks.full_planning import FullPlanning, PlanSubject
from tests.data.broken import plan_record
from tests.fuzz.strategies import documents
from tests.models.factory import CANDIDATES, SCENE, make_request
from tests.workspace import problem_of

STEPS = "Step1: Move block with index 3"


def answer(folder, key, seed=0):
    model = build_model(ModelConfig(name="m", replay=str(folder)), cache=None)
    assert not model.needs_messages
    return asyncio.run(model.ask(make_request(key, seed)))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b'{"predict": "a"', r"007\.json:1:\d+: is not JSON"),
        (b"\xff\xfe\x00", r"007\.json:1:1: is not JSON"),
        (b"[" * 100_000, r"007\.json:1:1: is not JSON: is nested more than 64 levels"),
        (b'{"text": ' + b"9" * 100_000 + b"}", "holds a number of 100,000 digits"),
        (b'{"error": "overloaded"}', "not a recorded reply of a known shape"),
    ],
)
def test_a_broken_recording_is_an_error_at_its_place(tmp_path, content, said):
    (tmp_path / "007.json").write_bytes(content)
    with pytest.raises(DataError, match=said):
        answer(tmp_path, "007")


KEPT = Reply(text=STEPS, reasoning="red", cost_usd=0.5, seed_sent=False).model_copy(
    update={"usage": Usage(prompt_tokens=7, completion_tokens=5)}
)


def record(model, scene, seed, **fields):
    named = {"sample": f"full_planning/{model}/{scene}/s{seed}", "scene": scene}
    whole = {"model": model, "key": scene, "seed": seed, "reply": KEPT.model_dump(), "error": None}
    return json.dumps({**plan_record(), **named, **whole, **fields}) + "\n"


def test_a_run_of_our_own_is_matched_by_model_key_and_seed(tmp_path):
    (tmp_path / "records.jsonl").write_text(
        record("m", "007", 1)
        + record("n", "007", 1, reply=Reply(text="other").model_dump())
        + record("m", "007", 2, reply=Reply(text="first").model_dump())
        + record("m", "007", 2, reply=Reply(text="last").model_dump())
        + record("m", "008", 1, reply=None)
        + '{"model": "m", "key": "009"'
    )
    kept = KEPT.model_copy(update={"cost_usd": 0.0, "attempts": 0})
    found = [answer(tmp_path, *asked) for asked in (("007", 1), ("007", 2), ("007", 3))]
    assert (found[0], found[1].text, found[2]) == (kept, "last", None)
    assert [answer(tmp_path, key, 1) for key in ("008", "009")] == [None, None]


@pytest.mark.parametrize(("kind", "error"), [("sample", SampleError), ("refused", RefusedError)])
def test_a_recorded_error_is_raised_again(tmp_path, kind, error):
    failed = {"kind": kind, "status": 400, "message": "no"}
    (tmp_path / "records.jsonl").write_text(record("m", "007", 1, reply=None, error=failed))
    with pytest.raises(error, match="no") as caught:
        answer(tmp_path, "007", 1)
    assert caught.value.status == 400


def choice(message, finish="stop"):
    return {"choices": [{"index": 0, "finish_reason": finish, "message": message}]}


def reply(text, finish="unknown", reasoning="", **counts):
    return Reply(text=text, finish=finish, reasoning=reasoning, usage=Usage(**counts))


def named(model, one):
    return one.model_copy(update={"provider_model": model})


PART = {"type": "text", "text": "a"}
DETAILS = {"prompt_tokens_details": {"cached_tokens": 3, "cache_write_tokens": 1},
           "completion_tokens_details": {"reasoning_tokens": 2}}  # fmt: skip


def candidate(*parts, **fields):
    return {"candidates": [{"content": {"parts": list(parts)}, **fields}]}


SHAPES = {
    "openai": (
        {**choice({"role": "assistant", "content": STEPS, "refusal": None}), "model": "gpt",
         "usage": {"prompt_tokens": 7, "completion_tokens": 5, **DETAILS}},
        named("gpt", reply(STEPS, "stop", prompt_tokens=7, completion_tokens=5, reasoning_tokens=2,
                           cached_tokens=3, cache_write_tokens=1))),
    "openai refusal": (
        choice({"content": None, "refusal": "I will not"}), reply("I will not", "refusal")),
    "openai cut": (choice({"content": ""}, "length"), reply("", "length")),
    "reasoning beside": (
        choice({"content": STEPS, "reasoning_content": "red"}), reply(STEPS, "stop", "red")),
    "parts": (choice({"content": [PART, {**PART, "text": "b"}]}), reply("ab", "stop")),
    "completion with text": (
        {"choices": [{"text": STEPS, "finish_reason": "length"}]}, reply(STEPS, "length")),
    "anthropic": (
        {"model": "claude", "content": [{"type": "text", "text": STEPS, "citations": None}],
         "usage": {"input_tokens": 7, "output_tokens": 5, "cache_read_input_tokens": 2},
         "stop_reason": "end_turn"},
        named("claude", reply(STEPS, "stop", prompt_tokens=9, completion_tokens=5,
                              cached_tokens=2))),
    "anthropic thinking": (
        {"content": [{"type": "thinking", "thinking": "red"}, {"type": "text", "text": STEPS}],
         "stop_reason": "max_tokens"},
        reply(STEPS, "length", "red")),
    "gemini of the client": (
        {**candidate({"text": STEPS, "thought": None}, finish_reason="STOP"),
         "model_version": "gemini",
         "usage_metadata": {"prompt_token_count": 7, "candidates_token_count": 5}},
        named("gemini", reply(STEPS, "stop", prompt_tokens=7, completion_tokens=5))),
    "gemini of the wire": (
        {**candidate({"text": "red", "thought": True}, {"text": STEPS}, finishReason="MAX_TOKENS"),
         "usageMetadata": {"promptTokenCount": 7, "thoughtsTokenCount": 3}},
        reply(STEPS, "length", "red", prompt_tokens=7, reasoning_tokens=3)),
    "gemini with an enum's name": (
        candidate(finish_reason="FinishReason.SAFETY"), reply("", "refusal")),
    "gemini blocked": (
        {"candidates": [], "promptFeedback": {"blockReason": "SAFETY"}}, reply("", "refusal")),
    "gemini without content": (
        {"candidates": [{"content": None, "finish_reason": "MAX_TOKENS"}]}, reply("", "length")),
    "gemini without candidates": (
        {"candidates": None, "usage_metadata": {"prompt_token_count": 7}},
        reply("", prompt_tokens=7)),
    "internvl": ({"input": "", "output": "gold", "image": ["a"], "predict": STEPS}, reply(STEPS)),
    "text": ({"text": STEPS, "model_id": "llava"}, reply(STEPS)),
    "response": ({"response": STEPS}, reply(STEPS)),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_read(name):
    raw, expected = SHAPES[name]
    assert read_raw_reply(raw, "000.json") == expected


OTHERS = (
    {}, {"error": {"message": "overloaded"}}, {"choices": []}, [], "a text", None, 17,
    {"candidates": []}, {"content": "not a list"},
)  # fmt: skip


@pytest.mark.parametrize("raw", OTHERS, ids=repr)
def test_another_shape_is_an_error_that_names_the_file_and_its_keys(raw):
    problem = problem_of(DataError, read_raw_reply, raw, "outputs/x/007.json")
    found = f"keys {', '.join(raw)}" if isinstance(raw, dict) else type(raw).__name__
    assert ("outputs/x/007.json" in problem.where, problem.found) == (True, found)


DOCUMENTS = documents(
    *("choices", "message", "content", "text", "output", "usage", "candidates", "parts", "value"),
    *("finish_reason", "thinking", "response", "body", "predict", "promptFeedback", "refusal"),
    *("model", "modelVersion", "prompt_tokens", "input_tokens", "promptTokenCount"),
)


@given(DOCUMENTS)
def test_any_document_is_read_or_refused_with_a_data_error(raw):
    """Values that are read can be written: texts as UTF-8, counts as numbers."""
    try:
        read = read_raw_reply(raw, "x.json")
    except DataError:
        return
    assert read.storable() == read
    for text in (read.text, read.reasoning, read.provider_model):
        text.encode()


keys = st.text(min_size=1, max_size=5)
seeds = st.integers(0, 10**6)


def said(name, request):
    model = build_model(ModelConfig(name=name), cache=None)
    assert not model.needs_messages
    return asyncio.run(model.ask(request))


def steps(name, request):
    """The steps of a reply whose every line has the benchmark's form."""
    lines = said(name, request).text.splitlines()
    read = [re.fullmatch(r"Step(\d+): Move block with index (\d+)", line) for line in lines]
    assert [int(match[1]) for match in read if match] == list(range(1, len(lines) + 1))
    return [int(match[2]) for match in read if match]


@given(keys, seeds)
def test_the_oracle_gives_a_valid_order_of_the_right_looks(key, seed):
    given_steps = steps("oracle", make_request(key, seed))
    looks = [CANDIDATES[index].look for index in given_steps]
    order = [[block.look for block in SCENE.blocks].index(look) for look in looks]
    assert SCENE.graph.is_valid(order)


@given(keys, seeds)
def test_without_orientation_only_the_orientation_is_wrong(key, seed):
    given_steps = steps("oracle-no-orientation", make_request(key, seed))
    kinds = [CANDIDATES[index].kind for index in given_steps]
    order = [[block.kind for block in SCENE.blocks].index(kind) for kind in kinds]
    assert SCENE.graph.is_valid(order)
    wrong = [
        CANDIDATES[i].look != SCENE.blocks[v].look for i, v in zip(given_steps, order, strict=True)
    ]
    assert wrong == [SCENE.blocks[v].type == "arch" for v in order]


@pytest.mark.parametrize("name", FullPlanning.baselines)
def test_what_is_drawn_depends_on_seed_and_key_alone(name):
    many = [make_request(f"{key:03}", seed) for key in range(10) for seed in range(5)]
    forwards = {(r.key, r.seed): said(name, r) for r in many}
    backwards = {(r.key, r.seed): said(name, r) for r in reversed(many)}
    assert forwards == backwards
    if name not in ("all-candidates", "goal-blind", "color-areas"):
        assert len({answer.text for answer in forwards.values()}) > 1


def test_an_oracle_without_its_candidate_is_an_error():
    poor = CandidateSet((Candidate("triangle", "orange", (0.0, 0.0, 0.0)),))
    with pytest.raises(DataError, match="no candidate looks like this block"):
        said("oracle", replace(make_request(), subject=PlanSubject(SCENE, poor)))
