"""Ending a run: what was sent is waited for, what waits for its turn is given up."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator
from typing import Any

from phyblock.errors import PhyblockError

__all__ = ["Halt", "HaltedError"]


class HaltedError(PhyblockError):
    """The run was ended before this request was sent."""


class Halt:
    """A switch that all models of a run share; asyncio, one loop."""

    def __init__(self) -> None:
        self._is_set = False
        self._waiting: set[asyncio.Task[Any]] = set()

    @property
    def waiting(self) -> int:
        """How many tasks are in a wait that would be given up."""
        return len(self._waiting)

    def set(self) -> None:
        """End all waits, those that begin later too."""
        self._is_set = True
        for task in self._waiting:
            task.cancel()

    @contextlib.contextmanager
    def giving_up(self) -> Iterator[None]:
        """Raise HaltedError before, out of, or after a wait, once the switch is set.

        After it too: a wait that ends at the same moment may swallow the cancellation, as
        `asyncio.wait_for` did before Python 3.12.
        """
        task = asyncio.current_task()
        assert task is not None
        self._raise_if_set()
        self._waiting.add(task)
        try:
            yield
        except asyncio.CancelledError:
            self._raise_if_set()
            raise
        finally:
            self._waiting.discard(task)
        self._raise_if_set()

    def _raise_if_set(self) -> None:
        if self._is_set:
            raise HaltedError("the run was ended before this request was sent") from None
