"""Calls through litellm: over our HTTP client or not at all, and its settings stay as they are."""

import contextlib
import logging
import os
import socket
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from unittest import mock

import pytest
from aiohttp import web

from phyblock.config.models import ModelConfig, load_models
from phyblock.config.suite import Suite
from phyblock.errors import RetryableError, UnavailableError
from phyblock.models.client import KEYLESS, HttpClient
from phyblock.models.costs import map_entry
from phyblock.models.model import RetryPolicy
from phyblock.models.request import Message
from phyblock.records.record import Reply
from phyblock.run.plan import to_config
from tests.models.factory import ROUTES, ask, make_model, make_request
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import KEY_VARIABLE

ROOT = Path(__file__).parents[2]
OWN_CLIENT = ["amazon_nova/m", "cohere_chat/m", "maritalk/m", "oobabooga/m", "petals/m"]
PROVIDERS = [
    *OWN_CLIENT,
    *("azure/m", "bedrock/converse/amazon.nova-pro-v1:0", "codestral/m", "dashscope/m"),
    *("databricks/m", "deepseek/m", "gigachat/m", "groq/m", "huggingface/a/m", "mistral/m"),
    *("ollama/m", "ollama_chat/m", "openrouter/m", "watsonx_text/m", "xai/m"),
]
MODELS = load_models(ROOT / "models.yaml")
SUITE = Suite(name="s", models=("m",))


class AnyPath(OpenAIChat):
    """Fails alike on every path, and counts what arrives."""

    hits = 0

    def add_routes(self, app):
        app.router.add_route("*", "/{tail:.*}", self._answer)

    async def _answer(self, _):
        self.hits += 1
        return web.json_response({"x": 1}, status=500)


@pytest.fixture
def hosts(monkeypatch):
    """The hosts that anything in the process looks up; none but this machine is found."""
    found, look_up = set(), socket.getaddrinfo

    def noted(host, *args, **fields):
        name = host.decode() if isinstance(host, bytes) else str(host)
        if name == "127.0.0.1":
            return look_up(host, *args, **fields)
        found.add(name)
        raise socket.gaierror(socket.EAI_NONAME, "no host but this one")

    monkeypatch.setattr(socket, "getaddrinfo", noted)
    return found


@pytest.fixture(autouse=True)
def _environment(monkeypatch):
    aws = {"EC2_METADATA_DISABLED": "true", "REGION": "eu-west-1"}
    aws |= {"ACCESS_KEY_ID": "AKIANOTAREALKEY", "SECRET_ACCESS_KEY": "not-a-real-secret"}
    others = {"NO_GCE_CHECK": "true", "WATSONX_PROJECT_ID": "p"}
    for name, value in ({f"AWS_{name}": value for name, value in aws.items()} | others).items():
        monkeypatch.setenv(name, value)


def answer_of(model_id, **fields):
    known = {"seed": "never", "timeout_s": 10.0, "transport": "litellm"}
    config = ModelConfig(name="m", id=model_id, **{**known, **fields})
    asked = replace(make_request(), params={}, messages=(Message("user", ("Which blocks?",)),))
    (answer,) = ask(make_model(config, policy=RetryPolicy(1, 0.0)), asked)
    return answer


@pytest.mark.parametrize("model_id", PROVIDERS)
def test_a_provider_sends_through_our_client_to_its_server_or_not_at_all(model_id, hosts):
    send = HttpClient.send
    with (
        Running(AnyPath()) as running,
        mock.patch.object(HttpClient, "send", autospec=True, side_effect=send) as sends,
    ):
        answer = answer_of(model_id, api_base=running.url, api_key_env=KEY_VARIABLE)
    hits, urls = running.server.hits, [call.args[1] for call in sends.call_args_list]
    assert hits == (len(urls) or int(model_id in OWN_CLIENT))
    assert all(url.startswith(running.url) for url in urls)
    # Where it signs in, and what it asks about models of any provider, with no key and no prompt.
    signs_in = {"ngw.devices.sberbank.ru", "iam.cloud.ibm.com"}
    assert hosts <= {*signs_in, "huggingface.co", "localhost"}
    if signs_in & hosts:
        assert isinstance(answer, UnavailableError), answer
    else:
        assert (type(answer), answer.status, hits) == (RetryableError, 500, 1), answer


def test_what_is_missing_on_this_machine_is_no_outage(monkeypatch, hosts):
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_PROFILE", "HOME"):
        monkeypatch.delenv(name, raising=False)
    for model_id in ("vertex_ai/gemini-2.0-flash", "sagemaker/m", "bedrock/m"):
        answer = answer_of(model_id)
        assert (type(answer), answer.sent) == (UnavailableError, "no"), answer
    # Where litellm looks for what it knows of a model, with no key and no prompt.
    assert hosts <= {"huggingface.co"}


def settings_of(litellm):
    """Return what a program may have set: the module's values, its loggers and the environment."""
    kinds = (bool, int, float, str, type(None), tuple)
    found = {name: value for name, value in vars(litellm).items() if isinstance(value, kinds)}
    for name in ("callbacks", "success_callback", "failure_callback", "_async_success_callback"):
        found[name] = list(getattr(litellm, name))
    for name in ("LiteLLM", "LiteLLM Router", "LiteLLM Proxy", "openai", "httpx"):
        logger = logging.getLogger(name)
        found[name] = (logger.level, logger.disabled, logger.propagate, list(logger.handlers))
    return {**found, "environment": dict(os.environ)}


def methods():
    """The methods of the HTTP libraries that litellm and others send with."""
    import aiohttp
    import httpx
    import openai
    from litellm.llms.custom_httpx.http_handler import AsyncHTTPHandler, HTTPHandler

    owners = (
        httpx.AsyncClient, httpx.Client, httpx.AsyncHTTPTransport, httpx.HTTPTransport,
        AsyncHTTPHandler, HTTPHandler, aiohttp.ClientSession, openai.AsyncOpenAI,
    )  # fmt: skip
    return {f"{owner.__name__}.{k}": v for owner in owners for k, v in vars(owner).items()}


@pytest.mark.parametrize("mode", ["ok", "429", "401", "cut", "seed"])
def test_calls_change_no_setting_logger_variable_or_class_of_the_callers_libraries(mode):
    import litellm

    litellm.suppress_debug_info = True
    # What a first call of anybody sets, as caches and flags inside, is no matter of ours.
    for name in ("openai", "vllm", "anthropic"):
        for faults in (Faults(), Faults(mode=mode)):
            server = ROUTES[name].server(faults)
            with Running(server) as running:
                config = ROUTES[name].config(running.url)
                before, known = settings_of(litellm), methods()
                ask(make_model(config, policy=RetryPolicy(1, 0.0)), make_request())
    assert methods() == known
    after = settings_of(litellm)
    changed = {name for name in before if before[name] != after.get(name, "gone")}
    assert not changed, {name: (before[name], after[name]) for name in changed}


FIRST = """
import asyncio, os, sys
from phyblock.models.model import RetryPolicy
from phyblock.config.models import ModelConfig
from tests.models.factory import ask, make_model, make_request
os.chdir(sys.argv[1])
before = dict(os.environ)
config = ModelConfig(name="m", id="gemini/gemini-2.5-flash", api_base=sys.argv[2])
(answer,) = ask(make_model(config, policy=RetryPolicy(attempts=1, retry_for_s=0.0)), make_request())
print(answer.usage.prompt_tokens)
# litellm itself names the folder of its tokenizer there.
os.environ.pop("TIKTOKEN_CACHE_DIR", None)
print(dict(os.environ) == before, os.environ.get("FROM_DOTENV"))
import litellm
print(litellm.suppress_debug_info, litellm.drop_params, litellm.num_retries)
"""


def test_the_first_call_imports_litellm_quietly_and_reads_no_key_file(tmp_path):
    (tmp_path / ".env").write_text("FROM_DOTENV=1\nGEMINI_API_KEY=sk-from-a-file-12345\n")
    # In its mode "DEV", litellm would read keys from any .env file above.
    environment = {"PYTHONPATH": str(ROOT), "PATH": "", "LITELLM_MODE": "DEV"}
    with Running(ROUTES["gemini"].server()) as running:
        command = [sys.executable, "-W", "error", "-c", FIRST, str(tmp_path), running.url]
        options = {"capture_output": True, "text": True, "check": True}
        done = subprocess.run(command, cwd=ROOT, env=environment, **options)
    assert (done.stdout, done.stderr) == ("1000\nTrue None\nFalse False None\n", "")
    assert [seen.key for seen in running.server.seen] == ["no-key"]


# The models that come with the project.


def of_group(group):
    return {name: spec for name, spec in MODELS.items() if group in spec.groups}


@pytest.mark.parametrize("name", [*of_group("frontier"), *of_group("open")])
def test_a_current_model_is_served_looks_at_pictures_and_has_room_to_think(name):
    asked = to_config(name, MODELS[name], SUITE)
    if asked.provider in KEYLESS:
        return  # Servers of one's own serve what they like: the map knows none of them.
    entry = map_entry(asked)
    assert (entry["supports_vision"], entry["mode"]) == (True, "chat")
    # On the day of which models.yaml speaks.
    assert (entry.get("deprecation_date") or "9999-01-01") > "2026-11-22"
    if name in of_group("frontier") and entry.get("supports_reasoning"):
        assert MODELS[name].max_tokens > 8192


def test_each_is_asked_with_what_it_takes():
    with contextlib.ExitStack() as stack:
        served = {n: stack.enter_context(Running(r.server())) for n, r in ROUTES.items()}
        for name, spec in of_group("frontier").items():
            shipped = to_config(name, spec, SUITE)
            route = shipped.provider if shipped.provider in ROUTES else "openai"
            given = shipped.model_dump(
                include=shipped.model_fields_set - {"addresses", "api_key_env"}, by_alias=True
            )
            at = ROUTES[route].config(served[route].url, **{**given, "transport": "litellm"})
            (reply,) = ask(make_model(at), replace(make_request(), params={}))
            assert isinstance(reply, Reply), reply
            seen = served[route].server.seen[-1]
            limits = ("max_tokens", "max_completion_tokens", "max_output_tokens")
            assert [seen.params[key] for key in limits if key in seen.params] == [
                spec.with_defaults(SUITE.sampling.model_dump()).params["max_tokens"]
            ], name
            if map_entry(shipped).get("supports_sampling_params") is False:
                assert not {"temperature", "top_p"} & shipped.params.keys(), name
                # litellm sends Gemini the temperature that it has anyway.
                assert seen.params.get("temperature", 1.0) == 1.0, name
