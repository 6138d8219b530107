"""Checks of scenes by geometry and physics: one list for making, verifying and auditing sets."""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import combinations
from typing import Literal

import numpy as np

from phyblock.domain.aov import AOVGraph, CycleError
from phyblock.domain.blocks import KIT_PALETTE, orientation_class
from phyblock.domain.scene import MAX_CANDIDATES, Block, Candidate, CandidateSet, Kind, Scene
from phyblock.errors import Problem
from phyblock.making.scenes.sketch import POSES, find_twins
from phyblock.making.workers import Workers, open_workers
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
from phyblock.sim.pictures import (
    LEAST_SHOWN,
    PictureStyle,
    candidate_camera,
    hidden_blocks,
    on_the_floor,
    picture,
    visible_shares,
)
from phyblock.text import csv_cell

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
        """The finding as an error: orders as a list of the file, an empty one not at all."""
        declared, derived = (
            (str(list(one)) if one else "") if isinstance(one, tuple) else str(one)
            for one in (self.declared, self.derived)
        )
        return Problem(self.scene, self.message, self.field, declared, derived)

    def __str__(self) -> str:
        return str(self.problem)


VIEW = PictureStyle(size_px=256)
"""Style of the goal picture in which blocks have to show."""

STEP_TRIAL = replace(DEFAULT_TRIAL, physics=DEFAULT_TRIAL.physics[:1])
"""Every step is tried at the first of the two time steps, for two seconds or until at rest."""

FINISHED_REST = Rest(quiet_s=0.5)
"""The rest at which the generator ends the trial of a finished structure."""


@dataclass(frozen=True)
class Tolerances:
    """Limits: overlaps and gaps up to `fit_m` [m], movement within the limits of the trials.

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
FOREIGN = Tolerances(fit_m=0.002, last_step=False, rest=FINISHED_REST)
"""For scenes made elsewhere, whose positions are written by hand in rounded millimeters."""


@dataclass(frozen=True)
class Limits:
    """The blocks and layers that a level allows (paper section 3.1)."""

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
    """A scene whose orders are unique, and facts about it, each computed once, when asked for.

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
        return {
            block.order: frozenset(block.depend) or frozenset({GROUND})
            for block in self.scene.blocks
        }

    @cached_property
    def graph(self) -> AOVGraph | None:
        """The graph of the declared dependencies; None when they are unsound."""
        vertex_of = {order: vertex for vertex, order in enumerate(self.declared)}
        rests_on = [orders - {GROUND} for orders in self.declared.values()]
        if any(order not in vertex_of for orders in rests_on for order in orders):
            return None
        try:
            return AOVGraph(tuple(frozenset(vertex_of[o] for o in orders) for orders in rests_on))
        except CycleError:
            return None

    @cached_property
    def finished(self) -> Stability:
        """Stability of the finished structure, watched to the end or until it is at rest."""
        blocks, trial, rest = self.scene.blocks, self.tolerances.trial, self.tolerances.rest
        return check(blocks, trial) if rest is None else check(blocks, trial, rest)

    @cached_property
    def steps(self) -> tuple[Stability, ...]:
        """Stability of the structure after each step of the stored order."""
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


@dataclass(frozen=True)
class Check:
    """A check; `law` is what holds where it finds nothing, several checks may share one."""

    name: CheckName
    law: str
    find: Callable[[SceneFacts], Iterable[Finding]]


CHECKS: dict[CheckName, Check] = {}
"""The checks of a scene by itself."""
_Find = Callable[[SceneFacts], Iterable[Finding]]


def _check(name: CheckName, law: str) -> Callable[[_Find], _Find]:
    def register(find: _Find) -> _Find:
        CHECKS[name] = Check(name, law, find)
        return find

    return register


def findings_of(facts: SceneFacts, names: Iterable[CheckName]) -> Iterator[Finding]:
    """The findings of these checks, in the order given, each computed when it is asked for."""
    for name in names:
        yield from CHECKS[name].find(facts)


@_check("size", "limits of its levels")
def _size(facts: SceneFacts) -> Iterator[Finding]:
    """More or fewer blocks, or more layers, than a level of the scene allows."""
    scene = facts.scene
    layers = 0 if facts.graph is None else max(facts.graph.layers, default=0)
    for level in scene.levels:
        limits = LEVEL_LIMITS[level]
        if not limits.least_blocks <= len(scene) <= limits.most_blocks:
            allowed = f"{limits.least_blocks} to {limits.most_blocks} at level {level}"
            yield Finding(
                scene.id, "size", "wrong size", field="blocks", declared=len(scene), derived=allowed
            )
        if layers > limits.most_layers:
            allowed = f"at most {limits.most_layers} at level {level}"
            yield Finding(
                scene.id, "size", "too high", field="layers", declared=layers, derived=allowed
            )


@_check("palette", "colors of the palette")
def _palette(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks whose pair of type and color is not in the palette."""
    for at, block in _blocks(facts):
        if block.kind not in facts.palette:
            about, kind = (block.order,), " ".join(block.kind)
            message = "not in the palette"
            yield Finding(facts.scene.id, "palette", message, about, field=at, declared=kind)


@_check("undeclared dependency", "dependencies are contacts")
def _undeclared_dependency(facts: SceneFacts) -> Iterator[Finding]:
    """Contacts that carry and are not declared."""
    yield from _dependencies(
        facts, "undeclared dependency", "block {} rests on {}, which is not declared"
    )


@_check("dependency without contact", "dependencies are contacts")
def _dependency_without_contact(facts: SceneFacts) -> Iterator[Finding]:
    """Declared dependencies that are no contacts that carry."""
    yield from _dependencies(
        facts, "dependency without contact", "block {} does not rest on {}, which is declared"
    )


def _dependencies(facts: SceneFacts, name: CheckName, message: str) -> Iterator[Finding]:
    for at, block in _blocks(facts):
        declared, contacts = facts.declared[block.order], facts.contacts[block.order]
        is_undeclared = name == "undeclared dependency"
        for other in sorted(contacts - declared if is_undeclared else declared - contacts):
            yield Finding(
                facts.scene.id,
                name,
                message.format(block.order, _name(other)),
                (block.order, other),
                field=f"{at}.depend",
                declared=tuple(sorted(declared)),
                derived=tuple(sorted(contacts)),
            )


@_check("layer", "layers are longest paths")
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


@_check("order", "order can be built")
def _order(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that stand in the file before one that they depend on, if that is sound."""
    if facts.graph is None:
        return
    placed: set[int] = set()
    for block in facts.scene.blocks:
        early = sorted(set(block.depend) - placed)
        if early:
            supports = ", ".join(map(_name, early))
            message = f"the stored order puts block {block.order} before its support, {supports}"
            about = (block.order, *early)
            yield Finding(facts.scene.id, "order", message, about, field="blocks")
        placed.add(block.order)


@_check("overlap", "no overlap")
def _overlap(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that share space, with one another or with the ground."""
    for overlap in facts.overlaps:
        depth_mm = overlap.depth_m * 1000
        other = _name(overlap.first)
        message = f"block {overlap.second} overlaps {other} by {depth_mm:.2f} mm"
        pair = (overlap.first, overlap.second)
        yield Finding(facts.scene.id, "overlap", message, pair, depth_mm, _fit_mm(facts), "mm")


@_check("floating", "no gap")
def _floating(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that hang above what is below them."""
    for gap in facts.gaps:
        height_mm = gap.height_m * 1000
        message = f"block {gap.order} floats {height_mm:.2f} mm above its support"
        about = (gap.order,)
        yield Finding(facts.scene.id, "floating", message, about, height_mm, _fit_mm(facts), "mm")


@_check("unstable", "stands when finished")
def _unstable(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that fall from the finished structure."""
    whole = facts.finished
    if not whole.stable:
        differing = "" if whole.agreed else ", not the same ones at every time step"
        message = f"{{}} when all is built{differing}"
        yield _fall(facts, "unstable", message, whole, facts.tolerances.trial)


@_check("unstable step", "stands at every step")
def _unstable_step(facts: SceneFacts) -> Iterator[Finding]:
    """Steps of the stored order after which something falls."""
    trial = facts.tolerances.step_trial
    for count, (block, step) in enumerate(zip(facts.scene.blocks, facts.steps, strict=False), 1):
        if not step.stable:
            message = f"{{}} at step {count}, once block {block.order} is placed"
            yield _fall(facts, "unstable step", message, step, trial)


def _fall(
    facts: SceneFacts, name: CheckName, message: str, shown: Stability, trial: Trial
) -> Finding:
    named = ", ".join(map(str, shown.fallen))
    falling = f"blocks {named} fall" if len(shown.fallen) > 1 else f"block {named} falls"
    moved_mm, limit_mm = shown.moved_m * 1000, trial.limit_m * 1000
    return Finding(
        facts.scene.id, name, message.format(falling), shown.fallen, moved_mm, limit_mm, "mm"
    )


@_check("hidden", "every block shows")
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


@_check("too many candidates", "candidate set")
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


@_check("candidates", "candidate set")
def _lacking_candidates(facts: SceneFacts) -> Iterator[Finding]:
    """Blocks that no candidate can stand for."""
    missing = () if facts.candidates is None else facts.candidates.missing(facts.scene)
    for order in missing:
        message = f"the candidates hold nothing that block {order} needs"
        yield Finding(facts.scene.id, "candidates", message, (order,), field="candidates")


@_check("distractor", "candidate set")
def _distractors(facts: SceneFacts) -> Iterator[Finding]:
    """Candidates that are not needed in poses that no design knows: these give themselves away."""
    scene = facts.scene
    looks = {block.look for block in scene.blocks}
    poses = {
        block_type: {orientation_class(block_type, euler) for euler in known.values()}
        for block_type, known in POSES.items()
    }
    offered = () if facts.candidates is None else facts.candidates.candidates
    for i, candidate in enumerate(offered):
        if candidate.look not in looks and candidate.look[2] not in poses[candidate.type]:
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


def _fit_mm(facts: SceneFacts) -> float:
    return facts.tolerances.fit_m * 1000


def _name(order: int) -> str:
    return "the ground" if order == GROUND else f"block {order}"


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
    """True if a scene could enter a data set, each of its blocks to be seen in the goal picture.

    It ends at the first fault, and a trial ends once all is at rest, at both time steps.
    """
    facts = SceneFacts(scene, tolerances=OURS_IN_HASTE, palette=palette)
    return next(findings_of(facts, (*FORM, "hidden", *PHYSICS)), None) is None


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
"""The laws of a scene by itself."""
Verified = dict[str, tuple[Finding, ...]]
"""Findings against each law; empty where it holds."""
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
    """Count the looks of candidate sets, and find the pairs that the camera cannot tell apart."""
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
