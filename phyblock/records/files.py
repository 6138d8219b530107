"""The files of JSON lines in a run folder, read one line at a time and within bounds.

They only ever grow: a later record of a sample replaces an earlier one, and a last line that a kill
cut short is not there. Every other line that is not what its file holds, or is not of the run that
it should be of, is an error that names file, line and field.
"""

from __future__ import annotations

import functools
import json
import operator
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, Literal, TypeVar

from pydantic import Field, TypeAdapter, create_model

from phyblock.errors import DataError, Problem, StoreError, reason_of
from phyblock.files import NotRegularError, open_regular, read_bytes
from phyblock.records.line import Line, decode, not_a
from phyblock.records.manifest import Manifest, read_manifest
from phyblock.records.record import BatchLine, Call, Prompt, PromptMessage, Record, Stopped
from phyblock.registry import known_tracks

RECORDS = "records.jsonl"
CALLS = "calls.jsonl"
PROMPTS = "prompts.jsonl"
BATCHES = "batches.jsonl"
STOPPED = "stopped.json"
_LONGEST_LINE_BYTES = 256 * 1024 * 1024
LineT = TypeVar("LineT", bound=Line)


@dataclass(frozen=True)
class Validation:
    """Shows that records and calls are those of a run, by its digest and their names.

    `samples` are all ids of the run, where its plan is known. Records of models and seeds that the
    run does not select at present are passed over, unless it is taken as a `whole`.
    """

    manifest: Manifest
    samples: Collection[str] | None = None
    whole: bool = False

    def takes(self, line: Line) -> bool:
        """True if a line is to be seen."""
        return self.whole or not isinstance(line, Record) or self._selects(line)

    def _selects(self, record: Record) -> bool:
        return self.manifest.selects(record.model, record.seed)

    def problem(self, where: str, line: Line) -> Problem | None:
        """Return what shows that a record or call is of another run, or None."""
        if not isinstance(line, Record | Call):
            return None
        field, found, allowed = "sample", line.sample, line.sample
        if line.run not in ("", self.manifest.run):
            field, found, allowed = "run", line.run, self.manifest.run
        elif isinstance(line, Record) and found != line.named:
            allowed = line.named
        elif (
            self.samples is None
            or found in self.samples
            or isinstance(line, Call)
            or (line.run and not self._selects(line))
        ):
            return None
        else:
            allowed = "a sample of the suite as it is run"
        hint = (
            "records of different runs are never counted together: take out the lines that are not "
            "of this run, or restore the file from a copy; nothing was changed"
        )
        return Problem(where, "is of another run", field, found, allowed, hint)


class Lines(Generic[LineT]):
    """Every line of a file with where it stands, one at a time, oldest first.

    A last line without its newline counts all the same when it is whole; else, as a kill leaves it
    behind, it ends the iteration: `is_cut` is then set. `lacks_newline` says that the last one
    needs one. `whole_bytes` is the size of the lines passed so far, `start_bytes` where the last of
    them begins.
    """

    file: ClassVar[str]
    noun: ClassVar[str]
    hint: ClassVar[str]
    kind: ClassVar[type[Line]]

    def __init__(self, folder: Path, validation: Validation | None = None) -> None:
        """Without a `validation` lines of any run are taken."""
        self.path = folder / self.file
        self.is_cut = False
        self.lacks_newline = False
        self.start_bytes = 0
        self.whole_bytes = 0
        self._adapter: TypeAdapter[LineT] = self.adapter()
        self._validation = validation

    def adapter(self) -> TypeAdapter[Any]:
        """Return what reads a line."""
        return TypeAdapter(self.kind)

    def __iter__(self) -> Iterator[tuple[str, LineT]]:
        self.whole_bytes = 0
        try:
            with open_regular(self.path) as file:
                number = 0
                while data := file.readline(_LONGEST_LINE_BYTES + 1):
                    number += 1
                    where = f"{self.path}:{number}"
                    if b"\0" in data or data.endswith(b"\r\n"):
                        held = "holds zero bytes" if b"\0" in data else "ends with CR LF"
                        message = f"is not a {self.noun}: it {held}"
                        raise StoreError(Problem(where, message, hint=self.hint))
                    self.lacks_newline = not data.endswith(b"\n")
                    if self.lacks_newline and _is_cut(data):
                        self.is_cut = True
                        return
                    line = self._read(where, data)
                    problem = self._validation and self._validation.problem(where, line)
                    if problem:
                        raise StoreError(problem)
                    self.start_bytes = self.whole_bytes
                    self.whole_bytes += len(data)
                    if self._validation is None or self._validation.takes(line):
                        yield where, line
        except FileNotFoundError:
            return
        except OSError as error:
            raise StoreError(
                Problem(str(self.path), f"cannot be read: {error.strerror}")
            ) from error
        except NotRegularError as error:
            raise StoreError(Problem(str(self.path), str(error))) from error

    def at(self, starts: Iterable[int]) -> Iterator[LineT]:
        """Yield the lines that begin at these places [bytes], which were passed before."""
        if self.path.exists():
            with open_regular(self.path) as file:
                for start in starts:
                    file.seek(start)
                    yield self._read(f"{self.path} (byte {start})", file.readline())

    def _read(self, where: str, data: bytes) -> LineT:
        if len(data) > _LONGEST_LINE_BYTES:
            message = f"is longer than {_LONGEST_LINE_BYTES // 1024**2} MB"
            raise StoreError(Problem(where, message, hint=self.hint))
        try:
            return decode(self._adapter, data, where, self.kind)
        except DataError as error:
            raise not_a(self.noun, error, self.hint) from error


def _is_cut(line: bytes) -> bool:
    """True if a line is no JSON, as one that a kill cut short; one out of bounds is whole."""
    try:
        if len(line) <= _LONGEST_LINE_BYTES:
            json.loads(line)
    except (json.JSONDecodeError, UnicodeDecodeError):
        return True
    except (ValueError, RecursionError):
        return False
    return False


class RecordLines(Lines[Record]):
    """The records of a run folder, each read by the model of its track."""

    file = RECORDS
    kind = Record
    noun = "record"
    hint = "restore the file from a copy, or remove this line: its sample is then run again"

    def adapter(self) -> TypeAdapter[Any]:
        """Return what reads a record by the model of its track."""
        return known_records()


class CallLines(Lines[Call]):
    """The calls of a run folder, each when it was sent and when it had ended."""

    file = CALLS
    kind = Call
    noun = "call"
    hint = (
        "restore the file from a copy, or remove this line: its cost is then not counted, and a "
        "reply that no record holds is asked for again"
    )


class PromptLines(Lines[Prompt]):
    """The prompts of a run folder."""

    file = PROMPTS
    kind = Prompt
    noun = "prompt"
    hint = "remove this line: reports then show the sample without its prompt"


class BatchLines(Lines[BatchLine]):
    """The history of the batches of a run."""

    file = BATCHES
    kind = BatchLine
    noun = "line about a batch"
    hint = (
        "restore the file from a copy, or remove all lines of the same batch: its questions are "
        "then asked again"
    )


def record_types() -> tuple[type[Record], ...]:
    """Return the model of every track's records; plain for a track that adds nothing of its own."""
    kinds = known_tracks().values()
    return tuple(kind.record if kind.record is not None else _plain(kind.name) for kind in kinds)


def known_records() -> TypeAdapter[Record]:
    """Return what reads a record by the model of its track."""
    return _adapter(record_types())


@functools.cache
def _adapter(types: tuple[type[Record], ...]) -> TypeAdapter[Record]:
    union: Any = functools.reduce(operator.or_, types)
    return TypeAdapter(Annotated[union, Field(discriminator="track")])


@functools.cache
def _plain(track: str) -> type[Record]:
    tag: Any = Literal[track]
    return create_model("Record", __base__=Record, track=(tag, ...))


def run_records(
    folder: Path,
    manifest: Manifest | None = None,
    samples: Collection[str] | None = None,
    *,
    whole: bool = False,
) -> RecordLines:
    """Return the records of a run folder; any that are not the run's own are a StoreError.

    `manifest` is that of the folder, read where it is not given; `samples` are the ids of its
    plan, where that is known. Models and seeds that it does not select are seen with `whole` alone.
    """
    return RecordLines(folder, Validation(manifest or read_manifest(folder), samples, whole))


def read_records(folder: Path, manifest: Manifest | None = None) -> Iterator[Record]:
    """Yield the newest record of every sample, in order of first appearance, one at a time.

    Raises StoreError for a line that is no record of the run before the first is given.
    """
    lines = run_records(folder, manifest)
    return lines.at(newest_starts(lines).values())


def newest_starts(lines: RecordLines, tracks: Collection[str] | None = None) -> dict[str, int]:
    """Return where the newest record of every sample begins [bytes], in order of appearance.

    Only samples of `tracks` are taken, of all where it is None.
    """
    starts: dict[str, int] = {}
    for _, record in lines:
        if tracks is None or record.track in tracks:
            starts[record.sample] = lines.start_bytes
    return starts


def read_stopped(folder: Path) -> Stopped:
    """Return what stopped a run: nothing where it was not stopped."""
    path = folder / STOPPED
    try:
        return Stopped.model_validate_json(read_bytes(path))
    except FileNotFoundError:
        return Stopped()
    except (OSError, ValueError) as error:
        message, hint = f"cannot be read: {reason_of(error)}", "remove it: it is made again"
        raise StoreError(Problem(str(path), message, hint=hint)) from error


def read_prompts(folder: Path) -> dict[str, tuple[PromptMessage, ...]]:
    """Return the messages of every prompt of a run folder, by digest."""
    return {line.sha256: line.messages for _, line in PromptLines(folder)}
