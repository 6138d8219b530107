"""Writing a data set scene by scene, in flat memory: lines, statistics, card and checksums."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from phyblock.data import VERSION_FILE
from phyblock.data.scenes import StoredScene
from phyblock.domain.scene import CandidateSet, Scene
from phyblock.errors import Problem, StoreError, reason_of
from phyblock.files import atomic_write, check_free, read_text, writing
from phyblock.making.checks import FINISHED_REST, LEVEL_LIMITS
from phyblock.making.scenes.candidates import make_candidates
from phyblock.making.scenes.sketch import PALETTES, Palette
from phyblock.sim.contact import FIT_TOLERANCE_M
from phyblock.sim.dynamics import DEFAULT_REST, DEFAULT_TRIAL
from phyblock.sim.engine import other_engine
from phyblock.sim.pictures import LEAST_SHARE, LEAST_SHOWN
from phyblock.stable import hex_digest

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


def check_sums(folder: Path) -> tuple[int, tuple[Problem, ...]]:
    """The number of files that `SHA256SUMS` names, and those that are missing or changed."""
    path = folder / SUMS_FILE
    if not path.is_file():
        return 1, (Problem(str(path), "is missing"),)
    try:
        lines = read_text(path).splitlines()
    except (OSError, ValueError) as error:
        return 1, (Problem(str(path), f"cannot be read: {reason_of(error)}"),)
    wrong = []
    for line in lines:
        digest, _, name = line.partition("  ")
        file = folder / name
        if not file.is_file():
            wrong.append(Problem(str(file), "is missing"))
        elif hex_digest(file.read_bytes()) != digest:
            wrong.append(Problem(str(file), f"differs from its checksum in {SUMS_FILE}"))
    return len(lines), tuple(wrong)


def _text(name: str) -> str:
    """A part of the cards, with fields in braces."""
    return Path(__file__).with_name(name).read_text(encoding="utf-8")


def card(name: str, written: SetWriter, command: str, palette_text: str) -> str:
    """Return the Markdown card, after all scenes were added; `command` is what made them."""
    levels = dict(sorted(written.levels.items()))
    settings = " and at ".join(
        f"1/{round(1 / physics.time_step_s)} s ({physics.iterations} solver iterations)"
        for physics in DEFAULT_TRIAL.physics
    )
    text = _text("card.md").format(
        name=name,
        count=written.count,
        levels=", ".join(f"{one.scenes} of level {level}" for level, one in levels.items()),
        shared=written.shared,
        base=written.base,
        varied=written.count - written.base,
        command=command,
        simulators=f", by {engine}" if (engine := other_engine()) else "",
        palette=palette_text,
        fit_mm=FIT_TOLERANCE_M * 1000,
        duration=DEFAULT_TRIAL.duration_s,
        settings=settings,
        limit_mm=DEFAULT_TRIAL.limit_m * 1000,
        limit_deg=DEFAULT_TRIAL.limit_deg,
        speed=DEFAULT_REST.speed_m_s * 1000,
        finished_quiet=FINISHED_REST.quiet_s,
        quiet=DEFAULT_REST.quiet_s,
        pixels=LEAST_SHARE * 512**2,
        shown=LEAST_SHOWN,
        version=SET_VERSION,
        limits="\n".join(_limit(level) for level in levels),
        heads=" | ".join(f"{quantity}, mean | most" for quantity in QUANTITIES),
        rules="|".join("---|---" for _ in QUANTITIES),
        rows="\n".join(_row(level, one) for level, one in levels.items()),
        candidates=" to ".join(
            str(size) for size in sorted({min(written.sizes), max(written.sizes)})
        ),
    )
    return text + _text("card_file.md")


def completed_card(name: str, count: int, command: str) -> str:
    """Markdown text of the card of scenes that were given by their positions."""
    fit_mm = FIT_TOLERANCE_M * 1000
    text = _text("card_completed.md")
    filled = text.format(name=name, count=count, command=command, fit_mm=fit_mm)
    return filled + _text("card_file.md")


def _limit(level: int) -> str:
    limits = LEVEL_LIMITS[level]
    blocks = f"{limits.least_blocks} to {limits.most_blocks} blocks"
    return f"    level {level}: {blocks}, up to {limits.most_layers} layers"


def _row(level: int, one: LevelStatistics) -> str:
    cells = [str(level), str(one.scenes), str(one.base)]
    for quantity in QUANTITIES:
        cells += [f"{one.total[quantity] / one.scenes:.1f}", str(one.most[quantity])]
    return f"| {' | '.join(cells)} |"
