"""Which key a model needs, and that keys stay out of all text."""

from __future__ import annotations

import pytest

from phyblock.errors import UnavailableError
from phyblock.models import KeyStatus, ModelConfig, api_key_status
from phyblock.models.keys import api_key, hidden, secrets_of


@pytest.fixture(autouse=True)
def _no_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OPENAI", "ANTHROPIC", "GEMINI", "GOOGLE", "DASHSCOPE", "HOSTED_VLLM", "MINE"):
        monkeypatch.delenv(f"{name}_API_KEY", raising=False)


def config(model_id: str, **fields: object) -> ModelConfig:
    return ModelConfig("m", "litellm", model_id, **fields)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("model", "status"),
    [
        (config("openai/o1"), KeyStatus(("OPENAI_API_KEY",), False, True)),
        (config("openai/m", api_base="http://x"), KeyStatus(("OPENAI_API_KEY",), False, False)),
        (config("dashscope/qwen"), KeyStatus(("DASHSCOPE_API_KEY",), False, True)),
        (config("gemini/g"), KeyStatus(("GEMINI_API_KEY", "GOOGLE_API_KEY"), False, True)),
        (config("hosted_vllm/m"), KeyStatus(("HOSTED_VLLM_API_KEY",), False, False)),
        (config("vertex_ai/g"), KeyStatus(("VERTEX_AI_API_KEY",), False, False)),
        (
            config("openai/m", api_base="http://x", api_key_env="MINE_API_KEY"),
            KeyStatus(("MINE_API_KEY",), False, True),
        ),
        (ModelConfig("oracle", "baseline", "oracle"), KeyStatus((), False, False)),
    ],
)
def test_what_a_model_needs(model: ModelConfig, status: KeyStatus) -> None:
    assert api_key_status(model) == status


def test_the_first_variable_that_is_set_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("GEMINI_API_KEY", "")
    monkeypatch.setenv("GOOGLE_API_KEY", "second")
    assert api_key_status(config("gemini/g")).is_set
    assert api_key(config("gemini/g")) == "second"
    monkeypatch.setenv("GEMINI_API_KEY", "first")
    assert api_key(config("gemini/g")) == "first"


def test_a_key_that_is_needed_and_not_set_stops_the_model_before_any_call() -> None:
    with pytest.raises(UnavailableError, match="set GEMINI_API_KEY or GOOGLE_API_KEY"):
        api_key(config("gemini/g"))
    with pytest.raises(UnavailableError, match="set MINE_API_KEY"):
        api_key(config("openai/m", api_base="http://x", api_key_env="MINE_API_KEY"))


def test_servers_that_need_none_get_a_placeholder_and_others_are_left_to_litellm() -> None:
    assert api_key(config("openai/m", api_base="http://x")) == "no-key"
    assert api_key(config("vertex_ai/g")) is None


def test_keys_are_hidden_wherever_they_stand(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MINE_API_KEY", "correct horse battery staple")
    secrets = secrets_of(config("openai/m", api_key_env="MINE_API_KEY"))
    text = "bad key 'correct horse battery staple' at https://x/?key=AIzaSyA&alt=1"
    assert hidden(text, secrets) == "bad key '[key]' at https://x/?key=[key]&alt=1"
    assert hidden("Bearer abcdefgh1234", ()) == "Bearer [key]"
    assert hidden("provided: sk-proj-abc_DEF-123.", ()) == "provided: [key]."
    assert hidden("Bearer abcdefgh1234", secrets, guess=False) == "Bearer abcdefgh1234"


@pytest.mark.parametrize("value", ["", "EMPTY", "no-key"])
def test_a_placeholder_is_no_secret(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", value)
    assert secrets_of(config("openai/o1")) == ()
