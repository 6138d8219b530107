"""The models of the paper's Tables 1 and 2 and how their names are spelled elsewhere; pure.

A name is read as its tokens: runs of letters and runs of digits, in lower case, so that case and
separators make no difference. Release dates and a few words without meaning for the weights are
left out. What remains must equal, token for token, a known spelling; anything else is unknown.
"""

from __future__ import annotations

import re

__all__ = ["PUBLISHED_NAMES", "TABLE2_NAMES", "match_published"]

_SPELLINGS: dict[str, tuple[str, ...]] = {
    "Claude-3.5 Haiku": (),
    "Claude-3.5 Sonnet": (),
    "Claude-3.7 Sonnet": ("claude-3-7",),
    "Claude-3.7 Sonnet-Thinking": ("claude-3-7-thinking",),
    "GPT-4o-mini": (),
    "GPT-4o": (),
    "GPT-o1": ("o1",),
    "Gemini-1.5-flash-8b": (),
    "Gemini-1.5-flash": (),
    "Gemini-2.0-flash-lite": ("gemini-2.0-flash-lite-preview",),
    "Gemini-2.0-flash": (),
    "Gemini-2.0-flash-thinking-exp": ("gemini-2.0-flash-thinking",),
    "Qwen-VL-Max": (),
    "InternVL2.5-1B": (),
    "InternVL2.5-8B": (),
    "InternVL2.5-78B": (),
    "Qwen2.5-VL-3B-Instruct": ("qwen2.5-vl-3b",),
    "Qwen2.5-VL-7B-Instruct": ("qwen2.5-vl-7b",),
    "LLaVa-OneVision-0.5B": (
        "llava-onevision-qwen2-0.5b",
        "llava-onevision-qwen2-0.5b-ov",
        "llava-onevision-qwen2-0.5b-ov-hf",
    ),
    "LLaVa-OneVision-7B": (
        "llava-onevision-qwen2-7b",
        "llava-onevision-qwen2-7b-ov",
        "llava-onevision-qwen2-7b-ov-hf",
    ),
    "Random": (),
}

_OTHER_SPELLINGS: dict[str, tuple[str, ...]] = {
    "GPT-4.1": (),
    "GPT-o3": ("o3",),
    "Qwen2.5-VL-72B-Instruct": ("qwen2.5-vl-72b",),
}

PUBLISHED_NAMES: tuple[str, ...] = tuple(_SPELLINGS)
"""Row names of Table 1, in its order."""
TABLE2_NAMES: tuple[str, ...] = tuple(_OTHER_SPELLINGS)
"""Names that Table 2 has a row of and Table 1 has not."""

_TOKEN = re.compile(r"[a-z]+|[0-9]+|[^\W_]+")
_MONTH, _DAY = "(?:0[1-9]|1[0-2])", "(?:0[1-9]|[12][0-9]|3[01])"
_DATE = re.compile(rf"(?<![0-9])20[0-9]{{2}}[-_./ ]?{_MONTH}(?:[-_./ ]?{_DAY})?(?![0-9])")
_SHORT_DATE = re.compile(rf"(?<=[-_./ @]){_MONTH}[-_./ ]?{_DAY}$")
_RELEASE = re.compile(r"(?<=[-_./ @])(?:latest|00[0-9])$")


def match_published(name: str) -> str | None:
    """The row of Table 1 or 2 that a folder of recorded replies or a model name stands for.

    Folders before the last slash (a provider, an owner) are ignored. None where the name is
    unknown or could mean more than one row: "claude-3-5" names two models, "gemini-2.0" four.
    """
    return _ROWS.get(_tokens(name))


def _tokens(name: str) -> tuple[str, ...]:
    bare = name.strip().rstrip("/").rpartition("/")[2].lower()
    bare = _DATE.sub(" ", bare).rstrip("-_. @")
    for pattern in (_RELEASE, _SHORT_DATE, _RELEASE):
        bare = pattern.sub("", bare).rstrip("-_. @")
    return tuple(_TOKEN.findall(bare))


_ROWS: dict[tuple[str, ...], str] = {
    _tokens(spelling): row
    for row, more in (_SPELLINGS | _OTHER_SPELLINGS).items()
    for spelling in (row, *more)
}
