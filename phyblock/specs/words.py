"""Small helpers of wording: show a value, guess what was meant, know a secret when it is there."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Mapping
from itertools import islice

__all__ = ["SECRET_KEYS", "did_you_mean", "looks_secret", "show"]

_LONGEST = 80
"""Characters of a value that are shown, and so the most of its items that can matter."""

_SECRET = re.compile(
    r"""(?<![A-Za-z0-9])(?:
        sk-[A-Za-z0-9_-]{8,}            # OpenAI, Anthropic, OpenRouter, DashScope
      | (?:AIza|ya29\.)[A-Za-z0-9_-]{16,}  # Google
      | (?:hf|gsk|pplx|xai|nvapi|r8|ghp|fw)[_-][A-Za-z0-9_-]{16,}
      | AKIA[A-Z0-9]{12,}               # AWS
      | eyJ[A-Za-z0-9_-]{10,300}\.[A-Za-z0-9_-]{10,}
      | [Bb]earer\s+[A-Za-z0-9._-]{8,}
    )""",
    re.VERBOSE,
)
_CREDENTIALS_IN_URL = re.compile(r"^[a-z][a-z0-9+.-]*://[^/@\s:]*:[^/@\s]*@", re.IGNORECASE)

SECRET_KEYS = frozenset(
    {"api_key", "apikey", "api-key", "token", "secret", "password", "authorization",
     "x-api-key"}
)  # fmt: skip
"""Keys under which only a secret would be written."""


def looks_secret(text: str) -> bool:
    """Whether a text has the form of a provider's key, a token, or a URL with a password."""
    return bool(_SECRET.search(text) or _CREDENTIALS_IN_URL.match(text))


def show(value: object) -> str:
    """A value as it would be written in YAML, on one short line; secrets are not repeated."""
    if isinstance(value, Mapping):
        keys = ", ".join(str(key) for key in islice(value, _LONGEST))
        text = f"a mapping with {keys}" if value else "an empty mapping"
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(show(item) for item in islice(value, _LONGEST)) + "]"
    elif isinstance(value, str):
        text = "a text that looks like a key" if looks_secret(value) else _quote(value)
    elif isinstance(value, float):
        text = repr(value)
    else:
        text = json.dumps(value, default=str)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A hint at the known word that is most like `word`, case aside; "" where none is close."""
    folded = {name.casefold(): name for name in known}
    matches = difflib.get_close_matches(word.casefold(), folded, n=1)
    return f"did you mean {folded[matches[0]]}?" if matches else ""


def _quote(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
