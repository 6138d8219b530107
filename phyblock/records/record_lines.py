"""The records of a run folder, each by the model of its track."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from functools import reduce
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from phyblock.errors import DataError, Problem
from phyblock.records.belonging import Belonging
from phyblock.records.line import problems_of
from phyblock.records.lines import RECORDS, Lines
from phyblock.records.record import Record, Recorded

__all__ = ["RecordLines", "RecordedLines", "record_adapter"]

_HINT = "restore the file from a copy, or remove this line: its sample is then run again"
_BY_TRACK = ("union_tag_invalid", "union_tag_not_found")
_COMMON: TypeAdapter[Record] = TypeAdapter(Record)
_RECORDED: TypeAdapter[Recorded] = TypeAdapter(Recorded)


def record_adapter(types: Sequence[type[Record]]) -> TypeAdapter[Record]:
    """Reads a record as the one of `types`, two at least, whose `track` it has."""
    union: Any = reduce(operator.or_, types)
    adapter: TypeAdapter[Record] = TypeAdapter(Annotated[union, Field(discriminator="track")])
    return adapter


class RecordLines(Lines[Record]):
    """The records of a run folder that are the run's own; any other is an error."""

    noun = "record"
    hint = _HINT

    def __init__(
        self, folder: Path, adapter: TypeAdapter[Record], belonging: Belonging | None
    ) -> None:
        """`belonging` None takes records of any run."""
        super().__init__(folder / RECORDS, adapter, belonging)

    def problem(self, error: ValidationError, where: str) -> Problem:
        """As of any line; a record of no known track is first held against what all share."""
        (first, *_) = error.errors(include_url=False)
        if first["type"] not in _BY_TRACK:
            # The place begins with the track by which the model was chosen.
            return next(
                problems_of(error, where, Record, f"is not a {self.noun}", self.hint, skip=1)
            )
        try:
            _COMMON.validate_python(first["input"])
        except ValidationError as common:
            return super().problem(common, where)
        context = first.get("ctx") or {}
        found, allowed = str(context.get("tag")), str(context.get("expected_tags"))
        message = f"is not a {self.noun}: of a track that is not known"
        hint = "a track of a program of its own: open it from there, by registry.register_track"
        return Problem(where, message, "track", found, allowed, hint)


class RecordedLines(Lines[Recorded]):
    """Records as a recording takes them: of any run, whatever it was."""

    noun = "record"
    hint = "restore the file from a copy, or remove this line: its sample then has no reply"
    error = DataError

    def __init__(self, path: Path) -> None:
        super().__init__(path, _RECORDED)
