"""The batches of a model, as their lines on disk tell: what is in which, and how far each is.

A line says that a batch is about to be sent, with the requests in it, before anything of it leaves
this machine. So a kill at any moment leaves a batch that is done, one that can be asked about by
its id, or one that can be looked for under our name.
"""

from __future__ import annotations

import asyncio
import re
import secrets
from collections.abc import Awaitable, Callable, Iterable
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from pathlib import Path

from phyblock.files import writing
from phyblock.models.batches.results import Results
from phyblock.records.record import BatchEvent, BatchLine

__all__ = ["Batch", "BatchFiles", "Ledger", "new_token", "remove_unfinished", "under_way"]

_FOLDER = "batches"
_UNFINISHED = re.compile(r"pb[0-9a-f]{24}\.(?:requests|candidate|answers\.part)")
"""Names of the files that a batch is sent from, and is looked for and fetched into."""


@dataclass(frozen=True)
class BatchFiles:
    """Where batches of a run are kept: the lines written so far, oldest first, and what appends
    one and returns when it is on disk; the run's folder. A batch is looked at every `poll_s` or
    more often.
    """

    earlier: tuple[BatchLine, ...]
    put: Callable[[BatchLine], Awaitable[None]]
    run_folder: Path
    poll_s: float = 60.0

    @property
    def folder(self) -> Path:
        """Where requests and answers lie."""
        return self.run_folder / _FOLDER

    def requests(self, token: str) -> Path:
        """Where a batch is written before it is sent."""
        return self.folder / f"{token}.requests"

    def candidate(self, token: str) -> Path:
        """The answers of one that may be a batch that is looked for."""
        return self.folder / f"{token}.candidate"

    def answers(self, token: str) -> Path:
        """The answers of a batch, once it has ended."""
        return self.folder / f"{token}.answers.jsonl"

    def half_fetched(self, token: str) -> Path:
        """The answers of a batch while they are fetched."""
        return self.folder / f"{token}.answers.part"


@dataclass(eq=False)
class Batch:
    """A batch: its line of intent, what became of it, and its answers when they are here.

    `held` are the reservations of its requests in the budget,
    `following` the work that ends when it has ended.
    """

    intent: BatchLine
    event: BatchEvent = "intended"
    id: str = ""
    is_complete: bool = True
    following: asyncio.Future[None] | None = None
    results: Results | None = None
    words: str = ""
    places: dict[str, int] = field(default_factory=dict)
    held: dict[str, int] = field(default_factory=dict)

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
        """When it was about to be sent, in UTC."""
        time = datetime.strptime(self.intent.time, "%Y-%m-%dT%H:%M:%SZ")
        return time.replace(tzinfo=UTC)

    @property
    def created_s(self) -> float:
        """As Unix time."""
        return self.created.timestamp()

    @property
    def day(self) -> date:
        """The day by which its answers are priced, whenever they are read."""
        return self.created.date()

    def most_usd(self, key: str) -> float:
        """What one of its requests can cost."""
        costs = self.intent.most_usd
        return costs[self.places[key]] if costs else 0.0


class Ledger:
    """The batches of one model; every change is on disk when its method returns."""

    def __init__(self, model: str, files: BatchFiles) -> None:
        self._model = model
        self._files = files
        self.batches: dict[str, Batch] = {}
        self._newest: dict[str, Batch] = {}
        for line in files.earlier:
            if line.model == model:
                self._take(line)

    def newest(self, key: str) -> Batch | None:
        """The last batch that a request went out in, or is about to."""
        return self._newest.get(key)

    @property
    def ids(self) -> frozenset[str]:
        """The provider's names of all batches."""
        return frozenset(batch.id for batch in self.batches.values() if batch.id)

    async def intend(
        self, token: str, keys: Iterable[str], most_usd: Iterable[float], *, seeded: bool
    ) -> Batch:
        """Begin a batch; it counts as under way from here."""
        line = BatchLine(
            batch=token,
            model=self._model,
            event="intended",
            time=_now(),
            keys=tuple(keys),
            most_usd=tuple(most_usd),
            seeded=seeded,
        )
        await self._files.put(line)
        return self._take(line)

    async def tell(self, batch: Batch, event: BatchEvent, **fields: object) -> None:
        """Say what became of a batch."""
        told = {"batch": batch.token, "model": self._model, "event": event, "time": _now()}
        line = BatchLine.model_validate({**told, **fields})
        await self._files.put(line)
        self._take(line)

    def _take(self, line: BatchLine) -> Batch:
        if line.event == "intended":
            batch = self.batches[line.batch] = Batch(line)
            self._newest.update(dict.fromkeys(line.keys, batch))
            return batch
        batch = self.batches[line.batch]
        batch.event, batch.id = line.event, line.id or batch.id
        batch.is_complete, batch.words = line.is_complete, line.words
        if line.event == "lost":
            self._forget(batch)
        return batch

    def _forget(self, batch: Batch) -> None:
        """Requests of a batch that there never was count as not sent in it."""
        del self.batches[batch.token]
        for key in batch.places:
            if self._newest.get(key) is batch:
                del self._newest[key]
        for earlier in self.batches.values():
            self._newest.update({k: earlier for k in earlier.places if k in batch.places})


def new_token() -> str:
    """A name that no other batch has; what the providers allow in names and boundaries."""
    return f"pb{secrets.token_hex(12)}"


def remove_unfinished(run_folder: Path) -> None:
    """Remove what killed commands left half written: it is written anew where it is needed.

    Only for who holds the run folder, before it sends a batch. Raises StoreError where the disk
    refuses.
    """
    folder = run_folder / _FOLDER
    with writing(folder):
        for path in folder.iterdir() if folder.is_dir() else ():
            if _UNFINISHED.fullmatch(path.name):
                path.unlink()


def under_way(lines: Iterable[BatchLine]) -> dict[str, str]:
    """Batches that have not ended, by the name of their model: one of each."""
    newest = {line.batch: line for line in lines}
    return {
        line.model: line.id or line.batch
        for line in newest.values()
        if line.event in ("intended", "created")
    }


def _now() -> str:
    return datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
