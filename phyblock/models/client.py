"""Shared parts of both clients: one HTTP client with bounds, the reply in an answer, or its error.

No redirect is followed, so that keys and prompts go to the host that was named and to no other. A
body is read up to a limit. The time limit holds for the whole exchange, whatever the server does.
Nothing is sent twice. aiohttp is imported by the first call.
"""

from __future__ import annotations

import email.utils
import math
import re
import time
import urllib.parse
import urllib.request
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from phyblock.config.models import ModelConfig, host_of
from phyblock.errors import (
    ModelError,
    Problem,
    RefusedError,
    RetryableError,
    SampleError,
    SpecError,
    UnavailableError,
    UnreachableError,
)
from phyblock.files import load_json
from phyblock.models.keys import api_key, hidden, secrets_of
from phyblock.models.replay import read_chat_completion
from phyblock.models.request import Request, json_body, wire_params
from phyblock.records.record import Reply
from phyblock.text import well_formed

if TYPE_CHECKING:
    import aiohttp

_LONGEST_CONNECT_S = 30.0
_LONGEST_MESSAGE = 500
_LONGEST_WORDS = 20_000
"""Characters of a server's words that are looked at; far fewer are shown."""

_RETRYABLE = (408, 409, 425, 429)
_UNAVAILABLE = (401, 402, 403, 404)
_PASSING = re.compile(r"429|5\d\d")
_POLICY = re.compile(
    r"content_policy_violation|ResponsibleAIPolicyViolation|content management policy"
    r"|data_?inspection_?failed|\bcontent_filter\b|requires moderation"
    r"|invalid_request_error.*content_policy|safety system",
    re.IGNORECASE,
)
_NEVER = re.compile(
    r"insufficient_quota|billing_hard_limit_reached|model_not_found|invalid_api_key"
    r"|authentication_error|credit balance is too low|API_KEY_INVALID|API key not valid"
    r"|LLM Provider NOT provided|Server is pinned to|Unexpected fields in the request",
    re.IGNORECASE,
)
_THINKING = re.compile(r"\s*<(think|thinking)>(.*?)</\1>\s*(.*)", re.DOTALL)


class SeedRefusedError(ModelError):
    """The request failed with words about its seed: the provider may take none."""


class Client(ABC):
    """Sends a request to one server, once: retries, limits and the cache are above.

    Neither its replies nor its errors hold a key. An error that is no ModelError is a bug of ours,
    or an input that cannot be sent, and ends the run.
    """

    def __init__(self, config: ModelConfig, http: HttpClient | None = None) -> None:
        """`http` sends in the place of a connection of its own."""
        self.config = config
        self.http = http or HttpClient(config)
        self._secrets = secrets_of(config)

    async def complete(self, request: Request, *, with_seed: bool = True) -> Reply:
        """Return the validated reply, its cost not yet known; raises ModelError."""
        try:
            reply = await self._complete(request, with_seed=with_seed)
        except ModelError as error:
            said = shown(str(error), self._secrets)
            may_refuse = error.status in (400, 422) or error.sent == "no"
            if with_seed and may_refuse and re.search(r"\bseed\b", str(error)):
                raise SeedRefusedError(said, status=error.status, sent=error.sent) from None
            error.args = (said,)
            raise
        texts = {
            name: hidden(well_formed(text), self._secrets, guess=False)
            for name in ("text", "reasoning", "provider_model")
            if (text := getattr(reply, name))
        }
        return reply.model_copy(update={**texts, "seed_sent": with_seed})

    @abstractmethod
    async def _complete(self, request: Request, *, with_seed: bool) -> Reply:
        """Send once; keys may stand in what comes of it."""

    async def aclose(self) -> None:
        """Close all connections."""
        await self.http.aclose()


def shown(text: str, secrets: tuple[str, ...]) -> str:
    """Return a text for messages and records: keys are taken out before it is cut."""
    return " ".join(hidden(text, secrets).split())[:_LONGEST_MESSAGE]


@dataclass(frozen=True)
class Answer:
    """The answer of a server; `fault` says what is wrong with its body, or "" for nothing."""

    status: int
    headers: Mapping[str, str]
    body: bytes
    fault: str = ""

    @property
    def is_success(self) -> bool:
        """True if the status promises a reply."""
        return 200 <= self.status < 300


class HttpClient:
    """Sends requests for one model, over one session that is opened by the first."""

    def __init__(self, config: ModelConfig) -> None:
        self._timeout_s = config.timeout_s
        self._most_bytes = config.most_body_bytes
        self._session: aiohttp.ClientSession | None = None
        self._proxies: dict[tuple[str, str], str | None] = {}

    async def send(
        self,
        url: str,
        body: bytes,
        headers: Mapping[str, str],
        *,
        method: str = "POST",
    ) -> Answer:
        """Send once and read the answer.

        Raises UnreachableError where no connection could be made in time, and RetryableError where
        it was lost or the answer did not end in time.
        """
        import aiohttp
        import yarl

        if self._session is None:
            self._session = aiohttp.ClientSession(
                connector=aiohttp.TCPConnector(limit=0),
                timeout=aiohttp.ClientTimeout(
                    total=self._timeout_s, connect=min(_LONGEST_CONNECT_S, self._timeout_s / 2)
                ),
                cookie_jar=aiohttp.DummyCookieJar(),
            )
        host = host_of(url)
        try:
            async with self._session.request(
                method,
                yarl.URL(url, encoded=url.isascii()),
                data=body,
                headers={**headers, "Accept-Encoding": "gzip, deflate"},
                proxy=self._proxy(url),
                allow_redirects=False,
            ) as response:
                status, found = response.status, response.headers
                if 300 <= status < 400:
                    response.close()
                    return Answer(status, found, b"", _redirect(url, found.get("Location")))
                pieces: list[bytes] = []
                size = 0
                try:
                    async for piece in response.content.iter_any():
                        size += len(piece)
                        if size > self._most_bytes:
                            response.close()
                            limit = f"{self._most_bytes / 2**20:g} MB"
                            return Answer(status, found, b"", f"the body is larger than {limit}")
                        pieces.append(piece)
                except aiohttp.ClientPayloadError:
                    response.close()
                    fault = "the body breaks off, or is not encoded as it says"
                    return Answer(status, found, b"", fault)
                return Answer(status, found, b"".join(pieces))
        except aiohttp.ConnectionTimeoutError:
            raise UnreachableError(f"no connection to {host} in time") from None
        except TimeoutError:
            within = f"no whole answer within {self._timeout_s:g} s"
            raise RetryableError(within, sent="maybe") from None
        except aiohttp.ClientConnectorError as error:
            raise _unconnected(error, host) from None
        except (aiohttp.ClientError, OSError) as error:
            said = f"{type(error).__name__}: {error}".strip(": ")
            lost = f"the connection to {host} was lost ({said})"
            raise RetryableError(lost, sent="lost") from None

    async def aclose(self) -> None:
        """Close all connections."""
        if self._session is not None:
            await self._session.close()
            self._session = None

    def _proxy(self, url: str) -> str | None:
        """Return the proxy that the environment names for an address, looked up once."""
        parts = urllib.parse.urlsplit(url)
        place = parts.scheme, parts.hostname or ""
        if place not in self._proxies:
            proxies = urllib.request.getproxies()
            proxy = proxies.get(place[0]) or proxies.get("all")
            if urllib.request.proxy_bypass(place[1]):
                proxy = None
            self._proxies[place] = f"http://{proxy}" if proxy and "://" not in proxy else proxy
        return self._proxies[place]


def _redirect(url: str, location: str | None) -> str:
    """Name the target of a redirect without its path and query."""
    if location is None:
        return "redirects, but not to where"
    try:
        target = urllib.parse.urljoin(url, location)
    except ValueError:
        target = ""
    return f"redirects to {host_of(target)}, and no redirect is followed"


def _unconnected(error: aiohttp.ClientConnectorError, host: str) -> UnreachableError:
    """Say why no connection could be made: a wrong name, or a server that is not there."""
    import aiohttp

    if isinstance(error, aiohttp.ClientConnectorCertificateError):
        return UnreachableError(f"no trusted connection to {host}: {error.certificate_error}")
    reason = error.os_error.strerror or error.os_error
    if isinstance(error, aiohttp.ClientConnectorDNSError):
        return UnreachableError(f"the name of {host} is not known (DNS): {reason}")
    if isinstance(error, aiohttp.ClientProxyConnectionError):
        return UnreachableError(f"no connection to the proxy: {reason}")
    return UnreachableError(f"no connection to {host}: {reason}")


def read_json(answer: Answer) -> object:
    """Return the decoded body of an answer whose status promises a reply.

    Raises a ModelError for a body that is not whole, is no JSON within bounds, or is an error: some
    servers send those with status 200.
    """
    if answer.fault or not answer.is_success:
        raise error_of(answer)
    try:
        body = load_json(answer.body)
    except ValueError as error:
        start = answer.body[:2_000].decode("utf-8", "replace")
        why = f"no JSON that can be read ({error}): {start}" if start else "no body"
        raise malformed(answer.status, why) from None
    if isinstance(body, Mapping) and body.get("error"):
        raise error_of(answer)
    return body


def read_completion(body: object, latency_s: float, status: int = 200) -> Reply:
    """Return the reply in the decoded body of a success.

    Thoughts that a server leaves in the text between think tags become reasoning, as litellm does
    it. Raises RetryableError when the body is no chat completion, or one without choices.
    """
    raw = read_chat_completion(body)
    if raw is None:
        found = type(body).__name__
        if isinstance(body, Mapping):
            words = [body[key] for key in ("message", "detail") if isinstance(body.get(key), str)]
            found = ": ".join([", ".join(map(str, body)) or "nothing", *words])
        raise malformed(status, f"no choices in it (found {found})")
    if not raw.reasoning and (match := _THINKING.match(raw.text)):
        raw = raw.model_copy(update={"reasoning": match[2], "text": match[3]})
    return raw.model_copy(update={"latency_s": latency_s})


def malformed(status: int, why: str) -> RetryableError:
    """Return the error of a success that holds no reply: it was answered, and may be billed."""
    return RetryableError(f"HTTP {status}: malformed reply: {why}", status=status)


def error_of(answer: Answer) -> ModelError:
    """Return the error of an answer that holds no reply."""
    status, wish_s = answer.status, retry_after_s(answer.headers)
    if answer.fault and answer.is_success:
        return malformed(status, answer.fault)
    words = answer.fault or _words(answer.body)
    text = f"HTTP {status}: {words}"
    if answer.is_success:
        # An error that came as a success: its own code says which. A limit that is reached and a
        # fault behind a gateway are no replies that were paid for.
        codes = _codes(answer.body)
        if _POLICY.search(text):
            return RefusedError(text, status=status)
        if _NEVER.search(text) or any(str(code) in codes for code in _UNAVAILABLE):
            return UnavailableError(text, status=status)
        own = next((int(code) for code in codes if _PASSING.fullmatch(code)), status)
        return RetryableError(text, status=own, retry_after_s=wish_s)
    if status >= 500:
        return RetryableError(text, status=status, retry_after_s=wish_s)
    if _POLICY.search(words):
        return RefusedError(text, status=status)
    if status in _UNAVAILABLE or _NEVER.search(words):
        return UnavailableError(text, status=status)
    if status in _RETRYABLE:
        return RetryableError(text, status=status, retry_after_s=wish_s)
    if 300 <= status < 400:
        return UnavailableError(f"{text} (is api_base the address of the API?)", status=status)
    return SampleError(text, status=status)


def _words(body: bytes) -> str:
    """Return what an error body says: message and code of the usual forms, else its text."""
    text = body[: 4 * _LONGEST_WORDS].decode("utf-8", "replace")[:_LONGEST_WORDS]
    try:
        raw = load_json(body)
    except ValueError:
        return text
    raw = raw[0] if isinstance(raw, list) and len(raw) == 1 else raw
    error = (raw.get("error") or raw) if isinstance(raw, Mapping) else raw
    if not isinstance(error, Mapping):
        return str(error)[:_LONGEST_WORDS]
    said = [error.get(name) for name in ("message", "detail", "code", "status", "type")]
    return " ".join(str(item) for item in said if item)[:_LONGEST_WORDS] or text


def _codes(body: bytes) -> tuple[str, ...]:
    """Return the codes of an error body as text: servers write numbers and names in either form."""
    raw: Any = load_json(body)
    error = raw.get("error") if isinstance(raw, Mapping) else None
    named = [error.get(name) for name in ("code", "status")] if isinstance(error, Mapping) else []
    return tuple(str(code) for code in named if isinstance(code, str | int))


def retry_after_s(headers: Mapping[str, str]) -> float | None:
    """Return the seconds that a `Retry-After` header asks for, given as seconds or HTTP date."""
    value = next((v for k, v in headers.items() if k.lower() == "retry-after"), None)
    if value is None:
        return None
    try:
        asked_s = float(value)
    except ValueError:
        try:
            then = email.utils.parsedate_to_datetime(value)
        except (ValueError, OverflowError):
            return None
        then = then if then.tzinfo else then.replace(tzinfo=UTC)
        asked_s = (then - datetime.now(UTC)).total_seconds()
    return max(0.0, asked_s) if math.isfinite(asked_s) else None


OPENAI_API_BASE = "https://api.openai.com/v1"


class OpenAIClient(Client):
    """`POST {api_base}/chat/completions`."""

    def __init__(self, config: ModelConfig, http: HttpClient | None = None) -> None:
        """Raise SpecError where no address is given and the provider is not OpenAI.

        Without an address the request, with another provider's key, would go to OpenAI.
        """
        if config.api_base is None and config.provider != "openai":
            message = "needs an api_base to be called directly"
            raise SpecError(Problem(f"model {config.name}", message, "api_base", config.id))
        super().__init__(config, http)
        self._url = f"{(config.api_base or OPENAI_API_BASE).rstrip('/')}/chat/completions"

    async def _complete(self, request: Request, *, with_seed: bool) -> Reply:
        params = wire_params(self.config, request)
        extra_body = params.pop("extra_body", {})
        headers = {
            "Authorization": f"Bearer {api_key(self.config)}",
            "Content-Type": "application/json",
            **params.pop("extra_headers", {}),
        }
        fields = {"model": self.config.provider_model, **params}
        if with_seed:
            fields["seed"] = request.seed
        fields |= extra_body
        body = json_body(fields, request.messages, self.config.image_detail)
        started_s = time.perf_counter()
        answer = await self.http.send(self._url, body, headers)
        return read_completion(read_json(answer), time.perf_counter() - started_s, answer.status)
