"""Keys: the one that a model needs, and that keys stay out of all text."""

import base64
import html
import itertools
import json
import urllib.parse

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.config.models import ModelConfig
from phyblock.errors import UnavailableError
from phyblock.models.client import KeyStatus, api_key, api_key_status, hidden, secrets_of
from tests.workspace import KEY_VARIABLE

PRINTABLE = st.characters(min_codepoint=33, max_codepoint=126)
KEYS = st.text(PRINTABLE, min_size=8, max_size=60)


@pytest.fixture(autouse=True)
def _no_keys(monkeypatch):
    for name in ("OPENAI", "ANTHROPIC", "GEMINI", "GOOGLE", "DASHSCOPE", "HOSTED_VLLM", "MINE"):
        monkeypatch.delenv(f"{name}_API_KEY", raising=False)
    monkeypatch.delenv(KEY_VARIABLE)


def config(model_id, **fields):
    return ModelConfig(name="m", id=model_id, **fields)


@pytest.mark.parametrize(
    ("fields", "variables", "is_needed"),
    [
        ({"id": "openai/o1"}, ("OPENAI_API_KEY",), True),
        ({"id": "openai/m", "api_base": "http://x"}, ("OPENAI_API_KEY",), False),
        ({"id": "dashscope/qwen"}, ("DASHSCOPE_API_KEY",), True),
        ({"id": "gemini/g"}, ("GEMINI_API_KEY", "GOOGLE_API_KEY"), True),
        ({"id": "hosted_vllm/m"}, ("HOSTED_VLLM_API_KEY",), False),
        ({"id": "vertex_ai/g"}, ("VERTEX_AI_API_KEY",), False),
        ({"id": "openai/m", "api_base": "http://x", "api_key_env": "MINE"}, ("MINE",), True),
        ({}, (), False),
    ],
)
def test_what_a_model_needs(fields, variables, is_needed):
    assert api_key_status(ModelConfig(name="m", **fields)) == KeyStatus(variables, None, is_needed)


@pytest.mark.parametrize("value", ["", " ", "abc", "EMPTY", "no-key"])
def test_a_placeholder_is_no_secret(monkeypatch, value):
    monkeypatch.setenv("OPENAI_API_KEY", value)
    assert secrets_of(config("openai/o1")) == ()


@given(KEYS, st.text(max_size=8), st.text(max_size=8))
def test_a_key_is_hidden_in_every_form(key, before, after):
    forms = [
        key,
        json.dumps(key)[1:-1],
        json.dumps(key)[1:-1].replace("/", "\\/"),
        repr(key)[1:-1],
        html.escape(key),
        urllib.parse.quote(key),
        urllib.parse.quote(key, safe=""),
        urllib.parse.quote_plus(key),
        urllib.parse.quote(key, safe="").lower() if key == key.lower() else key,
    ]
    for form, guess in itertools.product(forms, (True, False)):
        text = hidden(f"{before} {form} {after}", (key,), guess=guess)
        assert form not in text or form in f"{before} [key] {after}"


@given(KEYS, st.text(PRINTABLE.filter(lambda c: c != ":"), max_size=9))
def test_a_key_is_hidden_in_basic_credentials(key, user):
    credentials = base64.b64encode(f"{user}:{key}".encode()).decode()
    left = hidden(f"got {credentials}", (key,), guess=False).partition("[key]")
    assert left[1]
    assert len(left[2]) <= 4
    try:
        shown = base64.b64decode(left[0].removeprefix("got ") + "===", validate=False)
    except ValueError:
        return
    assert key[:2].encode() not in shown.removeprefix(f"{user}:".encode())


@given(KEYS, st.integers(min_value=4))
def test_a_key_that_is_cut_at_the_end_is_hidden(key, length):
    part = key[: min(length, len(key) - 1)]
    assert not hidden(f"bad key {part}", (key,)).endswith(part)


def test_a_short_key_is_hidden_as_a_word_and_not_inside_of_others():
    text = hidden("key s3cr! of s3cr, not xs3cr or s3crets", ("s3cr",))
    assert text == "key [key]! of [key], not xs3cr or s3crets"


@pytest.mark.parametrize("bad", ["a-key\nof-mine", "a-key\x7fof-mine", "a-k\u00e9y-of-mine"])
def test_a_key_that_cannot_be_sent_is_named_by_its_variable(monkeypatch, bad):
    monkeypatch.setenv("OPENAI_API_KEY", bad)
    with pytest.raises(UnavailableError, match="OPENAI_API_KEY holds") as refused:
        api_key(config("openai/o1"))
    assert "of-mine" not in str(refused.value)
    assert "of-mine" not in repr(api_key_status(config("openai/o1")))


@pytest.mark.parametrize(
    ("model_id", "variable"),
    [
        ("bedrock/m", "AWS_BEARER_TOKEN_BEDROCK"),
        ("bedrock/m", "AWS_SESSION_TOKEN"),
        ("sagemaker/m", "AWS_SECRET_ACCESS_KEY"),
        ("azure/m", "AZURE_AD_TOKEN"),
        ("azure/m", "AZURE_CLIENT_SECRET"),
        ("watsonx_text/m", "WX_API_KEY"),
        ("gigachat/m", "GIGACHAT_CREDENTIALS"),
        ("huggingface/a/m", "HF_TOKEN"),
        ("vertex_ai/m", "VERTEXAI_CREDENTIALS"),
    ],
)
@pytest.mark.parametrize("api_key_env", [None, "MINE_API_KEY"])
def test_what_a_provider_signs_in_with_is_a_secret(monkeypatch, model_id, variable, api_key_env):
    monkeypatch.setenv(variable, "a-long-secret-of-mine")
    config = ModelConfig(name="m", id=model_id, api_key_env=api_key_env)
    assert "a-long-secret-of-mine" in secrets_of(config)
    assert api_key_status(config).key is None
