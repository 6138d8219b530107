"""Batches of OpenAI, Anthropic and Gemini: writing, sending, polling and reading them.

Sources, read in November 2026. OpenAI, guide "Batch API" (format of lines, 50,000 requests and 200
MB a file, states, `batch_expired`) and API reference of files and batches. Anthropic, guide "Batch
processing" (100,000 requests or 256 MB, results in any order, errors and requests that expired are
not billed) and API references of message batches and of errors. Google, Gemini API guide "Batch
API" (lines with `key` and `request`, an input file of at most 2 GB, no results of what expired) and
references of batches and of files (resumable uploads); google.rpc.Code.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, TypeVar
from urllib.parse import urlsplit

from phyblock.config.models import ModelConfig, host_of
from phyblock.errors import ModelError, RetryableError, UnavailableError
from phyblock.files import load_json
from phyblock.models import client
from phyblock.models.client import Answer, HttpClient

T = TypeVar("T")
Post = tuple[str, bytes, Mapping[str, str]]
"""Address, body and headers of a call."""

UNREADABLE = (AttributeError, KeyError, TypeError, ValueError)
"""Errors of reading data that differ from the provider's documentation."""

_TRANSFER_S = 1800.0
_LARGEST_RESULTS_BYTES = 1024**3


@dataclass(frozen=True)
class BatchStatus:
    """The state of a batch, as its provider reports it.

    No request of a `refused` batch was answered; an `ended` one may lack some answers. `words` are
    the provider's message, with counts and errors; `results` are the addresses of the answers.
    """

    id: str
    state: Literal["running", "ended", "refused"]
    words: str
    results: tuple[str, ...]


class BatchProvider(ABC):
    """One provider's batches: `create`, `status` and `results`.

    Methods raise ModelErrors without keys. Everything is sent with `headers` and the model's key,
    only to the model's server. A batch is at `url` and its id; `named_in` says where the provider
    shows phyblock's name for it. The limits are below the providers': a batch is kept in memory.
    """

    most_requests = 50_000
    most_bytes = 100 * 1000**2
    headers: ClassVar[Mapping[str, str]]
    named_in: ClassVar[str]

    def __init__(self, config: ModelConfig, base: str, url: str) -> None:
        self._config = config
        self._base = base
        self._url = url
        self._secrets = client.secrets_of(config)
        self.http = HttpClient(_TRANSFER_S, _LARGEST_RESULTS_BYTES)

    @abstractmethod
    def line(self, custom_id: str, body: bytes, headers: Mapping[str, str]) -> bytes:
        """Return the line of a request from the body and headers of a direct call."""

    async def create(self, token: str, lines: Sequence[bytes]) -> BatchStatus:
        """Create a batch. Raises UnavailableError (`sent="maybe"`) if it may exist all the same."""
        try:
            post = await self._prepare(token, lines)
        except ModelError as error:
            error.sent = "no"
            raise
        try:
            return await self._call(self._status_in, *post)
        except RetryableError as error:
            if error.sent == "no" or error.status in (429, 529):
                raise
            raise UnavailableError(str(error), status=error.status, sent="maybe") from None

    async def status(self, batch_id: str) -> BatchStatus:
        """Return the current state of a batch."""
        return await self._call(self._status_in, f"{self._url}/{batch_id}")

    async def results(self, status: BatchStatus) -> bytes:
        """Return the lines of a batch's results, without keys."""
        bodies = [await self._call(lambda answer: answer.body, url) for url in status.results]
        text = b"\n".join(bodies).decode("utf-8", "surrogateescape")
        return client.hidden(text, self._secrets, guess=False).encode("utf-8", "surrogateescape")

    @abstractmethod
    def read(self, line: Any) -> tuple[str, Answer | str]:
        """Return the name of a request, and its answer as a server would have sent it, or the
        reason why it was never processed. Raises one of UNREADABLE for a malformed line.
        """

    @abstractmethod
    async def _prepare(self, token: str, lines: Sequence[bytes]) -> Post:
        """Return the call that creates a batch, without making it."""

    @abstractmethod
    def _read_status(self, batch: Any) -> BatchStatus:
        """Read the provider's description of a batch; raises one of UNREADABLE."""

    def _status(
        self, name: Any, state: Any, words: Sequence[Any], results: Sequence[str] = ()
    ) -> BatchStatus:
        """Return a status; `words` are a state, the number of answered requests, and errors."""
        if not (isinstance(name, str) and name):
            raise ValueError("a batch without a name")
        word, answered, errors = words
        said = "; ".join(f"{error.get('code')} {error.get('message')}" for error in errors or ())
        text = f"{word}, {answered or 0} answered{': ' if said else ''}{said}"
        return BatchStatus(name, state, client.shown(text, self._secrets), tuple(results))

    async def _call(
        self,
        read: Callable[[Answer], T],
        url: str,
        body: bytes | None = None,
        headers: Mapping[str, str] | None = None,
    ) -> T:
        """Send once and read the answer."""
        try:
            if urlsplit(url)[:2] != urlsplit(self._base)[:2]:
                why = f"nothing is sent to {host_of(url)}, which is not the model's server"
                raise UnavailableError(why, sent="no")
            key = client.api_key(self._config) or ""
            own = {name: value.replace("{key}", key) for name, value in self.headers.items()}
            sent = {"Content-Type": "application/json", **own, **(headers or {})}
            method = "GET" if body is None else "POST"
            answer = await self.http.send(url, body or b"", sent, method=method)
            if answer.fault or not answer.is_success:
                raise client.error_of(answer)
            try:
                return read(answer)
            except UNREADABLE as error:
                raise client.malformed(answer.status, f"{type(error).__name__}: {error}") from None
        except ModelError as error:
            error.args = (client.shown(str(error), self._secrets),)
            raise

    def _status_in(self, answer: Answer) -> BatchStatus:
        return self._read_status(_object(answer))


class _OpenAI(BatchProvider):
    """`{api_base}/files` and `{api_base}/batches`, of OpenAI and servers that have both."""

    headers: ClassVar[Mapping[str, str]] = {"Authorization": "Bearer {key}"}
    named_in = "in its metadata"

    def __init__(self, config: ModelConfig) -> None:
        base = (config.api_base or client.OPENAI_API_BASE).rstrip("/")
        super().__init__(config, base, f"{base}/batches")

    def line(self, custom_id: str, body: bytes, headers: Mapping[str, str]) -> bytes:  # noqa: ARG002
        fields = {"custom_id": custom_id, "method": "POST", "url": "/v1/chat/completions"}
        return _joined(fields, "body", body)

    async def _prepare(self, token: str, lines: Sequence[bytes]) -> Post:
        start = (
            f'--{token}\r\nContent-Disposition: form-data; name="purpose"\r\n\r\nbatch\r\n'
            f'--{token}\r\nContent-Disposition: form-data; name="file"; '
            f'filename="phyblock-{token}.jsonl"\r\nContent-Type: application/jsonl\r\n\r\n'
        )
        data = b"".join((start.encode(), b"\n".join(lines), f"\r\n--{token}--\r\n".encode()))
        form = {"Content-Type": f"multipart/form-data; boundary={token}"}
        url = f"{self._base}/files"
        file = await self._call(lambda answer: str(_object(answer)["id"]), url, data, form)
        body = {
            "input_file_id": file,
            "endpoint": "/v1/chat/completions",
            "completion_window": "24h",
            "metadata": {"phyblock": token},
        }
        return self._url, json.dumps(body).encode(), {}

    def read(self, line: Any) -> tuple[str, Answer | str]:
        response, error = line.get("response") or {}, line.get("error") or {}
        if isinstance(response.get("body"), Mapping):
            return line["custom_id"], _answer(int(response["status_code"]), response["body"])
        if error.get("code") in ("batch_expired", "batch_cancelled"):
            return line["custom_id"], str(error["code"])
        return line["custom_id"], _answer(500, {"error": error})

    def _read_status(self, batch: Any) -> BatchStatus:
        word, counts = batch["status"], batch.get("request_counts") or {}
        files = [batch[name] for name in ("output_file_id", "error_file_id") if batch.get(name)]
        # A batch without its files yet must not count as empty, or it would be asked again.
        ends = {"expired": "ended", "cancelled": "ended", "failed": "refused"}
        return self._status(
            batch["id"],
            "ended" if word == "completed" and files else ends.get(word, "running"),
            (word, counts.get("completed"), (batch.get("errors") or {}).get("data")),
            [f"{self._base}/files/{file}/content" for file in files],
        )


class _Anthropic(BatchProvider):
    """`/v1/messages/batches`, where batches cannot have names."""

    headers: ClassVar[Mapping[str, str]] = {"anthropic-version": "2023-06-01", "x-api-key": "{key}"}
    named_in = "in the custom_id of its results"

    def __init__(self, config: ModelConfig) -> None:
        base = (config.api_base or "https://api.anthropic.com").rstrip("/")
        # As in litellm, the address may include the path of messages or not.
        base = base.removesuffix("/messages").removesuffix("/v1")
        super().__init__(config, base, f"{base}/v1/messages/batches")
        self._betas: set[str] = set()

    def line(self, custom_id: str, body: bytes, headers: Mapping[str, str]) -> bytes:
        # The batch requests the betas that any of its requests needs.
        betas = next((v for name, v in headers.items() if name.lower() == "anthropic-beta"), "")
        self._betas |= {name.strip() for name in betas.split(",") if name.strip()}
        return _joined({"custom_id": custom_id}, "params", body)

    async def _prepare(self, token: str, lines: Sequence[bytes]) -> Post:  # noqa: ARG002
        betas = {"anthropic-beta": ",".join(sorted(self._betas))} if self._betas else {}
        return self._url, b"".join((b'{"requests":[', b",".join(lines), b"]}")), betas

    def read(self, line: Any) -> tuple[str, Answer | str]:
        result = line["result"]
        if result["type"] in ("canceled", "expired"):
            return line["custom_id"], result["type"]
        if result["type"] == "succeeded":
            return line["custom_id"], _answer(200, result["message"])
        # The error is in an error response, or by itself.
        error = result["error"].get("error") or result["error"]
        status = _ANTHROPIC_STATUSES.get(error.get("type"), 500)
        return line["custom_id"], _answer(status, {"type": "error", "error": error})

    def _read_status(self, batch: Any) -> BatchStatus:
        word, counts = batch["processing_status"], batch["request_counts"]
        has_ended = word == "ended"
        return self._status(
            batch["id"],
            "ended" if has_ended else "running",
            (word, counts.get("succeeded"), ()),
            # Not `results_url`, which behind a gateway is the provider's own and unreachable.
            [f"{self._url}/{batch['id']}/results"] if has_ended else [],
        )


class _Gemini(BatchProvider):
    """`/v1beta/models/{model}:batchGenerateContent` and `/v1beta/batches`."""

    headers: ClassVar[Mapping[str, str]] = {"x-goog-api-key": "{key}"}
    named_in = "as its displayName"

    def __init__(self, config: ModelConfig) -> None:
        base = config.api_base or "https://generativelanguage.googleapis.com"
        base = base.rstrip("/").removesuffix("/v1beta")
        # The name of a batch includes the rest of the path.
        super().__init__(config, base, f"{base}/v1beta")

    def line(self, custom_id: str, body: bytes, headers: Mapping[str, str]) -> bytes:  # noqa: ARG002
        return _joined({"key": custom_id}, "request", body)

    async def _prepare(self, token: str, lines: Sequence[bytes]) -> Post:
        data = b"\n".join(lines)
        announced = {
            "X-Goog-Upload-Protocol": "resumable",
            "X-Goog-Upload-Command": "start",
            "X-Goog-Upload-Header-Content-Length": str(len(data)),
            "X-Goog-Upload-Header-Content-Type": "application/jsonl",
        }
        named = json.dumps({"file": {"display_name": token}}).encode()
        url = f"{self._base}/upload/v1beta/files"
        answered = await self._call(lambda answer: answer.headers, url, named, announced)
        url = next((v for name, v in answered.items() if name.lower() == "x-goog-upload-url"), "")
        sent = {"X-Goog-Upload-Offset": "0", "X-Goog-Upload-Command": "upload, finalize"}
        file = await self._call(lambda answer: _object(answer)["file"]["name"], url, data, sent)
        batch = {"batch": {"display_name": token, "input_config": {"file_name": file}}}
        url = f"{self._url}/models/{self._config.provider_model}:batchGenerateContent"
        return url, json.dumps(batch).encode(), {}

    def read(self, line: Any) -> tuple[str, Answer | str]:
        if isinstance(line.get("response"), Mapping):
            return line["key"], _answer(200, line["response"])
        error = line.get("error") or {}
        code = int(error.get("code") or 13)
        if code == 1:
            return line["key"], "cancelled"
        status = _GOOGLE_STATUSES.get(code, 500) if code < 100 else code
        return line["key"], _answer(status, {"error": {**error, "code": status}})

    def _read_status(self, batch: Any) -> BatchStatus:
        facts = batch.get("metadata") or {}
        # BATCH_STATE_... or JOB_STATE_..., by version.
        word = (facts.get("state") or "").rpartition("STATE_")[2].lower()
        ends = dict.fromkeys(("succeeded", "expired", "cancelled"), "ended")
        stats = facts.get("batchStats") or {}
        file = (batch.get("response") or facts.get("output") or {}).get("responsesFile")
        error = batch.get("error")
        return self._status(
            batch["name"],
            {**ends, "failed": "refused"}.get(word, "running"),
            (word or "begun", stats.get("successfulRequestCount"), [error] if error else ()),
            [f"{self._base}/download/v1beta/{file}:download?alt=media"] if file else [],
        )


PROVIDERS: Mapping[str, Callable[[ModelConfig], BatchProvider]] = {
    "openai": _OpenAI,
    "hosted_vllm": _OpenAI,
    "anthropic": _Anthropic,
    "gemini": _Gemini,
}
"""By the prefix of a model's id; the models file refuses batches of other providers."""

_ANTHROPIC_STATUSES: Mapping[str, int] = {
    "invalid_request_error": 400, "authentication_error": 401, "billing_error": 402,
    "permission_error": 403, "not_found_error": 404, "request_too_large": 413,
    "rate_limit_error": 429, "timeout_error": 504, "overloaded_error": 529,
}  # fmt: skip
_GOOGLE_STATUSES: Mapping[int, int] = {
    3: 400, 4: 504, 5: 404, 7: 403, 8: 429, 9: 400, 13: 500, 14: 503, 16: 401,
}  # fmt: skip


def _joined(fields: Mapping[str, Any], name: str, body: bytes) -> bytes:
    """Return an object as JSON, with the JSON `body` inserted unchanged under a further name."""
    return json.dumps({**fields, name: None}).encode().removesuffix(b"null}") + body + b"}"


def _answer(status: int, body: Mapping[str, Any]) -> Answer:
    return Answer(status, {}, json.dumps(body).encode())


def _object(answer: Answer) -> Any:
    """Return the object in an answer; raises the answer's error."""
    found: Any = load_json(answer.body)
    # A failed batch has its error beside its name.
    if found.get("error") and not found.keys() & {"id", "name"}:
        raise client.error_of(answer)
    return found
