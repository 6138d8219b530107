"""Auditing scenes made elsewhere: what geometry and physics say against what was declared.

Lives beside the acceptance test, of which it is the tolerant sister: it takes scenes whose
dependencies may be unsound, measures instead of refusing, and proposes what they should say.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal, get_args

from phyblock.domain.aov import AOVGraph, CycleError
from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Block, Scene
from phyblock.sim.stability import DEFAULT_TRIAL, Trial, check
from phyblock.sim.steps import check_steps
from phyblock.sim.support import GROUND, find_gaps, find_overlaps, support_graph
from phyblock_making.checks.scene_checks import STEP_TRIAL

__all__ = [
    "CHECKS",
    "AuditSettings",
    "Check",
    "Finding",
    "SceneAudit",
    "audit_scene",
    "stated_orders",
]

Check = Literal[
    "unreadable",
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
]
CHECKS: tuple[Check, ...] = get_args(Check)
"""What an audit may find, in the order of its tables."""


@dataclass(frozen=True)
class AuditSettings:
    """Overlaps and gaps up to `tolerance_m` [m] pass; how stability of states and steps is tried.

    The tolerance is 2 mm, not the half millimeter of our own scenes: hand-placed data sets write
    positions in rounded millimeters, and what is under 2 mm cannot be seen in a picture.
    """

    tolerance_m: float = 0.002
    trial: Trial = DEFAULT_TRIAL
    step_trial: Trial = STEP_TRIAL


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong: `blocks` by order, `size` in `unit`, and what was declared."""

    scene: str
    check: Check
    message: str
    blocks: tuple[int, ...] = ()
    size: float | None = None
    unit: str = ""
    declared: str = ""
    found: str = ""


@dataclass(frozen=True)
class SceneAudit:
    """What an audit found in one scene.

    `declared`, `contacts` and `shared` count dependencies (the ground is one): those declared,
    those that are contacts, and those that are both. `fixed` is the scene with dependencies from
    contacts and layers from the longest path; `sound` whether it has an order, which it lacks
    when neither contacts nor declared dependencies name one.
    """

    scene: Scene
    findings: tuple[Finding, ...]
    declared: int
    contacts: int
    shared: int
    fixed: Scene
    sound: bool

    def has(self, *checks: Check) -> bool:
        """Whether one of these checks found something."""
        return any(finding.check in checks for finding in self.findings)


def audit_scene(
    scene: Scene, candidates: CandidateSet | None, settings: AuditSettings | None = None
) -> SceneAudit:
    """Check one scene, whose orders are unique; its dependencies need not be sound.

    Without `candidates` they are not checked. Raises SimulationError as the simulator does.
    """
    settings = settings or AuditSettings()
    below = support_graph(scene.blocks)
    fixed = _fixed(scene, below)
    findings = [
        *_fit(scene, settings.tolerance_m),
        *_dependencies(scene, below),
        *_declared_order(scene),
        *_stability(scene, settings),
        *_candidates(scene, candidates),
    ]
    pairs = [(stated_orders(block), _seen_orders(block, below)) for block in scene.blocks]
    return SceneAudit(
        scene,
        tuple(findings),
        declared=sum(len(said) for said, _ in pairs),
        contacts=sum(len(seen) for _, seen in pairs),
        shared=sum(len(said & seen) for said, seen in pairs),
        fixed=fixed or scene,
        sound=fixed is not None,
    )


def stated_orders(block: Block) -> set[int]:
    """The orders a block is declared to rest on; the ground alone is {0}."""
    return set(block.depend) or {GROUND}


def _fit(scene: Scene, tolerance_m: float) -> Iterator[Finding]:
    for overlap in find_overlaps(scene.blocks, tolerance_m):
        one, other = _name(scene, overlap.first), _name(scene, overlap.second)
        depth_mm = overlap.depth_m * 1000
        message = f"{one} and {other} share {depth_mm:.1f} mm"
        pair = (overlap.first, overlap.second)
        yield Finding(scene.id, "overlap", message, pair, depth_mm, "mm")
    for gap in find_gaps(scene.blocks, tolerance_m):
        height_mm = gap.height_m * 1000
        message = f"{_name(scene, gap.order)} hangs {height_mm:.1f} mm above what is below it"
        yield Finding(scene.id, "floating", message, (gap.order,), height_mm, "mm")


def _dependencies(scene: Scene, below: Mapping[int, frozenset[int]]) -> Iterator[Finding]:
    kinds: tuple[tuple[Check, Callable[[set[int], set[int]], set[int]], str], ...] = (
        ("undeclared dependency", lambda said, seen: seen - said, "rests on {}, not declared"),
        ("dependency without contact", lambda said, seen: said - seen, "does not rest on {}"),
    )
    for block in scene.blocks:
        said, seen = stated_orders(block), _seen_orders(block, below)
        for kind, difference, text in kinds:
            for other in sorted(difference(said, seen)):
                message = f"{_name(scene, block.order)} {text.format(_name(scene, other))}"
                pair = (block.order, other)
                declared, found = _listed(said), _listed(seen)
                yield Finding(scene.id, kind, message, pair, declared=declared, found=found)


def _declared_order(scene: Scene) -> Iterator[Finding]:
    """Declared layers and file order against the declared dependencies, where those are sound."""
    graph = _graph({block.order: stated_orders(block) for block in scene.blocks})
    if graph is None:
        return
    for block, layer in zip(scene.blocks, graph.layers, strict=True):
        if block.layer != layer:
            message = f"{_name(scene, block.order)} is on layer {layer} by its dependencies"
            said, path = str(block.layer), str(layer)
            yield Finding(scene.id, "layer", message, (block.order,), declared=said, found=path)
    placed: set[int] = set()
    for block in scene.blocks:
        early = sorted(set(block.depend) - placed)
        if early:
            message = f"{_name(scene, block.order)} is placed before {_listed(early)}"
            yield Finding(scene.id, "order", message, (block.order, *early))
        placed.add(block.order)


def _stability(scene: Scene, settings: AuditSettings) -> Iterator[Finding]:
    whole = check(scene.blocks, settings.trial)
    if not whole.stable:
        settled = "" if whole.agreed else ", not the same ones at every time step"
        message = f"blocks {_listed(whole.fallen)} fall from the finished structure{settled}"
        yield Finding(scene.id, "unstable", message, whole.fallen, whole.moved_m * 1000, "mm")
    steps = check_steps(scene.blocks[:-1], settings.step_trial)
    for block, step in zip(scene.blocks, steps, strict=False):
        if not step.stable:
            fallen = _listed(step.fallen)
            message = f"blocks {fallen} fall once {_name(scene, block.order)} is placed"
            moved_mm = step.moved_m * 1000
            yield Finding(scene.id, "unstable step", message, step.fallen, moved_mm, "mm")


def _candidates(scene: Scene, candidates: CandidateSet | None) -> Iterator[Finding]:
    missing = () if candidates is None else candidates.missing(scene)
    for order in missing:
        message = f"no candidate can stand for {_name(scene, order)}"
        yield Finding(scene.id, "candidates", message, (order,))


def _fixed(scene: Scene, below: Mapping[int, frozenset[int]]) -> Scene | None:
    """Dependencies from contact, layers from them; what touches nothing keeps what it declares."""
    rests_on = {
        block.order: _seen_orders(block, below) or stated_orders(block) for block in scene.blocks
    }
    graph = _graph(rests_on)
    if graph is None:
        rests_on = {block.order: stated_orders(block) for block in scene.blocks}
        graph = _graph(rests_on)
    if graph is None:
        return None
    blocks = tuple(
        replace(block, depend=tuple(sorted(rests_on[block.order] - {GROUND})), layer=layer)
        for block, layer in zip(scene.blocks, graph.layers, strict=True)
    )
    return replace(scene, blocks=blocks)


def _seen_orders(block: Block, below: Mapping[int, frozenset[int]]) -> set[int]:
    """The orders a block rests on; the ground is named only alone, as in the files."""
    return set(below[block.order] - {GROUND}) or set(below[block.order])


def _graph(rests_on: Mapping[int, set[int]]) -> AOVGraph | None:
    """The graph over blocks as they stand in the file; None when it is unsound."""
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


def _name(scene: Scene, order: int) -> str:
    if order == GROUND:
        return "the ground"
    kinds = {block.order: f"{block.color} {block.type}" for block in scene.blocks}
    return f"block {order} ({kinds[order]})" if order in kinds else f"block {order}"


def _listed(orders: Iterable[int]) -> str:
    return " ".join(map(str, sorted(orders)))
