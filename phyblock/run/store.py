"""The records of a run: judged, written, replaced; `run.yaml`, written first, and other files.

A record counts once it is appended and synced, so a kill loses nothing that was written; a line
that it cut short is dropped when the run is opened again. A later record replaces an earlier one.
"""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import json
import os
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import UTC, datetime
from io import FileIO
from pathlib import Path
from typing import Any, NamedTuple

from phyblock.config.yaml import dump_yaml
from phyblock.errors import ModelError, Problem, SimulationError, StoreError
from phyblock.files import LIST, OutFolder, append_whole, atomic_write, sync_folder, writing
from phyblock.models.request import Image, Request
from phyblock.records import files
from phyblock.records.files import Lines, LineT, Manifest
from phyblock.records.record import BatchLine, Call, Line, Record, Reply, SentPrompt, StoredError
from phyblock.run.manifest import code_versions, differences
from phyblock.scoring.plan import Counts
from phyblock.text import counted, hex_digest, plain_sum, some_of, well_formed
from phyblock.tracks.base import Episode, Item, Judgement, Track
from phyblock.types import Outcome

_HEADLINE = "aov"
_OTHER_FOLDER = "choose another folder with --out"
_APPENDING = "free some space and run the same command again to continue"


class AppendFile:
    """Lines that are on disk when `append` or `put` returns; created with the first line."""

    def __init__(self, path: Path, *, sync: bool = True) -> None:
        """Without `sync`, lines survive a crash of the process, but not of the machine."""
        self._path = path
        self._sync = sync
        self._file: FileIO | None = None
        self._size_bytes = 0
        self._waiting: list[tuple[Line, asyncio.Future[None]]] = []
        self._flusher: asyncio.Task[None] | None = None

    def append(self, lines: Iterable[Mapping[str, Any]]) -> None:
        """Write objects, one per line, and wait until they are on disk.

        Raises StoreError if the disk fails or somebody changed the file; earlier lines stay whole.
        """
        data = "".join(f"{_json_line(line)}\n" for line in lines).encode("utf-8", "replace")
        with writing(self._path, _APPENDING):
            if self._file is None:
                # Unbuffered: a failed write must not be repeated implicitly.
                self._file = FileIO(self._path, "a")
                self._size_bytes = os.fstat(self._file.fileno()).st_size
                if self._sync:
                    sync_folder(self._path.parent)
            self.check()
            append_whole(self._file.fileno(), data, sync=self._sync)
            self._size_bytes += len(data)

    async def put(self, line: Line) -> None:
        """Append a line, with others that wait, outside of the event loop; raises as `append`."""
        written: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._waiting.append((line, written))
        if self._flusher is None:
            self._flusher = asyncio.create_task(self._flush())
        await written

    async def _flush(self) -> None:
        while self._waiting:
            batch, self._waiting = self._waiting, []
            failure: Exception | None = None
            try:
                await asyncio.to_thread(self.append, [line.fields() for line, _ in batch])
            except Exception as error:
                # Waiters must get every exception, or they wait forever.
                failure = error
            # The future of a cancelled waiter is already done.
            for written in (future for _, future in batch if not future.done()):
                if failure is None:
                    written.set_result(None)
                else:
                    written.set_exception(failure)
        self._flusher = None

    async def drain(self) -> None:
        """Wait until everything that was put is on disk or has failed."""
        if self._flusher is not None:
            await self._flusher

    def check(self) -> None:
        """Raise StoreError unless the file that was written is the one at its path, and whole."""
        if self._file is None:
            return
        opened, is_same = os.fstat(self._file.fileno()), False
        with contextlib.suppress(FileNotFoundError):
            is_same = os.path.samestat(opened, os.stat(self._path))
        if not is_same or opened.st_size != self._size_bytes:
            message = "was removed, replaced or changed while the run was writing it"
            hint = f"restore it from a copy; replies that have arrived are in {files.CALLS}"
            raise StoreError(Problem(str(self._path), message, hint=hint))

    def close(self) -> None:
        """Close the file, once everything that was put is written."""
        if self._file is not None:
            self._file.close()
            self._file = None


Answer = Reply | ModelError | None
"""The outcome of a request; None is a reply that is missing in a recording."""


def begun(
    sample: str, track: Track, model: str, item: Item, seed: int, answer: Answer
) -> dict[str, Any]:
    """Return the fields of a record before its answer is judged."""
    error = None
    if isinstance(answer, ModelError):
        known = {"kind": answer.kind, "status": answer.status, "billed_usd": answer.billed_usd}
        error = StoredError.model_validate({**known, "message": str(answer)})
    return {
        "sample": sample,
        "track": track.name,
        "model": model,
        "key": item.key,
        **about_item(track, item),
        "seed": seed,
        "reply": answer.storable() if isinstance(answer, Reply) else None,
        "error": error,
        "prompt": None,
        "parse": None,
        "scores": (),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def about_item(track: Track, item: Item) -> dict[str, Any]:
    """Return the fields of a record about its item: its scene, and what the track adds."""
    scene = item.scene
    facts = {"scene": scene.id, "levels": scene.levels, "parents": scene.parents}
    return {**facts, "n_blocks": len(scene), **track.about(item)}


def judged(track: Track, item: Item, fields: Mapping[str, Any], judgement: Judgement) -> Record:
    """Return a record, from the fields of an unjudged or earlier one, with judgement and counts."""
    reply, error = fields["reply"], fields["error"]
    outcome: Outcome = "ok" if judgement.is_read else "parse_failure"
    if error is not None:
        outcome = "refusal" if error.kind == "refused" else "api_error"
    elif reply is None:
        outcome = "missing"
    elif reply.finish in ("refusal", "length"):
        outcome = "refusal" if reply.finish == "refusal" else "truncated"
    found = {**fields, "outcome": outcome, **judgement.fields}
    record = track.record_type().model_validate(found)
    if counts := track.counts(item, record):
        record = record.model_copy(update={"counts": {**record.counts, **counts}})
    return record


def judge_episode(
    track: Track, item: Item, fields: Mapping[str, Any], episode: Episode, replies: Sequence[Reply]
) -> Record:
    """Return the record of an episode so far, with the sum of these replies and the last text.

    The sum counts as truncated or refused only if all of them are, and is unknown where a part is.
    """
    judgement = episode.judgement()
    if not replies:
        return judged(track, item, fields, judgement)

    def total(values: list[Any]) -> Any:
        return None if None in values else plain_sum(values)

    billed = [reply.billed_usd for reply in replies if reply.billed_usd is not None]
    ends = {reply.finish for reply in replies}
    usages, kinds = [reply.usage for reply in replies], type(replies[0].usage).model_fields
    tokens = {name: total([getattr(one, name) for one in usages]) for name in kinds}
    pooled = Reply(
        text=replies[-1].text,
        finish=ends.pop() if len(ends) == 1 else "stop",
        usage=usages[0].model_copy(update=tokens),
        cost_usd=total([reply.cost_usd for reply in replies]),
        billed_usd=plain_sum(billed) if billed else None,
        latency_s=plain_sum(reply.latency_s for reply in replies),
        provider_model=replies[-1].provider_model,
        attempts=sum(reply.attempts for reply in replies),
        cached=all(reply.cached for reply in replies),
        seed_sent=all(reply.seed_sent for reply in replies),
    )
    first = judgement.fields["turns"][0]["prompt"]
    return judged(track, item, {**fields, "reply": pooled.storable(), "prompt": first}, judgement)


async def judge_reply(
    track: Track, item: Item, fields: Mapping[str, Any], earlier: Record | None = None
) -> Record:
    """Return the record of a single request, judged now or again after an `earlier` record.

    If no engine could execute the reply, the record says so and can be rescored.
    """
    reply = fields["reply"]
    text = None if reply is None else reply.text
    try:
        return judged(track, item, fields, await track.judge_apart(item, text, earlier))
    except SimulationError as error:
        if text is None:
            raise
        lacking = StoredError(kind="unjudged", message=str(error))
        nothing = await track.judge_apart(item, None, None)
        return judged(track, item, {**fields, "error": lacking}, nothing)


class Summary(NamedTuple):
    """The part of a record that live progress needs; `counts` are those of the headline.

    `paid_usd` is None if a price is unknown, `cached` None without a reply.
    """

    model: str
    outcome: str
    is_answered: bool
    is_final: bool
    is_judged: bool
    counts: Counts | None
    cached: bool | None
    paid_usd: float | None

    @classmethod
    def of(cls, record: Record) -> Summary:
        """Return the summary of a record."""
        headline = next((s for s in record.scores if s.criterion == _HEADLINE), None)
        counts = None if headline is None else Counts(headline.tp, headline.fp, headline.fn)
        cached = None if record.reply is None else record.reply.cached
        known = record.model, record.outcome, record.is_answered, record.is_final, record.is_judged
        return cls(*known, counts, cached, record.paid_usd)


@dataclass
class Progress:
    """The summary of the newest record of every sample, and the cost of the run so far.

    `batches` are lines about batches, oldest first; `calls` counts calls; `replies` are those
    without a final record, by key, `unanswered` calls without a known end, which may be billed.
    """

    samples: dict[str, Summary] = field(default_factory=dict)
    batches: list[BatchLine] = field(default_factory=list)
    calls: int = 0
    replies: dict[str, Reply] = field(default_factory=dict)
    unanswered: dict[int, Call] = field(default_factory=dict)
    _calls_usd: float = 0.0
    _records_usd: dict[str, float] = field(default_factory=dict)

    def add(self, record: Record) -> None:
        """Add a record; records come oldest first."""
        name = record.sample
        self.samples[name] = Summary.of(record)
        self._records_usd[name] = self._records_usd.get(name, 0.0) + record.limit_usd

    def add_call(self, call: Call) -> None:
        """Add a line about a call, oldest first, after all records."""
        self.calls = max(self.calls, call.call + 1)
        # The cost of a single call is counted here, that of one in a batch by its record.
        self._records_usd.pop(call.sample, None)
        if not call.ended:
            self.unanswered[call.call] = call
            return
        self.unanswered.pop(call.call, None)
        self._calls_usd += call.billed_usd or 0.0
        sample = self.samples.get(call.sample)
        if call.reply is not None and not (sample and sample.is_final):
            self.replies[call.key] = call.reply

    @property
    def limit_usd(self) -> float:
        """Return the cost that a limit counts [US dollars]; calls without a known end in full."""
        most = (call.most_usd or 0.0 for call in self.unanswered.values())
        return plain_sum((self._calls_usd, *most, *self._records_usd.values()))

    @property
    def unanswered_text(self) -> str:
        """Return a sentence on calls without a known end, or ""."""
        if not self.unanswered:
            return ""
        usd = [call.most_usd for call in self.unanswered.values()]
        known = [cost for cost in usd if cost is not None]
        most = f" (${sum(known):,.4f} at most)" if len(known) == len(usd) else ""
        return f"{counted(len(usd), 'call')} may have been billed without a reply{most}"


class RunStore:
    """A run folder opened for writing, and the journal of the run's calls; one process at a time.

    `records` and `batches` are synced line by line. `progress` is that when the folder was opened;
    its replies without a record are not requested again. `run` is the digest in this run's records.
    """

    def __init__(self, folder: Path, manifest: Manifest, samples: Collection[str]) -> None:
        """Open `folder` for the run that `manifest` describes, creating it when it is new.

        `samples` are ids. Raises StoreError if it cannot be written, is in use or has another run.
        """
        self.progress = Progress()
        self._folder = folder
        self.run = manifest.run
        self._prompts_known: set[str] = set()
        with writing(folder, _OTHER_FOLDER), ExitStack() as self._open:
            check_place(folder)
            OutFolder(folder).claim([])
            self._open.enter_context(locked(folder))
            self._claim(manifest)
            records = files.run_records(folder, manifest, samples, whole=True)
            self.records = self._file(records, self.progress.add)
            calls = files.CallLines(folder, files.Validation(manifest, samples))
            self.calls = self._file(calls, self.progress.add_call)
            self.batches = self._file(files.BatchLines(folder), self.progress.batches.append)
            # Prompts can be made again.
            prompts, known = files.PromptLines(folder), self._prompts_known
            self._prompts = self._file(prompts, lambda one: known.add(one.sha256), sync=False)
            self._open = self._open.pop_all()

    def close(self) -> None:
        """Release the files and the lock after pending writes."""
        self._open.close()

    def kept(self, key: str) -> Reply | None:
        """Return the reply to a request of an earlier command, or None."""
        return self.progress.replies.get(key)

    async def sent(self, model: str, sample: str, key: str, most_usd: float | None) -> Call:
        """Write a call that is about to be sent. Raises StoreError if the disk fails."""
        about = {"call": self.progress.calls, "model": model, "sample": sample, "key": key}
        call = Call.model_validate({**about, "run": self.run, "most_usd": most_usd})
        self.progress.calls += 1
        await self.calls.put(call)
        return call

    async def ended(self, call: Call, billed_usd: float | None, reply: Reply | None) -> None:
        """Write the end of a call. Raises StoreError if the disk fails."""
        stored = None if reply is None else reply.storable()
        known = {"ended": True, "billed_usd": billed_usd, "reply": stored}
        await self.calls.put(call.model_copy(update=known))

    def keep_prompt(self, request: Request, template: str) -> SentPrompt:
        """Write a prompt unless it is stored; return its part of a record. Raises as `append`."""

        def stored(part: str | Image) -> object:
            return {"image": part.label} if isinstance(part, Image) else well_formed(part)

        fields = [{"role": m.role, "parts": [*map(stored, m.parts)]} for m in request.messages]
        digest = hex_digest(json.dumps(fields, sort_keys=True, separators=(",", ":")))
        if digest not in self._prompts_known:
            self._prompts_known.add(digest)
            self._prompts.append([{"sha256": digest, "messages": fields}])
        about = {"template": template, "version": request.prompt_version, "messages": digest}
        sent = {**about, "images": request.images}
        return SentPrompt.model_validate(sent, from_attributes=True)

    def note_stopped(self, models: Mapping[str, str], run: str, asked: Collection[str]) -> None:
        """Write why the models among `asked`, or the whole run, were stopped.

        Earlier entries about other models are kept. Raises StoreError if the disk fails.
        """
        earlier = files.read_stopped(self._folder)
        kept = {name: why for name, why in earlier.models.items() if name not in asked}
        stopped = earlier.model_copy(update={"models": {**kept, **models}, "run": run})
        folder = OutFolder(self._folder)
        if stopped.models or stopped.run:
            folder.write({files.STOPPED: json.dumps(stopped.fields(), indent=2) + "\n"})
        else:
            folder.remove([files.STOPPED])

    def _file(
        self, lines: Lines[LineT], take: Callable[[LineT], object], *, sync: bool = True
    ) -> AppendFile:
        """Open a file for appending, without an unfinished last line; `take` gets the others."""
        file = AppendFile(lines.path, sync=sync)
        self._open.callback(file.close)
        for _, line in lines:
            take(line)
        if lines.is_cut:
            os.truncate(lines.path, lines.whole_bytes)
        elif lines.lacks_newline:
            with FileIO(lines.path, "a") as end:
                end.write(b"\n")
        return file

    def _claim(self, manifest: Manifest) -> None:
        """Write the manifest unless the folder has one with the same selection."""
        found = held_run(self._folder, manifest)
        if found is not None:
            old, new = ([model.name for model in one.models] for one in (found, manifest))
            if old == new and found.suite.get("seeds") == manifest.suite.get("seeds"):
                return
            others = [m for m in (*found.models, *found.others) if m.name not in new]
            changes = {"created": found.created, "others": tuple(others)}
            manifest = manifest.model_copy(update=changes)
        atomic_write(self._folder / files.MANIFEST, dump_yaml(manifest.fields()), sync=True)


def held_run(folder: Path, manifest: Manifest) -> Manifest | None:
    """Return the manifest in `folder` if it holds the run of `manifest`, None if it holds no run.

    Raises StoreError if it holds records or calls of another run or version of phyblock, or
    anything else. A manifest alone does not count as a run: it is left by one that failed at once.
    """
    check_place(folder)
    if not (folder / files.MANIFEST).exists():
        return None
    found = files.read_manifest(folder)
    if all(next(iter(kind(folder)), None) is None for kind in _PAID):
        return None
    if differ := differences(found, manifest):
        changed = f"different: {', '.join(differ)}"
        raise StoreError(Problem(str(folder), "holds another run", "", changed, "", _OTHER_FOLDER))
    here = code_versions()
    if differ := [name for name in here if found.versions.get(name) != here[name]]:
        made = ", ".join(f"{name} {found.versions.get(name)}" for name in differ)
        now = ", ".join(f"{name} {here[name]}" for name in differ)
        message = "was scored by another version of phyblock"
        hint = f"phyblock score {folder} first: it scores the replies again and calls no model"
        raise StoreError(Problem(str(folder), message, found=made, allowed=now, hint=hint))
    return found


LOCK = ".lock"
_PAID: tuple[type[Lines[Any]], ...] = (files.RecordLines, files.CallLines, files.BatchLines)
_OWN = (files.MANIFEST, *(kind.file for kind in _PAID), files.PROMPTS, "batches", LOCK, LIST)
_BEGUN = re.compile(rf"{re.escape(LOCK)}|{re.escape(LIST)}|\.[0-9a-f]{{32}}\.part")
"""Names of files that a run leaves if it is killed before it has a manifest."""


@contextlib.contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a run folder. Raises StoreError if another process holds it."""
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

    A folder with files but no manifest is somebody else's. A run's own files must not be links.
    """
    with writing(folder, _OTHER_FOLDER):
        try:
            names = sorted(os.listdir(folder))
        except FileNotFoundError:
            return
    strangers = [name for name in names if not _BEGUN.fullmatch(name)]
    if files.MANIFEST not in names and strangers:
        message = f"is not empty and holds no run (no {files.MANIFEST})"
        hint = "name a new or an empty folder with --out"
        raise StoreError(Problem(str(folder), message, found=some_of(strangers), hint=hint))
    if links := [folder / name for name in _OWN if (folder / name).is_symlink()]:
        message = "is a link, and a run writes only in its own folder"
        raise StoreError([Problem(str(path), message, hint=_OTHER_FOLDER) for path in links])


def write_run(folder: Path, manifest: Manifest, records: Iterable[Record]) -> None:
    """Replace manifest and records of a run. Raises StoreError if the disk fails."""
    lines = (line.encode("utf-8", "replace") for line in record_lines(records))
    OutFolder(folder).claim([])
    # A kill between the two leaves a run that has to be rescored.
    for name, data in ((files.RECORDS, lines), (files.MANIFEST, dump_yaml(manifest.fields()))):
        with writing(folder / name):
            atomic_write(folder / name, data, sync=True)


def record_lines(records: Iterable[Record]) -> Iterator[str]:
    """Yield the lines of `records.jsonl`: the same text for the same records."""
    for record in records:
        yield f"{_json_line(record.fields())}\n"


def _json_line(fields: Mapping[str, Any]) -> str:
    return json.dumps(fields, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
