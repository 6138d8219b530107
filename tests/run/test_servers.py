"""Servers: where one is decides nothing, and no key or picture that it says again is kept."""

import base64
import itertools
from contextlib import ExitStack

import pytest

from phyblock.config.models import ModelConfig
from phyblock.config.suite import Suite
from phyblock.models.cache import reply_key
from phyblock.run.plan import to_config
from tests.models.factory import ask, make_model, make_request
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.servers.other_protocols import AnthropicMessages, GeminiGenerate
from tests.workspace import KEY_VARIABLE

COMPATIBLE = (
    *("hosted_vllm", "lm_studio", "llamafile", "xai", "dashscope", "mistral", "openrouter"),
    *("together_ai", "moonshot", "zai", "meta", "novita"),
)
WAYS = [
    ("OPENAI_BASE_URL", "openai/m", "/v1", OpenAIChat),
    ("OPENAI_API_BASE", "openai/m", "/v1", OpenAIChat),
    *((f"{name.upper()}_API_BASE", f"{name}/m", "/v1", OpenAIChat) for name in COMPATIBLE),
    ("ANTHROPIC_API_BASE", "anthropic/claude-3-7-sonnet-20250219", "", AnthropicMessages),
    ("ANTHROPIC_BASE_URL", "anthropic/claude-3-7-sonnet-20250219", "", AnthropicMessages),
    ("GEMINI_API_BASE", "gemini/gemini-2.5-flash", "", GeminiGenerate),
]


def config_of(model_id):
    spec = ModelConfig(id=model_id, api_key_env=KEY_VARIABLE)
    return to_config("m", spec, Suite(name="s", models=("m",)))


@pytest.fixture(autouse=True)
def _environment(monkeypatch):
    for variable, *_ in WAYS:
        monkeypatch.delenv(variable, raising=False)


@pytest.mark.parametrize(("variable", "model_id", "path", "server"), WAYS)
def test_calls_go_to_the_address_and_keys_say_so(monkeypatch, variable, model_id, path, server):
    keys = {reply_key(config_of(model_id), make_request())}
    with Running(server()) as running:
        monkeypatch.setenv(variable, running.url + path)
        config = config_of(model_id)
        answers = ask(make_model(config), make_request("001"))
        assert running.server.ended == {"ok": 1}, answers
        keys.add(reply_key(config, make_request()))
        monkeypatch.setenv(variable, "http://127.0.0.1:9/v1")
        keys.add(reply_key(config_of(model_id), make_request()))
    assert len(keys) == 2


KEYS = {
    "HOSTED_VLLM_API_KEY": "hv-5ecret-0123456789abcdef",
    "OPENAI_API_KEY": "sk-proj-5ecret0123456789abcdefghij",
    "ANTHROPIC_API_KEY": "sk-ant-5ecret0123456789abcdefghij",
    "GEMINI_API_KEY": "AIza5ecret0123456789abcdefghij",
    "MY_SERVER_KEY": 'a "plain" w\\ord/with 5ecret in it & <more>',
    "MY_SHORT_KEY": "5ecret!",
}
PNG_HEAD = base64.b64encode(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR")[:20]


def told(seen):
    return f"{seen.reply_text}\nYour key is {seen.key}."


@pytest.mark.parametrize("transport", ["direct", pytest.param("litellm", marks=pytest.mark.slow)])
def test_keys_and_pictures_stay_off_the_disk(workspace, transport):
    echoes = {f"echo-key-{kind}": 0.04 for kind in ("in-reply", "json", "cut", "page")}
    faults = Faults({"429": 0.1, "500": 0.1, "html": 0.1, **echoes}, retry_after="0")
    kinds = {"locked": Faults(mode="echo-key"), "refuses": Faults(mode="echo-key-json")}
    entries, used = {}, []
    with ExitStack() as stack:
        for name, each in {"talks": faults, **kinds}.items():
            server = OpenAIChat(each, say=told, think=told)
            url = stack.enter_context(Running(server)).url
            entries[name] = {"id": f"hosted_vllm/{name}", "api_base": f"{url}/v1"}
            entries[name]["transport"] = transport
            used.append(server.seen)
        # Other limits, so that none is answered from another's cached replies and its key unused.
        own_key = {"named": "MY_SERVER_KEY", "short": "MY_SHORT_KEY"}
        for max_tokens, (name, key) in enumerate(own_key.items(), start=1000):
            keyed = {"api_key_env": key, "max_tokens": max_tokens}
            entries[name] = entries["talks"] | keyed
        entries["openai"] = entries["talks"] | {"id": "openai/some-model"}
        workspace.write_yaml("models.yaml", entries)
        # What fails for good is recorded with what the server said, and waits grow no longer.
        limits = {"max_attempts": 3, "retry_for_s": 0}
        workspace.write_suite(models=list(entries), seeds=[0, 1], limits=limits)
        shown = [workspace.run("--yes", env=KEYS, fresh=True), workspace.run("--dry-run", env=KEYS)]
        shown.append(workspace.phyblock("models", env=KEYS))
    names = ("HOSTED_VLLM_API_KEY", "MY_SERVER_KEY", "MY_SHORT_KEY", "OPENAI_API_KEY")
    assert {seen.key for seen in itertools.chain(*used)} == {KEYS[name] for name in names}
    assert {r["outcome"] for r in workspace.records()} >= {"ok", "api_error"}

    found = workspace.files()
    assert any(name.endswith("replies.sqlite") for name in found)
    found |= {f"output {i}": (done.out + done.err).encode() for i, done in enumerate(shown)}
    for name, content in found.items():
        leaked = [word for word in (b"5ecret", PNG_HEAD, b"IHDR") if word in content]
        assert not leaked, name
