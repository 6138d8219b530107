"""The one HTTP client behind every transport: how much it reads, how long it waits, where it goes.

No redirect is followed, so that keys and prompts go to the host that was named and to no other. A
body is read up to a limit, before and after unpacking. The time limit holds for the whole exchange,
whatever the server does. Nothing is sent twice. aiohttp is imported by the first call.
"""

from __future__ import annotations

import asyncio
import urllib.parse
import urllib.request
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, BinaryIO, Protocol

from phyblock.config.models import ModelConfig, host_of
from phyblock.errors import RetryableError, UnreachableError
from phyblock.models.unpacking import ACCEPTED_ENCODINGS, BodyReader

if TYPE_CHECKING:
    import ssl

    import aiohttp

__all__ = ["Answer", "Client", "HttpClient"]


@dataclass(frozen=True)
class Answer:
    """What a server answered; `fault` says what is wrong with its body, or "" for nothing."""

    status: int
    headers: Mapping[str, str]
    body: bytes
    fault: str = ""

    @property
    def is_success(self) -> bool:
        """Whether the status promises a reply."""
        return 200 <= self.status < 300


class Client(Protocol):
    """What sends the request of a transport; see HttpClient."""

    async def send(
        self,
        url: str,
        body: bytes,
        headers: Mapping[str, str],
        *,
        method: str = "POST",
        tls: ssl.SSLContext | bool = True,
    ) -> Answer:
        """Send once and read the answer."""

    async def aclose(self) -> None:
        """Close all connections."""


@dataclass
class _Progress:
    """How far an exchange came: whether its request has begun to be sent."""

    has_begun: bool = False


async def _note_begun(_: object, context: SimpleNamespace, __: object) -> None:
    context.trace_request_ctx.has_begun = True


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
        body: bytes | BinaryIO,
        headers: Mapping[str, str],
        *,
        method: str = "POST",
        tls: ssl.SSLContext | bool = True,
        sink: Callable[[bytes], object] | None = None,
    ) -> Answer:
        """Send once and read the answer; a file is sent as it is read. `sink` takes the body of a
        success piece by piece, and the answer then has none.

        Raises UnreachableError where no connection could be made in time, and RetryableError where
        it was lost or the answer did not end in time.
        """
        import aiohttp

        progress = _Progress()
        exchange = self._exchange(method, url, body, headers, tls, progress, sink)
        try:
            return await asyncio.wait_for(exchange, self._timeout_s)
        except TimeoutError:
            within = f"within {self._timeout_s:g} s"
            if progress.has_begun:
                raise RetryableError(f"no whole answer {within}", sent="maybe") from None
            raise UnreachableError(f"no connection to {host_of(url)} {within}") from None
        except aiohttp.ClientConnectorError as error:
            raise _unconnected(error, url) from None
        except (aiohttp.ClientError, OSError) as error:
            text = f"{type(error).__name__}: {error}".strip(": ")
            lost = f"the connection to {host_of(url)} was lost ({text})"
            raise RetryableError(lost, sent="lost") from None

    async def aclose(self) -> None:
        """Close all connections."""
        if self._session is not None:
            await self._session.close()
            self._session = None

    async def _exchange(
        self,
        method: str,
        url: str,
        body: bytes | BinaryIO,
        headers: Mapping[str, str],
        tls: ssl.SSLContext | bool,
        progress: _Progress,
        sink: Callable[[bytes], object] | None,
    ) -> Answer:
        import yarl

        async with self._open_session().request(
            method,
            yarl.URL(url, encoded=url.isascii()),
            data=body,
            headers={**headers, "Accept-Encoding": ACCEPTED_ENCODINGS},
            proxy=self._proxy(url),
            allow_redirects=False,
            ssl=tls,
            trace_request_ctx=progress,
        ) as response:
            if 300 <= response.status < 400:
                response.close()
                fault = _redirect(url, response.headers.get("Location"))
                return Answer(response.status, response.headers, b"", fault)
            return await self._read(response, sink if response.ok else None)

    async def _read(
        self, response: aiohttp.ClientResponse, sink: Callable[[bytes], object] | None
    ) -> Answer:
        """The answer, its body read up to the limit; what is not read to its end is cut off."""
        import aiohttp

        status, headers = response.status, response.headers
        try:
            reader = BodyReader(headers.get("Content-Encoding", ""), self._most_bytes, sink)
            async for piece in response.content.iter_any():
                reader.add(piece)
            return Answer(status, headers, reader.body())
        except aiohttp.ClientPayloadError:
            fault = "breaks off, as the connection was lost"
        except ValueError as error:
            fault = str(error)
        response.close()
        return Answer(status, headers, b"", f"the body {fault}")

    def _proxy(self, url: str) -> str | None:
        """The proxy for an address, looked up once and not per call."""
        parts = urllib.parse.urlsplit(url)
        place = parts.scheme, parts.hostname or ""
        if place not in self._proxies:
            self._proxies[place] = _proxy_for(*place)
        return self._proxies[place]

    def _open_session(self) -> aiohttp.ClientSession:
        import aiohttp

        if self._session is None:
            trace = aiohttp.TraceConfig()
            trace.on_request_headers_sent.append(_note_begun)
            self._session = aiohttp.ClientSession(
                connector=aiohttp.TCPConnector(limit=0),
                timeout=aiohttp.ClientTimeout(total=None),
                cookie_jar=aiohttp.DummyCookieJar(),
                auto_decompress=False,
                trace_configs=[trace],
            )
        return self._session


def _redirect(url: str, location: str | None) -> str:
    """What a redirect says, without the path and query of its target."""
    if location is None:
        return "redirects, but not to where"
    try:
        target = urllib.parse.urljoin(url, location)
    except ValueError:
        target = ""
    return f"redirects to {host_of(target)}, and no redirect is followed"


def _unconnected(error: aiohttp.ClientConnectorError, url: str) -> UnreachableError:
    """Why no connection could be made: a wrong name is told from a server that is not there."""
    import aiohttp

    host = host_of(url)
    if isinstance(error, aiohttp.ClientConnectorCertificateError):
        return UnreachableError(f"no trusted connection to {host}: {error.certificate_error}")
    reason = error.os_error.strerror or error.os_error
    if isinstance(error, aiohttp.ClientConnectorDNSError):
        return UnreachableError(f"the name of {host} is not known (DNS): {reason}")
    if isinstance(error, aiohttp.ClientProxyConnectionError):
        return UnreachableError(f"no connection to the proxy: {reason}")
    return UnreachableError(f"no connection to {host}: {reason}")


def _proxy_for(scheme: str, host: str) -> str | None:
    """The proxy that the environment names for a host."""
    if urllib.request.proxy_bypass(host):
        return None
    proxies = urllib.request.getproxies()
    proxy = proxies.get(scheme) or proxies.get("all")
    return f"http://{proxy}" if proxy and "://" not in proxy else proxy
