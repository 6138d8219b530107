"""SHA-256: what stands for a content, and chance that is the same on every machine."""

from __future__ import annotations

import hashlib

__all__ = ["drawn_bytes", "hex_digest"]


def hex_digest(content: bytes | str) -> str:
    """The digest of bytes, or of a text as UTF-8, in hexadecimal digits."""
    data = content.encode() if isinstance(content, str) else content
    return hashlib.sha256(data).hexdigest()


def drawn_bytes(*words: object) -> bytes:
    """Bytes that words decide, as evenly spread as chance: to sort by, or to draw a number from."""
    return hashlib.sha256("|".join(map(str, words)).encode()).digest()
