"""Auditing a whole data set: its scenes in several processes, totals, and all findings as CSV."""

from __future__ import annotations

import csv
import functools
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.making.auditing.scene_audit import SceneAudit, audit_scene
from phyblock.making.checks.finding import CheckName, Declared, Finding
from phyblock.making.checks.tolerances import FOREIGN, Tolerances
from phyblock.making.workers import open_workers
from phyblock.text import csv_cell

__all__ = ["Audit", "audit_scenes", "csv_text", "findings_csv", "shown_orders"]

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
        of_scenes = (finding for audit in self.scenes for finding in audit.findings)
        return tuple(sorted([*self.others, *of_scenes], key=lambda finding: finding.scene))

    def of(self, check: CheckName) -> tuple[Finding, ...]:
        """What one check found."""
        return tuple(finding for finding in self.findings if finding.check == check)

    def without(self, *checks: CheckName) -> int:
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


def audit_scenes(
    tasks: Iterable[Task], tolerances: Tolerances = FOREIGN, jobs: int = 1
) -> Iterator[SceneAudit]:
    """Check many scenes in `jobs` processes; results come in the order given.

    Raises PhyblockError when a process is killed, SimulationError as the simulator does.
    """
    with open_workers(jobs) as workers:
        yield from workers.map(functools.partial(_audit_task, tolerances=tolerances), tasks)


def findings_csv(audit: Audit) -> str:
    """All findings as CSV text with a header."""
    levels = {one.scene.id: one.scene.level for one in audit.scenes}
    rows = [
        (
            *(finding.scene, levels.get(finding.scene, ""), finding.check),
            " ".join(map(str, finding.blocks)),
            *("" if finding.value is None else f"{finding.value:.3f}", finding.unit),
            *(shown_orders(finding.declared), shown_orders(finding.derived), finding.message),
        )
        for finding in audit.findings
    ]
    return csv_text(_FINDING_COLUMNS, rows)


def shown_orders(value: Declared) -> str:
    """Orders as numbers with spaces between them; anything else as it is."""
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def csv_text(columns: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table as CSV text."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(map(csv_cell, row) for row in rows)
    return text.getvalue()


def _audit_task(task: Task, tolerances: Tolerances) -> SceneAudit:
    return audit_scene(*task, tolerances)
