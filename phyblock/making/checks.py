"""Checks of scenes by geometry and physics, used to make, verify and audit sets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

from phyblock.domain.blocks import orientation_class
from phyblock.domain.scene import AssemblyTask, CandidateSet, Scene, fingerprint
from phyblock.errors import Problem
from phyblock.making.scenes.sketch import POSES
from phyblock.sim import dynamics
from phyblock.sim.contact import FIT_TOLERANCE_M, GROUND, find_gaps, find_overlaps, support_graph
from phyblock.sim.dynamics import DEFAULT_TRIAL, Stability, Trial, check
from phyblock.sim.pictures import LEAST_SHOWN, PictureStyle, hidden_blocks, visible_shares


@dataclass(frozen=True)
class Finding(Problem):
    """One problem of the scene `where`, found by a check, with a sentence that describes it.

    `blocks` are orders, 0 the ground; `allowed` is what geometry, physics or a limit requires.
    """

    check: str = ""
    blocks: tuple[int, ...] = ()


class Limits(NamedTuple):
    """The blocks and layers that a level allows (paper section 3.1)."""

    least_blocks: int
    most_blocks: int
    most_layers: int


LEVEL_LIMITS: dict[int, Limits] = {
    1: Limits(1, 4, 4),
    2: Limits(2, 5, 3),
    3: Limits(6, 12, 8),
    4: Limits(13, 22, 8),
    5: Limits(23, 40, 20),
}


@dataclass(frozen=True)
class SceneFacts:
    """A scene with cached facts for its checks; without `candidates`, checks of them find nothing.

    Overlaps and gaps may be up to `fit_m` [m]. The finished structure is simulated for the `trial`,
    or until at rest for `quiet_s` [s]; earlier steps only at the trial's first time step.
    """

    scene: Scene
    candidates: CandidateSet | None = None
    fit_m: float = FIT_TOLERANCE_M
    trial: Trial = DEFAULT_TRIAL
    quiet_s: float | None = None

    @cached_property
    def contacts(self) -> Mapping[int, frozenset[int]]:
        """By order, the orders a block rests on: the ground only if alone, none if it floats."""
        graph = support_graph(self.scene.blocks)
        return {order: (below - {GROUND}) or below for order, below in graph.items()}


def _fault(
    message: str, *blocks: int, field: str = "", found: object = "", allowed: str = ""
) -> Finding:
    return Finding("", message, field, str(found), allowed, blocks=blocks)


def _size(facts: SceneFacts) -> Iterator[Finding]:
    """More or fewer blocks, or more layers, than a level of the scene allows."""
    count, layers = len(facts.scene), max(facts.scene.graph.layers, default=0)
    for level in facts.scene.levels:
        least, most, most_layers = LEVEL_LIMITS[level]
        if not least <= count <= most:
            allowed = f"{least} to {most} at level {level}"
            yield _fault("wrong size", field="blocks", found=count, allowed=allowed)
        if layers > most_layers:
            allowed = f"at most {most_layers} at level {level}"
            yield _fault("too high", field="layers", found=layers, allowed=allowed)


def _layer(facts: SceneFacts) -> Iterator[Finding]:
    """Layers that are not the longest path of the declared dependencies."""
    both = zip(facts.scene.blocks, facts.scene.graph.layers, strict=True)
    for i, (block, layer) in enumerate(both):
        if block.layer != layer:
            message = (
                f"block {block.order} is on layer {block.layer}, but on {layer} by dependencies"
            )
            yield _fault(message, block.order, field=f"blocks[{i}].layer")


def _order(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks listed in the file before one that they depend on."""
    placed: set[int] = set()
    for block in facts.scene.blocks:
        if early := sorted(set(block.depend) - placed):
            supports = ", ".join(map(_name, early))
            message = f"the stored order puts block {block.order} before its support, {supports}"
            yield _fault(message, block.order, *early, field="blocks")
        placed.add(block.order)


def _hidden(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks with too little area or outline visible in the goal picture."""
    hidden = hidden_blocks(facts.scene)
    for order in hidden:
        yield _fault(f"block {order} does not show in the goal picture", order)
    for order, share in visible_shares(facts.scene, PictureStyle(size_px=256)).items():
        if share < LEAST_SHOWN and order not in hidden:
            message = f"only {share:.1%} of the outline of block {order} shows in the goal picture"
            yield _fault(message, order, allowed=f"at least {LEAST_SHOWN:.0%}")


def _overlap(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that share space with each other or with the ground."""
    for one in find_overlaps(facts.scene.blocks, facts.fit_m):
        message = f"block {one.second} overlaps {_name(one.first)} by {one.depth_m * 1000:.2f} mm"
        yield _fault(message, one.first, one.second)


def _floating(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks with a gap below them."""
    for order, height_m in find_gaps(facts.scene.blocks, facts.fit_m).items():
        message = f"block {order} floats {height_m * 1000:.2f} mm above its support"
        yield _fault(message, order)


def _dependencies(facts: SceneFacts, is_declared: bool) -> Iterator[Finding]:
    """Declared dependencies without contact, or supporting contacts that are not declared."""
    for i, block in enumerate(facts.scene.blocks):
        order, declared = block.order, frozenset(block.depend or {GROUND})
        contacts = facts.contacts[order]
        for other in sorted(declared - contacts if is_declared else contacts - declared):
            message = f"block {order} rests on {_name(other)}, which is not declared"
            if is_declared:
                message = f"block {order} does not rest on {_name(other)}, which is declared"
            found, allowed = sorted(declared), str(sorted(contacts))
            field = f"blocks[{i}].depend"
            yield _fault(message, order, other, field=field, found=found, allowed=allowed)


def _unstable_step(facts: SceneFacts) -> Iterator[Finding]:
    """Steps of the stored order, before the last one, after which something falls."""
    blocks, first = facts.scene.blocks, replace(facts.trial, physics=facts.trial.physics[:1])
    for count, step in enumerate(dynamics.check_steps(blocks[:-1], first), 1):
        if step.fallen:
            when = f"at step {count}, once block {blocks[count - 1].order} is placed"
            yield _fall(step, when, first)


def _unstable(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that fall from the finished structure."""
    whole = check(facts.scene.blocks, facts.trial, facts.quiet_s)
    if whole.fallen:
        differing = "" if whole.agreed else ", not the same ones at every time step"
        yield _fall(whole, f"when all is built{differing}", facts.trial)


def _fall(shown: Stability, when: str, trial: Trial) -> Finding:
    named = ", ".join(map(str, shown.fallen))
    falling = f"blocks {named} fall" if len(shown.fallen) > 1 else f"block {named} falls"
    moved, limit = f"moved {shown.moved_m * 1000:.0f} mm", f"{trial.limit_m * 1000:g} mm"
    return _fault(f"{falling} {when}", *shown.fallen, found=moved, allowed=limit)


def _candidates(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks without a candidate."""
    given = facts.candidates
    for order in () if given is None else given.missing(facts.scene):
        message = f"the candidates hold nothing that block {order} needs"
        yield _fault(message, order, field="candidates")


def _distractor(facts: SceneFacts) -> Iterator[Finding]:
    """Distractors in poses that no design uses, which give themselves away."""
    needed = {block.look for block in facts.scene.blocks}
    for i, one in enumerate(facts.candidates.candidates if facts.candidates else ()):
        poses = {orientation_class(one.type, euler) for euler in POSES[one.type].values()}
        if one.look not in needed and one.look[2] not in poses:
            message = f"candidate {i + 1} is not needed, and no goal has it in this pose"
            yield _fault(message, field=f"candidates[{i}]", found=one)


def _name(order: int) -> str:
    return "the ground" if order == GROUND else f"block {order}"


CHECKS: dict[str, Callable[[SceneFacts], Iterable[Finding]]] = {
    "size": _size,
    "layer": _layer,
    "order": _order,
    "hidden": _hidden,
    "overlap": _overlap,
    "floating": _floating,
    "undeclared dependency": partial(_dependencies, is_declared=False),
    "dependency without contact": partial(_dependencies, is_declared=True),
    "unstable step": _unstable_step,
    "unstable": _unstable,
    "candidates": _candidates,
    "distractor": _distractor,
}
"""The checks of a scene with its candidates, cheap ones first, and causes before effects."""
FORM = tuple(CHECKS)[:3]
"""Checks without geometry."""
PHYSICS = tuple(CHECKS)[4:10]
"""Overlaps, floating blocks, wrong dependencies, and falls."""
FOREIGN_CHECKS = (*PHYSICS, "layer", "order", "candidates")
"""Checks of a scene made elsewhere."""


def findings_of(facts: SceneFacts, names: Iterable[str]) -> Iterator[Finding]:
    """Yield the findings of these checks, each computed on demand; raises as the simulator does."""
    for name in names:
        for found in CHECKS[name](facts):
            yield replace(found, where=facts.scene.id, check=name)


def is_acceptable(scene: Scene) -> bool:
    """True if a scene could enter a set: proven to stand with margins, each block visible."""
    found = findings_of(SceneFacts(scene), (*FORM, "hidden", *PHYSICS))
    return (
        all(map(dynamics.is_proven, dynamics.groups(scene.blocks)))
        # Runs simulate until all is at rest, and a tall column may sway past a limit by then.
        and (len(scene) <= dynamics.MOST_PROVEN or dynamics.stands(scene.blocks))
        and next(found, None) is None
    )


def verify_scene(task: AssemblyTask) -> tuple[Finding, ...]:
    """Return the findings about a scene and its candidate set."""
    return tuple(findings_of(SceneFacts(task.scene, task.candidates), CHECKS))


def verify_foreign(task: AssemblyTask, trial: Trial = DEFAULT_TRIAL) -> tuple[Finding, ...]:
    """Return findings on a task of the official data, whose positions are rounded millimeters."""
    # 2 mm cannot be seen in a picture.
    facts = SceneFacts(task.scene, task.candidates, fit_m=0.002, trial=trial, quiet_s=0.5)
    return tuple(findings_of(facts, FOREIGN_CHECKS))


def check_set(scenes: Sequence[Scene]) -> tuple[Finding, ...]:
    """Return findings on scenes that equal an earlier one up to quarter turns, mirroring and
    shifting, and on those whose parents are not base scenes of the set.
    """
    found: list[Finding] = []
    first: dict[bytes, str] = {}
    bases = {scene.id for scene in scenes if scene.parents == (scene.id,)}
    for scene in scenes:
        if (twin := first.setdefault(fingerprint(scene.blocks), scene.id)) != scene.id:
            message = f"is scene {twin}, turned, mirrored or shifted at most"
            found.append(Finding(scene.id, message, check="duplicate"))
        strange = [parent for parent in scene.parents if parent not in bases]
        if strange or not scene.parents:
            message = "name no base scene of the set"
            found.append(Finding(scene.id, message, "parents", str(strange), check="parents"))
    return tuple(found)
