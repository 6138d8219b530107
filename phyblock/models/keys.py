"""Environment variables of a model: its key, which no text may contain, and its server."""

from __future__ import annotations

import base64
import functools
import html
import json
import os
import re
import urllib.parse
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from phyblock.config.models import ADDRESS_ALLOWED, ModelConfig, is_address
from phyblock.errors import Problem, SpecError, UnavailableError

_KEY_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "cloudflare": ("CLOUDFLARE_API_KEY",),
    "fireworks_ai": ("FIREWORKS_AI_API_KEY", "FIREWORKS_API_KEY"),
    "gemini": ("GEMINI_API_KEY", "GOOGLE_API_KEY"),
    "perplexity": ("PERPLEXITYAI_API_KEY", "PERPLEXITY_API_KEY"),
    "qwencloud": ("QWENCLOUD_API_KEY", "DASHSCOPE_API_KEY"),
    "together_ai": ("TOGETHERAI_API_KEY", "TOGETHER_API_KEY", "TOGETHER_AI_API_KEY"),
}
"""Variables of providers whose key is not in `<PROVIDER>_API_KEY`, in the order of lookup."""

_ADDRESS_VARIABLES: Mapping[str, tuple[str, ...]] = {
    "anthropic": ("ANTHROPIC_API_BASE", "ANTHROPIC_BASE_URL"),
    "fireworks_ai": ("FIREWORKS_API_BASE",),
    "mistral": ("MISTRAL_AZURE_API_BASE", "MISTRAL_API_BASE"),
    "ollama_chat": ("OLLAMA_API_BASE",),
    "openai": ("OPENAI_BASE_URL", "OPENAI_API_BASE"),
}
"""Variables of a server's address, if not `<PROVIDER>_API_BASE`, in litellm's order."""

_OWN_CREDENTIALS = (
    "azure", "bedrock", "github_copilot", "oci", "sagemaker", "vertex_ai", "watsonx",
)  # fmt: skip
"""Providers that can sign in without an API key, which litellm handles by itself."""

KEYLESS = ("hosted_vllm", "lm_studio", "llamafile", "ollama", "ollama_chat")
"""Local servers, which accept a key but need none."""

_PLACEHOLDER = "no-key"
_PLACEHOLDERS = (_PLACEHOLDER, "empty", "none", "null", "dummy", "test")
"""Placeholders for an unneeded key, in lower case; they are not secrets."""

_CALLED_SECRET = re.compile(
    r"(?:^|_|API)(?:KEY|TOKEN|SECRET|PASSW(?:OR)?D|CREDENTIALS?|JWT)(?:_|$)", re.IGNORECASE
)
_SHORTEST_KEY = 4
_SHORT = 8
_MASK = "[key]"
_LOOKS_SECRET = re.compile(
    r"(?:\bsk-[\w-]{6,}|\bAIza[\w-]{10,}|(?<=Bearer )[\w.~+/-]{6,}|(?<=Basic )[\w+/=-]{6,}"
    r"|(?<=[?&]key=)[^&\s'\"]+|(?<=://)[^/\s@]+(?=@))"
)


@dataclass(frozen=True)
class KeyStatus:
    """The state of a model's key.

    `variables` are the environment variables that are checked, in order; `is_set` is True if one
    holds a key, `is_needed` if calls fail without; `fault` is the reason why the key cannot be
    sent, or "".
    """

    variables: tuple[str, ...]
    is_set: bool
    is_needed: bool
    fault: str = ""


def api_key_status(config: ModelConfig) -> KeyStatus:
    """Return the state of the model's key in the environment."""
    if config.kind != "litellm":
        return KeyStatus((), is_set=False, is_needed=False)
    variables = _variables(config)
    is_needed = config.api_key_env is not None or not (
        config.addresses or config.provider in KEYLESS + _OWN_CREDENTIALS
    )
    found = _found(variables)
    if found is None or all(" " <= character <= "~" for character in found[1]):
        return KeyStatus(variables, found is not None, is_needed)
    fault = f"{found[0]} holds a line break or another character that no HTTP header can carry"
    return KeyStatus(variables, is_set=True, is_needed=is_needed, fault=fault)


def api_key(config: ModelConfig) -> str | None:
    """Return the key to send; None leaves it to litellm (providers with their own credentials).

    A server named by `api_base` gets a placeholder if no key is set, since clients require one.
    Raises UnavailableError if a key is needed and not set, or no header can carry it.
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
    """Return the address of the model's server in the environment, or None.

    litellm would find it too, but then replies of two servers could be confused. Raises SpecError
    if it is not an address, or may contain a key or a password, since it is stored and shown.
    """
    provider = model_id.partition("/")[0]
    usual = f"{provider.upper().replace('-', '_')}_API_BASE"
    for name in _ADDRESS_VARIABLES.get(provider, (usual,)):
        if value := os.environ.get(name):
            if not is_address(value):
                message = "is not an address that can be used"
                where = f"environment variable {name}"
                raise SpecError(Problem(where, message, allowed=ADDRESS_ALLOWED))
            return value
    return None


def secrets_of(config: ModelConfig) -> tuple[str, ...]:
    """Return the values that no stored text may contain, longest first.

    They are the model's key, and all environment variables named as a key, token, secret, password
    or credential, since litellm signs in with many of them. Values of fewer than 4 characters (8
    for others than the model's key) and common words for "no key" are excluded: removing them would
    ruin texts and hide nothing.
    """
    own = _variables(config)
    secrets = {
        value.strip()
        for name, value in os.environ.items()
        if (name in own and len(value.strip()) >= _SHORTEST_KEY)
        or (_CALLED_SECRET.search(name) and len(value.strip()) >= _SHORT)
    }
    secrets = {value for value in secrets if value.lower() not in _PLACEHOLDERS}
    return tuple(sorted(secrets, key=lambda value: (-len(value), value)))


def _variables(config: ModelConfig) -> tuple[str, ...]:
    if config.api_key_env is not None:
        return (config.api_key_env,)
    usual = f"{config.provider.upper().replace('-', '_')}_API_KEY"
    return _KEY_VARIABLES.get(config.provider, (usual,))


def _found(variables: tuple[str, ...]) -> tuple[str, str] | None:
    """Return the first variable that holds a key, and the key without surrounding white space."""
    values = ((name, os.environ.get(name, "").strip()) for name in variables)
    return next((found for found in values if found[1]), None)


def hidden(text: str, secrets: Iterable[str], *, guess: bool = True) -> str:
    """Return `text` with every secret masked, whether plain or escaped (JSON, HTML, URL, base64).

    A secret of fewer than 8 characters is masked only as a whole word: inside a longer word it is a
    coincidence. With `guess`, for messages and not for replies, text that looks like a key is also
    masked, and the beginning of a secret at the very end of the text, where it was cut.
    """
    known = tuple(secrets)
    for form in _forms(known):
        if form in text:
            exact = re.escape(form)
            word = rf"(?<![^\W_]){exact}(?![^\W_])" if len(form) < _SHORT else exact
            text = re.sub(word, _MASK, text)
    if not guess:
        return text
    for form in _forms(known):
        for length in range(len(form) - 1, _SHORTEST_KEY - 1, -1):
            if text.endswith(form[:length]):
                text = text[:-length] + _MASK
                break
    return _LOOKS_SECRET.sub(_MASK, text)


@functools.lru_cache(maxsize=64)
def _forms(secrets: tuple[str, ...]) -> tuple[str, ...]:
    """Return all forms in which a server, a library or a log may write one of the secrets.

    The longest come first, since one may begin another. In base64 a secret is found at any place in
    the encoded bytes, also in `user:key`; the characters at either end that also depend on its
    neighbors are omitted.
    """
    forms: set[str] = set()
    for secret in secrets:
        quoted, escaped = urllib.parse.quote(secret, safe=""), json.dumps(secret)[1:-1]
        forms |= {secret, " ".join(secret.split()), repr(secret)[1:-1], html.escape(secret)}
        forms |= {escaped, escaped.replace("/", "\\/"), secret.replace("'", "\\'")}
        forms |= {quoted, urllib.parse.quote(secret), urllib.parse.quote_plus(secret)}
        forms.add(re.sub("%..", lambda match: match[0].lower(), quoted))
        for before in range(3):
            data = bytes(before) + secret.encode()
            inside = slice((before * 8 + 5) // 6, len(data) * 8 // 6)
            for encode in (base64.b64encode, base64.urlsafe_b64encode):
                encoded = encode(data).decode()[inside]
                forms |= {encoded} if len(encoded) >= _SHORT else set()
    return tuple(sorted(forms, key=lambda form: (-len(form), form)))
