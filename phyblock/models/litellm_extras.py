"""Work that litellm and the OpenAI client under it do for each call and that nobody here reads.

It is a fifth of what a call through them costs, and has no settings. What another version of theirs
has not is left as that version does it.
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Mapping
from types import ModuleType
from typing import Any

__all__ = ["leave_out", "unlogged"]


def leave_out(litellm: ModuleType) -> None:
    """Leave out litellm's own reckoning of what a call costs, and the client's search through
    requests of chats for fields to rename: they are as they go over the wire.
    """
    if hasattr(litellm, "response_cost_calculator"):
        litellm.response_cost_calculator = _no_cost  # type: ignore[attr-defined]
    with contextlib.suppress(ImportError, AttributeError):
        # The client is litellm's, and no package of ours.
        is_given = importlib.import_module("openai._utils").is_given
        chats: Any = importlib.import_module("openai.resources.chat.completions.completions")

        async def as_it_is(data: Mapping[str, object], _: object) -> dict[str, object]:
            return {name: value for name, value in data.items() if is_given(value)}

        if hasattr(chats, "async_maybe_transform"):
            chats.async_maybe_transform = as_it_is


def unlogged() -> None:
    """Leave out what litellm tells its loggers of calls of this task."""
    with contextlib.suppress(ImportError):
        from litellm._internal_context import is_internal_call

        is_internal_call.set(True)


def _no_cost(**_: object) -> None:
    return None
