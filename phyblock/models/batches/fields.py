"""Fields of what providers write about batches, taken for what they should be, or for nothing."""

from __future__ import annotations

import json
from collections.abc import Mapping
from datetime import datetime
from typing import Any

__all__ = ["count", "error_words", "joined", "mapping", "text", "unix_s"]


def text(value: object) -> str:
    """A text, or ""."""
    return value if isinstance(value, str) else ""


def mapping(value: object) -> Mapping[str, Any]:
    """An object, or an empty one."""
    return value if isinstance(value, Mapping) else {}


def count(value: object) -> int | None:
    """A number, also one that is written as a text, as Google does; else None."""
    if isinstance(value, str) and value.isdecimal() and len(value) < 16:
        return int(value)
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def unix_s(value: object) -> float | None:
    """A time as RFC 3339 writes it as Unix time; None for what is none."""
    try:
        # Nine decimals, and a Z before Python 3.11, are more than it reads.
        whole, _, rest = text(value).partition(".")
        zone = rest.lstrip("0123456789") if rest else ""
        return datetime.fromisoformat((whole + zone).replace("Z", "+00:00")).timestamp()
    except ValueError:
        return None


def error_words(error: object) -> str:
    """What an error says."""
    parts = mapping(error)
    return " ".join(str(parts[name]) for name in ("code", "message") if parts.get(name))


def joined(fields: Mapping[str, Any], name: str, body: Any) -> bytes:
    """An object as JSON with `body` under `name`; bytes are JSON already, and go in as they are.

    Without a name the body is all of it.
    """
    inner = body if isinstance(body, bytes) else json.dumps(body).encode()
    if not name:
        return inner
    # Last, also where there was one of this name.
    others = {key: value for key, value in fields.items() if key != name}
    head = json.dumps({**others, name: None}).encode()
    return head.removesuffix(b"null}") + inner + b"}"
