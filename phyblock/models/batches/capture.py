"""Clients that stand in for a connection: one keeps what would be sent, one gives a kept answer.

With them a transport makes the body of a request, and reads the answer to it, by the same code as
in a direct call, so that both say the same in a batch.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phyblock.errors import RetryableError
from phyblock.models.http_client import Answer

__all__ = ["AnsweringClient", "CapturingClient"]


class CapturingClient:
    """Keeps the request, `body` and `headers`, and sends nothing."""

    def __init__(self) -> None:
        self.body: bytes | None = None
        self.headers: Mapping[str, str] = {}

    async def send(self, url: str, body: bytes, headers: Mapping[str, str], **_: Any) -> Answer:
        """Raise RetryableError, which says that nothing was sent."""
        self.body, self.headers = body, headers
        raise RetryableError(f"a request to {url} is kept for a batch", sent="no")

    async def aclose(self) -> None:
        """Nothing is open."""


class AnsweringClient:
    """Gives the same answer to whatever is asked."""

    def __init__(self, answer: Answer) -> None:
        self._answer = answer

    async def send(self, url: str, body: bytes, headers: Mapping[str, str], **_: Any) -> Answer:  # noqa: ARG002
        """The answer."""
        return self._answer

    async def aclose(self) -> None:
        """Nothing is open."""
