"""Writing a data set scene by scene, in flat memory: lines, statistics, card and checksums."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from phyblock.datasets.version import VERSION_FILE
from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.errors import Problem, StoreError
from phyblock.files import atomic_write, check_free, writing
from phyblock.making.scenes.candidate_sets import make_candidates
from phyblock.making.scenes.scene_draft import PALETTES, Palette
from phyblock.records.scene import StoredScene
from phyblock.stable import hex_digest

__all__ = [
    "CARD_FILE",
    "SCENES_FILE",
    "SET_VERSION",
    "SUMS_FILE",
    "LevelStatistics",
    "SetWriter",
    "check_folder",
    "open_writer",
    "sums_text",
]

SCENES_FILE = "scenes.jsonl"
CARD_FILE = "README.md"
SUMS_FILE = "SHA256SUMS"
SET_VERSION = 2
"""Counts what makes other scenes or candidate sets out of the same seed: 2 offers distractors as
often as goals need them, and shows at least 3 % of every block's outline.
"""
QUANTITIES = ("blocks", "types", "colors", "layers")


@dataclass
class LevelStatistics:
    """Counts of one level: scenes, base scenes, sum and most of each of `QUANTITIES`."""

    scenes: int = 0
    base: int = 0
    total: dict[str, int] = field(default_factory=lambda: dict.fromkeys(QUANTITIES, 0))
    most: dict[str, int] = field(default_factory=lambda: dict.fromkeys(QUANTITIES, 0))

    def add(self, scene: Scene) -> None:
        """Count a scene."""
        counts = {
            "blocks": len(scene),
            "types": len({block.type for block in scene.blocks}),
            "colors": len({block.color for block in scene.blocks}),
            "layers": max(scene.graph.layers),
        }
        self.scenes += 1
        self.base += scene.parents == (scene.id,)
        for name, number in counts.items():
            self.total[name] += number
            self.most[name] = max(self.most[name], number)


class SetWriter:
    """Takes scenes in the order in which they are made; every level's ids must rise."""

    def __init__(self, folder: Path, parts: Path, palette: Palette) -> None:
        self._folder, self._parts, self._palette = folder, parts, palette
        self.levels: dict[int, LevelStatistics] = {}
        self.shared = self.base = self.count = 0
        self.sizes: set[int] = set()

    def add(self, scene: Scene, offered: CandidateSet | None = None) -> CandidateSet:
        """Append a scene with a candidate set of its own, else the one given, which is returned."""
        candidates = offered or make_candidates(scene, palette=PALETTES[self._palette])
        with (self._parts / f"{scene.levels[0]}").open("a", encoding="utf-8", newline="\n") as file:
            file.write(StoredScene.of(scene, candidates).as_json() + "\n")
        for level in scene.levels:
            self.levels.setdefault(level, LevelStatistics()).add(scene)
        self.count += 1
        self.shared += len(scene.levels) > 1
        self.base += scene.parents == (scene.id,)
        self.sizes.add(len(candidates))
        return candidates

    def finish(self, card: str) -> None:
        """Put the scenes together, sorted by id, and write the card and the checksums."""
        whole = self._parts / SCENES_FILE
        with whole.open("wb") as out:
            for part in sorted(path for path in self._parts.iterdir() if path.name.isdigit()):
                with part.open("rb") as file:
                    shutil.copyfileobj(file, out)
        whole.replace(self._folder / SCENES_FILE)
        atomic_write(self._folder / CARD_FILE, card)
        atomic_write(self._folder / VERSION_FILE, f"{SET_VERSION}\n")
        atomic_write(self._folder / SUMS_FILE, sums_text(self._folder))


def check_folder(folder: Path, replace: bool = False, hint: str = "give another --out") -> None:
    """Raise StoreError, with `hint`, where the folder holds scenes already (and not `replace`), or
    other files of these names.
    """
    if (folder / SCENES_FILE).exists() and not replace:
        raise StoreError(Problem(str(folder), "holds a data set already", hint=hint))
    if not (folder / SCENES_FILE).exists():
        others = [folder / name for name in (SCENES_FILE, CARD_FILE, VERSION_FILE, SUMS_FILE)]
        check_free(others, "give another --out")


@contextlib.contextmanager
def open_writer(
    folder: Path, palette: Palette, replace: bool = False, hint: str = "give another --out"
) -> Iterator[SetWriter]:
    """A writer into a folder; what is half written is gone when the with statement fails.

    Raises StoreError as `check_folder`, and where the folder cannot be written.
    """
    check_folder(folder, replace, hint)
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".making-", dir=folder) as parts:
            yield SetWriter(folder, Path(parts), palette)


def sums_text(folder: Path) -> str:
    """Checksums of the scenes, the card and the version, as `sha256sum -c` reads them."""
    names = (CARD_FILE, SCENES_FILE, VERSION_FILE)
    sums = [hex_digest((folder / name).read_bytes()) for name in names]
    return "".join(f"{one}  {name}\n" for one, name in zip(sums, names, strict=True))
