"""The files of a run folder: `run.yaml`, its manifest, and files of JSON lines.

Lines are read one at a time and within bounds. Files only grow: a later record of a sample replaces
an earlier one, and a last line that a kill cut short is ignored. Every other line that is malformed
or belongs to another run is an error that names file, line and field.
"""

from __future__ import annotations

import functools
import json
import operator
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Generic, TypeVar

from pydantic import Field, TypeAdapter, ValidationError

from phyblock.config.suite import Suite, suite_model
from phyblock.config.validation import Fault, checked, problems_of
from phyblock.config.yaml import parse_yaml
from phyblock.errors import DataError, InputError, Problem, StoreError, reason_of
from phyblock.files import NotRegularError, open_regular, read_bytes, read_text
from phyblock.records import record
from phyblock.records.record import BatchLine, Call, Line, Prompt, PromptMessage, Record, Stopped
from phyblock.registry import known_tracks

FORMAT = 1
"""Version of run folders; additional fields do not change it."""
MANIFEST = "run.yaml"
_HINT = "restore the file from a copy; if the run used a plugin: phyblock --plugin MODULE"
_DIGITS = 16
_LARGEST_BYTES = 2 * 1024 * 1024
"""Far above the manifest of the largest allowed suite."""
Version = Annotated[int, Field(ge=1)]


class ManifestModel(Line):
    """A model of the run, with everything that determines its replies."""

    name: str
    """Its name in the run."""
    published: str | None = None
    """Its name in the paper."""
    size_b: float | None = None
    """Its size [billion parameters]."""
    served_at: tuple[str, ...] = ()
    """Addresses of your own servers at which it was called when the run began."""
    kind: str = ""
    """`litellm`: over the network; `replay`: a recording; `baseline`: a rule; `human`: a person."""

    @property
    def is_baseline(self) -> bool:
        """True if it is a rule, which has no rank among models."""
        return self.kind == "baseline"


def _same_names(models: tuple[ManifestModel, ...]) -> Iterator[Fault]:
    names = [model.name for model in models]
    for index, name in enumerate(names):
        if name in names[:index]:
            yield Fault("is listed twice", found=name, at=(index, "name"))


class ManifestDataset(Line):
    """The data set."""

    name: str
    """Its name."""
    sha256: str
    """Digest of the scenes of the run."""
    version: Version = 1
    """Its version; results on different versions are never mixed."""
    format: str = "builtin"
    """Its layout."""
    root: str = ""
    """The folder that it was in."""


class ManifestQuestions(Line):
    """The question set."""

    format: str
    """Its layout."""
    root: str
    """The folder that it was in."""
    version: Version = 1
    """Its version; results on different versions are never mixed."""


class Manifest(Line):
    """The description of a run, written before any request."""

    identity: str
    """Digest of all that determines the results; only the same run can continue in a folder."""
    created: str = ""
    """Time of its start, UTC."""
    format: Annotated[int, Field(ge=1, le=FORMAT)] = FORMAT
    """Version of the run folder."""
    suite: dict[str, Any] = Field(default_factory=dict)
    """The suite, including all defaults."""
    models: Annotated[tuple[ManifestModel, ...], checked(_same_names)] = ()
    """The models and their parameters."""
    others: tuple[ManifestModel, ...] = ()
    """Models of earlier commands in this folder that the last command did not name: their records
    are kept, and tables omit them until they are named again."""
    dataset: ManifestDataset | None = None
    """The data set."""
    tracks: dict[str, dict[str, Any]] = Field(default_factory=dict)
    """Digests by track of all that determines results: prompt, pictures, questions."""
    variants: dict[str, dict[str, dict[str, Any]]] = Field(default_factory=dict)
    """The same digests by condition, as named in records, and track; empty: only one condition."""
    limit: int | None = None
    """Maximum number of items of each track."""
    questions: ManifestQuestions | None = None
    """The question set; null: no questions."""
    items: dict[str, int] = Field(default_factory=dict)
    """Number of items of each track."""
    scenes: int = 0
    """Number of distinct scenes."""
    scenes_by_level: dict[int, int] = Field(default_factory=dict)
    """Number of scenes of each level; a scene may have several."""
    engine: str | None = None
    """The physics engine, with its version; null: nothing in the run depends on one."""
    versions: dict[str, str] = Field(default_factory=dict)
    """Versions of Python, libraries and parsers."""

    @property
    def run(self) -> str:
        """The digest that its records carry."""
        return self.identity[:_DIGITS]

    def selects(self, model: str, seed: int) -> bool:
        """True if the run includes this model and seed; records of others may exist."""
        seeds = self.suite.get("seeds") or [seed]
        return seed in seeds and model in ([one.name for one in self.models] or [model])


def read_manifest(folder: Path) -> Manifest:
    """Return the run's manifest. Raises StoreError if it is missing or cannot be read."""
    path = folder / MANIFEST
    try:
        return _manifest(read_text(path, _LARGEST_BYTES), str(path))
    except (FileNotFoundError, NotADirectoryError) as error:
        message = f"holds no {MANIFEST}" if folder.exists() else "is not there"
        allowed = "a folder that phyblock run wrote"
        raise StoreError(Problem(str(folder), message, allowed=allowed)) from error
    except (OSError, ValueError) as error:
        message = f"cannot be read: {reason_of(error)}"
        raise StoreError(Problem(str(path), message, hint=_HINT)) from error
    except InputError as error:
        raise record.not_a("run manifest", error, _HINT) from error


@functools.lru_cache(maxsize=2)
def _manifest(text: str, where: str) -> Manifest:
    """Return a manifest; cached, since one command reads it several times."""
    source = parse_yaml(text, where, _LARGEST_BYTES, may_hold_keys=True)
    return record.validated(Manifest, source.data, source)


def suite_of(manifest: Manifest, where: str) -> Suite:
    """Return the suite of a run. Raises StoreError naming `where` and every wrong field."""
    try:
        return suite_model().model_validate(manifest.suite)
    except ValidationError as error:
        problems = problems_of(error, suite_model(), manifest.suite, where)
        raise StoreError(
            replace(one, field=f"suite.{one.field}", hint=_HINT) for one in problems
        ) from error


RECORDS = "records.jsonl"
CALLS = "calls.jsonl"
PROMPTS = "prompts.jsonl"
BATCHES = "batches.jsonl"
STOPPED = "stopped.json"
_LONGEST_LINE_BYTES = 256 * 1024 * 1024
LineT = TypeVar("LineT", bound=Line)


@dataclass(frozen=True)
class Validation:
    """Checks that records and calls belong to a run, by its digest and their names.

    `samples` are all ids, if known. Unless `whole`, records not selected by the run are skipped.
    """

    manifest: Manifest
    samples: Collection[str] | None = None
    whole: bool = False

    def takes(self, line: Line) -> bool:
        """True if a line is not skipped."""
        return self.whole or not isinstance(line, Record) or self._selects(line)

    def _selects(self, line: Record) -> bool:
        return self.manifest.selects(line.model, line.seed)

    def problem(self, where: str, line: Line) -> Problem | None:
        """Return the evidence that a record or call belongs to another run, or None."""
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
    """Every line of a file with its place, one at a time, oldest first.

    A last line without a newline counts if it is complete; otherwise, as after a kill, it ends the
    iteration and sets `is_cut`. `lacks_newline` is set if the last line has no newline.
    `whole_bytes` is the size of the lines read so far, `start_bytes` the start of the last one.
    """

    file: ClassVar[str]
    noun: ClassVar[str]
    hint: ClassVar[str]
    kind: ClassVar[type[Line]]

    def __init__(self, folder: Path, validation: Validation | None = None) -> None:
        """Without a `validation`, lines of any run are accepted."""
        self.path = folder / self.file
        self.is_cut = False
        self.lacks_newline = False
        self.start_bytes = 0
        self.whole_bytes = 0
        self._adapter: TypeAdapter[LineT] = self.adapter()
        self._validation = validation

    def adapter(self) -> TypeAdapter[Any]:
        """Return the type adapter of a line."""
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
        except (OSError, NotRegularError) as error:
            message = f"cannot be read: {reason_of(error)}"
            raise StoreError(Problem(str(self.path), message)) from error

    def at(self, starts: Iterable[int]) -> Iterator[LineT]:
        """Yield the lines that begin at these offsets [bytes], which were read before."""
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
            return record.decode(self._adapter, data, where, self.kind)
        except DataError as error:
            raise record.not_a(self.noun, error, self.hint) from error


def _is_cut(line: bytes) -> bool:
    """True if a line is not JSON, as after a kill; one that is out of bounds is complete."""
    try:
        if len(line) <= _LONGEST_LINE_BYTES:
            json.loads(line)
    except (json.JSONDecodeError, UnicodeDecodeError):
        return True
    except (ValueError, RecursionError):
        return False
    return False


class RecordLines(Lines[Record]):
    """The records of a run folder, each with the model of its track."""

    file = RECORDS
    kind = Record
    noun = "record"
    hint = (
        "restore the file from a copy, load the plugin of its track (phyblock --plugin MODULE), or "
        "remove this line: its sample is then run again"
    )

    def adapter(self) -> TypeAdapter[Any]:
        """Return the type adapter of a record, by the model of its track."""
        return known_records()


class CallLines(Lines[Call]):
    """The calls of a run folder, each with a line before it was sent and one at its end."""

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
    """Return the model of every track's records."""
    return tuple(kind.record_type() for kind in known_tracks().values())


def known_records() -> TypeAdapter[Record]:
    """Return the type adapter of a record, by the model of its track."""
    return _adapter(record_types())


@functools.cache
def _adapter(types: tuple[type[Record], ...]) -> TypeAdapter[Record]:
    union: Any = functools.reduce(operator.or_, types)
    return TypeAdapter(Annotated[union, Field(discriminator="track")])


def run_records(
    folder: Path,
    manifest: Manifest | None = None,
    samples: Collection[str] | None = None,
    *,
    whole: bool = False,
) -> RecordLines:
    """Return the records of a run folder. Raises StoreError for records of another run.

    `manifest` is that of the folder, which is read if not given; `samples` are the ids of its plan,
    if known. Models and seeds that it does not select are included only with `whole`.
    """
    return RecordLines(folder, Validation(manifest or read_manifest(folder), samples, whole))


def read_records(folder: Path, manifest: Manifest | None = None) -> Iterator[Record]:
    """Yield the newest record of every sample, in order of first appearance, one at a time.

    Raises StoreError for a line that is not a record of the run, before the first is yielded.
    """
    lines = run_records(folder, manifest)
    return lines.at(newest_starts(lines).values())


def newest_starts(lines: RecordLines, tracks: Collection[str] | None = None) -> dict[str, int]:
    """Return the offset of the newest record of every sample [bytes], in order of appearance.

    Only samples of `tracks` are included, or all if it is None.
    """
    starts: dict[str, int] = {}
    for _, line in lines:
        if tracks is None or line.track in tracks:
            starts[line.sample] = lines.start_bytes
    return starts


def read_stopped(folder: Path) -> Stopped:
    """Return the reasons why a run was stopped, if any."""
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
