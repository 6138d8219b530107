"""The records of all tracks: what reads records knows each by the model of its track."""

from __future__ import annotations

import functools
from typing import Any, Literal

from pydantic import TypeAdapter, create_model

from phyblock.records.record import Record
from phyblock.records.record_lines import record_adapter
from phyblock.registry import known_tracks

__all__ = ["known_records", "record_types"]


def record_types() -> tuple[type[Record], ...]:
    """The model of every track's records; a track that adds nothing of its own has a plain one."""
    kinds = known_tracks().values()
    return tuple(kind.record if kind.record is not None else _plain(kind.name) for kind in kinds)


def known_records() -> TypeAdapter[Record]:
    """Reads a record by the model of its track."""
    return _adapter(record_types())


@functools.cache
def _adapter(types: tuple[type[Record], ...]) -> TypeAdapter[Record]:
    return record_adapter(types)


@functools.cache
def _plain(track: str) -> type[Record]:
    tag: Any = Literal[track]
    return create_model("Record", __base__=Record, track=(tag, ...))
