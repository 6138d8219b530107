"""Asking for JSON: what arrives at servers, who is sent a schema, and how a refusal is told."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest
from aiohttp import web

from phyblock.config.models import ModelConfig
from phyblock.config.suite import Suite
from phyblock.errors import ModelError, RefusedError, SampleError, UnavailableError
from phyblock.models import Reply, Request
from phyblock.parsing.answer import choice_form
from phyblock.parsing.move import move_form
from phyblock.parsing.plan import parse_plan, plan_form
from phyblock.run.models import to_config
from tests.models.factory import ask, make_model, make_request, reply_of
from tests.models.routes import KEY_VARIABLE, ROUTES
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat

FORM = plan_form(16)


@pytest.fixture(autouse=True)
def _key(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")


def asking(key: str = "017") -> Request:
    return replace(make_request(key, 42), response_format=FORM.response_format)


def arrived(route: str, request: Request, **fields: Any) -> Seen:
    server = ROUTES[route].server()
    with Running(server) as running:
        reply_of(make_model(ROUTES[route].config(running.url, **fields)), request)
    return server.seen[0]


class Choosy(OpenAIChat):
    """Plans in the schema that it is sent; refuses one after `takes` requests."""

    def __init__(self, takes: int = 10**9, message: str = "") -> None:
        super().__init__()
        self.takes, self.message = takes, message

    async def _end(self, seen: Seen, ending: str, request: web.Request) -> web.StreamResponse:
        if "response_format" in seen.params and self.requests > self.takes:
            error = self.error(400, "policy" if "safety" in self.message else "", self.message)
            return web.json_response(error, status=400)
        return await super()._end(seen, ending, request)

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        asked = seen.params.get("response_format", {}).get("json_schema", {}).get("schema")
        if asked is not None:
            numbers = asked["properties"]["plan"]["items"]["enum"]
            content = json.dumps({"reasoning": "Bottom up.", "plan": numbers[:3]})
            body["choices"][0]["message"]["content"] = content
        return body


def test_the_schema_arrives_as_it_is_declared_and_the_reply_is_read() -> None:
    server = Choosy()
    with Running(server) as running:
        config = ROUTES["direct"].config(running.url, response_format="always")
        reply = reply_of(make_model(config), asking())
    assert server.seen[0].raw["response_format"] == {
        "type": "json_schema",
        "json_schema": {"name": "plan", "schema": FORM.schema, "strict": True},
    }
    parsed = parse_plan(reply.text, 16)
    assert (parsed.plan.steps, parsed.rule) == ((1, 2, 3), "json")


SPEAKING = (
    "Invalid parameter: 'response_format' of type 'json_schema' is not supported with this model.",
    "This model does not support structured outputs",
    "json_schema is not supported by this backend: no grammar",
)


@pytest.mark.parametrize("message", SPEAKING)
def test_a_provider_that_refuses_the_schema_is_left_with_the_setting_named(message: str) -> None:
    answers = _answers(Choosy(0, message))
    for answer in answers:
        assert isinstance(answer, UnavailableError)
        assert message in str(answer)
        assert "set response_format: never for this model in the models file" in str(answer)


def test_what_else_a_server_refuses_is_the_request_s_own() -> None:
    policy = _answers(Choosy(0, "rejected by our safety system: response_format"))
    assert {type(answer) for answer in policy} == {RefusedError}
    other = _answers(Choosy(0, "Image too large"))
    assert {type(answer) for answer in other} == {SampleError}
    first, *later = _answers(Choosy(1, 'Bad request: {"response_format": {"type": "json_schema"}}'))
    assert isinstance(first, Reply)
    assert {type(answer) for answer in later} == {SampleError}


def _answers(server: OpenAIChat) -> list[Reply | ModelError | None]:
    with Running(server) as running:
        config = ROUTES["direct"].config(running.url, response_format="always", max_concurrency=1)
        return ask(make_model(config), asking("001"), asking("002"), asking("003"))


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
