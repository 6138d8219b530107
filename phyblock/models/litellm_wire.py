"""The wire under litellm: its HTTP clients send through ours, and hand it what is fit to be read.

litellm makes its clients itself, with redirects followed, bodies without a limit, and requests sent
again when a connection dies; it has no setting for these. So the method by which it makes the
transport of every asynchronous client is replaced. What it gets instead knows only the exchange
that is under way in its task, and sends nothing outside of one.
"""

from __future__ import annotations

import ssl
from collections.abc import Mapping
from contextvars import ContextVar
from typing import Any

import httpx
from litellm.llms.custom_httpx.http_handler import AsyncHTTPHandler, HTTPHandler

from phyblock.errors import ModelError
from phyblock.models.http_client import Answer, HttpClient
from phyblock.models.litellm_bodies import readable_body
from phyblock.models.refusals import read_body, refusal

__all__ = ["CURRENT", "Exchange", "WireTransport", "install"]

_OURS = ("accept-encoding", "connection", "content-length", "host", "transfer-encoding")
_UNPACKED = ("content-encoding", "content-length", "transfer-encoding")


class Exchange:
    """What one call puts on the wire: the last answer, or why there is none that may be read."""

    def __init__(self, client: HttpClient) -> None:
        self.answer: Answer | None = None
        self.failure: ModelError | None = None
        self._client = client
        self._posted: set[str] = set()

    async def send(
        self, method: str, url: str, body: bytes, headers: Mapping[str, str], tls: Any
    ) -> Answer:
        """Send through our client; raises a ModelError for all that litellm shall not see."""
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


CURRENT: ContextVar[Exchange] = ContextVar("phyblock_exchange")
"""The exchange of the task that runs."""


class WireTransport(httpx.AsyncBaseTransport):
    """An httpx transport that sends through the exchange of its task."""

    def __init__(self, tls: ssl.SSLContext | bool) -> None:
        self._tls = tls

    async def handle_async_request(self, request: httpx.Request) -> httpx.Response:
        """Send once; httpx.ReadError stands for every failure, and the exchange knows which."""
        exchange = CURRENT.get(None)
        if exchange is None:
            raise httpx.ReadError("nothing is sent outside of a call", request=request)
        headers = {name: value for name, value in request.headers.items() if name not in _OURS}
        body = await request.aread()
        try:
            answer = await exchange.send(request.method, str(request.url), body, headers, self._tls)
        except ModelError:
            # The error's own words may hold what litellm must not log.
            raise httpx.ReadError("the call failed", request=request) from None
        kept = [(k, v) for k, v in answer.headers.items() if k.lower() not in _UNPACKED]
        return httpx.Response(answer.status, headers=kept, content=answer.body, request=request)


def install() -> None:
    """Make litellm's clients send through ours, and its synchronous ones follow no redirect.

    The latter fetch tokens for a few providers.
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
