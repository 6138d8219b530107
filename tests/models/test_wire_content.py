"""Requests as they arrive at servers: pictures byte for byte and in order, texts, parameters."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.config.suite import Suite
from phyblock.models import Image, Message, Request
from phyblock.models.request import json_body, wire_messages
from phyblock.parsing.answer import choice_form
from phyblock.parsing.move import move_form
from phyblock.parsing.plan import plan_form
from phyblock.run.plan import to_config
from phyblock.types import ImageDetail
from tests.models.factory import JPEG, PNG, make_model, make_request, picture, reply_of
from tests.models.routes import ROUTES
from tests.servers.chassis import Running, Seen


def arrived_with(route: str, *, pictures: tuple[bytes, bytes], **params: object) -> Seen:
    server = ROUTES[route].server()
    with Running(server) as running:
        config = ROUTES[route].config(running.url)
        reply_of(make_model(config), make_request("017", 42, pictures=pictures, **params))
    return server.seen[0]


@pytest.mark.parametrize("route", ROUTES)
def test_texts_and_pictures_arrive_in_order_byte_for_byte(route: str) -> None:
    pictures = (picture(1, PNG, 150_000), picture(2, JPEG, 90_000))
    request = make_request("017", 42, pictures=pictures)
    goal, candidates = (p for p in request.messages[1].parts if isinstance(p, Image))
    seen = arrived_with(route, pictures=pictures)
    assert seen.system == "You assemble blocks."
    assert seen.parts == (
        "The goal:",
        ("image/png", goal.sha256),
        "The candidates, numbered:",
        ("image/jpeg", candidates.sha256),
        "Scene 017: which blocks, in which order?",
    )


@pytest.mark.parametrize(
    ("route", "names"),
    [
        ("direct", ("temperature", "top_p", "max_tokens")),
        ("openai", ("temperature", "top_p", "max_tokens")),
        ("vllm", ("temperature", "top_p", "max_tokens")),
        ("anthropic", ("temperature", "top_p", "max_tokens")),
        ("gemini", ("temperature", "top_p", "max_output_tokens")),
    ],
)
def test_sampling_parameters_arrive_and_nothing_else(route: str, names: tuple[str, ...]) -> None:
    seen = arrived_with(route, pictures=(picture(1), picture(2)))
    assert seen.params == dict(zip(names, (0.5, 0.9, 128), strict=True))
    assert seen.seed == (None if route == "anthropic" else 42)


@pytest.mark.parametrize(
    "extra",
    [
        {},
        {"extra_body": {"top_k": 20, "chat_template_kwargs": {"enable_thinking": False}}},
        {"stop": ["END"], "presence_penalty": 0.5},
        {"temperature": None, "top_p": None},
    ],
)
def test_both_transports_put_the_same_json_on_the_wire(extra: dict[str, object]) -> None:
    pictures = (picture(1), picture(2))
    direct, through_openai = (
        arrived_with(route, pictures=pictures, **extra).raw for route in ("direct", "openai")
    )
    assert direct == through_openai
    assert direct["seed"] == 42
    assert ("temperature" in direct) == (extra.get("temperature", 0) is not None)


@pytest.mark.parametrize("route", ["direct", "openai"])
def test_thoughts_left_in_the_text_become_reasoning(route: str) -> None:
    thinking = "<think>\nred first\n</think>\n\nStep1: Move block with index 3"

    class Thinker(ROUTES[route].server):  # type: ignore[misc, name-defined]
        def reply(self, seen: Seen, ending: str) -> dict[str, object]:
            body: dict[str, object] = super().reply(seen, ending)
            message = {"role": "assistant", "content": thinking}
            return {**body, "choices": [{"message": message, "finish_reason": "stop"}]}

    with Running(Thinker()) as running:
        reply = reply_of(make_model(ROUTES[route].config(running.url)), make_request())
    assert reply.text.strip() == "Step1: Move block with index 3"
    assert reply.reasoning.strip() == "red first"


def looked_at(seen: Seen) -> list[object]:
    """Return the detail that a request asks for, picture by picture or as a whole."""
    if "contents" in seen.raw:
        whole = seen.params.get("mediaResolution")
        parts = [part for content in seen.raw["contents"] for part in content["parts"]]
        return [part.get("media_resolution", whole) for part in parts if "text" not in part]
    content = seen.raw["messages"][-1]["content"]
    return [p["image_url"].get("detail") for p in content if p["type"] == "image_url"]


@pytest.mark.parametrize(
    ("route", "model_id", "detail", "arrives"),
    [
        ("direct", "openai/m", "low", "low"),
        ("openai", "openai/m", "original", "original"),
        ("vllm", "hosted_vllm/m", "high", "high"),
        ("gemini", "gemini/gemini-3.8-flash", "medium", {"level": "MEDIA_RESOLUTION_MEDIUM"}),
        ("gemini", "gemini/gemini-2.5-flash", "low", "MEDIA_RESOLUTION_LOW"),
        ("direct", "openai/m", None, None),
        ("gemini", "gemini/gemini-3.8-flash", None, None),
    ],
)
def test_how_closely_to_look_arrives_in_the_words_of_the_provider(
    route: str, model_id: str, detail: ImageDetail | None, arrives: object
) -> None:
    server = ROUTES[route].server()
    with Running(server) as running:
        config = ROUTES[route].config(running.url, id=model_id, image_detail=detail)
        # litellm refuses the sampling parameters that models of today do not take.
        reply_of(make_model(config), replace(make_request(), params={}))
    assert looked_at(server.seen[0]) == [arrives, arrives]


texts = st.text(max_size=30)
images = st.builds(
    lambda magic, tail: Image(magic + tail, "goal", 8, 8),
    st.sampled_from([PNG, JPEG, b"GIF89a", b"RIFF0000WEBP"]),
    st.binary(max_size=40),
)
messages = st.builds(
    Message,
    st.sampled_from(["system", "user", "assistant"]),
    st.lists(texts | images, min_size=1, max_size=5).map(tuple),
)


@settings(max_examples=200)
@given(
    st.lists(messages, max_size=4).map(tuple),
    st.dictionaries(texts, texts, max_size=3),
    st.sampled_from([None, "low", "high"]),
)
def test_a_body_made_around_the_encoder_says_what_the_encoder_would(
    content: tuple[Message, ...], fields: dict[str, str], detail: ImageDetail | None
) -> None:
    import json

    expected = {**fields, "messages": wire_messages(content, detail)}
    assert json.loads(json_body(fields, content, detail)) == expected


def test_only_pictures_are_sent_as_pictures() -> None:
    from phyblock.errors import DataError

    request = make_request(pictures=(b"<html>", picture(1)))
    with pytest.raises(DataError, match=r"'goal'.*is no picture"):
        wire_messages(replace(request).messages, None)


FORM = plan_form(16)


def asking(key: str = "017") -> Request:
    return replace(make_request(key, 42), response_format=FORM.response_format)


def arrived(route: str, request: Request, **fields: Any) -> Seen:
    server = ROUTES[route].server()
    with Running(server) as running:
        reply_of(make_model(ROUTES[route].config(running.url, **fields)), request)
    return server.seen[0]


def test_the_schema_arrives_as_it_is_declared() -> None:
    schema = {"name": "plan", "schema": FORM.schema, "strict": True}
    seen = arrived("direct", asking(), response_format="always")
    assert seen.raw["response_format"] == {"type": "json_schema", "json_schema": schema}


JSON_SUITE = Suite(name="s", models=("m",), answer_format="json_schema")


@pytest.mark.parametrize(
    ("fields", "sends"),
    [
        ({"id": "openai/gpt-4o-2024-08-06"}, True),
        ({"id": "openai/gpt-4o-2024-08-06", "response_format": "never"}, False),
        ({"id": "hosted_vllm/Qwen/Qwen3-VL-8B-Instruct", "api_base": "http://localhost:8000/v1"},
         True),
        ({"id": "openai/mine", "api_base": "http://localhost:8000/v1"}, True),
        ({"id": "openai/mine"}, False),
        ({"id": "dashscope/qwen-vl-max"}, False),
        ({"id": "dashscope/qwen-vl-max", "response_format": "always"}, True),
    ],
)  # fmt: skip
def test_who_is_sent_a_schema(fields: dict[str, str], sends: bool) -> None:
    spec = ModelConfig.model_validate(fields)
    assert to_config("m", spec, JSON_SUITE).sends_format is sends
    assert not to_config("m", spec, Suite(name="s", models=("m",))).sends_format


@pytest.mark.slow
@pytest.mark.parametrize("form", [plan_form(16), move_form(16), choice_form("abcd", True)])
def test_litellm_hands_every_schema_on(form: Any) -> None:
    request = replace(make_request("017", 42), response_format=form.response_format)
    for route in ("openai", "vllm"):
        assert arrived(route, request, response_format="always").raw == (
            arrived("direct", request, response_format="always").raw
        )
    gemini = arrived("gemini", request, response_format="always").params
    assert gemini["response_mime_type"] == "application/json"
    assert form.key in json.dumps(gemini["response_json_schema"])
    claude = arrived("anthropic", request, response_format="always").params
    assert claude["tools"][0]["input_schema"]["properties"] == form.schema["properties"]


@pytest.mark.parametrize(
    ("model_id", "api_base", "transport", "is_direct"),
    [
        ("openai/m", "http://x/v1", "auto", True),
        ("hosted_vllm/m", "http://x/v1", "auto", True),
        ("openai/m", None, "auto", False),
        ("openai/o1", "http://x/v1", "auto", False),
        ("anthropic/c", "http://x", "auto", False),
        ("anthropic/c", "http://x", "direct", True),
        ("openai/m", "http://x/v1", "litellm", False),
    ],
)
def test_the_transport_is_chosen_by_rule(
    model_id: str, api_base: str | None, transport: Any, is_direct: bool
) -> None:
    config = ModelConfig(name="m", id=model_id, api_base=api_base, transport=transport)  # type: ignore[call-arg]
    assert config.is_direct == is_direct
