"""An OpenAI chat server that bears little at once: `python -m tests.servers.strained --strain slows
--bears 12`.

Up to `bears` requests at once are each answered after the latency. Of more it gets slower for all
(`slows`), refuses them with 429 (`refuses`), or leaves them without an answer (`hangs`).
"""

from __future__ import annotations

import argparse
import asyncio
from typing import Any

from aiohttp import web

from tests.servers.chassis import Faults, Seen, start
from tests.servers.openai_chat import OpenAIChat

__all__ = ["STRAINS", "StrainedChat"]

STRAINS = ("slows", "refuses", "hangs")
_HANGS_S = 5.0


class StrainedChat(OpenAIChat):
    """POST /v1/chat/completions."""

    def __init__(self, strain: str, bears: int, latency_s: float) -> None:
        super().__init__(Faults(retry_after="0.1"), keep=False)
        self._strain = strain
        self._bears = bears
        self._latency_s = latency_s
        self._working = 0

    async def _end(self, seen: Seen, ending: str, request: web.Request) -> web.StreamResponse:
        is_too_much = self._working >= self._bears
        if is_too_much and self._strain == "refuses":
            self.ended["ok"] -= 1
            self.ended["429"] += 1
            return self._refuse(seen, "429")
        if is_too_much and self._strain == "hangs":
            await asyncio.sleep(_HANGS_S)
        self._working += 1
        try:
            load = self._working / self._bears if self._strain == "slows" else 0.0
            await asyncio.sleep(self._latency_s * (1 + load**2))
            return await super()._end(seen, ending, request)
        finally:
            self._working -= 1


def main(arguments: Any = None) -> None:
    """Serve until killed; the first line printed is the port."""
    parser = argparse.ArgumentParser(description=StrainedChat.__doc__)
    parser.add_argument("--strain", choices=STRAINS, required=True)
    parser.add_argument("--bears", type=int, default=12, metavar="REQUESTS")
    parser.add_argument("--latency", type=float, default=0.05, metavar="SECONDS")
    given = parser.parse_args(arguments)

    async def serve() -> None:
        server = StrainedChat(given.strain, given.bears, given.latency)
        _, port = await start(server, 0)
        print(port, flush=True)
        await asyncio.Event().wait()

    asyncio.run(serve())


if __name__ == "__main__":
    main()
