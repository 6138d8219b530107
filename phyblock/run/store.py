"""Writing a run: `run.yaml`, written first, and the files that grow.

A record counts only when it is appended and synced, so a kill at any moment loses nothing that was
written; a line that a kill cut short is dropped when the run is opened again. A later record of a
sample replaces an earlier one.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import json
import os
import re
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from io import FileIO
from pathlib import Path
from typing import Any, TypeVar

from phyblock.config.models import ModelConfig
from phyblock.config.yaml import dump_yaml
from phyblock.errors import Problem, StoreError
from phyblock.files import LIST, OutFolder, append_whole, atomic_write, sync_folder, writing
from phyblock.models.cache import reply_key
from phyblock.models.request import Image, Message, Model, Request
from phyblock.records.files import (
    BATCHES,
    CALLS,
    PROMPTS,
    RECORDS,
    STOPPED,
    BatchLines,
    CallLines,
    Lines,
    PromptLines,
    RecordLines,
    Validation,
    read_stopped,
    run_records,
)
from phyblock.records.line import Line, encodable
from phyblock.records.manifest import MANIFEST, Manifest, read_manifest
from phyblock.records.record import Call, PictureMark, Prompt, PromptMessage, Record, Reply, Stopped
from phyblock.run.events import Standing
from phyblock.run.manifest import code_versions, differences, reasons
from phyblock.stable import hex_digest

LineT = TypeVar("LineT", bound=Line)

_HINT = "choose another folder with --out"


class RunStore:
    """A run folder opened for writing; one process at a time.

    `records`, `calls` and `batches` are synced line by line; `prompts` hold what could be made
    again. `standing` is how far the run was when it was opened.
    """

    def __init__(self, folder: Path, manifest: Manifest, samples: Collection[str]) -> None:
        """Open `folder` for the run that `manifest` describes, creating it when it is new.

        `samples` are the ids of the run's samples. Raises StoreError when the folder cannot be
        written, holds records of another run, or is being written by another process.
        """
        self.standing = Standing()
        self._folder = folder
        self._validation = Validation(manifest, samples)
        self._lock = ExitStack()
        self._files: list[AppendFile] = []
        try:
            with writing(folder, _HINT):
                check_place(folder)
                OutFolder(folder).claim([])
                self._lock.enter_context(locked(folder))
                self._claim(manifest)
                records = run_records(folder, manifest, samples, whole=True)
                self.records = self._open(records, self.standing.add)
                calls = CallLines(folder, self._validation)
                self.calls = self._open(calls, self.standing.add_call)
                batches = BatchLines(folder)
                self.batches = self._open(batches, self.standing.batches.append)
                known: set[str] = set()
                prompts = PromptLines(folder)
                file = self._open(prompts, lambda one: known.add(one.sha256), sync=False)
                self.prompts = PromptFile(file, known)
        except StoreError:
            self.close()
            raise

    def __enter__(self) -> RunStore:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the files and the lock, once what is being written is written."""
        for file in self._files:
            file.close()
        self._lock.close()

    def note_stopped(self, models: Mapping[str, str], run: str, asked: Collection[str]) -> None:
        """Keep why the models `asked` about, or the whole run, were stopped, for whoever reads it.

        What an earlier session says of other models stays. Raises StoreError where the folder
        cannot be written.
        """
        earlier = read_stopped(self._folder).models
        kept = {name: why for name, why in earlier.items() if name not in asked}
        stopped = Stopped(models={**kept, **models}, run=run)
        folder = OutFolder(self._folder)
        if stopped.models or stopped.run:
            folder.write({STOPPED: json.dumps(stopped.fields(), indent=2) + "\n"})
        else:
            folder.remove([STOPPED])

    def _open(
        self,
        lines: Lines[LineT],
        take: Callable[[LineT], None] = lambda _: None,
        *,
        sync: bool = True,
    ) -> AppendFile:
        """Open a file for appending, rid of a line that a kill cut short; `take` sees the rest."""
        file = AppendFile(lines.path, sync=sync)
        self._files.append(file)
        for _, line in lines:
            take(line)
        if lines.is_cut:
            os.truncate(lines.path, lines.whole_bytes)
        elif lines.lacks_newline:
            file.end_line()
        return file

    def _claim(self, manifest: Manifest) -> None:
        found = held_run(self._folder, manifest)
        if found is not None:
            if _selection(found) == _selection(manifest):
                return
            named = {model.name for model in manifest.models}
            others = [m for m in (*found.models, *found.others) if m.name not in named]
            changes = {"created": found.created, "others": tuple(others)}
            manifest = manifest.model_copy(update=changes)
        with writing(self._folder, _HINT):
            atomic_write(self._folder / MANIFEST, manifest_text(manifest), sync=True)


def _selection(manifest: Manifest) -> tuple[list[str], object]:
    """The models and seeds of a run, of which a command may name others than the last."""
    return [model.name for model in manifest.models], manifest.suite.get("seeds")


def held_run(folder: Path, manifest: Manifest) -> Manifest | None:
    """Return the manifest in `folder`, which holds the run that `manifest` describes; None where it
    holds no run. Nothing is written.

    Raises StoreError when it holds records or calls of another run, of a run that another version
    of phyblock began, or what is no run. A manifest without any is no run yet: one that failed at
    once leaves it behind, and nothing would be lost with it.
    """
    check_place(folder)
    if not (folder / MANIFEST).exists():
        return None
    found = read_manifest(folder)
    paid: tuple[Lines[Any], ...] = (RecordLines(folder), CallLines(folder), BatchLines(folder))
    if all(next(iter(lines), None) is None for lines in paid):
        return None
    if differ := differences(found, manifest):
        changed = f"different: {', '.join(differ)}"
        hint = "; ".join((*reasons(found, manifest), _HINT))
        raise StoreError(Problem(str(folder), "holds another run", found=changed, hint=hint))
    if differ := [
        name for name in code_versions() if found.versions.get(name) != manifest.versions[name]
    ]:
        made, here = (
            ", ".join(f"{name} {one.versions.get(name, 'unknown')}" for name in differ)
            for one in (found, manifest)
        )
        message = "was judged by another version of phyblock"
        hint = f"phyblock score {folder} first: it judges the replies again and asks nobody"
        raise StoreError(Problem(str(folder), message, found=made, allowed=here, hint=hint))
    return found


_HINT_APPENDING = "free some space and give the same command again: it goes on from here"


class AppendFile:
    """Lines that are on disk when `append` returns; safe to call from several threads.

    The file is made with the first line.
    """

    def __init__(self, path: Path, *, sync: bool = True) -> None:
        """Without `sync` lines survive the death of the process, not that of the machine."""
        self._path = path
        self._sync = sync
        self._writing = threading.Lock()
        self._file: FileIO | None = None
        self._size_bytes = 0

    def append(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Write objects, a line each, and wait until they are on disk.

        Raises StoreError when the disk refuses, or when somebody else removed, replaced or changed
        the file meanwhile; what was written before stays whole.
        """
        data = b"".join(_line(line) for line in lines)
        with self._writing:
            self._append(data)

    def end_line(self) -> None:
        """Write the newline that the last line lacks."""
        with FileIO(self._path, "a") as file:
            file.write(b"\n")

    def check(self) -> None:
        """Raise StoreError unless the file that was written is the one at its path, and whole."""
        with self._writing:
            if self._file is not None:
                self._check(self._file.fileno())

    def close(self) -> None:
        """Close the file, once what is being written is written."""
        with self._writing:
            if self._file is not None:
                self._file.close()
                self._file = None

    def _append(self, data: bytes) -> None:
        with writing(self._path, _HINT_APPENDING):
            if self._file is None:
                # Unbuffered: a write that failed must not be tried again behind our back.
                self._file = FileIO(self._path, "a")
                self._size_bytes = os.fstat(self._file.fileno()).st_size
                if self._sync:
                    sync_folder(self._path.parent)
            self._check(self._file.fileno())
            append_whole(self._file.fileno(), data, sync=self._sync)
            self._size_bytes += len(data)

    def _check(self, number: int) -> None:
        opened = os.fstat(number)
        try:
            there = os.stat(self._path)
            is_same = os.path.samestat(opened, there)
        except FileNotFoundError:
            is_same = False
        if not is_same or opened.st_size != self._size_bytes:
            message = "was removed, replaced or changed while the run was writing it"
            hint = f"restore it from a copy; replies that have arrived are in {CALLS}"
            raise StoreError(Problem(str(self._path), message, hint=hint))


def _line(line: Mapping[str, Any]) -> bytes:
    text = json.dumps(line, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.encode("utf-8", "replace") + b"\n"


LOCK = ".lock"
_OWN = (MANIFEST, RECORDS, CALLS, PROMPTS, BATCHES, "batches", LOCK, LIST)
_BEGUN = re.compile(rf"{re.escape(LOCK)}|{re.escape(LIST)}|\.[0-9a-f]{{32}}\.part")
"""What a run that was killed before it had a manifest leaves behind."""


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a run folder, which one process writes; StoreError where another does."""
    with (folder / LOCK).open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            hint = "wait for it to end, or choose another folder with --out"
            message = "is being written by another phyblock run"
            raise StoreError(Problem(str(folder), message, hint=hint)) from error
        yield


def check_place(folder: Path) -> None:
    """Raise StoreError unless `folder` is new, empty or a run's; nothing is written.

    A folder without our manifest that holds anything is somebody's: a run makes names of its own
    in it. What a run grows must be files of the folder itself, no links to others.
    """
    with writing(folder, _HINT):
        try:
            os.lstat(folder)
        except FileNotFoundError:
            return
        names = {entry.name for entry in os.scandir(folder)}
    strangers = sorted(name for name in names if not _BEGUN.fullmatch(name))
    if MANIFEST not in names and strangers:
        found = ", ".join(strangers[:3]) + (", ..." if len(strangers) > 3 else "")
        message = f"is not empty and holds no run (no {MANIFEST})"
        hint = "name a new or an empty folder with --out"
        raise StoreError(Problem(str(folder), message, found=found, hint=hint))
    links = [folder / name for name in _OWN if (folder / name).is_symlink()]
    if links:
        message = "is a link, and a run writes nowhere but in its own folder"
        raise StoreError([Problem(str(path), message, hint=_HINT) for path in links])


def write_run(folder: Path, manifest: Manifest, records: Iterable[Record]) -> None:
    """Write manifest and records of a run; raises StoreError where the disk refuses."""
    lines = (line.encode("utf-8", "replace") for line in record_lines(records))
    files: dict[str, str | Iterator[bytes]] = {RECORDS: lines, MANIFEST: manifest_text(manifest)}
    # Where a run is replaced, a kill between the two leaves one that has to be scored again.
    names = (RECORDS, MANIFEST) if (folder / MANIFEST).exists() else (MANIFEST, RECORDS)
    OutFolder(folder).claim([])
    for name in names:
        with writing(folder / name):
            atomic_write(folder / name, files[name], sync=True)


def manifest_text(manifest: Manifest) -> str:
    """`run.yaml`."""
    return dump_yaml(manifest.fields())


def record_lines(records: Iterable[Record]) -> Iterator[str]:
    """`records.jsonl`, line by line: the same text for the same records."""
    for record in records:
        yield json.dumps(record.fields(), ensure_ascii=False, separators=(",", ":")) + "\n"


class RecordWriter:
    """Appends records off the event loop; `put` returns when its record is synced."""

    def __init__(self, file: AppendFile) -> None:
        self._file = file
        self._waiting: list[tuple[Line, asyncio.Future[None]]] = []
        self._flusher: asyncio.Task[None] | None = None

    async def put(self, record: Line) -> None:
        """Append a record and wait until it is on disk; StoreError when the disk refuses."""
        written: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.append((record, written))
        if self._flusher is None:
            self._flusher = asyncio.create_task(self._flush())
        await written

    async def drain(self) -> None:
        """Wait until everything that was put is on disk or refused."""
        if self._flusher is not None:
            await self._flusher

    async def _flush(self) -> None:
        while self._waiting:
            batch, self._waiting = self._waiting, []
            failure: Exception | None = None
            try:
                await asyncio.to_thread(self._file.append, [line.fields() for line, _ in batch])
            except Exception as error:
                # Whatever it is, those who wait must hear of it, or they wait for ever.
                failure = error
            # A waiter that was cancelled has a future that is already done.
            for written in (future for _, future in batch if not future.done()):
                if failure is None:
                    written.set_result(None)
                else:
                    written.set_exception(failure)
        self._flusher = None


class PromptFile:
    """Prompts on their way to disk, each once."""

    def __init__(self, file: AppendFile, known: set[str]) -> None:
        self._file = file
        self._known = known

    def keep(self, messages: Sequence[Message]) -> str:
        """Write a prompt unless it is there; its digest. Raises StoreError as the file does."""
        prompt = prompt_of(messages)
        if prompt.sha256 not in self._known:
            self._known.add(prompt.sha256)
            self._file.append([prompt.fields()])
        return prompt.sha256


def prompt_of(messages: Sequence[Message]) -> Prompt:
    """Return messages as they are kept, with the labels of pictures in their place."""
    content = tuple(_content(message) for message in messages)
    fields = [message.fields() for message in content]
    digest = hex_digest(json.dumps(fields, sort_keys=True, separators=(",", ":")))
    return Prompt(sha256=digest, messages=content)


def _content(message: Message) -> PromptMessage:
    parts = (
        PictureMark(image=part.label) if isinstance(part, Image) else encodable(part)
        for part in message.parts
    )
    return PromptMessage(role=message.role, parts=tuple(parts))


class CallJournal:
    """The calls of a run, each on disk before it is sent, and with its reply before that is judged.

    What an earlier command was answered and no record holds is kept in `replies` by its key.
    """

    def __init__(self, writer: RecordWriter, run: str, standing: Standing) -> None:
        self._writer = writer
        self._run = run
        self._next = standing.calls
        self._replies = standing.replies

    def kept(self, key: str) -> Reply | None:
        """Return the reply to a request that an earlier command was answered, or None."""
        return self._replies.get(key)

    async def sent(self, model: str, sample: str, key: str, most_usd: float | None) -> Call:
        """Write a call that is about to be sent; StoreError where the disk refuses."""
        number, self._next = self._next, self._next + 1
        call = Call(
            call=number, model=model, sample=sample, key=key, run=self._run, most_usd=most_usd
        )
        await self._writer.put(call)
        return call

    async def ended(self, call: Call, billed_usd: float | None, reply: Reply | None) -> None:
        """Write what became of a call; StoreError where the disk refuses."""
        stored = None if reply is None else reply.storable()
        known = {"ended": True, "billed_usd": billed_usd, "reply": stored}
        await self._writer.put(call.model_copy(update=known))


class Journaled:
    """A model that answers here and cannot be asked again: its answers are written as they come."""

    needs_messages = True

    def __init__(self, model: Model, config: ModelConfig, journal: CallJournal) -> None:
        self.name = model.name
        self._model = model
        self._config = config
        self._journal = journal

    async def ask(self, request: Request) -> Reply | None:
        """Return the answer of the model, or that which it gave to an earlier command."""
        key = reply_key(self._config, request)
        if (kept := self._journal.kept(key)) is not None:
            return kept
        reply = await self._model.ask(request)
        if reply is not None:
            call = await self._journal.sent(self.name, request.sample, key, 0.0)
            await self._journal.ended(call, 0.0, reply)
        return reply

    async def aclose(self) -> None:
        """Release what the model holds."""
        await self._model.aclose()
