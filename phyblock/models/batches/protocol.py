"""What a provider's batches are, whichever protocol they have."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from phyblock.config.models import ModelConfig
from phyblock.models.batches.wire import BatchWire
from phyblock.models.client import Answer

__all__ = ["BatchProtocol", "BatchStatus", "ResultLine"]


@dataclass(frozen=True)
class BatchStatus:
    """What a provider says of a batch.

    `word` is its own for the state; a `refused` batch asked nothing of anyone. `token` is the name
    that we gave it, None where the provider does not tell. `total`, `done` and `failed` count
    requests, None where it does not say, `created_s` is a Unix time. `results` are the addresses of
    the answers; with `is_complete` False some were not asked, as the batch was cancelled. `words`
    say why.
    """

    id: str
    state: Literal["running", "ended", "refused"]
    word: str
    token: str | None = None
    total: int | None = None
    done: int | None = None
    failed: int | None = None
    created_s: float | None = None
    results: tuple[str, ...] = ()
    is_complete: bool = True
    words: str = ""

    @property
    def progress(self) -> str:
        """State and counts in words."""
        if not self.total:
            return self.word
        failed = f", {self.failed:,} failed" if self.failed else ""
        return f"{self.word}, {self.done or 0:,} of {self.total:,} answered{failed}"


@dataclass(frozen=True)
class ResultLine:
    """The answer to a request, as a server would have given it; or why it was never asked."""

    custom_id: str
    answer: Answer | str


class BatchProtocol(ABC):
    """One provider's way: how requests are written, sent, watched and read.

    The body of an upload is `head`, then lines with `between` between them, then `tail`;
    `most_requests` and `most_bytes` bound it. Methods raise ModelErrors, without keys.
    """

    most_requests: int
    most_bytes: int
    between: bytes = b"\n"

    def __init__(self, config: ModelConfig, wire: BatchWire) -> None:
        self.config = config
        self.wire = wire

    def head(self, token: str) -> bytes:  # noqa: ARG002
        """What stands before the lines."""
        return b""

    def tail(self, token: str) -> bytes:  # noqa: ARG002
        """What stands after the lines."""
        return b""

    @abstractmethod
    def line(self, custom_id: str, body: bytes, headers: Mapping[str, str]) -> bytes:
        """A request with the body, and of the headers, of a direct call."""

    async def upload(self, token: str, path: Path) -> str:  # noqa: ARG002
        """Send the file, which begins nothing yet; its name at the provider, "" for none."""
        return ""

    @abstractmethod
    async def create(self, token: str, path: Path, file: str) -> BatchStatus:
        """Begin the batch. After a RetryableError it may have begun all the same."""

    @abstractmethod
    async def look(self, batch_id: str) -> BatchStatus:
        """How it is now."""

    @abstractmethod
    def listed(self) -> AsyncIterator[BatchStatus]:
        """All batches of the account, the newest first."""

    @abstractmethod
    def read(self, line: Mapping[str, Any]) -> ResultLine | None:
        """A line of the results; None for what is none."""
