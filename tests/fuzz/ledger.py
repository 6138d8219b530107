"""The server's own account of who asked what and what was answered: the third law, exactly.

3. What was answered is kept, and is never asked again; what was refused for good is not asked again
   either, unless it is told to. What failed may be asked again.
"""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from aiohttp import web

from tests.fuzz.laws import Broken
from tests.servers.chassis import Seen
from tests.servers.faults import WIRE_FAULTS
from tests.servers.openai_chat import OpenAIChat
from tests.servers.step_agent import StepAgent

__all__ = ["Entry", "Ledger", "LedgerAgent", "LedgerChat", "asked_twice", "kept_in", "lost"]

_FINAL = {"400": "sample", "policy": "sample"}
_REPLIES = ("ok", "length", "filtered", "blank")


class Entry(NamedTuple):
    """A request that arrived whole: which model was asked, what, and how the server ended it."""

    model: str
    sample: str
    ending: str

    @property
    def comes_to(self) -> str:
        """ "reply", "retryable", "unavailable" or "sample" (refused for good)."""
        if self.ending in WIRE_FAULTS:
            return WIRE_FAULTS[self.ending].ending
        return "reply" if self.ending in _REPLIES else _FINAL.get(self.ending, "retryable")

    @property
    def key(self) -> tuple[str, str]:
        """A request, and whom it was sent to."""
        return self.model, self.sample


class Ledger:
    """The entries of a server in the order in which requests arrived."""

    def __init__(self) -> None:
        self.entries: list[Entry] = []

    @property
    def faults(self) -> Counter[str]:
        """Numbers of requests without an ordinary answer, by their end."""
        return Counter(entry.ending for entry in self.entries if entry.ending != "ok")

    def answered(self) -> set[tuple[str, str]]:
        """Requests that got a reply."""
        return {entry.key for entry in self.entries if entry.comes_to == "reply"}

    def refused(self) -> set[tuple[str, str]]:
        """Requests that were refused for good."""
        return {entry.key for entry in self.entries if entry.comes_to == "sample"}


def asked_twice(entries: Iterable[Entry], *, retries_refused: bool = False) -> Iterator[Broken]:
    """Return what was asked again after it was answered, or refused for good."""
    ended: dict[tuple[str, str], Entry] = {}
    for entry in entries:
        if entry.key in ended:
            yield Broken(3, "asked twice", f"{ended[entry.key]}, then {entry}")
        if entry.comes_to == "reply" or (entry.comes_to == "sample" and not retries_refused):
            ended[entry.key] = entry


def lost(ledger: Ledger, kept: Collection[tuple[str, str]]) -> Iterator[Broken]:
    """Return what was answered and is not kept."""
    for model, sample in sorted(ledger.answered() - set(kept)):
        endings = [entry.ending for entry in ledger.entries if entry.key == (model, sample)]
        yield Broken(3, "a reply is lost", f"{sample} of {model}: {endings}")


def kept_in(folder: Path) -> set[tuple[str, str]]:
    """Return the entries of a run's records or calls, by model and signature of the reply.

    A last line that a kill cut short does not count.
    """
    found = set()
    for name in ("records.jsonl", "calls.jsonl"):
        path = folder / name
        for line in path.read_bytes().split(b"\n")[:-1] if path.exists() else ():
            stored: dict[str, Any] = json.loads(line)
            model = stored["model"]
            if stored.get("reply") is not None:
                found.add((model, stored["reply"]["reasoning"]))
    return found


class LedgerChat(OpenAIChat):
    """Answers plans and questions; the digest of a request is its reply's reasoning.

    Several that serve the same model may share a `ledger`.
    """

    def __init__(self, *args: Any, ledger: Ledger | None = None, **options: Any) -> None:
        super().__init__(*args, **options)
        self.ledger = ledger or Ledger()

    async def _end(self, seen: Seen, ending: str, request: web.Request) -> web.StreamResponse:
        self.ledger.entries.append(Entry(seen.model, seen.sample, ending))
        return await super()._end(seen, ending, request)

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        for choice in body["choices"]:
            letter = "ABCD"[hashlib.sha256(seen.sample.encode()).digest()[0] % 4]
            message = choice["message"]
            message["reasoning_content"] = seen.sample
            if "Question:" in str(seen.parts[-1]):
                message["content"] = f"Answer: {letter}"
        return body


class LedgerAgent(LedgerChat, StepAgent):
    """Answers the turns of episodes."""

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        return StepAgent.reply(self, seen, ending)
