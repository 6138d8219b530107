"""Gemini's batches: a file of requests is uploaded, then a batch is made of it by our name.

Sources, read in November 2026: Google, Gemini API guide "Batch API" (lines with `key` and
`request`, an input file of at most 2 GB, states, no results of what expired after 48 hours) and
references of batches (`batchGenerateContent`, `batchStats`, `responsesFile`, lists with
`pageToken`) and of files (resumable uploads, `:download?alt=media`); google.rpc.Code, by which the
errors of single lines are numbered.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.errors import RetryableError
from phyblock.models.batches.fields import count, error_words, joined, mapping, text, unix_s
from phyblock.models.batches.protocol import BatchProtocol, BatchStatus, ResultLine
from phyblock.models.batches.wire import BatchWire
from phyblock.models.client import Answer

__all__ = ["GeminiBatches"]

_API = "https://generativelanguage.googleapis.com"
_VERSION = "v1beta"
_STATES: Mapping[str, Any] = {
    "SUCCEEDED": "ended",
    "EXPIRED": "ended",
    "CANCELLED": "ended",
    "FAILED": "refused",
}
_CANCELLED = 1
_HTTP: Mapping[int, int] = {
    3: 400,
    4: 504,
    5: 404,
    7: 403,
    8: 429,
    9: 400,
    13: 500,
    14: 503,
    16: 401,
}
"""HTTP statuses of google.rpc codes."""


class GeminiBatches(BatchProtocol):
    """`/v1beta/models/{model}:batchGenerateContent` and `/v1beta/batches`.

    The provider bounds no number of requests; ours keeps an index in memory.
    """

    most_requests = 100_000
    most_bytes = 2 * 1000**3

    def __init__(self, config: ModelConfig, secrets: tuple[str, ...]) -> None:
        base = (config.api_base or _API).rstrip("/").removesuffix(f"/{_VERSION}")
        wire = BatchWire(config, secrets, base, lambda key: {"x-goog-api-key": key})
        super().__init__(config, wire)
        self._url = f"{base}/{_VERSION}"

    def line(self, custom_id: str, body: bytes, headers: Mapping[str, str]) -> bytes:  # noqa: ARG002
        """A request under its key."""
        return joined({"key": custom_id}, "request", body)

    async def upload(self, token: str, path: Path) -> str:
        """The file's name: an upload is announced, then sent to the address that is answered."""
        size = str(path.stat().st_size)
        announced = {
            "X-Goog-Upload-Protocol": "resumable",
            "X-Goog-Upload-Command": "start",
            "X-Goog-Upload-Header-Content-Length": size,
            "X-Goog-Upload-Header-Content-Type": "application/jsonl",
        }
        start = f"{self.wire.base}/upload/{_VERSION}/files"
        named = {"file": {"display_name": token}}
        _, answer = await self.wire.post(start, named, announced)
        told = {name.lower(): value for name, value in answer.headers.items()}
        url = told.get("x-goog-upload-url", "")
        if not url:
            raise RetryableError("no address for an upload was answered", status=answer.status)
        sent = {"X-Goog-Upload-Offset": "0", "X-Goog-Upload-Command": "upload, finalize"}
        made = await self.wire.post_file(url, path, sent)
        return text(mapping(made.get("file")).get("name"))

    async def create(self, token: str, path: Path, file: str) -> BatchStatus:  # noqa: ARG002
        """Make a batch of the file."""
        url = f"{self._url}/models/{self.config.provider_model}:batchGenerateContent"
        batch = {"display_name": token, "input_config": {"file_name": file}}
        made, _ = await self.wire.post(url, {"batch": batch})
        return self._status(made)

    async def look(self, batch_id: str) -> BatchStatus:
        """`GET /v1beta/batches/{id}`; the name holds the path."""
        return self._status(await self.wire.get(f"{self._url}/{batch_id}"))

    async def listed(self) -> AsyncIterator[BatchStatus]:
        """`GET /v1beta/batches`, page by page."""
        token = ""
        while True:
            page = await self.wire.get(f"{self._url}/batches?pageSize=100{token}")
            for one in page.get("operations") or ():
                yield self._status(mapping(one))
            following = text(page.get("nextPageToken"))
            if not following:
                return
            token = f"&pageToken={following}"

    def read(self, line: Mapping[str, Any]) -> ResultLine | None:
        """A line of the file of responses."""
        key, response = line.get("key"), line.get("response")
        if not isinstance(key, str):
            return None
        if isinstance(response, Mapping):
            return ResultLine(key, Answer(200, {}, joined({}, "", response)))
        error = mapping(line.get("error"))
        code = count(error.get("code")) or 13
        if code == _CANCELLED:
            return ResultLine(key, error_words(error))
        status = _HTTP.get(code, 500) if code < 100 else code
        return ResultLine(key, Answer(status, {}, joined({}, "error", {**error, "code": status})))

    def _status(self, operation: Mapping[str, Any]) -> BatchStatus:
        batch = mapping(operation.get("metadata"))
        # BATCH_STATE_... or JOB_STATE_..., by version.
        word = text(batch.get("state")).rpartition("STATE_")[2]
        stats = mapping(batch.get("batchStats"))
        output = mapping(operation.get("response")) or mapping(batch.get("output"))
        file = text(output.get("responsesFile"))
        done, bad = (count(stats.get(f"{name}RequestCount")) for name in ("successful", "failed"))
        return BatchStatus(
            text(operation.get("name")),
            _STATES.get(word, "running"),
            word.lower() or "begun",
            text(batch.get("displayName")) or None,
            count(stats.get("requestCount")),
            done,
            bad,
            unix_s(batch.get("createTime")),
            (f"{self.wire.base}/download/{_VERSION}/{file}:download?alt=media",) if file else (),
            word != "CANCELLED",
            error_words(operation.get("error")),
        )
