"""Audit of scenes made elsewhere: geometry and physics against what was declared.

The tolerant sister of the acceptance test: it measures instead of refusing.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.making.checks.finding import CheckName, Declared, Finding
from phyblock.making.checks.scene_checks import findings_of
from phyblock.making.checks.scene_facts import SceneFacts
from phyblock.making.checks.tolerances import FOREIGN, Tolerances
from phyblock.making.workers import open_workers
from phyblock.text import csv_cell

AUDITED: tuple[CheckName, ...] = (
    "overlap",
    "floating",
    "undeclared dependency",
    "dependency without contact",
    "layer",
    "order",
    "unstable",
    "unstable step",
    "duplicate",
    "candidates",
)
"""Checks of an audit in the order of its tables: causes before their effects."""
_COLUMNS = ("scene", "level", "check", "blocks", "size", "unit", "declared", "found", "message")


@dataclass(frozen=True)
class SceneAudit:
    """Findings about one scene.

    `declared`, `contacts` and `shared` count dependencies (the ground is one): those declared,
    those that are contacts, and those that are both.
    """

    scene: Scene
    findings: tuple[Finding, ...]
    declared: int
    contacts: int
    shared: int

    def has(self, *checks: CheckName) -> bool:
        """True if one of these checks found something."""
        return any(finding.check in checks for finding in self.findings)

    @property
    def badness(self) -> tuple[float, float, int]:
        """Sort key: scenes that fall, then the largest overlap or gap [mm], then all findings."""
        falls = 2.0 * self.has("unstable") + 1.0 * self.has("unstable step")
        fit = [f.value or 0.0 for f in self.findings if f.check in ("overlap", "floating")]
        return falls, max(fit, default=0.0), len(self.findings)


def audit_scene(
    task: tuple[Scene, CandidateSet | None], tolerances: Tolerances = FOREIGN
) -> SceneAudit:
    """Check one scene; without candidates these are not checked.

    Raises SimulationError as the simulator does.
    """
    scene, candidates = task
    facts = SceneFacts(scene, candidates, tolerances)
    pairs = [(facts.declared[block.order], facts.contacts[block.order]) for block in scene.blocks]
    return SceneAudit(
        scene,
        tuple(findings_of(facts, tuple(name for name in AUDITED if name != "duplicate"))),
        declared=sum(len(declared) for declared, _ in pairs),
        contacts=sum(len(contacts) for _, contacts in pairs),
        shared=sum(len(declared & contacts) for declared, contacts in pairs),
    )


def audit_scenes(
    tasks: Iterable[tuple[Scene, CandidateSet | None]],
    tolerances: Tolerances = FOREIGN,
    jobs: int = 1,
) -> Iterator[SceneAudit]:
    """Check many scenes in `jobs` processes; results come in the order given.

    Raises PhyblockError when a process is killed, SimulationError as the simulator does.
    """
    with open_workers(jobs) as workers:
        yield from workers.map(partial(audit_scene, tolerances=tolerances), tasks)


def findings_csv(audits: Sequence[SceneAudit], others: Sequence[Finding] = ()) -> str:
    """Return all findings as CSV text with a header, sorted by scene."""
    levels = {audit.scene.id: audit.scene.level for audit in audits}
    findings = [*others, *(finding for audit in audits for finding in audit.findings)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(_COLUMNS)
    for finding in sorted(findings, key=lambda finding: finding.scene):
        row = (
            *(finding.scene, levels.get(finding.scene, ""), finding.check),
            " ".join(map(str, finding.blocks)),
            *("" if finding.value is None else f"{finding.value:.3f}", finding.unit),
            *(shown_orders(finding.declared), shown_orders(finding.derived), finding.message),
        )
        writer.writerow(map(csv_cell, row))
    return text.getvalue()


def shown_orders(value: Declared) -> str:
    """Return orders as numbers with spaces between them; anything else as text."""
    return " ".join(map(str, value)) if isinstance(value, tuple) else str(value)
