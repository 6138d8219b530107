"""Ending a run: calls to models are cancelled; those under way still return their answer."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator
from typing import Any

from phyblock.models import HaltedError

__all__ = ["Halt"]


class Halt:
    """A switch that all calls of a run share; asyncio, one loop."""

    def __init__(self) -> None:
        self._is_set = False
        self._inside: set[asyncio.Task[Any]] = set()

    def set(self) -> None:
        """Cancel what is inside `giving_up`, and whatever enters it later."""
        self._is_set = True
        for task in self._inside:
            task.cancel()

    @contextlib.contextmanager
    def giving_up(self) -> Iterator[None]:
        """Raise HaltedError before or out of what is inside, once the switch is set.

        What comes to its end all the same, as a request that is under way, is kept.
        """
        task = asyncio.current_task()
        assert task is not None
        self._raise_if_set()
        self._inside.add(task)
        try:
            yield
        except asyncio.CancelledError:
            self._raise_if_set()
            raise
        finally:
            self._inside.discard(task)

    def _raise_if_set(self) -> None:
        if self._is_set:
            raise HaltedError("the run was ended before this request was sent") from None
