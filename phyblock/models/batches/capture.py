"""Clients that stand in for a connection: one keeps what would be sent, one gives a kept answer.

With them a client makes the body of a request, and reads the answer to it, by the same code as
in a direct call, so that both say the same in a batch.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, BinaryIO

from phyblock.errors import RetryableError
from phyblock.models.client import Answer, HttpClient

__all__ = ["AnsweringClient", "CapturingClient"]


class CapturingClient(HttpClient):
    """Keeps the request, `body` and `headers`, and sends nothing."""

    def __init__(self) -> None:
        self.body: bytes | None = None
        self.headers: Mapping[str, str] = {}

    async def send(
        self, url: str, body: bytes | BinaryIO, headers: Mapping[str, str], **_: Any
    ) -> Answer:
        """Raise RetryableError, which says that nothing was sent."""
        assert isinstance(body, bytes)
        self.body, self.headers = body, headers
        raise RetryableError(f"a request to {url} is kept for a batch", sent="no")

    async def aclose(self) -> None:
        """Nothing is open."""


class AnsweringClient(HttpClient):
    """Gives the same answer to whatever is asked."""

    def __init__(self, answer: Answer) -> None:
        self._answer = answer

    async def send(self, *_: Any, **__: Any) -> Answer:
        """Return the answer."""
        return self._answer

    async def aclose(self) -> None:
        """Nothing is open."""
