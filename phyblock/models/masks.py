"""Taking keys out of text, in every form in which a server may repeat them."""

from __future__ import annotations

import base64
import functools
import html
import json
import re
import urllib.parse
from collections.abc import Iterable

__all__ = ["hidden"]

_MASK = "[key]"
_SHORT = 8
_SHORTEST_PART = 4
_LOOKS_SECRET = re.compile(
    r"(?:\bsk-[\w-]{6,}|\bAIza[\w-]{10,}|(?<=Bearer )[\w.~+/-]{6,}|(?<=Basic )[\w+/=-]{6,}"
    r"|(?<=[?&]key=)[^&\s'\"]+|(?<=://)[^/\s@]+(?=@))"
)


def hidden(text: str, secrets: Iterable[str], *, guess: bool = True) -> str:
    """`text` with every secret replaced, as it is or escaped for JSON, Python, HTML, URLs, base64.

    A secret of fewer than 8 characters is replaced where it stands as a word of its own: as part of
    a longer word it is chance. With `guess`, which is for messages and not for replies, what looks
    like a key goes too, and the beginning of a secret at the very end of the text, where a message
    was cut.
    """
    known = tuple(secrets)
    if known:
        text = _pattern(known).sub(_MASK, text)
    if not guess:
        return text
    return _LOOKS_SECRET.sub(_MASK, _without_cut_secret(text, known))


@functools.lru_cache(maxsize=256)
def _pattern(secrets: tuple[str, ...]) -> re.Pattern[str]:
    """One pattern for all forms of all secrets; the longest first, as one may begin another."""
    forms = {form for secret in secrets for form in _forms(secret)}
    return re.compile("|".join(map(_matched, sorted(forms, key=len, reverse=True))))


def _matched(form: str) -> str:
    exact = re.escape(form)
    return rf"(?<![^\W_]){exact}(?![^\W_])" if len(form) < _SHORT else exact


@functools.lru_cache(maxsize=256)
def _forms(secret: str) -> frozenset[str]:
    """Every way in which a server, a library or a log may write a secret."""
    quoted = urllib.parse.quote(secret, safe="")
    escaped = json.dumps(secret)[1:-1]
    plain = {
        secret,
        " ".join(secret.split()),
        escaped,
        escaped.replace("/", "\\/"),
        repr(secret)[1:-1],
        secret.replace("'", "\\'"),
        html.escape(secret),
        urllib.parse.quote(secret),
        quoted,
        urllib.parse.quote_plus(secret),
        re.sub("%..", lambda match: match[0].lower(), quoted),
    }
    return frozenset(plain | {form for form in _in_base64(secret) if len(form) >= _SHORT})


def _in_base64(secret: str) -> set[str]:
    """What base64 makes of a secret wherever it stands in the encoded bytes, `user:key` included.

    The characters at either end that also depend on its neighbours are left out.
    """
    found = set()
    for before in range(3):
        data = bytes(before) + secret.encode()
        whole = len(data) * 8 // 6
        for encode in (base64.b64encode, base64.urlsafe_b64encode):
            first = (before * 8 + 5) // 6
            found.add(encode(data).decode()[first:whole])
    return found


def _without_cut_secret(text: str, secrets: tuple[str, ...]) -> str:
    """The text without the first part of a secret at its end, if at least 4 characters of it."""
    for secret in secrets:
        for form in _forms(secret):
            for length in range(len(form) - 1, _SHORTEST_PART - 1, -1):
                if text.endswith(form[:length]):
                    return text[:-length] + _MASK
    return text
