"""Replies as lines of a run hold them."""

from __future__ import annotations

from dataclasses import asdict, fields

from phyblock.models.base import Reply, Usage
from phyblock.records import StoredReply

__all__ = ["reply_of", "stored"]

_REPLY = tuple(field.name for field in fields(Reply) if field.name != "usage")
_USAGE = tuple(field.name for field in fields(Usage))


def stored(reply: Reply) -> StoredReply:
    """A reply as it is written."""
    return StoredReply.of(asdict(reply))


def reply_of(line: StoredReply) -> Reply:
    """A reply that was written."""
    usage = Usage(**{name: getattr(line.usage, name) for name in _USAGE})
    return Reply(**{name: getattr(line, name) for name in _REPLY}, usage=usage)
