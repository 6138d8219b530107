"""What a scene is, derived from the poses of its blocks: dependencies, layers, levels, an order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from phyblock.domain.aov import CycleError
from phyblock.domain.blocks import KIT_PALETTE
from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Block, Scene
from phyblock.errors import DataError, Problem
from phyblock.making.checks.finding import CheckName
from phyblock.making.checks.scene_checks import findings_of
from phyblock.making.checks.scene_facts import SceneFacts
from phyblock.making.checks.tolerances import LEVEL_LIMITS, OURS_IN_HASTE
from phyblock.making.scenes.given_scenes import GivenScene, ReadScene
from phyblock.making.scenes.scene_draft import Palette
from phyblock.making.scenes.sketch import scene_of
from phyblock.records.scene import candidate_set

__all__ = ["Completed", "complete", "derived", "palette_of"]

_GEOMETRY: tuple[CheckName, ...] = ("overlap", "floating", "order", "candidates")
_STANDING: tuple[CheckName, ...] = ("unstable step", "unstable")
_NOTED: tuple[CheckName, ...] = ("size", "hidden")
_HINTS: dict[str, str] = {
    "order": "{} blocks in an order in which they can be built",
    "unstable step": "{} blocks in an order in which each of them stands when it is placed",
}


@dataclass(frozen=True)
class Completed:
    """A scene with all that was derived; `offered` are candidates that were given, and `notes` tell
    what is unusual about it.
    """

    scene: Scene
    offered: CandidateSet | None
    notes: tuple[str, ...]


def complete(read: ReadScene) -> Completed:
    """Derive a scene, and check that it can be built and stands.

    Raises DataError with what is wrong: blocks that overlap, float or fall, contacts without an
    order, candidates that lack what is needed.
    """
    scene = derived(read.name, read.given, read.where)
    offered = None if read.given.candidates is None else candidate_set(read.given.candidates)
    facts = SceneFacts(scene, offered, OURS_IN_HASTE)
    how = "number" if read.given.is_ordered else "list"
    # What overlaps or floats falls as well; that shall be told once.
    for names in (_GEOMETRY, _STANDING):
        if findings := tuple(findings_of(facts, names)):
            raise DataError(
                replace(
                    one.problem,
                    where=read.where,
                    message=f"scene {read.name}: {one.message}",
                    hint=_HINTS.get(one.check, "").format(how),
                )
                for one in findings
            )
    noted = [one.problem for one in findings_of(facts, _NOTED)]
    notes = [
        f"{one.message}: {one.found} {one.field}, {one.allowed}" if one.found else one.message
        for one in noted
    ]
    return Completed(scene, offered, (*notes, *_other(read.given, scene)))


def derived(name: str, given: GivenScene, where: str) -> Scene:
    """The scene that the poses of blocks make; nothing but its order is checked.

    Where no block says its `order`, blocks are numbered as they are listed, each behind those that
    it rests on. Raises DataError where contacts name no order.
    """
    unordered = [n for n, block in enumerate(given.blocks) if block.order is None]
    if unordered and len(unordered) < len(given.blocks):
        message = f"scene {name}: is missing, and other blocks have one"
        allowed = "an order for every block, or for none"
        raise DataError(Problem(where, message, f"blocks[{unordered[0]}].order", "", allowed))
    listed = [block.block(number) for number, block in enumerate(given.blocks, 1)]
    orders = [block.order for block in listed]
    if twice := sorted({order for order in orders if orders.count(order) > 1}):
        message = f"scene {name}: has two blocks of the same order"
        raise DataError(Problem(where, message, "order", str(twice[0]), "unique orders"))
    try:
        scene = scene_of(name, (), listed, given.parents)
        if not given.is_ordered:
            scene = scene_of(name, (), _buildable(scene), given.parents)
    except CycleError as error:
        cycle = " -> ".join(str(orders[v]) for v in (*error.vertices, error.vertices[0]))
        message = f"scene {name}: blocks rest on one another in a circle"
        raise DataError(Problem(where, message, "blocks", cycle)) from None
    return replace(scene, levels=given.levels or (_level(scene),))


def palette_of(scenes: Sequence[Scene]) -> Palette:
    """The palette that distractors are drawn from: the kit's, where the scenes keep to it."""
    kinds = {block.kind for scene in scenes for block in scene.blocks}
    return "kit" if kinds <= set(KIT_PALETTE) else "full"


def _buildable(scene: Scene) -> list[Block]:
    """The blocks with new orders: of those that can be placed, the one listed first comes next."""
    order: list[int] = []
    while ready := scene.graph.ready(sum(1 << vertex for vertex in order)):
        order.append(ready[0])
    return [replace(scene.blocks[v], order=n) for n, v in enumerate(order, 1)]


def _level(scene: Scene) -> int:
    """The first level above 1 that has room for so many blocks."""
    fitting = (n for n in LEVEL_LIMITS if n > 1 and len(scene) <= LEVEL_LIMITS[n].most_blocks)
    return next(fitting, max(LEVEL_LIMITS))


def _other(given: GivenScene, scene: Scene) -> list[str]:
    """Dependencies and layers that were given and are others by contact.

    Where no block says its `order`, numbers that were given are places in the list.
    """
    listed = [one.block(number) for number, one in enumerate(given.blocks, 1)]
    by_place = {_place(block): block for block in scene.blocks}
    order_of = {block.order: by_place[_place(block)].order for block in listed}
    notes = []
    for one, block in zip(given.blocks, (by_place[_place(block)] for block in listed), strict=True):
        depend = sorted(block.depend) or [0]
        declared = None if one.depend is None else sorted(order_of.get(n, n) for n in one.depend)
        if declared is not None and declared != depend:
            notes.append(f"block {block.order} depends on {depend} by contact, not {declared}")
        if one.layer is not None and one.layer != block.layer:
            notes.append(f"block {block.order} is on layer {block.layer}, not {one.layer}")
    return notes


def _place(block: Block) -> tuple[object, ...]:
    return block.type, block.color, block.position_m, block.euler_deg
