"""Calls of a provider's batch API over our HTTP client: small ones, and files both ways."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import urlsplit

from phyblock.config.models import ModelConfig, host_of
from phyblock.errors import ModelError, UnavailableError
from phyblock.files import writing
from phyblock.models.client import Answer, HttpClient, error_of, read_json
from phyblock.models.keys import api_key, hidden

__all__ = ["BatchWire"]

_CALL_S = 60.0
_TRANSFER_S = 3600.0
_LARGEST_RESULTS_BYTES = 8 * 1024**3
_LONGEST_MESSAGE = 500


class _Lines:
    """Takes pieces of a body and writes whole lines, so that no key is cut in two and missed."""

    def __init__(self, file: BinaryIO, secrets: Sequence[str]) -> None:
        self._file = file
        self._secrets = secrets
        self._rest: list[bytes] = []

    def take(self, piece: bytes) -> None:
        lines, newline, rest = piece.rpartition(b"\n")
        if newline:
            self._write(b"".join([*self._rest, lines]))
            self._rest = []
        self._rest.append(rest)

    def end(self) -> None:
        self._write(b"".join(self._rest))
        self._rest = []

    def _write(self, lines: bytes) -> None:
        text = lines.decode("utf-8", "surrogateescape")
        shown = hidden(text, self._secrets, guess=False)
        self._file.write(shown.encode("utf-8", "surrogateescape") + b"\n")


class BatchWire:
    """Sends with the model's key, to the model's server alone.

    `base` is the address of the API without a slash at its end, `headers_of` makes headers of a
    key. Everything raises ModelErrors, in which no key stands.
    """

    def __init__(
        self,
        config: ModelConfig,
        secrets: Sequence[str],
        base: str,
        headers_of: Callable[[str], Mapping[str, str]],
    ) -> None:
        self.base = base
        self._config = config
        self._secrets = tuple(secrets)
        self._headers_of = headers_of
        self._calls = HttpClient(config.model_copy(update={"timeout_s": _CALL_S}))
        self._transfers = HttpClient(
            config.model_copy(
                update={"timeout_s": _TRANSFER_S, "most_body_bytes": _LARGEST_RESULTS_BYTES}
            )
        )

    async def get(self, url: str) -> Mapping[str, Any]:
        """The JSON object at an address."""
        return self._object(await self._send(self._calls, url, b"", {}, method="GET"))

    async def post(
        self, url: str, body: Mapping[str, Any], headers: Mapping[str, str] | None = None
    ) -> tuple[Mapping[str, Any], Answer]:
        """Send a JSON object; the object that is answered, and the whole answer."""
        told = {"Content-Type": "application/json", **(headers or {})}
        answer = await self._send(self._calls, url, json.dumps(body).encode(), told)
        return self._object(answer), answer

    async def post_file(
        self, url: str, path: Path, headers: Mapping[str, str]
    ) -> Mapping[str, Any]:
        """Send a file, read while it is sent; the object that is answered."""
        with path.open("rb") as file:
            return self._object(await self._send(self._transfers, url, file, headers))

    async def download(self, urls: Sequence[str], path: Path) -> None:
        """Write the lines at some addresses into a file, one after the other, without keys.

        StoreError where the disk refuses.
        """
        with writing(path), path.open("wb") as file:
            lines = _Lines(file, self._secrets)
            for url in urls:
                await self._send(self._transfers, url, b"", {}, method="GET", sink=lines.take)
                lines.end()
            file.flush()
            await asyncio.to_thread(os.fsync, file.fileno())

    async def aclose(self) -> None:
        """Close all connections."""
        await self._calls.aclose()
        await self._transfers.aclose()

    def shown(self, text: str) -> str:
        """A text for messages and files, without keys."""
        return " ".join(hidden(text, self._secrets).split())[:_LONGEST_MESSAGE]

    async def _send(
        self, client: HttpClient, url: str, body: Any, headers: Mapping[str, str], **more: Any
    ) -> Answer:
        try:
            if urlsplit(url)[:2] != urlsplit(self.base)[:2]:
                why = f"nothing is sent to {host_of(url)}, which is not the model's server"
                raise UnavailableError(why, sent="no")
            own = self._headers_of(api_key(self._config) or "")
            answer = await client.send(url, body, {**own, **headers}, **more)
            if not answer.is_success or answer.fault:
                raise error_of(answer)
        except ModelError as error:
            error.args = (self.shown(str(error)),)
            raise
        return answer

    def _object(self, answer: Answer) -> Mapping[str, Any]:
        """The object in the body of a success; an upload may have none."""
        if not answer.body:
            return {}
        try:
            body = read_json(answer)
        except ModelError as error:
            error.args = (self.shown(str(error)),)
            raise
        return body if isinstance(body, Mapping) else {}
