"""What the environment says of a model: its key, which no text may hold, and its server."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from phyblock.config.models import ModelConfig, address_fault
from phyblock.errors import Problem, SpecError, UnavailableError
from phyblock.models.masks import hidden

__all__ = [
    "KEYLESS",
    "KeyStatus",
    "api_key",
    "api_key_status",
    "environment_secrets",
    "hidden",
    "secrets_of",
    "server_address",
]

_KEY_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "cloudflare": ("CLOUDFLARE_API_KEY",),
    "fireworks_ai": ("FIREWORKS_AI_API_KEY", "FIREWORKS_API_KEY"),
    "gemini": ("GEMINI_API_KEY", "GOOGLE_API_KEY"),
    "perplexity": ("PERPLEXITYAI_API_KEY", "PERPLEXITY_API_KEY"),
    "qwencloud": ("QWENCLOUD_API_KEY", "DASHSCOPE_API_KEY"),
    "together_ai": ("TOGETHERAI_API_KEY", "TOGETHER_API_KEY", "TOGETHER_AI_API_KEY"),
}
"""Where the name is not `<PROVIDER>_API_KEY`, in the order in which they are looked for."""

_OWN_CREDENTIALS = (
    "azure",
    "bedrock",
    "github_copilot",
    "oci",
    "sagemaker",
    "vertex_ai",
    "watsonx",
)
"""Providers that can sign in without an API key: litellm finds out by itself."""

KEYLESS = ("hosted_vllm", "lm_studio", "llamafile", "ollama", "ollama_chat")
"""Local servers, which take a key but need none."""

_ADDRESS_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "anthropic": ("ANTHROPIC_API_BASE", "ANTHROPIC_BASE_URL"),
    "fireworks_ai": ("FIREWORKS_API_BASE",),
    "mistral": ("MISTRAL_AZURE_API_BASE", "MISTRAL_API_BASE"),
    "ollama_chat": ("OLLAMA_API_BASE",),
    "openai": ("OPENAI_BASE_URL", "OPENAI_API_BASE"),
    **{
        provider: (f"{provider.upper()}_API_BASE",)
        for provider in (
            "azure",
            "azure_ai",
            "dashscope",
            "deepseek",
            "gemini",
            "groq",
            "hosted_vllm",
            "llamafile",
            "lm_studio",
            "meta",
            "moonshot",
            "novita",
            "ollama",
            "openrouter",
            "together_ai",
            "xai",
            "zai",
        )
    },
}
"""Where litellm looks for a server's address when it is given none, in its order."""

_AWS = (
    "AWS_ACCESS_KEY_ID",
    "AWS_BEARER_TOKEN_BEDROCK",
    "AWS_SECRET_ACCESS_KEY",
    "AWS_SESSION_TOKEN",
)
_AZURE = (
    "AZURE_AD_TOKEN",
    "AZURE_CLIENT_SECRET",
    "AZURE_OPENAI_API_KEY",
    "AZURE_PASSWORD",
)
_VERTEX = ("VERTEXAI_CREDENTIALS", "VERTEX_CREDENTIALS")
_WATSONX = (
    "WATSONX_API_KEY",
    "WATSONX_APIKEY",
    "WATSONX_TOKEN",
    "WATSONX_ZENAPIKEY",
    "WX_API_KEY",
)
_SECRET_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "anthropic": ("ANTHROPIC_API_KEY", "ANTHROPIC_AUTH_TOKEN"),
    "azure": _AZURE,
    "azure_ai": _AZURE,
    "azure_text": _AZURE,
    "bedrock": _AWS,
    "bedrock_converse": _AWS,
    "bedrock_mantle": (*_AWS, "BEDROCK_MANTLE_API_KEY"),
    "cohere": ("COHERE_API_KEY", "CO_API_KEY"),
    "cohere_chat": ("COHERE_API_KEY", "CO_API_KEY"),
    "databricks": ("DATABRICKS_API_KEY", "DATABRICKS_CLIENT_SECRET", "DATABRICKS_TOKEN"),
    "datarobot": ("DATAROBOT_API_TOKEN",),
    "fireworks_ai": ("FIREWORKSAI_API_KEY", "FIREWORKS_AI_TOKEN"),
    "friendliai": ("FRIENDLIAI_API_KEY", "FRIENDLI_TOKEN"),
    "gigachat": ("GIGACHAT_ACCESS_TOKEN", "GIGACHAT_CREDENTIALS", "GIGACHAT_PASSWORD"),
    "huggingface": ("HF_TOKEN", "HUGGINGFACE_API_KEY"),
    "mistral": ("MISTRAL_AZURE_API_KEY",),
    "openrouter": ("OR_API_KEY",),
    "replicate": ("REPLICATE_API_KEY", "REPLICATE_API_TOKEN"),
    "sagemaker": _AWS,
    "sagemaker_chat": _AWS,
    "snowflake": ("SNOWFLAKE_JWT",),
    "together_ai": ("TOGETHER_AI_TOKEN",),
    "vertex_ai": _VERTEX,
    "vertex_ai_beta": _VERTEX,
    "volcengine": ("ARK_API_KEY",),
    "watsonx": _WATSONX,
    "watsonx_text": _WATSONX,
}
"""Variables beside those of the key in which litellm looks for what it signs in with."""

_PLACEHOLDER = "no-key"
_CALLED_SECRET = re.compile("KEY|TOKEN|SECRET|PASSW|CREDENTIAL", re.IGNORECASE)
_SHORTEST_SECRET = 4
_PLACEHOLDERS = (_PLACEHOLDER, "empty", "none", "null", "dummy", "test")
"""What people write where a server needs no key, in lower case: no secrets."""


@dataclass(frozen=True)
class KeyStatus:
    """Whether a model can be called as far as keys go.

    `variables` are the environment variables looked at, in order; `is_set` whether one holds a
    key; `is_needed` whether calls fail without; `fault` what keeps the key that is set from being
    sent, or "".
    """

    variables: tuple[str, ...]
    is_set: bool
    is_needed: bool
    fault: str = ""


def api_key_status(config: ModelConfig) -> KeyStatus:
    """Whether the model's key is set; looks at the environment alone."""
    if config.kind != "litellm":
        return KeyStatus((), is_set=False, is_needed=False)
    variables = _variables(config)
    is_needed = config.api_key_env is not None or not (
        config.has_address or config.provider in KEYLESS + _OWN_CREDENTIALS
    )
    found = _found(variables)
    fault = _fault(*found) if found is not None else ""
    return KeyStatus(variables, found is not None, is_needed, fault)


def api_key(config: ModelConfig) -> str | None:
    """The key to send; None leaves it to litellm (providers with credentials of their own).

    A server named by `api_base` gets a placeholder when no key is set, as clients insist on one.
    Raises UnavailableError when a key is needed and not set, or when no header can carry it.
    """
    status = api_key_status(config)
    if status.fault:
        why = f"the API key of {config.name} cannot be sent: {status.fault}"
        raise UnavailableError(why, sent="no")
    if (found := _found(status.variables)) is not None:
        return found[1]
    if status.is_needed:
        names = " or ".join(status.variables)
        why = f"no API key for {config.name}: set {names} in the environment"
        raise UnavailableError(why, sent="no")
    return None if config.provider in _OWN_CREDENTIALS else _PLACEHOLDER


def server_address(model_id: str) -> str | None:
    """Address of the model's server that the environment names, or None.

    litellm would find it too, but unseen: replies of two servers must not pass for one another's.
    Raises SpecError for what is no address, or may hold a key or a password: it is kept and shown.
    """
    for name in _ADDRESS_VARIABLES.get(model_id.partition("/")[0], ()):
        if value := os.environ.get(name):
            if (fault := address_fault(value)) is not None:
                message, hint = fault
                raise SpecError(Problem(f"environment variable {name}", message, hint=hint))
            return value
    return None


def secrets_of(config: ModelConfig) -> tuple[str, ...]:
    """Values that no stored text may hold: all secrets that calls to this model could carry.

    A value of fewer than 4 characters, or a usual word for "no key", is none: to take it out of all
    text would ruin the text and hide nothing.
    """
    variables = (*_variables(config), *_SECRET_VARIABLES.get(config.provider, ()))
    return _secret_values(variables)


def environment_secrets() -> tuple[str, ...]:
    """Values of all variables that are called keys, tokens, secrets, passwords or credentials.

    Programs of the user's that are started here have all of them, whichever model they are for.
    """
    return _secret_values(name for name in os.environ if _CALLED_SECRET.search(name))


def _secret_values(variables: Iterable[str]) -> tuple[str, ...]:
    values = {os.environ.get(name, "").strip() for name in variables}
    return tuple(
        sorted(
            value
            for value in values
            if len(value) >= _SHORTEST_SECRET and value.lower() not in _PLACEHOLDERS
        )
    )


def _variables(config: ModelConfig) -> tuple[str, ...]:
    if config.api_key_env is not None:
        return (config.api_key_env,)
    usual = f"{config.provider.upper().replace('-', '_')}_API_KEY"
    return _KEY_VARIABLES.get(config.provider, (usual,))


def _found(variables: tuple[str, ...]) -> tuple[str, str] | None:
    """The first variable that holds a key, and that key without white space around it."""
    values = ((name, os.environ.get(name, "").strip()) for name in variables)
    return next((found for found in values if found[1]), None)


def _fault(variable: str, value: str) -> str:
    """What keeps a key from standing in an HTTP header, without the key."""
    if all(" " <= character <= "~" for character in value):
        return ""
    return f"{variable} holds a line break or another character that no HTTP header can carry"
