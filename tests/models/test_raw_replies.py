"""Raw replies of all shapes, made up here, and the official recordings where they are at hand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import DataError
from phyblock.models import RawReply, Usage, read_raw_reply
from phyblock.models.raw_replies import token_count
from phyblock.text import well_formed

STEPS = "Step1: Move block with index 3"


def choice(message: object, finish: str = "stop") -> dict[str, object]:
    return {"choices": [{"index": 0, "finish_reason": finish, "message": message}]}


SHAPES: dict[str, tuple[object, RawReply]] = {
    "openai": (
        {
            **choice({"role": "assistant", "content": STEPS, "refusal": None}),
            "model": "gpt",
            "usage": {
                "prompt_tokens": 7,
                "completion_tokens": 5,
                "completion_tokens_details": {"reasoning_tokens": 2},
            },
        },
        RawReply(
            "chat completion",
            STEPS,
            "",
            "stop",
            Usage(prompt_tokens=7, completion_tokens=5, reasoning_tokens=2),
            "gpt",
        ),
    ),
    "openai refusal": (
        choice({"role": "assistant", "content": None, "refusal": "I will not"}),
        RawReply("chat completion", "I will not", "", "refusal"),
    ),
    "openai cut": (
        choice({"content": ""}, "length"),
        RawReply("chat completion", "", "", "length"),
    ),
    "reasoning beside": (
        choice({"content": STEPS, "reasoning_content": "red"}),
        RawReply("chat completion", STEPS, "red", "stop"),
    ),
    "parts": (
        choice({"content": [{"type": "text", "text": "a"}, {"type": "text", "text": "b"}]}),
        RawReply("chat completion", "ab", "", "stop"),
    ),
    "completion with text": (
        {"choices": [{"text": STEPS, "finish_reason": "length"}]},
        RawReply("chat completion", STEPS, "", "length"),
    ),
    "dashscope choices": (
        {
            "output": choice({"content": [{"text": STEPS}]}),
            "usage": {"input_tokens": 7, "output_tokens": 5},
        },
        RawReply("DashScope", STEPS, "", "stop", Usage(prompt_tokens=7, completion_tokens=5)),
    ),
    "dashscope text": (
        {"output": {"text": STEPS, "finish_reason": "stop"}, "usage": {"input_tokens": 7}},
        RawReply("DashScope", STEPS, "", "stop", Usage(prompt_tokens=7, completion_tokens=None)),
    ),
    "anthropic": (
        {
            "type": "message",
            "model": "claude",
            "content": [{"type": "text", "text": STEPS, "citations": None}],
            "stop_reason": "end_turn",
            "usage": {"input_tokens": 7, "output_tokens": 5},
        },
        RawReply(
            "Anthropic message",
            STEPS,
            "",
            "stop",
            Usage(prompt_tokens=7, completion_tokens=5),
            "claude",
        ),
    ),
    "anthropic thinking": (
        {
            "content": [
                {"type": "thinking", "thinking": "block with index 9", "signature": "x"},
                {"type": "text", "text": STEPS},
            ],
            "stop_reason": "max_tokens",
        },
        RawReply("Anthropic message, thinking", STEPS, "block with index 9", "length"),
    ),
    "gemini of the client": (
        {
            "candidates": [
                {"content": {"parts": [{"text": STEPS, "thought": None}]}, "finish_reason": "STOP"}
            ],
            "model_version": "gemini",
            "usage_metadata": {"prompt_token_count": 7, "candidates_token_count": 5},
        },
        RawReply(
            "Gemini", STEPS, "", "stop", Usage(prompt_tokens=7, completion_tokens=5), "gemini"
        ),
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
        RawReply(
            "Gemini",
            STEPS,
            "red",
            "length",
            Usage(prompt_tokens=7, completion_tokens=None, reasoning_tokens=3),
        ),
    ),
    "gemini with an enum's name": (
        {"candidates": [{"content": {"parts": []}, "finish_reason": "FinishReason.SAFETY"}]},
        RawReply("Gemini", "", "", "refusal"),
    ),
    "gemini blocked": (
        {"candidates": [], "promptFeedback": {"blockReason": "SAFETY"}},
        RawReply("Gemini", "", "", "refusal"),
    ),
    "gemini without content": (
        {"candidates": [{"content": None, "finish_reason": "MAX_TOKENS"}]},
        RawReply("Gemini", "", "", "length"),
    ),
    "gemini without candidates": (
        {"candidates": None, "usage_metadata": {"prompt_token_count": 7}},
        RawReply("Gemini", "", "", "unknown", Usage(prompt_tokens=7)),
    ),
    "internvl": (
        {"instruction": "i", "input": "", "output": "gold", "image": ["a"], "predict": STEPS},
        RawReply("predict", STEPS),
    ),
    "predict in a list": ({"predict": [STEPS]}, RawReply("predict", STEPS)),
    "text": ({"text": STEPS, "model_id": "llava"}, RawReply("text", STEPS)),
    "response": ({"response": STEPS}, RawReply("response", STEPS)),
    "batch response": (
        {"custom_id": "7", "response": {"status_code": 200, "body": choice({"content": STEPS})}},
        RawReply("chat completion", STEPS, "", "stop"),
    ),
    "conversation": (
        {"conversations": [{"from": "human", "value": "?"}, {"from": "gpt", "value": STEPS}]},
        RawReply("conversation", STEPS),
    ),
    "bare": (STEPS, RawReply("text", STEPS)),
    "bare in a list": ([STEPS], RawReply("text", STEPS)),
    "list of one": ([choice({"content": STEPS})], RawReply("chat completion", STEPS, "", "stop")),
}


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
    *("finish_reason", "thinking", "conversations", "response", "body", "predict", "from"),
    *("promptFeedback", "refusal"),
)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from(WORDS), inner, max_size=4)
    ),
    max_leaves=12,
)


@given(json_values)
def test_any_document_is_read_or_refused_with_a_data_error(raw: object) -> None:
    try:
        reply = read_raw_reply(raw, "x.json")
    except DataError:
        return
    assert isinstance(reply.text, str)
    assert isinstance(reply.reasoning, str)
    assert reply.finish in ("stop", "length", "refusal", "unknown")


@pytest.mark.parametrize(
    ("model", "shape", "replies"),
    [
        ("gpt-4o", "chat completion", 400),
        ("Qwen-VL-max", "chat completion", 400),
        ("claude-3-5-haiku", "Anthropic message", 400),
        ("claude-3-7-thinking", "Anthropic message, thinking", 390),
        ("gemini-2.0-flash", "Gemini", 400),
        ("InternVL2.5-8B", "predict", 400),
    ],
)
def test_the_official_recordings_are_all_read(
    official_checkout: Path, model: str, shape: str, replies: int
) -> None:
    files = sorted((official_checkout / "outputs" / model).glob("*.json"))
    read = [read_raw_reply(json.loads(path.read_text()), str(path)) for path in files]
    assert len(read) == replies
    assert {reply.shape for reply in read} == {shape}
    assert all(reply.text for reply in read)
    assert all(bool(reply.reasoning) == ("thinking" in shape) for reply in read)


@given(st.one_of(st.integers(), st.floats(), st.booleans(), st.text(max_size=3), st.none()))
def test_a_number_of_tokens_is_one_or_not_known(value: object) -> None:
    count = token_count(value)
    if count is not None:
        assert type(count) is int
        assert 0 <= count <= 10**9
        assert count == value
    else:
        assert type(value) is not int or not 0 <= value <= 10**9


@given(st.text(st.characters()))
def test_every_text_of_a_reply_can_be_written(text: str) -> None:
    raw = RawReply("x", f"{text}\ud800", f"\udfff{text}", model=f"{text}\udc00\ud800")
    for kept in (raw.text, raw.reasoning, raw.model):
        kept.encode()
        assert kept.replace("\ufffd", "") == well_formed(text).replace("\ufffd", "")
