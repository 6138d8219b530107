"""The wire under litellm: its HTTP clients send through ours, and hand it what is fit to be read.

litellm makes its clients itself, with redirects followed, bodies without a limit, and requests sent
again when a connection dies; it has no setting for these. So the method by which it makes the
transport of every asynchronous client is replaced, and so is what any other httpx client sends
while a call is under way, the synchronous ones included. All of it goes to the exchange of the call
and no further than to the model's server.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import ssl
import urllib.parse
from collections.abc import Mapping
from contextvars import ContextVar
from typing import Any

import httpx
from litellm.llms.custom_httpx.http_handler import AsyncHTTPHandler, HTTPHandler

from phyblock.config.models import ModelConfig
from phyblock.errors import ModelError, UnavailableError, UnreachableError
from phyblock.models.http_client import Answer, Client
from phyblock.models.litellm_bodies import readable_body
from phyblock.models.refusals import read_body, refusal

__all__ = ["CURRENT", "Exchange", "WireTransport", "install"]

_OURS = ("accept-encoding", "connection", "content-length", "host", "transfer-encoding")
_UNPACKED = ("content-encoding", "content-length", "transfer-encoding")
_TOKEN_HOSTS: Mapping[str, tuple[str, ...]] = {
    "azure": ("login.microsoftonline.com",),
    "azure_ai": ("login.microsoftonline.com",),
    "gigachat": ("ngw.devices.sberbank.ru",),
    "github_copilot": ("api.github.com", "github.com"),
    "vertex_ai": ("oauth2.googleapis.com", "sts.googleapis.com"),
    "watsonx": ("iam.cloud.ibm.com",),
    "watsonx_text": ("iam.cloud.ibm.com",),
}
"""Where litellm signs in for a provider, beside its API; no prompt goes there."""

_STRAY_HOSTS: Mapping[str, tuple[str, ...]] = {
    "huggingface.co": ("huggingface",),
    "localhost": ("hosted_vllm", "lm_studio", "llamafile", "ollama", "ollama_chat"),
    "127.0.0.1": ("hosted_vllm", "lm_studio", "llamafile", "ollama", "ollama_chat"),
    "raw.githubusercontent.com": (),
}
"""Hosts that litellm asks about models of any provider, and whose models are really there."""

_INSTEAD = "if it has an OpenAI-compatible address, use openai/... with that api_base"


class Exchange:
    """What one call puts on the wire: the last answer, or why there is none that may be read.

    `refused` is why something was not sent that litellm wanted to send, "" for nothing.
    """

    def __init__(self, client: Client, config: ModelConfig) -> None:
        self.answer: Answer | None = None
        self.failure: ModelError | None = None
        self.refused = ""
        self._client = client
        self._config = config
        self._posted: set[str] = set()
        self._loop = asyncio.get_running_loop()
        self._is_over = False

    def answered(self) -> Answer:
        """The answer that a reply was made of.

        Raises the call's failure where the answer promises no reply, and UnavailableError where
        there is no answer: the reply came past our client.
        """
        if self.answer is None:
            raise self.failure or UnavailableError(self._past("answers"))
        if not self.answer.is_success:
            raise refusal(self.answer)
        return self.answer

    def end(self) -> None:
        """The call is over: nothing more is sent, whatever threads it leaves behind."""
        self._is_over = True

    def signs_in_at(self, url: str) -> bool:
        """Whether an address is where the model's provider gives out tokens."""
        host = urllib.parse.urlsplit(url).hostname
        return host in _TOKEN_HOSTS.get(self._config.provider, ())

    async def send(
        self, method: str, url: str, body: bytes, headers: Mapping[str, str], tls: Any
    ) -> Answer:
        """Send through our client; raises a ModelError for all that litellm shall not see."""
        self._require_own_host(url)
        if method == "POST" and url in self._posted:
            raise self.failure or RuntimeError("the library tried to send a request twice")
        self._posted.add(url)
        self.answer = None
        try:
            self.answer = await self._client.send(url, body, headers, method=method, tls=tls)
            if self.answer.fault:
                raise refusal(self.answer)
            if self.answer.is_success:
                return readable_body(self.answer, read_body(self.answer))
        except ModelError as error:
            self.failure = error
            raise
        return self.answer

    def send_from_thread(
        self, method: str, url: str, body: bytes, headers: Mapping[str, str]
    ) -> Answer:
        """Send for a synchronous client, which waits in its thread while the loop goes on.

        Raises UnavailableError on the loop's own thread, which must not wait.
        """
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            sending = self.send(method, url, body, headers, True)
            return asyncio.run_coroutine_threadsafe(sending, self._loop).result()
        raise self._refuse(self._past("sends"))

    def signed_out(self, error: httpx.TransportError) -> None:
        """The place where the provider gives out tokens could not be reached."""
        host = error.request.url.host
        self.failure = UnreachableError(f"no token from {host}: {error}")

    def _require_own_host(self, url: str) -> None:
        """Refuse what would go to another server than the model's."""
        if self._is_over:
            raise self._refuse("nothing is sent after a call")
        place, base = _place(url), self._config.api_base
        if base is not None:
            is_own = place == _place(base) or self.signs_in_at(url)
        else:
            is_own = self._config.provider in _STRAY_HOSTS.get(place[0], (self._config.provider,))
        if not is_own:
            raise self._refuse(f"nothing is sent to {place[0]}, which is not the model's server")

    def _past(self, does: str) -> str:
        past = f"{self._config.provider} {does} past phyblock's client, which keeps keys and limits"
        return f"{past}; {_INSTEAD}"

    def _refuse(self, why: str) -> UnavailableError:
        self.refused = why
        return UnavailableError(why, sent="no")


CURRENT: ContextVar[Exchange | None] = ContextVar("phyblock_exchange", default=None)
"""The exchange of the task, or of the thread that works for it."""


class WireTransport(httpx.AsyncBaseTransport):
    """An httpx transport that sends through the exchange of its task."""

    def __init__(self, tls: ssl.SSLContext | bool) -> None:
        self._tls = tls

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        """Send once; httpx.ReadError stands for every failure, and the exchange knows which."""
        exchange = CURRENT.get()
        if exchange is None:
            raise httpx.ReadError("nothing is sent outside of a call", request=request)
        body = await request.aread()
        try:
            answer = await exchange.send(
                request.method, str(request.url), body, _headers(request), self._tls
            )
        except ModelError:
            # The error's own words may hold what litellm must not log.
            raise httpx.ReadError("the call failed", request=request) from None
        return _response(answer, request)


def install() -> None:
    """Make all clients that litellm has send through ours while a call is under way.

    The synchronous ones still fetch tokens where a provider signs in, and follow no redirect.
    """

    def create_async_transport(
        ssl_context: ssl.SSLContext | None = None, ssl_verify: bool | None = None, **_: object
    ) -> WireTransport:
        return WireTransport(ssl_verify is not False if ssl_context is None else ssl_context)

    AsyncHTTPHandler.create_async_transport = staticmethod(create_async_transport)
    create_client = HTTPHandler.create_client

    def create_still_client(self: HTTPHandler) -> httpx.Client:
        client: httpx.Client = create_client(self)
        client.follow_redirects = False
        return client

    HTTPHandler.create_client = create_still_client
    _divert_other_clients()


def _divert_other_clients() -> None:
    """Put the exchange under way in the place of httpx's own transports.

    litellm made some of its clients when it was imported, and its providers' code makes others.
    """
    handle, handle_async = (
        httpx.HTTPTransport.handle_request,
        httpx.AsyncHTTPTransport.handle_async_request,
    )

    def handle_request(self: httpx.HTTPTransport, request: httpx.Request) -> httpx.Response:
        exchange = CURRENT.get()
        if exchange is None:
            return handle(self, request)
        if exchange.signs_in_at(str(request.url)):
            try:
                return handle(self, request)
            except httpx.TransportError as error:
                error.request = request
                exchange.signed_out(error)
                raise
        body, headers = request.read(), _headers(request)
        try:
            answer = exchange.send_from_thread(request.method, str(request.url), body, headers)
        except (ModelError, concurrent.futures.CancelledError):
            raise httpx.ReadError("the call failed", request=request) from None
        return _response(answer, request)

    async def handle_async_request(
        self: httpx.AsyncHTTPTransport, request: httpx.Request
    ) -> httpx.Response:
        if CURRENT.get() is None:
            return await handle_async(self, request)
        return await WireTransport(tls=True).handle_async_request(request)

    httpx.HTTPTransport.handle_request = handle_request  # type: ignore[method-assign]
    httpx.AsyncHTTPTransport.handle_async_request = handle_async_request  # type: ignore[method-assign]


def _place(url: str) -> tuple[str, int | None]:
    """Host and port of an address."""
    parts = urllib.parse.urlsplit(url)
    usual = {"http": 80, "https": 443}.get(parts.scheme)
    return parts.hostname or "", parts.port or usual


def _headers(request: httpx.Request) -> dict[str, str]:
    return {name: value for name, value in request.headers.items() if name not in _OURS}


def _response(answer: Answer, request: httpx.Request) -> httpx.Response:
    kept = [(k, v) for k, v in answer.headers.items() if k.lower() not in _UNPACKED]
    return httpx.Response(answer.status, headers=kept, content=answer.body, request=request)
