"""Files of JSON lines that only ever grow, read one line at a time."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from json import JSONDecodeError
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from pydantic import TypeAdapter, ValidationError

from phyblock.errors import InputError, Problem, StoreError
from phyblock.files import NotRegularError, open_regular
from phyblock.records.belonging import Belonging
from phyblock.records.line import Line, decode, problems_of
from phyblock.records.others import BatchLine, Prompt, Turn

__all__ = [
    "BATCHES",
    "PROMPTS",
    "RECORDS",
    "TURNS",
    "BatchLines",
    "Lines",
    "PromptLines",
    "TurnLines",
]

RECORDS = "records.jsonl"
TURNS = "turns.jsonl"
PROMPTS = "prompts.jsonl"
BATCHES = "batches.jsonl"

_LONGEST_LINE_BYTES = 256 * 1024 * 1024

LineT = TypeVar("LineT", bound=Line)


class Lines(Generic[LineT]):
    """Every line of a file that counts with where it stands, one at a time, oldest first.

    A last line without its newline counts all the same when it is whole; else, as a kill
    leaves it behind, it ends the iteration: `is_cut` is then set. `lacks_newline` says that the
    last one needs one. `whole_bytes` is the size of the lines passed so far, `start_bytes` where
    the last of them begins. Any other line that is not what the file holds, or is not of the run
    that it should be of, is an error naming file, line and field.
    """

    noun: ClassVar[str]
    hint: ClassVar[str]
    error: ClassVar[type[InputError]] = StoreError

    def __init__(
        self, path: Path, adapter: TypeAdapter[LineT], belonging: Belonging | None = None
    ) -> None:
        self.path = path
        self.is_cut = False
        self.lacks_newline = False
        self.start_bytes = 0
        self.whole_bytes = 0
        self._adapter = adapter
        self._belonging = belonging

    def __iter__(self) -> Iterator[tuple[str, LineT]]:
        for where, line in self.every():
            if self._belonging is None or self._belonging.counts(line):
                yield where, line

    def every(self) -> Iterator[tuple[str, LineT]]:
        """All lines, also those of readers of other versions, which do not count."""
        self.whole_bytes = 0
        try:
            with open_regular(self.path) as file:
                for number, data in enumerate(self._raw(file), 1):
                    where = f"{self.path}:{number}"
                    self.lacks_newline = not data.endswith(b"\n")
                    if self.lacks_newline and len(data) <= _LONGEST_LINE_BYTES and is_cut(data):
                        self.is_cut = True
                        return
                    line = self._read(where, data)
                    self._check(where, line)
                    self.start_bytes = self.whole_bytes
                    self.whole_bytes += len(data)
                    yield where, line
        except FileNotFoundError:
            return
        except OSError as error:
            problem = Problem(str(self.path), f"cannot be read: {error.strerror}")
            raise self.error(problem) from error
        except NotRegularError as error:
            raise self.error(Problem(str(self.path), str(error))) from error

    def at(self, starts: Iterable[int]) -> Iterator[LineT]:
        """Lines that begin at these places [bytes], which were passed before."""
        if not self.path.exists():
            return
        with open_regular(self.path) as file:
            for start in starts:
                file.seek(start)
                yield self._read(f"{self.path} (byte {start})", file.readline())

    def problem(self, error: ValidationError, where: str) -> Problem:
        """What is wrong with the first of the fields that are."""
        return next(problems_of(error, where, Line, f"is not a {self.noun}", self.hint))

    def _check(self, where: str, line: LineT) -> None:
        problem = None if self._belonging is None else self._belonging.problem(where, line)
        if problem is not None:
            raise self.error(problem)

    def _raw(self, file: Any) -> Iterator[bytes]:
        while data := file.readline(_LONGEST_LINE_BYTES + 1):
            yield data

    def _read(self, where: str, data: bytes) -> LineT:
        is_not = f"is not a {self.noun}"
        if len(data) > _LONGEST_LINE_BYTES:
            message = f"{is_not}: longer than {_LONGEST_LINE_BYTES // 1024**2} MB"
            raise self.error(Problem(where, message, hint=self.hint))
        try:
            read: LineT = decode(self._adapter, data)
        except JSONDecodeError as error:
            problem = Problem(f"{where}:{error.colno}", f"{is_not}: {error.msg}", hint=self.hint)
            raise self.error(problem) from error
        except UnicodeDecodeError as error:
            raise self.error(Problem(where, f"{is_not}: not UTF-8", hint=self.hint)) from error
        except ValidationError as error:
            raise self.error(self.problem(error, where)) from error
        except ValueError as error:
            raise self.error(Problem(where, f"{is_not}: it {error}", hint=self.hint)) from error
        return read


def is_cut(line: bytes) -> bool:
    """True if a line is no JSON, as one that a kill cut short; one out of bounds is whole."""
    try:
        json.loads(line)
    except (JSONDecodeError, UnicodeDecodeError):
        return True
    except (ValueError, RecursionError):
        return False
    return False


_TURN: TypeAdapter[Turn] = TypeAdapter(Turn)
_PROMPT: TypeAdapter[Prompt] = TypeAdapter(Prompt)
_BATCH: TypeAdapter[BatchLine] = TypeAdapter(BatchLine)


class TurnLines(Lines[Turn]):
    """The answered turns of a run folder's episodes, finished or not."""

    noun = "turn"
    hint = (
        "restore the file from a copy, or remove this line and those of the same sample below it: "
        "these turns are then asked again"
    )

    def __init__(self, folder: Path, belonging: Belonging | None = None) -> None:
        super().__init__(folder / TURNS, _TURN, belonging)


class PromptLines(Lines[Prompt]):
    """The prompts of a run folder; `digests` are those passed so far."""

    noun = "prompt"
    hint = "remove this line: reports then show the sample without its prompt"

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / PROMPTS, _PROMPT)
        self.digests: set[str] = set()

    def every(self) -> Iterator[tuple[str, Prompt]]:
        """All lines."""
        for where, line in super().every():
            self.digests.add(line.sha256)
            yield where, line


class BatchLines(Lines[BatchLine]):
    """What became of the batches of a run."""

    noun = "line about a batch"
    hint = (
        "restore the file from a copy, or remove all lines of the same batch: its questions are "
        "then asked again"
    )

    def __init__(self, folder: Path) -> None:
        super().__init__(folder / BATCHES, _BATCH)
