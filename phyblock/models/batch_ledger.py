"""The batches of a run on disk: what is in which, how far each is, and its answers.

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
from phyblock.files import load_json, writing
from phyblock.models.batch_providers import PROVIDERS, UNREADABLE, BatchProvider
from phyblock.models.client import Answer
from phyblock.records.record import BatchEvent, BatchLine

_FOLDER = "batches"


@dataclass(frozen=True)
class BatchFiles:
    """Batches of a run as they are kept: the lines written so far, oldest first, and what appends
    one and returns when it is on disk; the run's folder. A batch is looked at every `poll_s` or
    more often.
    """

    earlier: tuple[BatchLine, ...]
    put: Callable[[BatchLine], Awaitable[None]]
    run_folder: Path
    poll_s: float = 60.0

    def requests(self, token: str) -> Path:
        """Return the file that a batch is sent from."""
        return self.run_folder / _FOLDER / f"{token}.requests"

    def answers(self, token: str) -> Path:
        """Return the file of a batch's answers, which is there once it has ended."""
        return self.run_folder / _FOLDER / f"{token}.answers.jsonl"


@dataclass(eq=False)
class Batch:
    """A batch: its line of intent, what became of it, and its answers when they are here.

    `places` are its requests by their keys in the reply cache, `held` their reservations in the
    budget. `following` is the work that ends when it has ended.
    """

    intent: BatchLine
    event: BatchEvent = "intended"
    id: str = ""
    is_complete: bool = True
    words: str = ""
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
        time = datetime.strptime(self.intent.time, "%Y-%m-%dT%H:%M:%SZ")
        return time.replace(tzinfo=UTC)

    def most_usd(self, key: str) -> float:
        """Return what one of its requests can cost."""
        costs = self.intent.most_usd
        return costs[self.places[key]] if costs else 0.0


class Ledger:
    """The batches of one model; every change is on disk when its method returns."""

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

    async def intend(
        self, token: str, keys: Iterable[str], most_usd: Iterable[float], *, seeded: bool
    ) -> Batch:
        """Begin a batch; it counts as under way from here."""
        requests = {"keys": tuple(keys), "most_usd": tuple(most_usd), "seeded": seeded}
        await self._put(token, "intended", **requests)
        return self.batches[token]

    async def note(self, batch: Batch, event: BatchEvent, **fields: object) -> None:
        """Write what became of a batch."""
        await self._put(batch.token, event, **fields)

    async def _put(self, token: str, event: BatchEvent, **fields: object) -> None:
        time = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
        told = {"batch": token, "model": self._model, "event": event, "time": time}
        line = BatchLine.model_validate({**told, **fields})
        await self._files.put(line)
        self._take(line)

    def _take(self, line: BatchLine) -> None:
        if line.event == "intended":
            self.batches[line.batch] = Batch(line)
            return
        batch = self.batches[line.batch]
        batch.event, batch.id = line.event, line.id or batch.id
        batch.is_complete, batch.words = line.is_complete, line.words
        if line.event == "lost":
            # Its requests count as not sent in it.
            del self.batches[batch.token]


class Answers:
    """The first readable answer to each request of a batch that has one, by its place there; a text
    says why the request was never asked. `faults` counts other lines by what is wrong with them.
    """

    def __init__(self, lines: bytes, provider: BatchProvider, batch: Batch) -> None:
        self.found: dict[int, Answer | str] = {}
        self.faults: Counter[str] = Counter()
        for line in filter(None, map(bytes.strip, lines.splitlines())):
            try:
                name, answer = provider.read(load_json(line))
            except UNREADABLE:
                self.faults["that cannot be read"] += 1
                continue
            place = _place_of(name, batch.token)
            if place is None or place >= len(batch.places):
                self.faults["to what was not asked"] += 1
            elif place in self.found:
                self.faults["to what has an answer already"] += 1
            else:
                self.found[place] = answer


def custom_id(token: str, place: int) -> str:
    """Return the name of a request in a batch."""
    return f"{token}-{place}"


def _place_of(name: object, token: str) -> int | None:
    """Return the place of a request in the batch by its name; None for one of another batch."""
    start, _, number = name.rpartition("-") if isinstance(name, str) else ("", "", "")
    is_ours = start == token and number.isascii() and number.isdecimal() and len(number) < 10
    return int(number) if is_ours else None


def new_token() -> str:
    """Return a name that no other batch has; what the providers allow in names and boundaries."""
    return f"pb{secrets.token_hex(12)}"


def remove_unfinished(run_folder: Path) -> None:
    """Remove what killed commands left half written: it is written anew where it is needed.

    Only for who holds the run folder, before it sends a batch. Raises StoreError where the disk
    refuses.
    """
    folder = run_folder / _FOLDER
    with writing(folder):
        for path in (*folder.glob("pb*.requests"), *folder.glob(".*.part")):
            path.unlink()


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
