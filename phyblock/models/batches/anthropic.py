"""Anthropic's message batches: one call carries all requests, and answers come as JSON lines.

A batch has no name of ours, so that one whose making was cut off is found by what its answers
answer. Sources, read in November 2026: Anthropic, guide "Batch processing" (100,000 requests or
256 MB, 24 hours, errors and requests that expired are not billed, results in any order) and API
reference of message batches (`processing_status`, `request_counts`, results at
`/{id}/results`, lists with `after_id`; `custom_id` of at most 64 letters, digits, dashes and
underscores).
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.errors import UnavailableError
from phyblock.models.batches.fields import count, error_words, joined, mapping, text, unix_s
from phyblock.models.batches.protocol import BatchProtocol, BatchStatus, ResultLine
from phyblock.models.batches.wire import BatchWire
from phyblock.models.client import Answer

__all__ = ["AnthropicBatches"]

_API = "https://api.anthropic.com"
_VERSION = "2023-06-01"
_BETA = "anthropic-beta"
_STATUS: Mapping[str, int] = {
    "invalid_request_error": 400,
    "authentication_error": 401,
    "billing_error": 402,
    "permission_error": 403,
    "not_found_error": 404,
    "request_too_large": 413,
    "rate_limit_error": 429,
    "api_error": 500,
    "timeout_error": 504,
    "overloaded_error": 529,
}
"""HTTP statuses of the kinds of error, as the reference of errors lists them."""


class AnthropicBatches(BatchProtocol):
    """`/v1/messages/batches`."""

    most_requests = 100_000
    most_bytes = 256 * 1000**2
    between = b","

    def __init__(self, config: ModelConfig, secrets: tuple[str, ...]) -> None:
        base = (config.api_base or _API).rstrip("/")
        # As litellm takes an address, with or without the path of the messages.
        for end in ("/messages", "/v1"):
            base = base.removesuffix(end)
        own = {"anthropic-version": _VERSION}
        wire = BatchWire(config, secrets, base, lambda key: {**own, "x-api-key": key})
        super().__init__(config, wire)
        self._url = f"{base}/v1/messages/batches"
        self._betas: set[str] = set()

    def head(self, token: str) -> bytes:  # noqa: ARG002
        """The beginning of the list."""
        return b'{"requests":['

    def tail(self, token: str) -> bytes:  # noqa: ARG002
        """Its end."""
        return b"]}"

    def line(self, custom_id: str, body: bytes, headers: Mapping[str, str]) -> bytes:
        """A request with its parameters; the batch asks for the betas that any of them needs."""
        told = next((value for name, value in headers.items() if name.lower() == _BETA), "")
        self._betas |= {name.strip() for name in told.split(",") if name.strip()}
        return joined({"custom_id": custom_id}, "params", body)

    async def create(self, token: str, path: Path, file: str) -> BatchStatus:  # noqa: ARG002
        """Send all requests at once."""
        headers = {"Content-Type": "application/json"}
        if self._betas:
            headers[_BETA] = ",".join(sorted(self._betas))
        return self._status(await self.wire.post_file(self._url, path, headers))

    async def look(self, batch_id: str) -> BatchStatus:
        """`GET /v1/messages/batches/{id}`."""
        batch = await self.wire.get(f"{self._url}/{batch_id}")
        if batch.get("archived_at"):
            raise UnavailableError("it is archived, and its results are no longer there")
        return self._status(batch)

    async def listed(self) -> AsyncIterator[BatchStatus]:
        """`GET /v1/messages/batches`, page by page."""
        after = ""
        while True:
            page = await self.wire.get(f"{self._url}?limit=100{after}")
            batches = [self._status(mapping(one)) for one in page.get("data") or ()]
            for batch in batches:
                yield batch
            if not page.get("has_more") or not batches:
                return
            after = f"&after_id={batches[-1].id}"

    def read(self, line: Mapping[str, Any]) -> ResultLine | None:
        """A line of the results."""
        custom_id, result = line.get("custom_id"), mapping(line.get("result"))
        if not isinstance(custom_id, str):
            return None
        kind = text(result.get("type"))
        if kind == "succeeded":
            message = mapping(result.get("message"))
            return ResultLine(custom_id, Answer(200, {}, joined({}, "", message)))
        if kind == "errored":
            error = mapping(result.get("error"))
            # It stands in an error response, or alone.
            inner = mapping(error.get("error")) or error
            status = _STATUS.get(text(inner.get("type")), 500)
            body = joined({"type": "error"}, "error", inner)
            return ResultLine(custom_id, Answer(status, {}, body))
        if kind in ("canceled", "expired"):
            return ResultLine(custom_id, kind)
        return None

    def _status(self, batch: Mapping[str, Any]) -> BatchStatus:
        word, counts = text(batch.get("processing_status")), mapping(batch.get("request_counts"))
        numbers = {name: count(number) or 0 for name, number in counts.items()}
        batch_id, has_ended = text(batch.get("id")), word == "ended"
        # Not `results_url`, which behind a gateway is the provider's own and out of reach.
        results = (f"{self._url}/{batch_id}/results",) if has_ended else ()
        return BatchStatus(
            batch_id,
            "ended" if has_ended else "running",
            word,
            None,
            sum(numbers.values()),
            numbers.get("succeeded", 0),
            numbers.get("errored", 0) + numbers.get("expired", 0) + numbers.get("canceled", 0),
            unix_s(batch.get("created_at")),
            results,
            not (has_ended and numbers.get("canceled")),
            error_words(batch.get("error")),
        )
