"""Raw replies of all shapes, made up here, and the official recordings where they are at hand."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import DataError
from phyblock.models import Reply, Usage, read_raw_reply
from phyblock.text import well_formed

STEPS = "Step1: Move block with index 3"


def choice(message: object, finish: str = "stop") -> dict[str, object]:
    return {"choices": [{"index": 0, "finish_reason": finish, "message": message}]}


def reply(text: str, finish: Any = "unknown", reasoning: str = "", **counts: int) -> Reply:
    return Reply(text=text, finish=finish, reasoning=reasoning, usage=Usage(**counts))


def named(model: str, one: Reply) -> Reply:
    return one.model_copy(update={"provider_model": model})


PART = {"type": "text", "text": "a"}
SHAPES: dict[str, tuple[object, Reply]] = {
    "openai": (
        {
            **choice({"role": "assistant", "content": STEPS, "refusal": None}),
            "model": "gpt",
            "usage": {
                "prompt_tokens": 7,
                "completion_tokens": 5,
                "completion_tokens_details": {"reasoning_tokens": 2},
                "prompt_tokens_details": {"cached_tokens": 3, "cache_write_tokens": 1},
            },
        },
        named("gpt", reply(STEPS, "stop", prompt_tokens=7, completion_tokens=5, reasoning_tokens=2,
                           cached_tokens=3, cache_write_tokens=1)),
    ),
    "openai refusal": (
        choice({"role": "assistant", "content": None, "refusal": "I will not"}),
        reply("I will not", "refusal"),
    ),
    "openai cut": (choice({"content": ""}, "length"), reply("", "length")),
    "reasoning beside": (
        choice({"content": STEPS, "reasoning_content": "red"}),
        reply(STEPS, "stop", "red"),
    ),
    "parts": (choice({"content": [PART, {**PART, "text": "b"}]}), reply("ab", "stop")),
    "completion with text": (
        {"choices": [{"text": STEPS, "finish_reason": "length"}]},
        reply(STEPS, "length"),
    ),
    "anthropic": (
        {
            "type": "message",
            "model": "claude",
            "content": [{"type": "text", "text": STEPS, "citations": None}],
            "stop_reason": "end_turn",
            "usage": {"input_tokens": 7, "output_tokens": 5, "cache_read_input_tokens": 2},
        },
        named("claude", reply(STEPS, "stop", prompt_tokens=9, completion_tokens=5,
                              cached_tokens=2)),
    ),
    "anthropic thinking": (
        {
            "content": [
                {"type": "thinking", "thinking": "block with index 9", "signature": "x"},
                {"type": "text", "text": STEPS},
            ],
            "stop_reason": "max_tokens",
        },
        reply(STEPS, "length", "block with index 9"),
    ),
    "gemini of the client": (
        {
            "candidates": [
                {"content": {"parts": [{"text": STEPS, "thought": None}]}, "finish_reason": "STOP"}
            ],
            "model_version": "gemini",
            "usage_metadata": {"prompt_token_count": 7, "candidates_token_count": 5},
        },
        named("gemini", reply(STEPS, "stop", prompt_tokens=7, completion_tokens=5)),
    ),
    "gemini of the wire": (
        {
            "candidates": [
                {
                    "content": {"parts": [{"text": "red", "thought": True}, {"text": STEPS}]},
                    "finishReason": "MAX_TOKENS",
                }
            ],
            "usageMetadata": {"promptTokenCount": 7, "thoughtsTokenCount": 3},
        },
        reply(STEPS, "length", "red", prompt_tokens=7, reasoning_tokens=3),
    ),
    "gemini with an enum's name": (
        {"candidates": [{"content": {"parts": []}, "finish_reason": "FinishReason.SAFETY"}]},
        reply("", "refusal"),
    ),
    "gemini blocked": (
        {"candidates": [], "promptFeedback": {"blockReason": "SAFETY"}},
        reply("", "refusal"),
    ),
    "gemini without content": (
        {"candidates": [{"content": None, "finish_reason": "MAX_TOKENS"}]},
        reply("", "length"),
    ),
    "gemini without candidates": (
        {"candidates": None, "usage_metadata": {"prompt_token_count": 7}},
        reply("", prompt_tokens=7),
    ),
    "internvl": (
        {"instruction": "i", "input": "", "output": "gold", "image": ["a"], "predict": STEPS},
        reply(STEPS),
    ),
    "predict in a list": ({"predict": [STEPS]}, reply(STEPS)),
    "text": ({"text": STEPS, "model_id": "llava"}, reply(STEPS)),
    "response": ({"response": STEPS}, reply(STEPS)),
    "batch response": (
        {"custom_id": "7", "response": {"status_code": 200, "body": choice({"content": STEPS})}},
        reply(STEPS, "stop"),
    ),
    "bare": (STEPS, reply(STEPS)),
    "bare in a list": ([STEPS], reply(STEPS)),
    "list of one": ([choice({"content": STEPS})], reply(STEPS, "stop")),
}  # fmt: skip


@pytest.mark.parametrize("name", SHAPES)
def test_a_shape_is_read(name: str) -> None:
    raw, expected = SHAPES[name]
    assert read_raw_reply(raw, "000.json") == expected


@pytest.mark.parametrize(
    ("raw", "found"),
    [
        ({}, "keys "),
        ({"error": {"message": "overloaded"}, "id": 3}, "keys error, id"),
        ({"choices": []}, "keys choices"),
        ([], "list"),
        (None, "NoneType"),
        (17, "int"),
        ({"candidates": []}, "keys candidates"),
        ({"content": "not a list"}, "keys content"),
    ],
)
def test_another_shape_is_an_error_that_names_the_file_and_its_keys(
    raw: object, found: str
) -> None:
    with pytest.raises(DataError) as caught:
        read_raw_reply(raw, "outputs/x/007.json")
    assert "outputs/x/007.json" in str(caught.value)
    assert caught.value.problems[0].found == found


WORDS = (
    *("choices", "message", "content", "text", "output", "usage", "candidates", "parts", "value"),
    *("finish_reason", "thinking", "response", "body", "predict", "promptFeedback", "refusal"),
    *("model", "modelVersion", "prompt_tokens", "input_tokens", "promptTokenCount"),
)
texts = st.text(st.characters(), max_size=5)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | texts,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(WORDS), inner, max_size=4)
    ),
    max_leaves=12,
)


@given(json_values)
def test_any_document_is_read_or_refused_with_a_data_error(raw: object) -> None:
    """What is read can be written: texts as UTF-8, counts as numbers."""
    try:
        read = read_raw_reply(raw, "x.json")
    except DataError:
        return
    assert read.storable() == read
    for text in (read.text, read.reasoning, read.provider_model):
        text.encode()


@given(texts)
def test_only_characters_that_no_file_can_hold_are_replaced(text: str) -> None:
    read = read_raw_reply({**choice({"content": f"{text}\ud800"}), "model": f"\udfff{text}"}, "x")
    for kept in (read.text, read.provider_model):
        assert kept.replace("\ufffd", "") == well_formed(text).replace("\ufffd", "")


@pytest.mark.parametrize(
    ("model", "replies"),
    [
        ("gpt-4o", 400),
        ("Qwen-VL-max", 400),
        ("claude-3-5-haiku", 400),
        ("claude-3-7-thinking", 390),
        ("gemini-2.0-flash", 400),
        ("InternVL2.5-8B", 400),
    ],
)
def test_the_official_recordings_are_all_read(
    official_checkout: Path, model: str, replies: int
) -> None:
    files = sorted((official_checkout / "outputs" / model).glob("*.json"))
    read = [read_raw_reply(json.loads(path.read_text()), str(path)) for path in files]
    assert len(read) == replies
    assert all(one.text for one in read)
    assert all(bool(one.reasoning) == ("thinking" in model) for one in read)
