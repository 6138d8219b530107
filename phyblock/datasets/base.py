"""What every reader of a data format returns."""

from __future__ import annotations

import functools
import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from phyblock.domain import CandidateSet, Scene

__all__ = ["AssemblyTask", "Dataset"]


@dataclass(frozen=True)
class AssemblyTask:
    """A goal structure with its candidate set; `composite` is the data set's own picture of
    both, where it has one.
    """

    scene: Scene
    candidates: CandidateSet
    composite: Path | None = None

    @property
    def key(self) -> str:
        """What samples call it: the scene's id."""
        return self.scene.id


@dataclass(frozen=True)
class Dataset:
    """Assembly tasks in scene-id order; `root` is where they were read from."""

    name: str
    root: Path
    tasks: tuple[AssemblyTask, ...]

    @functools.cached_property
    def sha256(self) -> str:
        """Hex digest of the scenes and candidate sets, whatever the format they came in."""
        content = [[asdict(task.scene), asdict(task.candidates)] for task in self.tasks]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
