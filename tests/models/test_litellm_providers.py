"""Providers whose code in litellm differs: all of them send through our client, or not at all."""

from __future__ import annotations

import socket
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest
from aiohttp import web

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, RetryableError, UnavailableError, UnreachableError
from phyblock.models import Message, Reply, RetryPolicy
from phyblock.models.http_client import Answer, HttpClient
from phyblock.models.litellm_call import _litellm
from tests.models.factory import ask, make_model, make_request
from tests.models.routes import KEY_VARIABLE
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat

SYNCHRONOUS = ["amazon_nova/nova-m", "maritalk/m", "oobabooga/m"]
PROVIDERS = [
    *SYNCHRONOUS,
    "petals/m",
    "nlp_cloud/m",
    "gigachat/m",
    "watsonx_text/m",
    "ollama/m",
    "ollama_chat/m",
    "replicate/a/m",
    "huggingface/a/m",
    "codestral/m",
    "cohere_chat/m",
    "databricks/m",
    "deepseek/m",
    "groq/m",
    "mistral/m",
    "text-completion-codestral/m",
]
TEXT = replace(make_request(), params={}, messages=(Message("user", ("Which blocks?",)),))


class AnyPath(OpenAIChat):
    """Answers every path alike and counts what arrives."""

    def __init__(self, status: int, body: bytes) -> None:
        super().__init__()
        self.status, self.body = status, body
        self.hits = 0

    def add_routes(self, app: web.Application) -> None:
        app.router.add_route("*", "/{tail:.*}", self._answer)

    async def _answer(self, _: web.Request) -> web.Response:
        self.hits += 1
        return web.Response(status=self.status, body=self.body, content_type="application/json")


@pytest.fixture
def sends(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The addresses to which our client sends."""
    found: list[str] = []
    send = HttpClient.send

    async def counted(self: HttpClient, url: str, *args: Any, **fields: Any) -> Answer:
        found.append(url)
        return await send(self, url, *args, **fields)

    monkeypatch.setattr(HttpClient, "send", counted)
    return found


@pytest.fixture
def hosts(monkeypatch: pytest.MonkeyPatch) -> set[str]:
    """The hosts that anything in the process looks up; none but this machine is found."""
    found: set[str] = set()
    look_up = socket.getaddrinfo

    def noted(host: Any, *args: Any, **fields: Any) -> Any:
        name = host.decode() if isinstance(host, bytes) else str(host)
        if name == "127.0.0.1":
            return look_up(host, *args, **fields)
        found.add(name)
        raise socket.gaierror(socket.EAI_NONAME, "no host but this one")

    monkeypatch.setattr(socket, "getaddrinfo", noted)
    return found


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(KEY_VARIABLE, "sk-not-a-real-key-1234")
    monkeypatch.setenv("NO_PROXY", "*")
    for name, value in {
        "AWS_EC2_METADATA_DISABLED": "true",
        "NO_GCE_CHECK": "true",
        "WATSONX_PROJECT_ID": "p",
    }.items():
        monkeypatch.setenv(name, value)
    _litellm()


def answer_of(model_id: str, **fields: Any) -> Reply | ModelError | None:
    known: Mapping[str, Any] = {"seed": "never", "timeout_s": 10.0}
    config = ModelConfig(name="m", id=model_id, **{**known, **fields})
    (answer,) = ask(make_model(config, policy=RetryPolicy(1, 0.0)), TEXT)
    return answer


@pytest.mark.parametrize("model_id", PROVIDERS)
def test_a_provider_sends_through_our_client_to_its_server_or_not_at_all(
    model_id: str, sends: list[str], hosts: set[str]
) -> None:
    server = AnyPath(500, b'{"x": 1}')
    with Running(server) as running:
        answer = answer_of(model_id, api_base=running.url, api_key_env=KEY_VARIABLE)
    assert isinstance(answer, ModelError), answer
    assert server.hits == len(sends)
    assert all(url.startswith(running.url) for url in sends)
    assert hosts <= {"ngw.devices.sberbank.ru", "iam.cloud.ibm.com"}
    if server.hits:
        assert isinstance(answer, RetryableError)
        assert answer.status == 500
    elif hosts:
        assert isinstance(answer, UnreachableError), answer
    else:
        assert isinstance(answer, UnavailableError), answer


@pytest.mark.parametrize("model_id", ["amazon_nova/nova-m", "huggingface/a/m"])
def test_a_reply_comes_through_our_client(model_id: str, sends: list[str]) -> None:
    body = b'{"choices": [{"message": {"role": "assistant", "content": "Step1"}}]}'
    server = AnyPath(200, body)
    with Running(server) as running:
        answer = answer_of(model_id, api_base=running.url, api_key_env=KEY_VARIABLE)
    assert isinstance(answer, Reply), answer
    assert answer.text == "Step1"
    assert server.hits == len(sends) == 1


@pytest.mark.parametrize("model_id", SYNCHRONOUS)
def test_what_a_synchronous_client_reads_is_bounded_and_billed(
    model_id: str, sends: list[str]
) -> None:
    text = '{"choices": [{"message": {"role": "assistant", "content": "' + "x" * 2**20 + '"}}]}'
    server = AnyPath(200, text.encode())
    fields = {"api_key_env": KEY_VARIABLE, "most_body_bytes": 2**16}
    with Running(server) as running:
        long = answer_of(model_id, api_base=running.url, **fields)
        server.body = b"<html>Hello</html>"
        unread = answer_of(model_id, api_base=running.url, **fields)
    for answer in (long, unread):
        assert isinstance(answer, RetryableError), answer
        assert answer.status == 200
        assert answer.sent == "answered"
    assert server.hits == len(sends) == 2


@pytest.mark.parametrize("model_id", ["vertex_ai/gemini-2.0-flash", "sagemaker/m", "bedrock/m"])
def test_what_is_missing_on_this_machine_is_no_outage(
    monkeypatch: pytest.MonkeyPatch, model_id: str, hosts: set[str]
) -> None:
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_PROFILE", "HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("AWS_REGION", "eu-west-1")
    answer = answer_of(model_id)
    assert isinstance(answer, UnavailableError), answer
    assert answer.sent == "no"
    assert not hosts
