"""Addresses of servers: those in the environment count, and where a server is decides nothing."""

from __future__ import annotations

import pytest

from phyblock.config.models import ModelConfig
from phyblock.config.suite import Suite
from phyblock.models import reply_key
from phyblock.run.plan import to_config
from tests.models.factory import ask, make_model, make_request
from tests.servers.anthropic_messages import AnthropicMessages
from tests.servers.chassis import LocalServer, Running
from tests.servers.gemini_generate import GeminiGenerate
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

KEY = "sk-not-a-real-key-1234"
WAYS: list[tuple[str, str, str, type[LocalServer]]] = [
    ("OPENAI_BASE_URL", "openai/m", "/v1", OpenAIChat),
    ("OPENAI_API_BASE", "openai/m", "/v1", OpenAIChat),
    ("HOSTED_VLLM_API_BASE", "hosted_vllm/m", "/v1", OpenAIChat),
    ("LM_STUDIO_API_BASE", "lm_studio/m", "/v1", OpenAIChat),
    ("LLAMAFILE_API_BASE", "llamafile/m", "/v1", OpenAIChat),
    ("XAI_API_BASE", "xai/m", "/v1", OpenAIChat),
    ("DASHSCOPE_API_BASE", "dashscope/m", "/v1", OpenAIChat),
    ("MISTRAL_API_BASE", "mistral/m", "/v1", OpenAIChat),
    ("OPENROUTER_API_BASE", "openrouter/m", "/v1", OpenAIChat),
    ("TOGETHER_AI_API_BASE", "together_ai/m", "/v1", OpenAIChat),
    ("MOONSHOT_API_BASE", "moonshot/m", "/v1", OpenAIChat),
    ("ZAI_API_BASE", "zai/m", "/v1", OpenAIChat),
    ("META_API_BASE", "meta/m", "/v1", OpenAIChat),
    ("NOVITA_API_BASE", "novita/m", "/v1", OpenAIChat),
    ("ANTHROPIC_API_BASE", "anthropic/claude-3-7-sonnet-20250219", "", AnthropicMessages),
    ("ANTHROPIC_BASE_URL", "anthropic/claude-3-7-sonnet-20250219", "", AnthropicMessages),
    ("GEMINI_API_BASE", "gemini/gemini-2.5-flash", "", GeminiGenerate),
]


def config_of(model_id: str, transport: str = "auto") -> ModelConfig:
    spec = ModelConfig(id=model_id, api_key_env="PHYBLOCK_TEST_KEY", transport=transport)  # type: ignore[arg-type]
    return to_config("m", spec, Suite(name="s", models=("m",)))


@pytest.fixture(autouse=True)
def _environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PHYBLOCK_TEST_KEY", KEY)
    for variable, *_ in WAYS:
        monkeypatch.delenv(variable, raising=False)


@pytest.mark.parametrize(("variable", "model_id", "path", "server"), WAYS)
def test_calls_go_to_the_address_and_keys_say_that_there_is_one(
    monkeypatch: pytest.MonkeyPatch,
    variable: str,
    model_id: str,
    path: str,
    server: type[LocalServer],
) -> None:
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


def test_a_server_that_moved_is_asked_nothing_again(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as first:
        workspace.write_models(first.url, "alpha")
        workspace.write_suite(models=["alpha"], seeds=[0])
        assert workspace.run().code == 0
        assert first.server.ended["ok"] > 0
    with Running(OpenAIChat()) as second:
        several = [f"{url}/v1" for url in (first.url, second.url)]
        served = {"id": "hosted_vllm/alpha", "api_base": several}
        workspace.write_yaml("models.yaml", {"alpha": served})
        again = workspace.run()
        assert (again.code, second.server.ended) == (0, {}), again.err
        workspace.write_models(second.url, "alpha")
        moved = workspace.run()
        assert (moved.code, second.server.ended) == (0, {}), moved.err


def test_a_check_asks_every_server(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as server:
        bases = [f"{server.url}/v1", "http://127.0.0.1:9/v1"]
        workspace.write_yaml("models.yaml", {"m": {"id": "hosted_vllm/m", "api_base": bases}})
        models_file = workspace.root / "models.yaml"
        checked = workspace.phyblock("models", "--models-file", models_file, "check", "m")
    assert checked.code == 1
    assert f"m at 127.0.0.1:{server.port} answers: " in checked.out
    assert "m at 127.0.0.1:9 does not answer: " in checked.out


def test_one_model_at_two_addresses_is_named_before_anything_is_asked(workspace: Workspace) -> None:
    entries = {
        name: {"id": "hosted_vllm/m", "api_base": f"http://127.0.0.1:{port}/v1"}
        for name, port in (("alpha", 9), ("beta", 10))
    }
    workspace.write_yaml("models.yaml", entries)
    workspace.write_suite(models=["alpha", "beta"], seeds=[0])
    refused = workspace.run()
    assert refused.code == 2
    assert "model beta: api_base: is alpha at another address" in refused.err
    assert not workspace.out.exists()
    entries["beta"]["revision"] = "step 2000"
    workspace.write_yaml("models.yaml", entries)
    assert workspace.run("--dry-run").code == 0
