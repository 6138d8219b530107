"""Work that litellm and the OpenAI client under it do for each call and that nobody here reads.

It is a fifth of what a call through them costs, and has no settings. It is left out of calls of
phyblock alone: other calls that a program makes through litellm are as they were. What another
version of theirs has not is left as that version does it.
"""

from __future__ import annotations

import contextlib
import importlib
from collections.abc import Callable, Iterator, Mapping
from types import ModuleType
from typing import Any

__all__ = ["leave_out", "unlogged"]


def leave_out(litellm: ModuleType, is_ours: Callable[[], bool]) -> None:
    """Leave out litellm's own reckoning of what a call costs, and the client's search through
    requests of chats for fields to rename: they are as they go over the wire. `is_ours` says of the
    running task whether its call is one of phyblock.
    """
    if hasattr(litellm, "response_cost_calculator"):
        calculate = litellm.response_cost_calculator

        def cost(*args: object, **kwargs: object) -> object:
            return None if is_ours() else calculate(*args, **kwargs)

        litellm.response_cost_calculator = cost  # type: ignore[attr-defined]
    with contextlib.suppress(ImportError, AttributeError):
        # The client is litellm's, and no package of ours.
        is_given = importlib.import_module("openai._utils").is_given
        chats: Any = importlib.import_module("openai.resources.chat.completions.completions")
        transform = chats.async_maybe_transform

        async def renamed(data: Mapping[str, object], form: object) -> object:
            if not is_ours():
                return await transform(data, form)
            return {name: value for name, value in data.items() if is_given(value)}

        chats.async_maybe_transform = renamed


@contextlib.contextmanager
def unlogged() -> Iterator[None]:
    """Leave out what litellm tells its loggers of calls of this task."""
    try:
        from litellm._internal_context import is_internal_call
    except ImportError:
        yield
        return
    token = is_internal_call.set(True)
    try:
        yield
    finally:
        is_internal_call.reset(token)
