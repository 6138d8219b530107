"""The batches of a run on disk: the requests of each, its progress, and its answers.

A line says that a batch is about to be sent, with the requests in it, before anything of it leaves
this machine. So a kill at any moment leaves a batch that has ended, one that can be asked about by
its id, or one that can be looked for under our name.
"""

from __future__ import annotations

import asyncio
import secrets
from collections import Counter
from collections.abc import Awaitable, Callable, Iterable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

from phyblock.config.models import ModelConfig
from phyblock.files import load_json
from phyblock.models.batch_providers import PROVIDERS, UNREADABLE, BatchProvider
from phyblock.models.client import Answer
from phyblock.records.record import BatchEvent, BatchLine


@dataclass(frozen=True)
class BatchFiles:
    """Batches of a run as they are kept: the lines written so far, oldest first, and a callback
    that appends one and returns when it is on disk. A batch is looked at every `poll_s` at least.
    """

    earlier: tuple[BatchLine, ...]
    put: Callable[[BatchLine], Awaitable[None]]
    run_folder: Path
    poll_s: float = 60.0

    def answers(self, token: str) -> Path:
        """Return the file of a batch's answers, which is there once it has ended."""
        return self.run_folder / "batches" / f"{token}.answers.jsonl"


@dataclass(eq=False)
class Batch:
    """A batch: its line of intent, its newest state, and its answers when they are here.

    `places` are its requests by their keys in the reply cache, `held` their reservations in the
    budget. `following` is the work that ends when it has ended.
    """

    intent: BatchLine
    event: BatchEvent = "intended"
    id: str = ""
    places: dict[str, int] = field(default_factory=dict)
    held: dict[str, int] = field(default_factory=dict)
    following: asyncio.Future[None] | None = None
    answers: Answers | None = None

    def __post_init__(self) -> None:
        self.places = {key: place for place, key in enumerate(self.intent.keys)}

    @property
    def token(self) -> str:
        """Our name for it."""
        return self.intent.batch

    @property
    def shown(self) -> str:
        """Its name for people."""
        return self.id or self.token

    @property
    def created(self) -> datetime:
        """When it was about to be sent, in UTC; its answers are priced by that day."""
        return datetime.strptime(self.intent.time, "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)

    def most_usd(self, key: str) -> float:
        """Return the most that one of its requests can cost."""
        return self.intent.most_usd[self.places[key]] if self.intent.most_usd else 0.0


class Ledger:
    """The batches of one model; every change is on disk when `note` returns."""

    def __init__(self, model: str, files: BatchFiles) -> None:
        self._model = model
        self._files = files
        self.batches: dict[str, Batch] = {}
        for line in files.earlier:
            if line.model == model:
                self._take(line)

    def newest(self, key: str) -> Batch | None:
        """Return the last batch that a request went out in, or is about to."""
        return next((b for b in reversed(self.batches.values()) if key in b.places), None)

    async def note(self, token: str, event: BatchEvent, **fields: object) -> None:
        """Write the newest state of a batch; one that is `intended` counts as under way."""
        time = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        told = {"batch": token, "model": self._model, "event": event, "time": time, **fields}
        line = BatchLine.model_validate(told)
        await self._files.put(line)
        self._take(line)

    def _take(self, line: BatchLine) -> None:
        if line.event == "intended":
            self.batches[line.batch] = Batch(line)
        elif line.event == "lost":
            # Its requests count as not sent in it.
            self.batches.pop(line.batch).event = "lost"
        else:
            batch = self.batches[line.batch]
            batch.event, batch.id = line.event, line.id or batch.id


class Answers:
    """The first readable answer to each request of a batch that has one, by its place there; a text
    says why the request was never asked. `faults` counts other lines by what is wrong with them.
    """

    def __init__(self, lines: bytes, provider: BatchProvider, batch: Batch) -> None:
        self.found: dict[int, Answer | str] = {}
        self.faults: Counter[str] = Counter()
        places = {custom_id(batch.token, place): place for place in batch.places.values()}
        for line in filter(None, map(bytes.strip, lines.splitlines())):
            try:
                name, answer = provider.read(load_json(line))
                place = places.get(name)
            except UNREADABLE:
                self.faults["that cannot be read"] += 1
                continue
            if place is None:
                self.faults["to what was not asked"] += 1
            elif place in self.found:
                self.faults["to what has an answer already"] += 1
            else:
                self.found[place] = answer


def custom_id(token: str, place: int) -> str:
    """Return the name of a request in a batch."""
    return f"{token}-{place}"


def new_token() -> str:
    """Return a name that no other batch has; what the providers allow in names and boundaries."""
    return f"pb{secrets.token_hex(12)}"


def under_way(lines: Iterable[BatchLine]) -> dict[str, str]:
    """Return batches that have not ended, by the name of their model: one of each."""
    newest = {line.batch: line for line in lines}
    return {
        line.model: line.id or line.batch
        for line in newest.values()
        if line.event in ("intended", "created")
    }


def waiting_keys(
    config: ModelConfig, lines: Sequence[BatchLine], run_folder: Path
) -> frozenset[str]:
    """Return the requests that are not asked again, by their keys in the reply cache: of batches
    that have not ended all, of others those that were answered.
    """

    async def put(line: BatchLine) -> None:
        raise AssertionError(f"only read here: {line.event}")

    files = BatchFiles(tuple(lines), put, run_folder)
    provider = PROVIDERS[config.provider](config)
    waiting: set[str] = set()
    for batch in Ledger(config.name, files).batches.values():
        path = files.answers(batch.token)
        # Without its answers a batch stops its model: nothing of it is asked again.
        if batch.event != "ended" or not path.is_file():
            waiting |= batch.places.keys()
            continue
        found = Answers(path.read_bytes(), provider, batch).found
        for key, place in batch.places.items():
            answer = found.get(place)
            if isinstance(answer, Answer) and answer.is_success:
                waiting.add(key)
    return frozenset(waiting)
