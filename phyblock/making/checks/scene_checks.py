"""The one list of checks of a scene: each takes its facts and yields what is wrong with it.

Accepting new scenes, verifying stored ones and auditing foreign ones choose from this list.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from phyblock.domain.blocks import BlockType, orientation_class
from phyblock.domain.candidates import MAX_CANDIDATES
from phyblock.domain.scene import Block
from phyblock.making.checks.finding import CheckName, Finding
from phyblock.making.checks.scene_facts import SceneFacts
from phyblock.making.checks.tolerances import LEVEL_LIMITS
from phyblock.making.poses import POSES
from phyblock.sim.stability import Stability, Trial
from phyblock.sim.support import GROUND

__all__ = ["CHECKS", "Check", "findings_of"]


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
