"""Which part of a reply is the answer, where a model thinks aloud first."""

from __future__ import annotations

import re

__all__ = ["after_reasoning"]

_THINKING_ENDS = re.compile(r"</think(?:ing)?>", re.IGNORECASE)


def after_reasoning(text: str) -> str:
    """What follows the last closing tag of a reasoning section, or the whole text."""
    ends = list(_THINKING_ENDS.finditer(text))
    tail = text[ends[-1].end() :] if ends else ""
    return tail if tail.strip() else text
