"""Deriving everything in a data set again: from the stored blocks, by geometry and physics."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np

from phyblock.domain.scene import Candidate, CandidateSet, Scene
from phyblock.errors import Problem, reason_of
from phyblock.files import read_text
from phyblock.making.checks import (
    CHECKS,
    FOREIGN,
    CheckName,
    Declared,
    Finding,
    SceneFacts,
    Tolerances,
    findings_of,
)
from phyblock.making.scenes.scene_files import SUMS_FILE
from phyblock.making.workers import Workers, open_workers
from phyblock.sim.pictures import PictureStyle, candidate_camera, on_the_floor, picture
from phyblock.stable import hex_digest
from phyblock.text import csv_cell

_VERIFIED: tuple[CheckName, ...] = (
    "size",
    "undeclared dependency",
    "dependency without contact",
    "layer",
    "order",
    "overlap",
    "floating",
    "unstable",
    "unstable step",
    "hidden",
    "too many candidates",
    "candidates",
    "distractor",
)
LAWS = tuple(dict.fromkeys(CHECKS[name].law for name in _VERIFIED))
"""What must hold in a scene by itself."""
Verified = dict[str, tuple[Finding, ...]]
"""What breaks each law; empty where it holds."""
_Task = tuple[Scene, CandidateSet]
_LEAST_PIXELS = 0.01
"""Two looks must differ in this share of a candidate's picture."""
_VISIBLE_STEP = 24
_CELL_PX = 128


def verify_scenes(tasks: Iterable[_Task], workers: Workers) -> Iterator[Verified]:
    """All of `LAWS` on each scene and its candidate set, in the order given."""
    return workers.map(verify_scene, tasks)


def verify_scene(task: _Task) -> Verified:
    """All of `LAWS` on one scene and its candidate set."""
    facts = SceneFacts(*task)
    findings = tuple(findings_of(facts, _VERIFIED))
    return {law: tuple(f for f in findings if CHECKS[f.check].law == law) for law in LAWS}


def check_looks(sets: Iterable[CandidateSet]) -> tuple[int, tuple[Problem, ...]]:
    """How many looks the candidate sets use, and the pairs that the camera cannot tell apart."""
    looks = {candidate.look: candidate for offered in sets for candidate in offered.candidates}
    pictures = {look: _pixels(candidate) for look, candidate in sorted(looks.items())}
    alike = []
    for (one, first), (other, second) in combinations(pictures.items(), 2):
        differing = (np.abs(first - second).max(axis=2) > _VISIBLE_STEP).mean()
        if differing < _LEAST_PIXELS:
            message = f"looks like {_text_of(looks[other])}"
            name = _text_of(looks[one])
            alike.append(Problem(name, message, "candidates", f"{differing:.2%}"))
    return len(looks), tuple(alike)


def check_sums(folder: Path) -> tuple[int, tuple[Problem, ...]]:
    """How many files `SHA256SUMS` names, and those that are missing or changed."""
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


def _pixels(candidate: Candidate) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    block = on_the_floor(candidate.type, candidate.color, candidate.euler_deg)
    image = picture([block], candidate_camera(block, PictureStyle()), "white", _CELL_PX)
    return np.asarray(image, dtype=np.int64)


def _text_of(candidate: Candidate) -> str:
    return f"{candidate.color} {candidate.type} at {candidate.euler_deg}"


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
