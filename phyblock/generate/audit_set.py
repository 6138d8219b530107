"""Auditing a whole data set: in several processes, duplicates, totals, and a corrected copy."""

from __future__ import annotations

import csv
import functools
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.files import atomic_write, check_free, writing
from phyblock.generate.audit import AuditSettings, Check, Finding, SceneAudit, audit_scene
from phyblock.generate.symmetry import find_twins
from phyblock.generate.workers import open_workers
from phyblock.generate.writing import SCENES_FILE, scene_line
from phyblock.plain_text import csv_cell

__all__ = [
    "Audit",
    "Change",
    "Copied",
    "audit_scenes",
    "changes_of",
    "find_duplicates",
    "findings_csv",
    "write_fixed",
]

Task = tuple[Scene, CandidateSet | None]
_FINDING_COLUMNS = (
    *("scene", "level", "check", "blocks", "size", "unit"),
    *("declared", "found", "message"),
)


@dataclass(frozen=True)
class Audit:
    """An audit of a data set; `others` are findings that belong to no scene that was read."""

    scenes: tuple[SceneAudit, ...]
    others: tuple[Finding, ...]

    @functools.cached_property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, by scene."""
        found = [*self.others, *(one for audit in self.scenes for one in audit.findings)]
        return tuple(sorted(found, key=lambda finding: finding.scene))

    def of(self, check: Check) -> tuple[Finding, ...]:
        """What one check found."""
        return tuple(finding for finding in self.findings if finding.check == check)

    def without(self, *checks: Check) -> int:
        """How many of the scenes that were read show nothing in these checks."""
        return sum(not audit.has(*checks) for audit in self.scenes)

    @property
    def declared(self) -> int:
        """Declared dependencies; the ground is one."""
        return sum(audit.declared for audit in self.scenes)

    @property
    def contacts(self) -> int:
        """Contacts that carry; the ground is one."""
        return sum(audit.contacts for audit in self.scenes)

    @property
    def shared(self) -> int:
        """Declared dependencies that are contacts that carry."""
        return sum(audit.shared for audit in self.scenes)


@dataclass(frozen=True)
class Change:
    """One correction: a block's `field`, `depend` or `layer`, as it was and as it is now."""

    scene: str
    block: int
    field: str
    before: str
    after: str


@dataclass(frozen=True)
class Copied:
    """What a corrected copy holds: scenes written, changes made, and scenes that had to stay out.

    `left_out` says why, by scene.
    """

    scenes: int
    changes: tuple[Change, ...]
    left_out: Mapping[str, str]


def audit_scenes(
    tasks: Iterable[Task], settings: AuditSettings, jobs: int = 1
) -> Iterator[SceneAudit]:
    """Check many scenes in `jobs` processes; results come in the order given.

    Raises PhyblockError when a process is killed, SimulationError as the simulator does.
    """
    with open_workers(jobs) as workers:
        yield from workers.map(functools.partial(_audit_task, settings=settings), tasks)


def find_duplicates(scenes: Iterable[Scene]) -> tuple[Finding, ...]:
    """Scenes that equal an earlier one up to quarter turns, mirroring and shifting."""
    return tuple(
        Finding(
            name, "duplicate", f"is scene {twin}, turned, mirrored or shifted at most", found=twin
        )
        for name, twin in find_twins(scenes).items()
    )


def findings_csv(audit: Audit) -> str:
    """All findings as CSV text with a header."""
    levels = {one.scene.id: one.scene.level for one in audit.scenes}
    rows = [
        (
            *(one.scene, levels.get(one.scene, ""), one.check, " ".join(map(str, one.blocks))),
            *("" if one.size is None else f"{one.size:.3f}", one.unit),
            *(one.declared, one.found, one.message),
        )
        for one in audit.findings
    ]
    return _csv(_FINDING_COLUMNS, rows)


def changes_of(audit: SceneAudit) -> tuple[Change, ...]:
    """What the corrected scene says differently."""
    found: list[Change] = []
    for before, after in zip(audit.scene.blocks, audit.fixed.blocks, strict=True):
        said, seen = set(before.depend), set(after.depend)
        if said != seen:
            texts = (_orders(said), _orders(seen))
            found.append(Change(audit.scene.id, before.order, "depend", *texts))
        if before.layer != after.layer:
            layers = (str(before.layer), str(after.layer))
            found.append(Change(audit.scene.id, before.order, "layer", *layers))
    return tuple(found)


def write_fixed(
    folder: Path, audits: Iterable[SceneAudit], candidates: Mapping[str, CandidateSet | None]
) -> Copied:
    """Write `scenes.jsonl` with corrected dependencies and layers, and `changes.csv`.

    Scenes that the project's own format cannot hold stay out. Positions are as they were: an
    overlap or a gap is told, not mended. Raises StoreError when the folder holds a data set
    already or cannot be written.
    """
    lines: list[str] = []
    changes: list[Change] = []
    left_out: dict[str, str] = {}
    for audit in audits:
        offered = candidates[audit.scene.id]
        reason = _why_not(audit, offered)
        if offered is None or reason:
            left_out[audit.scene.id] = reason
            continue
        lines.append(scene_line(audit.fixed, offered))
        changes += changes_of(audit)
    rows = [(c.scene, str(c.block), c.field, c.before, c.after) for c in changes]
    texts = {
        SCENES_FILE: "".join(f"{line}\n" for line in lines),
        "changes.csv": _csv(("scene", "block", "field", "before", "after"), rows),
    }
    _write_new(folder, texts)
    return Copied(len(lines), tuple(changes), left_out)


def _audit_task(task: Task, settings: AuditSettings) -> SceneAudit:
    return audit_scene(*task, settings)


def _why_not(audit: SceneAudit, candidates: CandidateSet | None) -> str:
    """Why a scene cannot be in a data set; empty when it can."""
    if candidates is None:
        return "its candidate set cannot be read"
    if audit.has("candidates"):
        return "its candidate set lacks a block that it needs"
    if not audit.sound:
        return "neither its declared dependencies nor its contacts name an order"
    return ""


def _write_new(folder: Path, texts: Mapping[str, str]) -> None:
    check_free([folder / name for name in texts], "choose another folder")
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            atomic_write(folder / name, text)


def _csv(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(map(csv_cell, row) for row in rows)
    return text.getvalue()


def _orders(orders: set[int]) -> str:
    return " ".join(map(str, sorted(orders))) or "0"
