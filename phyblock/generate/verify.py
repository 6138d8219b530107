"""Deriving everything in a data set again: from the stored blocks, by geometry and physics."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from phyblock.bounded import read_text
from phyblock.domain.candidates import MAX_CANDIDATES, Candidate, CandidateSet
from phyblock.domain.scene import Block, Scene
from phyblock.errors import Problem, said
from phyblock.generate.checks import (
    dependency_problems,
    finished_problems,
    gap_problems,
    layer_problems,
    order_problems,
    overlap_problems,
    size_problems,
    step_problems,
)
from phyblock.generate.symmetry import find_twins
from phyblock.generate.workers import Workers
from phyblock.generate.writing import SUMS_FILE
from phyblock.sim.pictures import PictureStyle, candidate_camera, on_the_floor
from phyblock.sim.render import picture
from phyblock.sim.visibility import hidden_blocks

__all__ = [
    "SCENE_CHECKS",
    "Found",
    "check_duplicates",
    "check_looks",
    "check_parents",
    "check_sums",
    "verify_scenes",
]

Found = dict[str, tuple[Problem, ...]]
"""What each check found wrong; empty when a check passed."""
_Task = tuple[Scene, CandidateSet]
_Check = Callable[[Scene, CandidateSet], Iterable[Problem]]
_LEAST_PIXELS = 0.01
"""Two looks must differ in this share of a candidate's picture."""
_VISIBLE_STEP = 24
_CELL_PX = 128


def verify_scenes(tasks: Iterable[_Task], workers: Workers) -> Iterator[Found]:
    """All of `SCENE_CHECKS` on each scene and its candidate set, in the order given."""
    return workers.map(_verify, tasks)


def _verify(task: _Task) -> Found:
    scene, candidates = task
    return {name: tuple(run(scene, candidates)) for name, run in SCENE_CHECKS.items()}


def _visibility(scene: Scene) -> Iterator[Problem]:
    for order in hidden_blocks(scene):
        yield Problem(scene.id, f"block {order} does not show in the goal picture")


def _candidates(scene: Scene, candidates: CandidateSet) -> Iterator[Problem]:
    if len(candidates) > MAX_CANDIDATES:
        found, allowed = str(len(candidates)), f"at most {MAX_CANDIDATES}"
        yield Problem(scene.id, "are too many", "candidates", found, allowed)
    for order in candidates.missing(scene):
        yield Problem(scene.id, f"hold nothing that block {order} needs", "candidates")
    looks = {block.look for block in scene.blocks}
    for i, candidate in enumerate(candidates.candidates):
        if candidate.look not in looks and not any(_near(candidate, b) for b in scene.blocks):
            message = "differs from every needed block by more than one attribute"
            yield Problem(scene.id, message, f"candidates[{i}]", str(candidate))


def _near(candidate: Candidate, block: Block) -> bool:
    """Other in orientation, in color, or in type alone; a pose of another type is its own."""
    if candidate.type != block.type:
        return candidate.color == block.color
    return candidate.color == block.color or candidate.look[2] == block.look[2]


def _of_scene(find: Callable[[Scene], Iterable[Problem]]) -> _Check:
    """A check that does not look at the candidates."""
    return lambda scene, _: find(scene)


SCENE_CHECKS: Mapping[str, _Check] = {
    "limits of its levels": _of_scene(size_problems),
    "dependencies are contacts": _of_scene(dependency_problems),
    "layers are longest paths": _of_scene(layer_problems),
    "order can be built": _of_scene(order_problems),
    "no overlap": _of_scene(overlap_problems),
    "no gap": _of_scene(gap_problems),
    "stands when finished": _of_scene(finished_problems),
    "stands at every step": _of_scene(step_problems),
    "every block shows": _of_scene(_visibility),
    "candidate set": _candidates,
}
"""The checks of a scene by itself, by name."""


def check_duplicates(scenes: Iterable[Scene]) -> dict[str, Problem]:
    """Scenes, by id, that equal an earlier one but for turning, mirroring and shifting."""
    return {
        name: Problem(name, f"is scene {twin}, turned, mirrored or shifted at most")
        for name, twin in find_twins(scenes).items()
    }


def check_parents(scenes: Sequence[Scene]) -> dict[str, Problem]:
    """Scenes, by id, whose parents are not base scenes of the same set."""
    bases = {scene.id for scene in scenes if scene.parents == (scene.id,)}
    found: dict[str, Problem] = {}
    for scene in scenes:
        strange = [parent for parent in scene.parents if parent not in bases]
        if strange or not scene.parents:
            message = "name no base scene of the set"
            found[scene.id] = Problem(scene.id, message, "parents", str(strange))
    return found


def check_looks(sets: Iterable[CandidateSet]) -> tuple[int, tuple[Problem, ...]]:
    """How many looks the candidate sets use, and the pairs that the camera cannot tell apart."""
    looks = {candidate.look: candidate for one in sets for candidate in one.candidates}
    pictures = {look: _pixels(candidate) for look, candidate in sorted(looks.items())}
    alike = []
    for (one, first), (other, second) in combinations(pictures.items(), 2):
        differing = (np.abs(first - second).max(axis=2) > _VISIBLE_STEP).mean()
        if differing < _LEAST_PIXELS:
            message = f"looks like {_said(looks[other])}"
            alike.append(Problem(_said(looks[one]), message, "candidates", f"{differing:.2%}"))
    return len(looks), tuple(alike)


def check_sums(folder: Path) -> tuple[int, tuple[Problem, ...]]:
    """How many files `SHA256SUMS` names, and those that are missing or changed."""
    path = folder / SUMS_FILE
    if not path.is_file():
        return 1, (Problem(str(path), "is missing"),)
    try:
        lines = read_text(path).splitlines()
    except (OSError, ValueError) as error:
        return 1, (Problem(str(path), f"cannot be read: {said(error)}"),)
    wrong = []
    for line in lines:
        digest, _, name = line.partition("  ")
        file = folder / name
        if not file.is_file():
            wrong.append(Problem(str(file), "is missing"))
        elif hashlib.sha256(file.read_bytes()).hexdigest() != digest:
            wrong.append(Problem(str(file), f"differs from its checksum in {SUMS_FILE}"))
    return len(lines), tuple(wrong)


def _pixels(candidate: Candidate) -> np.ndarray[tuple[int, ...], np.dtype[np.int64]]:
    block = on_the_floor(candidate.type, candidate.color, candidate.euler_deg)
    image = picture([block], candidate_camera(block, PictureStyle()), "white", _CELL_PX)
    return np.asarray(image, dtype=np.int64)


def _said(candidate: Candidate) -> str:
    return f"{candidate.color} {candidate.type} at {candidate.euler_deg}"
