"""`phyblock models` and `validate`: what is shown and found, and the one call of `check`."""

from __future__ import annotations

import pytest

from phyblock.config.models import ModelConfig
from phyblock.models import litellm_client
from phyblock.models.litellm_client import known_providers
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace


def test_a_call_that_may_cost_is_made_only_where_somebody_agrees(workspace: Workspace) -> None:
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "dear", price={"input": 1.0, "output": 1.0})
        refused = workspace.phyblock("models", "check", "dear", env={"CI": "1"})
        assert (refused.code, running.server.requests) == (2, 0)
        assert "would cost money, and there is no terminal to ask on" in refused.err
        assert workspace.phyblock("models", "check", "dear", "--yes").code == 0
        assert running.server.requests == 1
        workspace.write_models(running.url, "free", price={"input": 0.0, "output": 0.0})
        assert workspace.phyblock("models", "check", "free").code == 0
        assert running.server.requests == 2


def test_missing_recordings_and_unknown_providers_are_found(workspace: Workspace) -> None:
    models = {
        "far": {"replay": "./nowhere"},
        "odd": {"id": "opnai/gpt-4o", "groups": ["mine"]},
        "own": {"id": "hosted_vllm/x", "api_base": "http://localhost:1/v1"},
        "straight": {"id": "My/x", "api_base": "http://localhost:1/v1", "transport": "direct"},
    }
    workspace.write_yaml("models.yaml", models)
    workspace.write_suite(models=["group:mine", "own", "straight"], seeds=[0])
    done = workspace.phyblock("validate", "models.yaml", "suite.yaml")
    assert done.code == 2
    assert "models.yaml:2:11: far.replay: recordings not found" in done.err
    # Of the suite its own models alone are looked at.
    assert done.err.count("far.replay") == 1
    assert done.err.count("models.yaml:4:7: odd.id: is of no provider that is known") == 2
    assert "did you mean openai?" in done.err
    assert "own.id" not in done.err
    assert "straight.id" not in done.err


@pytest.mark.parametrize(
    "model", ["hosted_vllm/x", "openai/new", "gemini/gemini-2.5-pro", "anthropic/claude-unheard-of"]
)
def test_a_model_at_hand_needs_no_litellm(model: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(litellm_client, "_litellm", lambda: pytest.fail("it was imported"))
    assert model.partition("/")[0] in known_providers(ModelConfig(name="m", id=model))
