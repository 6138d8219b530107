"""Checks of scenes by geometry and physics, used to make, verify and audit sets."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import NamedTuple

from phyblock.domain.blocks import KIT_PALETTE, orientation_class
from phyblock.domain.scene import MAX_CANDIDATES, CandidateSet, Kind, Scene
from phyblock.domain.symmetry import fingerprint
from phyblock.errors import Problem
from phyblock.making.scenes.sketch import POSES
from phyblock.sim.contact import FIT_TOLERANCE_M, GROUND, find_gaps, find_overlaps, support_graph
from phyblock.sim.dynamics import (
    DEFAULT_TRIAL,
    MOST_PROVEN,
    Stability,
    Trial,
    check,
    check_steps,
    groups,
    is_proven,
    stands,
)
from phyblock.sim.pictures import LEAST_SHOWN, PictureStyle, hidden_blocks, visible_shares


@dataclass(frozen=True)
class Finding:
    """One problem of a scene, with a sentence that describes it.

    `blocks` are orders of blocks, 0 the ground. `field` is the place of `found` in the file;
    `allowed` is the value by geometry, physics or a limit. `value_mm` was measured, and a value up
    to `tolerance_mm` would pass.
    """

    scene: str
    check: str
    message: str
    blocks: tuple[int, ...] = ()
    field: str = ""
    found: str = ""
    allowed: str = ""
    value_mm: float | None = None
    tolerance_mm: float | None = None

    @property
    def problem(self) -> Problem:
        """The finding as an error."""
        return Problem(self.scene, self.message, self.field, self.found, self.allowed)

    def __str__(self) -> str:
        return str(self.problem)


@dataclass(frozen=True)
class Tolerances:
    """Limits: overlaps and gaps up to `fit_m` [m], movement within the limits of a trial.

    The finished structure is simulated to the end of the `trial`, or until it is at rest for
    `quiet_s` [s]. Each earlier step is tried at the first of the trial's time steps.
    """

    fit_m: float = FIT_TOLERANCE_M
    trial: Trial = DEFAULT_TRIAL
    quiet_s: float | None = None


OURS = Tolerances()
"""For scenes made here."""
FOREIGN = Tolerances(fit_m=0.002, quiet_s=0.5)  # 2 mm cannot be seen in a picture.
"""For scenes made elsewhere, with positions written by hand in rounded millimeters."""


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
    """A scene with cached facts for its checks; without `candidates` their checks find nothing."""

    scene: Scene
    candidates: CandidateSet | None = None
    tolerances: Tolerances = OURS
    palette: tuple[Kind, ...] = KIT_PALETTE

    @cached_property
    def contacts(self) -> Mapping[int, frozenset[int]]:
        """For each block, by its order, the orders that it rests on; the ground only by itself.

        Empty for a block that touches nothing below it.
        """
        graph = support_graph(self.scene.blocks)
        return {order: (below - {GROUND}) or below for order, below in graph.items()}

    def finding(self, check: str, message: str, *blocks: int, **about: object) -> Finding:
        """Return a finding about the scene; `about` are further fields of it."""
        return Finding(self.scene.id, check, message, blocks, **about)  # type: ignore[arg-type]

    def measured(
        self, check: str, message: str, *blocks: int, value_m: float, limit_m: float
    ) -> Finding:
        """Return a finding about a length that exceeds a limit [m]."""
        about = {"value_mm": value_m * 1000, "tolerance_mm": limit_m * 1000}
        return self.finding(check, message, *blocks, **about)


def _size(facts: SceneFacts) -> Iterator[Finding]:
    """More or fewer blocks, or more layers, than a level of the scene allows."""
    count, layers = len(facts.scene), max(facts.scene.graph.layers, default=0)
    for level in facts.scene.levels:
        least, most, most_layers = LEVEL_LIMITS[level]
        if not least <= count <= most:
            about = {"found": str(count), "allowed": f"{least} to {most} at level {level}"}
            yield facts.finding("size", "wrong size", field="blocks", **about)
        if layers > most_layers:
            about = {"found": str(layers), "allowed": f"at most {most_layers} at level {level}"}
            yield facts.finding("size", "too high", field="layers", **about)


def _palette(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks whose pair of type and color is not in the palette."""
    for i, block in enumerate(facts.scene.blocks):
        if block.kind not in facts.palette:
            about = {"field": f"blocks[{i}]", "found": " ".join(block.kind)}
            yield facts.finding("palette", "not in the palette", block.order, **about)


def _layer(facts: SceneFacts) -> Iterator[Finding]:
    """Layers that are not the longest path of the declared dependencies."""
    for i, (block, layer) in enumerate(
        zip(facts.scene.blocks, facts.scene.graph.layers, strict=True)
    ):
        if block.layer != layer:
            message = (
                f"block {block.order} is on layer {block.layer}, but on {layer} by the longest "
                "path of dependencies"
            )
            yield facts.finding("layer", message, block.order, field=f"blocks[{i}].layer")


def _order(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that come in the file before one that they depend on."""
    placed: set[int] = set()
    for block in facts.scene.blocks:
        if early := sorted(set(block.depend) - placed):
            supports = ", ".join(map(_name, early))
            message = f"the stored order puts block {block.order} before its support, {supports}"
            yield facts.finding("order", message, block.order, *early, field="blocks")
        placed.add(block.order)


def _hidden(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks too little of which is visible in the goal picture, by area or outline."""
    hidden = hidden_blocks(facts.scene)
    for order in hidden:
        yield facts.finding("hidden", f"block {order} does not show in the goal picture", order)
    for order, share in visible_shares(facts.scene, PictureStyle(size_px=256)).items():
        if share < LEAST_SHOWN and order not in hidden:
            message = f"only {share:.1%} of the outline of block {order} shows in the goal picture"
            yield facts.finding("hidden", message, order, allowed=f"at least {LEAST_SHOWN:.0%}")


def _overlap(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that share space, with one another or with the ground."""
    limit_m = facts.tolerances.fit_m
    for one in find_overlaps(facts.scene.blocks, limit_m):
        message = f"block {one.second} overlaps {_name(one.first)} by {one.depth_m * 1000:.2f} mm"
        about = (one.first, one.second)
        yield facts.measured("overlap", message, *about, value_m=one.depth_m, limit_m=limit_m)


def _floating(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that hang above what is below them."""
    limit_m = facts.tolerances.fit_m
    for gap in find_gaps(facts.scene.blocks, limit_m):
        message = f"block {gap.order} floats {gap.height_m * 1000:.2f} mm above its support"
        about = {"value_m": gap.height_m, "limit_m": limit_m}
        yield facts.measured("floating", message, gap.order, **about)


def _dependencies(facts: SceneFacts, check: str) -> Iterator[Finding]:
    """Supporting contacts that are not declared, or declared dependencies without contact."""
    is_undeclared = check == "undeclared dependency"
    for i, block in enumerate(facts.scene.blocks):
        order, declared = block.order, frozenset(block.depend or {GROUND})
        contacts = facts.contacts[order]
        for other in sorted(contacts - declared if is_undeclared else declared - contacts):
            message = f"block {order} does not rest on {_name(other)}, which is declared"
            if is_undeclared:
                message = f"block {order} rests on {_name(other)}, which is not declared"
            about = {"found": str(sorted(declared)), "allowed": str(sorted(contacts))}
            yield facts.finding(check, message, order, other, field=f"blocks[{i}].depend", **about)


def _unstable_step(facts: SceneFacts) -> Iterator[Finding]:
    """Steps of the stored order, before the last one, after which something falls."""
    trial, blocks = facts.tolerances.trial, facts.scene.blocks
    first = replace(trial, physics=trial.physics[:1])
    for count, step in enumerate(check_steps(blocks[:-1], first), 1):
        if not step.stable:
            when = f"at step {count}, once block {blocks[count - 1].order} is placed"
            yield _fall(facts, "unstable step", when, step)


def _unstable(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that fall from the finished structure."""
    whole = check(facts.scene.blocks, facts.tolerances.trial, facts.tolerances.quiet_s)
    if not whole.stable:
        differing = "" if whole.agreed else ", not the same ones at every time step"
        yield _fall(facts, "unstable", f"when all is built{differing}", whole)


def _fall(facts: SceneFacts, check: str, when: str, shown: Stability) -> Finding:
    named = ", ".join(map(str, shown.fallen))
    falling = f"blocks {named} fall" if len(shown.fallen) > 1 else f"block {named} falls"
    about = {"value_m": shown.moved_m, "limit_m": facts.tolerances.trial.limit_m}
    return facts.measured(check, f"{falling} {when}", *shown.fallen, **about)


def _candidates(facts: SceneFacts) -> Iterator[Finding]:
    """Too many candidates, and blocks without a candidate."""
    if facts.candidates is None:
        return
    if len(facts.candidates) > MAX_CANDIDATES:
        about = {"found": str(len(facts.candidates)), "allowed": f"at most {MAX_CANDIDATES}"}
        yield facts.finding("candidates", "too many candidates", field="candidates", **about)
    for order in facts.candidates.missing(facts.scene):
        message = f"the candidates hold nothing that block {order} needs"
        yield facts.finding("candidates", message, order, field="candidates")


def _distractor(facts: SceneFacts) -> Iterator[Finding]:
    """Distractors in poses that no design uses, which give themselves away."""
    needed = {block.look for block in facts.scene.blocks}
    for i, one in enumerate(facts.candidates.candidates if facts.candidates else ()):
        poses = {orientation_class(one.type, euler) for euler in POSES[one.type].values()}
        if one.look not in needed and one.look[2] not in poses:
            message = f"candidate {i + 1} is not needed and stands as no block of a goal does"
            yield facts.finding("distractor", message, field=f"candidates[{i}]", found=str(one))


def _name(order: int) -> str:
    return "the ground" if order == GROUND else f"block {order}"


CHECKS: dict[str, Callable[[SceneFacts], Iterable[Finding]]] = {
    "size": _size,
    "palette": _palette,
    "layer": _layer,
    "order": _order,
    "hidden": _hidden,
    "overlap": _overlap,
    "floating": _floating,
    "undeclared dependency": partial(_dependencies, check="undeclared dependency"),
    "dependency without contact": partial(_dependencies, check="dependency without contact"),
    "unstable step": _unstable_step,
    "unstable": _unstable,
    "candidates": _candidates,
    "distractor": _distractor,
}
"""The checks of a single scene, cheap ones first, and causes before their effects."""
FORM = tuple(CHECKS)[:4]
"""Checks without geometry."""
PHYSICS = tuple(CHECKS)[5:11]
"""Overlaps, floating blocks, wrong dependencies, and falls."""
VERIFIED = tuple(name for name in CHECKS if name != "palette")
"""Checks of a scene that was made here, with its candidates."""
FOREIGN_CHECKS = (*PHYSICS, "layer", "order", "candidates")
"""Checks of a scene made elsewhere."""


def findings_of(facts: SceneFacts, names: Iterable[str]) -> Iterator[Finding]:
    """Yield the findings of these checks, each computed on demand.

    Raises SimulationError as the simulator does.
    """
    for name in names:
        yield from CHECKS[name](facts)


def is_acceptable(scene: Scene, palette: tuple[Kind, ...]) -> bool:
    """True if a scene could enter a data set: proven to stand, with margins, and
    with each of its blocks visible in the goal picture. The check ends at the first fault.
    """
    facts = SceneFacts(scene, palette=palette)
    found = findings_of(facts, (*FORM, "hidden", *PHYSICS))
    return (
        all(map(is_proven, groups(scene.blocks)))
        # Runs watch until all is at rest, and a tall column may sway past a limit by then.
        and (len(scene) <= MOST_PROVEN or stands(scene.blocks))
        and next(found, None) is None
    )


Task = tuple[Scene, CandidateSet | None]


def verify_scene(task: Task) -> tuple[Finding, ...]:
    """Return the findings about a scene and its candidate set."""
    return tuple(findings_of(SceneFacts(*task), VERIFIED))


def verify_foreign(task: Task, tolerances: Tolerances = FOREIGN) -> tuple[Finding, ...]:
    """Return the findings about a scene of the official data and its candidate set."""
    return tuple(findings_of(SceneFacts(*task, tolerances), FOREIGN_CHECKS))


def check_set(scenes: Sequence[Scene]) -> tuple[Finding, ...]:
    """Return scenes that equal an earlier one up to quarter turns, mirroring and shifting, and
    those whose parents are not base scenes of the set.
    """
    found: list[Finding] = []
    first: dict[bytes, str] = {}
    bases = {scene.id for scene in scenes if scene.parents == (scene.id,)}
    for scene in scenes:
        if (twin := first.setdefault(fingerprint(scene.blocks), scene.id)) != scene.id:
            message = f"is scene {twin}, turned, mirrored or shifted at most"
            found.append(Finding(scene.id, "duplicate", message))
        strange = [parent for parent in scene.parents if parent not in bases]
        if strange or not scene.parents:
            message = "name no base scene of the set"
            found.append(Finding(scene.id, "parents", message, (), "parents", str(strange)))
    return tuple(found)
