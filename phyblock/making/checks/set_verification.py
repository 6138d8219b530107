"""Deriving everything in a data set again: from the stored blocks, by geometry and physics."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import combinations
from pathlib import Path

import numpy as np

from phyblock.domain.candidates import Candidate, CandidateSet
from phyblock.domain.scene import Scene
from phyblock.errors import Problem, reason_of
from phyblock.files import read_text
from phyblock.making.checks.finding import CheckName, Finding
from phyblock.making.checks.scene_checks import CHECKS, findings_of
from phyblock.making.checks.scene_facts import SceneFacts
from phyblock.making.scenes.scene_files import SUMS_FILE
from phyblock.making.workers import Workers
from phyblock.sim.pictures import PictureStyle, candidate_camera, on_the_floor
from phyblock.sim.render import picture
from phyblock.stable import hex_digest

__all__ = [
    "LAWS",
    "Verified",
    "check_looks",
    "check_sums",
    "verify_scene",
    "verify_scenes",
]

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
