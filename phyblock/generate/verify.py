"""Deriving everything in a data set again: from the stored blocks, by geometry and physics."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from phyblock.domain.candidates import MAX_CANDIDATES, Candidate, CandidateSet
from phyblock.domain.scene import Block, Scene
from phyblock.errors import Problem
from phyblock.generate.acceptance import LEVEL_LIMITS, PREFIX_TRIAL
from phyblock.generate.symmetry import fingerprint
from phyblock.generate.visibility import hidden_blocks
from phyblock.generate.workers import Workers
from phyblock.generate.writing import SUMS_FILE
from phyblock.sim.pictures import PictureStyle, candidate_camera, on_the_floor
from phyblock.sim.render import picture
from phyblock.sim.stability import check
from phyblock.sim.steps import check_steps
from phyblock.sim.support import GROUND, find_gaps, find_overlaps, support_graph

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


def _limits(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
    layers = max(scene.graph.layers)
    for level in scene.levels:
        limits = LEVEL_LIMITS[level]
        if not limits.least_blocks <= len(scene) <= limits.most_blocks:
            allowed = f"{limits.least_blocks} to {limits.most_blocks} at level {level}"
            yield Problem(scene.id, "wrong size", "blocks", str(len(scene)), allowed)
        if layers > limits.most_layers:
            allowed = f"at most {limits.most_layers} at level {level}"
            yield Problem(scene.id, "too high", "layers", str(layers), allowed)


def _depend(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
    below = support_graph(scene.blocks)
    for i, block in enumerate(scene.blocks):
        rests_on = sorted(below[block.order] - {GROUND})
        if rests_on != sorted(block.depend):
            field = f"blocks[{i}].depend"
            found, allowed = str(list(block.depend) or [GROUND]), str(rests_on or [GROUND])
            yield Problem(scene.id, "differs from the contacts", field, found, allowed)


def _layers(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
    for i, (block, layer) in enumerate(zip(scene.blocks, scene.graph.layers, strict=True)):
        if block.layer != layer:
            message, field = "is not the longest path", f"blocks[{i}].layer"
            yield Problem(scene.id, message, field, str(block.layer), str(layer))


def _order(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
    if not scene.graph.is_valid(range(len(scene))):
        yield Problem(scene.id, "the stored order puts a block before its support", "blocks")


def _overlaps(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
    for one in find_overlaps(scene.blocks):
        message = f"blocks {one.first} and {one.second} overlap by {one.depth_m * 1000:.2f} mm"
        yield Problem(scene.id, message)


def _gaps(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
    for gap in find_gaps(scene.blocks):
        yield Problem(scene.id, f"block {gap.order} floats {gap.height_m * 1000:.2f} mm too high")


def _stability(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
    whole = check(scene.blocks)
    if not whole.stable:
        yield Problem(scene.id, f"blocks {list(whole.fallen)} fall when it is finished")


def _steps(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
    for count, step in enumerate(check_steps(scene.blocks, PREFIX_TRIAL), 1):
        if not step.stable:
            yield Problem(scene.id, f"blocks {list(step.fallen)} fall at step {count}")


def _visibility(scene: Scene, _: CandidateSet) -> Iterator[Problem]:
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


SCENE_CHECKS: Mapping[str, Callable[[Scene, CandidateSet], Iterable[Problem]]] = {
    "limits of its levels": _limits,
    "dependencies are contacts": _depend,
    "layers are longest paths": _layers,
    "order can be built": _order,
    "no overlap": _overlaps,
    "no gap": _gaps,
    "stands when finished": _stability,
    "stands at every step": _steps,
    "every block shows": _visibility,
    "candidate set": _candidates,
}
"""The checks of a scene by itself, by name."""


def check_duplicates(scenes: Iterable[Scene]) -> dict[str, Problem]:
    """Scenes, by id, that equal an earlier one but for turning, mirroring and shifting."""
    first: dict[bytes, str] = {}
    found: dict[str, Problem] = {}
    for scene in scenes:
        earlier = first.setdefault(fingerprint(scene.blocks), scene.id)
        if earlier != scene.id:
            found[scene.id] = Problem(scene.id, f"is scene {earlier}, turned, mirrored or shifted")
    return found


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
    lines = path.read_text(encoding="utf-8").splitlines()
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
