"""`stopped.json`: why the last session on a run did not ask all that is left."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field

from phyblock.files import read_bytes
from phyblock.records.line import Line

__all__ = ["STOPPED", "Stopped", "read_stopped"]

STOPPED = "stopped.json"


class Stopped(Line):
    """Why the last session on a run did not ask all; there while there is anything to say."""

    models: dict[str, str] = Field(default_factory=dict)
    """Why a model could not be asked on, by its name."""
    run: str = ""
    """Why the whole run was stopped; empty: it was not."""


def read_stopped(folder: Path) -> Stopped:
    """What stopped a run; nothing where it does not say, or cannot be read."""
    try:
        return Stopped.model_validate_json(read_bytes(folder / STOPPED))
    except (OSError, ValueError):
        return Stopped()
