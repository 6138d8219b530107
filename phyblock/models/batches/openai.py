"""Batches of OpenAI, and of servers that have its /files and /batches.

A file of requests is uploaded with the purpose `batch`, then a batch is made of it; answers are in
its output file, errors and what expired in its error file. Sources, read in November 2026: OpenAI,
guide "Batch API" (format of lines, 50,000 requests and 200 MB a file, states, `batch_expired`) and
API reference of files and batches (`metadata`, `request_counts`, lists with `after`).
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.models.batches.fields import count, error_words, joined, mapping, text
from phyblock.models.batches.protocol import BatchProtocol, BatchStatus, ResultLine
from phyblock.models.batches.wire import BatchWire
from phyblock.models.client import Answer
from phyblock.models.openai_client import OPENAI_API_BASE

__all__ = ["OpenAIBatches"]

_TOKEN = "phyblock"
_URL = "/v1/chat/completions"
_STATES: Mapping[str, Any] = {
    "completed": "ended",
    "expired": "ended",
    "cancelled": "ended",
    "failed": "refused",
}
_NEVER_ASKED = ("batch_expired", "batch_cancelled")


class OpenAIBatches(BatchProtocol):
    """`{api_base}/files` and `{api_base}/batches`."""

    most_requests = 50_000
    most_bytes = 200 * 1000**2

    def __init__(self, config: ModelConfig, secrets: tuple[str, ...]) -> None:
        base = (config.api_base or OPENAI_API_BASE).rstrip("/")
        wire = BatchWire(config, secrets, base, lambda key: {"Authorization": f"Bearer {key}"})
        super().__init__(config, wire)

    def head(self, token: str) -> bytes:
        """The form of an upload up to the file's content."""
        return (
            f'--{token}\r\nContent-Disposition: form-data; name="purpose"\r\n\r\nbatch\r\n'
            f'--{token}\r\nContent-Disposition: form-data; name="file"; '
            f'filename="phyblock-{token}.jsonl"\r\nContent-Type: application/jsonl\r\n\r\n'
        ).encode()

    def tail(self, token: str) -> bytes:
        """The end of the form."""
        return f"\r\n--{token}--\r\n".encode()

    def line(self, custom_id: str, body: bytes, headers: Mapping[str, str]) -> bytes:  # noqa: ARG002
        """A POST to the chat completions."""
        return joined({"custom_id": custom_id, "method": "POST", "url": _URL}, "body", body)

    async def upload(self, token: str, path: Path) -> str:
        """The file's id."""
        headers = {"Content-Type": f"multipart/form-data; boundary={token}"}
        return text((await self.wire.post_file(f"{self.wire.base}/files", path, headers)).get("id"))

    async def create(self, token: str, path: Path, file: str) -> BatchStatus:  # noqa: ARG002
        """Make a batch of the file."""
        body = {
            "input_file_id": file,
            "endpoint": _URL,
            "completion_window": "24h",
            "metadata": {_TOKEN: token},
        }
        made, _ = await self.wire.post(f"{self.wire.base}/batches", body)
        return self._status(made)

    async def look(self, batch_id: str) -> BatchStatus:
        """`GET /batches/{id}`."""
        return self._status(await self.wire.get(f"{self.wire.base}/batches/{batch_id}"))

    async def listed(self) -> AsyncIterator[BatchStatus]:
        """`GET /batches`, page by page."""
        after = ""
        while True:
            page = await self.wire.get(f"{self.wire.base}/batches?limit=100{after}")
            batches = [self._status(mapping(one)) for one in page.get("data") or ()]
            for batch in batches:
                yield batch
            if not page.get("has_more") or not batches:
                return
            after = f"&after={batches[-1].id}"

    def read(self, line: Mapping[str, Any]) -> ResultLine | None:
        """A line of the output file or of the error file."""
        custom_id, response = line.get("custom_id"), mapping(line.get("response"))
        if not isinstance(custom_id, str):
            return None
        status, body = count(response.get("status_code")), response.get("body")
        if status is not None and isinstance(body, Mapping):
            return ResultLine(custom_id, Answer(status, {}, joined({}, "", body)))
        error = mapping(line.get("error"))
        if error.get("code") in _NEVER_ASKED:
            return ResultLine(custom_id, f"{error['code']}: {error_words(error)}")
        return ResultLine(custom_id, Answer(500, {}, joined({}, "error", error)))

    def _status(self, batch: Mapping[str, Any]) -> BatchStatus:
        word, counts = text(batch.get("status")), mapping(batch.get("request_counts"))
        errors = mapping(batch.get("errors")).get("data") or ()
        files = [batch[name] for name in ("output_file_id", "error_file_id") if batch.get(name)]
        # Taken for empty, a batch whose files are not there yet would be asked again.
        is_late = word == "completed" and not files
        return BatchStatus(
            text(batch.get("id")),
            "running" if is_late else _STATES.get(word, "running"),
            word,
            text(mapping(batch.get("metadata")).get(_TOKEN)) or None,
            count(counts.get("total")),
            count(counts.get("completed")),
            count(counts.get("failed")),
            count(batch.get("created_at")),
            tuple(f"{self.wire.base}/files/{file}/content" for file in files),
            word != "cancelled",
            "; ".join(error_words(error) for error in errors),
        )
