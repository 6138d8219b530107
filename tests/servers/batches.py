"""What the local servers of batches share: what was made, how each ends, moments to break off.

A batch answers each of its requests as the server would answer it alone, and counts it as asked.
"""

from __future__ import annotations

import itertools
import json
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from aiohttp import web

from tests.servers.chassis import LocalServer, Seen
from tests.servers.faults import reset_connection

NEVER_ASKED = ("expired", "cancelled")


@dataclass(frozen=True)
class BatchFaults:
    """How batches and calls go wrong; batches are counted from 0.

    `lines` gives by batch the places whose line is not "ok": a status ("500", "400"), an ending of
    LocalServer.reply ("length"), "expired", "cancelled", "missing", "broken", "twice" or "stranger"
    (an answer to nothing besides). `ends` gives by batch another state than an ordinary end:
    "expired", "cancelled" or "refused". `calls` gives by kind of call ("upload", "create", "look",
    "list", "results") what the first ones meet: a status, "reset" (before anything), or
    "done-reset" (it is done, and the answer lost). A batch ends at look number `looks`. `key` is
    the right one.
    """

    lines: Mapping[int, Mapping[int, str]] = field(default_factory=dict)
    ends: Mapping[int, str] = field(default_factory=dict)
    calls: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    looks: int = 2
    key: str | None = None


@dataclass
class Made:
    """A batch; `state` is running until it was looked at often enough."""

    id: str
    token: str
    requests: list[tuple[str, dict[str, Any]]]
    ordinal: int
    created_s: float
    looks: int = 0
    state: str = "running"
    seen: list[Seen] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)


class BatchServer(LocalServer):
    """One protocol's batches; `asked` counts each request that was worked on, by sample."""

    batch_faults: BatchFaults = BatchFaults()
    page = 2

    def __init__(self, *args: Any, batch: BatchFaults | None = None, **options: Any) -> None:
        super().__init__(*args, **options)
        self.batch_faults = batch or BatchFaults()
        self.made: list[Made] = []
        self.asked: Counter[str] = Counter()
        self.calls: list[str] = []
        self.keys: set[str] = set()
        self.moment: Callable[[int, str], None] = lambda *_: None
        self._moments = itertools.count()
        self._met: Counter[str] = Counter()

    def key_of(self, request: web.Request) -> str:
        """The key that a request brings."""
        raise NotImplementedError

    def line(self, custom_id: str, seen: Seen, ending: str) -> dict[str, Any]:
        """A line of the results."""
        raise NotImplementedError

    async def guarded(
        self, kind: str, request: web.Request, work: Callable[[], Any]
    ) -> web.StreamResponse:
        """Do a call's work, or what it meets; moments lie before and after it."""
        self.calls.append(kind)
        self.keys.add(self.key_of(request))
        self.moment(next(self._moments), f"{kind} arrived")
        if self.batch_faults.key not in (None, self.key_of(request)):
            return web.json_response(self.error(401, "401", "Incorrect API key"), status=401)
        faults = self.batch_faults.calls.get(kind, ())
        fault = faults[self._met[kind]] if self._met[kind] < len(faults) else ""
        self._met[kind] += 1
        if fault == "reset":
            return reset_connection(request)
        if fault.isdigit():
            return web.json_response(self.error(int(fault), fault, "went wrong"), status=int(fault))
        response = await work()
        self.moment(next(self._moments), f"{kind} done")
        if fault == "done-reset":
            return reset_connection(request)
        assert isinstance(response, web.StreamResponse)
        return response

    def told(self, made: Made) -> dict[str, Any]:
        """What the provider says of a batch."""
        raise NotImplementedError

    async def look_at(self, request: web.Request) -> web.StreamResponse:
        """A call that looks at a batch."""

        async def work() -> web.Response:
            made = self.find(request.match_info["id"])
            self.look(made)
            return web.json_response(self.told(made))

        return await self.guarded("look", request, work)

    def listed(self, start: int) -> tuple[list[dict[str, Any]], bool]:
        """A page of batches, the newest first, and whether there are more."""
        end = start + self.page
        newest = self.made[::-1][start:end]
        for made in newest:
            self.look(made)
        return [self.told(made) for made in newest], end < len(self.made)

    def after(self, batch_id: str | None) -> int:
        """Where the page begins that follows on a batch."""
        newest = [made.id for made in reversed(self.made)]
        return newest.index(batch_id) + 1 if batch_id else 0

    def make(
        self, token: str, requests: list[tuple[str, dict[str, Any]]], call: web.Request
    ) -> Made:
        """Begin a batch, which works on its requests whether it is looked at or not."""
        number = len(self.made)
        made = Made(f"batch-{number}", token, requests, number, time.time())
        self.made.append(made)
        faults = self.batch_faults.lines.get(number, {})
        for place, (_, body) in enumerate(requests):
            seen = self.read(body, call)
            self.seen.append(seen)
            made.seen.append(seen)
            is_asked = self.batch_faults.ends.get(number) != "refused"
            if is_asked and faults.get(place) not in NEVER_ASKED:
                self.asked[seen.sample] += 1
        return made

    def find(self, batch_id: str) -> Made:
        return next(made for made in self.made if made.id == batch_id)

    def look(self, made: Made) -> None:
        """Bring a batch nearer to its end."""
        made.looks += 1
        if made.state == "running" and made.looks >= self.batch_faults.looks:
            made.state = self.batch_faults.ends.get(made.ordinal, "ended")
            if made.state != "refused":
                self._answer(made)

    def _answer(self, made: Made) -> None:
        faults = self.batch_faults.lines.get(made.ordinal, {})
        for place, ((custom_id, _), seen) in enumerate(zip(made.requests, made.seen, strict=True)):
            ending = faults.get(place, "ok")
            if ending == "missing":
                continue
            whole = json.dumps(self.line(custom_id, seen, "ok" if ending in ODD else ending))
            if ending == "broken":
                whole = whole[: len(whole) // 2]
            made.lines += [whole, whole] if ending == "twice" else [whole]
            if ending == "stranger":
                made.lines.append(json.dumps(self.line("nobody-7", seen, "ok")))


ODD = ("broken", "twice", "stranger")
