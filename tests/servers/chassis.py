"""Parts that the local servers share: counting, faults, running in a thread or as a process.

Faults are drawn from the content of a request and the number of times that it was asked, so that a
run meets the same ones whatever the order of its requests.
"""

from __future__ import annotations

import argparse
import asyncio
import base64
import hashlib
import json
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import KW_ONLY, dataclass, field
from typing import Any

from aiohttp import web
from anyio.from_thread import start_blocking_portal

from tests.servers.faults import WIRE_FAULTS
from tests.workspace import plan_text

FAULTS = ("429", "500", "reset", "cut", "html", "empty")
REPLIES = ("ok", "length", "filtered", "blank", "empty")
"""Ways in which an answer is a reply; an empty one has no choices."""


@dataclass(frozen=True)
class Faults:
    """Shares of requests that fail in each way, and how an answer comes otherwise.

    Another `seed` draws other requests for each. `mode` makes every request end in one way. Ways
    are the names of FAULTS (cut JSON, an HTML page with status 200, a reply without choices, ...)
    and WIRE_FAULTS, "401", "403", "404", "quota", "400", "policy", "seed" (400 for a request with
    a seed), "echo-key", "length", "filtered", "blank", "slow" (never answers).
    """

    shares: Mapping[str, float] = field(default_factory=dict)
    latency_s: float = 0.0
    retry_after: str = "1"
    mode: str = "ok"
    seed: int = 0

    def draw(self, sample: str, nth: int) -> str:
        """The way in which the nth request of a sample ends."""
        if self.mode != "ok":
            return self.mode
        drawn = hashlib.sha256(f"{sample}|{nth}|{self.seed}".encode()).hexdigest()
        share = int(drawn, 16) % 10**6 / 10**6
        for name, size in self.shares.items():
            if share < size:
                return name
            share -= size
        return "ok"


def picture_part(kind: str, data: str) -> tuple[str, str]:
    """MIME type and digest of a picture that arrived in base 64."""
    return kind, hashlib.sha256(base64.b64decode(data)).hexdigest()


@dataclass(frozen=True)
class Seen:
    """A request as it arrived: parts are texts and (MIME type, SHA-256 of the bytes) in order."""

    model: str
    system: str
    parts: tuple[str | tuple[str, str], ...]
    params: dict[str, Any]
    seed: int | None
    key: str
    raw: dict[str, Any] = field(repr=False, default_factory=dict)

    @property
    def sample(self) -> str:
        content = json.dumps([self.system, self.parts, self.seed])
        return hashlib.sha256(content.encode()).hexdigest()[:16]

    @property
    def pictures(self) -> tuple[str, ...]:
        """The digests of its pictures."""
        return tuple(part[1] for part in self.parts if not isinstance(part, str))

    @property
    def reply_text(self) -> str:
        """Four steps that depend on the messages alone."""
        digest = hashlib.sha256(json.dumps([self.system, self.parts]).encode()).digest()
        return plan_text(*(byte % 16 + 1 for byte in digest[:4]))


@dataclass(eq=False)
class LocalServer:
    """A server of one protocol, whose class gives it `add_routes`, which lead to `handle`; `read`,
    a request in common terms; `reply` by its ending, one of REPLIES; and `error`, an error body.

    `ended` counts requests by how they ended. `elsewhere` is where redirects to another host lead.
    At most `width` requests are looked at together. While it `holds`, which a test may end, no
    request is answered. `usage` counts the tokens of a prompt and its reply, which says what `say`
    gives and reasons what `think` gives.
    """

    faults: Faults | None = None
    _: KW_ONLY
    elsewhere: str = "http://localhost:9"
    width: int = 10_000
    holds: bool = False
    usage: Callable[[Seen], tuple[int, int]] = lambda _: (1000, 40)
    say: Callable[[Seen], str] = lambda seen: seen.reply_text
    think: Callable[[Seen], str] = lambda _: "Let me see."

    def __post_init__(self) -> None:
        self._gate = asyncio.Semaphore(self.width)
        self.at_once = 0
        self.forget(self.faults)

    def forget(self, faults: Faults | None = None) -> None:
        """Begin as new, with other faults."""
        self.faults = faults or Faults()
        self.seen: deque[Seen] | list[Seen] = []
        self.ended: Counter[str] = Counter()
        self.by_sample: Counter[str] = Counter()

    @property
    def requests(self) -> int:
        return self.ended.total()

    def text(self, seen: Seen, ending: str) -> str:
        return "" if ending in ("length", "filtered", "blank") else self.say(seen)

    async def handle(self, request: web.Request) -> web.StreamResponse:
        async with self._gate:
            self.at_once += 1
            try:
                seen = self.read(await request.json(), request)
                self.seen.append(seen)
                self.by_sample[seen.sample] += 1
                ending = self.faults.draw(seen.sample, self.by_sample[seen.sample])
                if ending == "seed" and seen.seed is None:
                    ending = "ok"
                self.ended[ending] += 1
                await asyncio.sleep(self.faults.latency_s)
                while self.holds:
                    await asyncio.sleep(0.005)
                return await self._end(seen, ending, request)
            finally:
                self.at_once -= 1

    async def _end(self, seen: Seen, ending: str, request: web.Request) -> web.StreamResponse:
        if ending in WIRE_FAULTS:
            return await WIRE_FAULTS[ending].behave(self, seen, request)
        if ending == "slow":
            await asyncio.sleep(3600)
        if ending in REPLIES:
            return web.json_response(self.reply(seen, ending))
        status, message = {
            "429": (429, "Rate limit reached"),
            "500": (500, "The server had an error"),
            "401": (401, "Incorrect API key provided"),
            "echo-key": (401, f"Incorrect API key provided: {seen.key}"),
            "403": (403, "Not allowed for your project"),
            "404": (404, f"The model {seen.model} does not exist"),
            "400": (400, "Invalid value for messages"),
            "quota": (429, "You exceeded your current quota, please check your plan"),
            "policy": (400, "Your request was rejected as a result of our safety system"),
            "seed": (400, "Unrecognized request argument supplied: seed"),
        }[ending]
        headers = {"Retry-After": self.faults.retry_after} if ending == "429" else {}
        body = self.error(status, ending, message)
        return web.json_response(body, status=status, headers=headers)


class Running:
    """A server on a free port, in a thread with a loop of its own; a context manager. It may die
    and come back, on the same port, any number of times.
    """

    def __init__(self, server: LocalServer) -> None:
        self.server = server
        self.port = 0
        self._runner: web.AppRunner | None = None
        self._stack = ExitStack()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    @property
    def is_alive(self) -> bool:
        return self._runner is not None

    def __enter__(self) -> Running:
        self._portal = self._stack.enter_context(start_blocking_portal())
        self.come_back()
        return self

    def __exit__(self, *_: object) -> None:
        with self._stack:
            if self._runner is not None:
                self._portal.call(self._runner.cleanup)

    def come_back(self) -> None:
        """Serve, or serve again."""
        if self._runner is None:
            self._runner = self._portal.call(start, self.server, self.port)
            self.port = self._runner.addresses[0][1]

    def die(self) -> None:
        """End as a process that is killed: at once, its connections reset."""
        if self._runner is not None:
            dying, self._runner = self._runner, None
            self._portal.call(_killed, dying)


async def _killed(runner: web.AppRunner) -> None:
    for site in list(runner.sites):
        await site.stop()
    for connection in runner.server.connections:
        if connection.transport is not None:
            connection.transport.abort()
    await runner.cleanup()


async def start(server: LocalServer, port: int) -> web.AppRunner:
    app = web.Application(client_max_size=64 * 2**20)
    server.add_routes(app)
    runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.1)
    await runner.setup()
    await web.TCPSite(runner, "127.0.0.1", port, backlog=1024).start()
    return runner


def main(kind: type[LocalServer]) -> None:
    """Serve until killed; the first line printed is the port."""
    parser = argparse.ArgumentParser(description=kind.__doc__)
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--latency", type=float, default=0.0, metavar="SECONDS")
    given = parser.parse_args()

    async def serve() -> None:
        server = kind(Faults(latency_s=given.latency))
        server.seen = deque(maxlen=1)
        runner = await start(server, given.port)
        print(runner.addresses[0][1], flush=True)
        await asyncio.Event().wait()

    asyncio.run(serve())
