"""What a check finds wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

from phyblock.domain.aov import AOVGraph, CycleError
from phyblock.domain.blocks import KIT_PALETTE, BlockType, orientation_class
from phyblock.domain.scene import MAX_CANDIDATES, Block, CandidateSet, Kind, Scene
from phyblock.errors import Problem
from phyblock.making.poses import POSES, find_twins
from phyblock.sim.contact import (
    FIT_TOLERANCE_M,
    GROUND,
    Gap,
    Overlap,
    find_gaps,
    find_overlaps,
    support_graph,
)
from phyblock.sim.dynamics import (
    DEFAULT_TRIAL,
    Rest,
    Stability,
    Trial,
    check,
    check_steps,
)
from phyblock.sim.pictures import LEAST_SHOWN, PictureStyle, hidden_blocks, visible_shares

CheckName = Literal[
    "size",
    "palette",
    "overlap",
    "floating",
    "undeclared dependency",
    "dependency without contact",
    "layer",
    "order",
    "unstable",
    "unstable step",
    "hidden",
    "duplicate",
    "parents",
    "candidates",
    "too many candidates",
    "distractor",
]
Declared = str | int | tuple[int, ...]
"""A value of the file, or what it should be: a text, a number, or orders of blocks."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with a scene, and the one sentence that says so.

    `blocks` are orders of blocks, 0 the ground. `value` was measured and `tolerance` would have
    passed, both in `unit`. `field` is where the file says `declared`; `derived` is what geometry,
    physics or a limit says instead.
    """

    scene: str
    check: CheckName
    message: str
    blocks: tuple[int, ...] = ()
    value: float | None = None
    tolerance: float | None = None
    unit: str = ""
    field: str = ""
    declared: Declared = ""
    derived: Declared = ""

    @property
    def problem(self) -> Problem:
        """The finding as an error says it."""
        declared, derived = _shown(self.declared), _shown(self.derived)
        return Problem(self.scene, self.message, self.field, declared, derived)

    def __str__(self) -> str:
        return str(self.problem)


def _shown(value: Declared) -> str:
    """Orders as a list of the file; an empty list says nothing."""
    if isinstance(value, tuple):
        return str(list(value)) if value else ""
    return str(value)


VIEW = PictureStyle(size_px=256)
"""How the goal picture is drawn to see which blocks show in it."""

STEP_TRIAL = replace(DEFAULT_TRIAL, physics=DEFAULT_TRIAL.physics[:1])
"""Every step is tried at the first of the two time steps, for two seconds or until at rest."""

FINISHED_REST = Rest(quiet_s=0.5)
"""When the generator takes a finished structure to be at rest."""


@dataclass(frozen=True)
class Tolerances:
    """What passes: overlaps and gaps up to `fit_m` [m], movement within the limits of the trials.

    `trial` is that of the finished structure, which is watched to its end, or until it is at rest
    as `rest` says; `step_trial` that of every step, `last_step` whether of the last step, too.
    Of every block at least the share `shown` of its outline shows in the goal picture.
    """

    fit_m: float = FIT_TOLERANCE_M
    trial: Trial = DEFAULT_TRIAL
    step_trial: Trial = STEP_TRIAL
    rest: Rest | None = None
    last_step: bool = True
    shown: float = LEAST_SHOWN


OURS = Tolerances()
"""For scenes made here."""

OURS_IN_HASTE = Tolerances(rest=FINISHED_REST)
"""For scenes that are being made: the same, but a trial ends once all is at rest."""

# The last step of a foreign scene is left to the trial of the finished structure: what falls there
# shall be told once. 2 mm cannot be seen in a picture.
FOREIGN = Tolerances(fit_m=0.002, last_step=False)
"""For scenes made elsewhere, whose positions are written by hand in rounded millimeters."""


@dataclass(frozen=True)
class Limits:
    """How many blocks and layers a level allows (paper section 3.1)."""

    least_blocks: int
    most_blocks: int
    most_layers: int


LEVEL_LIMITS: dict[int, Limits] = {
    1: Limits(1, 4, 4),
    2: Limits(2, 5, 3),
    3: Limits(6, 12, 8),
    4: Limits(13, 22, 8),
}


class SceneFacts:
    """A scene whose orders are unique, and facts about it; each is worked out once, when asked for.

    The scene's dependencies need not be sound. Facts raise SimulationError as the simulator does.
    """

    def __init__(
        self,
        scene: Scene,
        candidates: CandidateSet | None = None,
        tolerances: Tolerances = OURS,
        palette: tuple[Kind, ...] = KIT_PALETTE,
    ) -> None:
        """Without `candidates` checks of them find nothing."""
        self.scene = scene
        self.candidates = candidates
        self.tolerances = tolerances
        self.palette = palette

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Blocks that share space, with one another or with the ground."""
        return find_overlaps(self.scene.blocks, self.tolerances.fit_m)

    @cached_property
    def gaps(self) -> tuple[Gap, ...]:
        """Blocks that hang above what is below them."""
        return find_gaps(self.scene.blocks, self.tolerances.fit_m)

    @cached_property
    def contacts(self) -> Mapping[int, frozenset[int]]:
        """For each block, by its order, the orders that it rests on; the ground only alone.

        Empty for a block that touches nothing below it.
        """
        graph = support_graph(self.scene.blocks)
        return {order: (below - {GROUND}) or below for order, below in graph.items()}

    @cached_property
    def declared(self) -> Mapping[int, frozenset[int]]:
        """The same as the file declares it."""
        return {block.order: declared_orders(block) for block in self.scene.blocks}

    @cached_property
    def graph(self) -> AOVGraph | None:
        """The graph of the declared dependencies; None when they are unsound."""
        return graph_of(self.declared)

    @cached_property
    def finished(self) -> Stability:
        """What becomes of the finished structure, watched to the end or until it is at rest."""
        blocks, trial, rest = self.scene.blocks, self.tolerances.trial, self.tolerances.rest
        return check(blocks, trial) if rest is None else check(blocks, trial, rest)

    @cached_property
    def steps(self) -> tuple[Stability, ...]:
        """What becomes of the structure after each step of the stored order."""
        blocks = self.scene.blocks if self.tolerances.last_step else self.scene.blocks[:-1]
        return check_steps(blocks, self.tolerances.step_trial)

    @cached_property
    def shown(self) -> Mapping[int, float]:
        """For each block, by its order, the share of its outline that shows in the goal picture."""
        return visible_shares(self.scene, VIEW)

    @cached_property
    def hidden(self) -> tuple[int, ...]:
        """Orders of the blocks that do not show in the goal picture."""
        return hidden_blocks(self.scene)


def declared_orders(block: Block) -> frozenset[int]:
    """The orders that a block is declared to rest on; the ground alone is {0}."""
    return frozenset(block.depend) or frozenset({GROUND})


def graph_of(rests_on: Mapping[int, frozenset[int]]) -> AOVGraph | None:
    """The graph over blocks in the order given; None for unknown blocks or a cycle."""
    vertex_of = {order: vertex for vertex, order in enumerate(rests_on)}
    if any(order not in vertex_of for orders in rests_on.values() for order in orders - {GROUND}):
        return None
    edges = [
        frozenset(vertex_of[order] for order in orders - {GROUND}) for orders in rests_on.values()
    ]
    try:
        return AOVGraph(tuple(edges))
    except CycleError:
        return None


@dataclass(frozen=True)
class Check:
    """A check; `law` is what holds where it finds nothing, several checks may share one."""

    name: CheckName
    law: str
    find: Callable[[SceneFacts], Iterable[Finding]]


def findings_of(facts: SceneFacts, names: Iterable[CheckName]) -> Iterator[Finding]:
    """What these checks find, in the order given; nothing is worked out before it is asked for."""
    for name in names:
        yield from CHECKS[name].find(facts)


def _size(facts: SceneFacts) -> Iterator[Finding]:
    """More or fewer blocks, or more layers, than a level of the scene allows."""
    scene = facts.scene
    layers = 0 if facts.graph is None else max(facts.graph.layers, default=0)
    for level in scene.levels:
        limits = LEVEL_LIMITS[level]
        if not limits.least_blocks <= len(scene) <= limits.most_blocks:
            allowed = f"{limits.least_blocks} to {limits.most_blocks} at level {level}"
            yield _sized(facts, "wrong size", "blocks", len(scene), allowed)
        if layers > limits.most_layers:
            allowed = f"at most {limits.most_layers} at level {level}"
            yield _sized(facts, "too high", "layers", layers, allowed)


def _palette(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks whose pair of type and color is not in the palette."""
    for at, block in _blocks(facts):
        if block.kind not in facts.palette:
            about, kind = (block.order,), " ".join(block.kind)
            message = "not in the palette"
            yield Finding(facts.scene.id, "palette", message, about, field=at, declared=kind)


def _layer(facts: SceneFacts) -> Iterator[Finding]:
    """Layers that are not the longest path of the declared dependencies, where these are sound."""
    layers = () if facts.graph is None else facts.graph.layers
    for (at, block), layer in zip(_blocks(facts), layers, strict=False):
        if block.layer != layer:
            message = (
                f"block {block.order} is on layer {block.layer}, but on {layer} by the longest "
                "path of dependencies"
            )
            yield Finding(
                facts.scene.id,
                "layer",
                message,
                (block.order,),
                field=f"{at}.layer",
                declared=block.layer,
                derived=layer,
            )


def _order(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that stand in the file before one that they depend on, if that is sound."""
    if facts.graph is None:
        return
    placed: set[int] = set()
    for block in facts.scene.blocks:
        early = sorted(set(block.depend) - placed)
        if early:
            message = f"the stored order puts block {block.order} before its support, {_all(early)}"
            about = (block.order, *early)
            yield Finding(facts.scene.id, "order", message, about, field="blocks")
        placed.add(block.order)


def _overlap(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that share space, with one another or with the ground."""
    for overlap in facts.overlaps:
        depth_mm = overlap.depth_m * 1000
        other = _name(overlap.first)
        message = f"block {overlap.second} overlaps {other} by {depth_mm:.2f} mm"
        pair = (overlap.first, overlap.second)
        yield Finding(facts.scene.id, "overlap", message, pair, depth_mm, _fit_mm(facts), "mm")


def _floating(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that hang above what is below them."""
    for gap in facts.gaps:
        height_mm = gap.height_m * 1000
        message = f"block {gap.order} floats {height_mm:.2f} mm above its support"
        about = (gap.order,)
        yield Finding(facts.scene.id, "floating", message, about, height_mm, _fit_mm(facts), "mm")


def _undeclared_dependency(facts: SceneFacts) -> Iterator[Finding]:
    """Contacts that carry and are not declared."""
    for at, block in _blocks(facts):
        declared, contacts = facts.declared[block.order], facts.contacts[block.order]
        for other in sorted(contacts - declared):
            message = f"block {block.order} rests on {_name(other)}, which is not declared"
            yield _dependency(facts, "undeclared dependency", message, at, (block.order, other))


def _dependency_without_contact(facts: SceneFacts) -> Iterator[Finding]:
    """Declared dependencies that are no contacts that carry."""
    for at, block in _blocks(facts):
        declared, contacts = facts.declared[block.order], facts.contacts[block.order]
        for other in sorted(declared - contacts):
            message = f"block {block.order} does not rest on {_name(other)}, which is declared"
            pair = (block.order, other)
            yield _dependency(facts, "dependency without contact", message, at, pair)


def _unstable_step(facts: SceneFacts) -> Iterator[Finding]:
    """Steps of the stored order after which something falls."""
    trial = facts.tolerances.step_trial
    for count, (block, step) in enumerate(zip(facts.scene.blocks, facts.steps, strict=False), 1):
        if not step.stable:
            message = f"{_falling(step)} at step {count}, once block {block.order} is placed"
            yield _fall(facts, "unstable step", message, step, trial)


def _unstable(facts: SceneFacts) -> Iterator[Finding]:
    """What falls from the finished structure."""
    whole = facts.finished
    if not whole.stable:
        differing = "" if whole.agreed else ", not the same ones at every time step"
        message = f"{_falling(whole)} when all is built{differing}"
        yield _fall(facts, "unstable", message, whole, facts.tolerances.trial)


def _hidden(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks of which too little shows in the goal picture, of the picture or of their outline."""
    for order in facts.hidden:
        message = f"block {order} does not show in the goal picture"
        yield Finding(facts.scene.id, "hidden", message, (order,))
    least = facts.tolerances.shown
    for order, share in facts.shown.items():
        if share < least and order not in facts.hidden:
            message = f"only {share:.1%} of the outline of block {order} shows in the goal picture"
            covered, limit = 100 * (1 - share), 100 * (1 - least)
            yield Finding(facts.scene.id, "hidden", message, (order,), covered, limit, "%")


def _lacking_candidates(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that no candidate can stand for."""
    missing = () if facts.candidates is None else facts.candidates.missing(facts.scene)
    for order in missing:
        message = f"the candidates hold nothing that block {order} needs"
        yield Finding(facts.scene.id, "candidates", message, (order,), field="candidates")


def _too_many_candidates(facts: SceneFacts) -> Iterator[Finding]:
    """More candidates than a set may hold."""
    count = 0 if facts.candidates is None else len(facts.candidates)
    if count > MAX_CANDIDATES:
        yield Finding(
            facts.scene.id,
            "too many candidates",
            "the candidates are too many",
            field="candidates",
            declared=count,
            derived=f"at most {MAX_CANDIDATES}",
        )


def _distractors(facts: SceneFacts) -> Iterator[Finding]:
    """Candidates that are not needed in poses that no design knows: these give themselves away."""
    scene = facts.scene
    looks = {block.look for block in scene.blocks}
    offered = () if facts.candidates is None else facts.candidates.candidates
    for i, candidate in enumerate(offered):
        if candidate.look not in looks and candidate.look[2] not in _poses(candidate.type):
            message = "is not needed and stands as no block of a goal does"
            yield Finding(
                scene.id,
                "distractor",
                f"candidate {i + 1} {message}",
                field=f"candidates[{i}]",
                declared=str(candidate),
            )


def _blocks(facts: SceneFacts) -> Iterator[tuple[str, Block]]:
    """Each block with its field in the file."""
    for i, block in enumerate(facts.scene.blocks):
        yield f"blocks[{i}]", block


def _sized(facts: SceneFacts, message: str, field: str, count: int, allowed: str) -> Finding:
    return Finding(facts.scene.id, "size", message, field=field, declared=count, derived=allowed)


def _dependency(
    facts: SceneFacts, check: CheckName, message: str, at: str, pair: tuple[int, int]
) -> Finding:
    return Finding(
        facts.scene.id,
        check,
        message,
        pair,
        field=f"{at}.depend",
        declared=tuple(sorted(facts.declared[pair[0]])),
        derived=tuple(sorted(facts.contacts[pair[0]])),
    )


def _fall(
    facts: SceneFacts, check: CheckName, message: str, shown: Stability, trial: Trial
) -> Finding:
    moved_mm, limit_mm = shown.moved_m * 1000, trial.limit_m * 1000
    return Finding(facts.scene.id, check, message, shown.fallen, moved_mm, limit_mm, "mm")


def _poses(block_type: BlockType) -> set[tuple[float, ...]]:
    """The orientation classes in which designs lay down a type."""
    return {orientation_class(block_type, euler) for euler in POSES[block_type].values()}


def _fit_mm(facts: SceneFacts) -> float:
    return facts.tolerances.fit_m * 1000


def _falling(shown: Stability) -> str:
    named = ", ".join(map(str, shown.fallen))
    return f"blocks {named} fall" if len(shown.fallen) > 1 else f"block {named} falls"


def _name(order: int) -> str:
    return "the ground" if order == GROUND else f"block {order}"


def _all(orders: Sequence[int]) -> str:
    return ", ".join(map(_name, orders))


CHECKS: Mapping[CheckName, Check] = {
    check.name: check
    for check in (
        Check("size", "limits of its levels", _size),
        Check("palette", "colors of the palette", _palette),
        Check("undeclared dependency", "dependencies are contacts", _undeclared_dependency),
        Check(
            "dependency without contact", "dependencies are contacts", _dependency_without_contact
        ),
        Check("layer", "layers are longest paths", _layer),
        Check("order", "order can be built", _order),
        Check("overlap", "no overlap", _overlap),
        Check("floating", "no gap", _floating),
        Check("unstable", "stands when finished", _unstable),
        Check("unstable step", "stands at every step", _unstable_step),
        Check("hidden", "every block shows", _hidden),
        Check("too many candidates", "candidate set", _too_many_candidates),
        Check("candidates", "candidate set", _lacking_candidates),
        Check("distractor", "candidate set", _distractors),
    )
}
"""The checks of a scene by itself."""


def find_duplicates(scenes: Iterable[Scene]) -> tuple[Finding, ...]:
    """Scenes that equal an earlier one up to quarter turns, mirroring and shifting."""
    return tuple(
        Finding(
            name, "duplicate", f"is scene {twin}, turned, mirrored or shifted at most", derived=twin
        )
        for name, twin in find_twins(scenes).items()
    )


def find_orphans(scenes: Sequence[Scene]) -> Iterator[Finding]:
    """Scenes whose parents are not base scenes of the same set."""
    bases = {scene.id for scene in scenes if scene.parents == (scene.id,)}
    for scene in scenes:
        strange = [parent for parent in scene.parents if parent not in bases]
        if strange or not scene.parents:
            message = "name no base scene of the set"
            yield Finding(scene.id, "parents", message, field="parents", declared=str(strange))


FORM: tuple[CheckName, ...] = ("size", "palette", "layer", "order")
"""Checks without physics."""
# Cheap ones first.
PHYSICS: tuple[CheckName, ...] = (
    "overlap",
    "floating",
    "undeclared dependency",
    "dependency without contact",
    "unstable step",
    "unstable",
)
"""Overlaps, floating blocks, wrong dependencies, and what does not stand."""


def is_acceptable(scene: Scene, palette: tuple[Kind, ...]) -> bool:
    """Whether a scene could enter a data set, each of its blocks to be seen in the goal picture.

    It ends at the first fault, and a trial ends once all is at rest, at both time steps.
    """
    facts = SceneFacts(scene, tolerances=OURS_IN_HASTE, palette=palette)
    return next(findings_of(facts, (*FORM, "hidden", *PHYSICS)), None) is None
