"""OR: the subassemblies of one structure, to be put in the order of building or of taking apart.

Every picture shows the whole structure, so that nothing in it is larger or smaller for being
early: the blocks of one stage have one color, all the others another. What tells the order is what
rests on what. A block of each stage rests on one of the stage before, so that there is one order,
and the stages of a structure with several towers are no layers: no sorting by size, height or
place in the picture gives the order.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from phyblock.domain.blocks import Color
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Scene
from phyblock.making.questions.base import (
    COUNTED,
    Draft,
    Maker,
    UnfairError,
    are_seen,
    are_told_apart,
    draft,
    drawn_view,
    of_kind,
    option_pictures,
    orders_of,
    pick,
    require_seen,
    same_blocks,
    slots_of,
)
from phyblock.sim.question_pictures import seen

_STAGES = 4
_LEAST_BLOCKS = 6
_VIEWS_TRIED = 4
_CUTS_TRIED = 150
_GO_ON = 0.75
_PAIRS: tuple[tuple[Color, Color], ...] = (
    ("yellow", "blue"),
    ("orange", "blue"),
    ("red", "yellow"),
    ("blue", "orange"),
    ("green", "orange"),
    ("yellow", "green"),
)
"""The color of a stage and that of all else."""
Stages = tuple[frozenset[int], ...]


class OrderingMaker(Maker):
    """Kinds: `or-build` and `or-apart`."""

    subtask: Subtask = "OR"
    scenes_tried = 240

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft, of either kind, of a structure of which every block can be seen."""
        if len(scene) < _LEAST_BLOCKS:
            return
        for _ in range(_VIEWS_TRIED):
            plain = QuestionPicture("scene", scene.blocks, drawn_view(rng), framed=scene.blocks)
            if are_seen(plain, orders_of(scene.blocks), COUNTED):
                yield from _draft_from(scene, plain, rng)
                return

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By the stages that hold blocks resting on those of others: one order must follow."""
        slots, scene = slots_of(question), question.scene
        options = option_pictures(question)
        stages = tuple(_stage_in(scene, option, slots) for option in options)
        if sorted(itertools.chain(*stages)) != sorted(b.order for b in scene.blocks):
            raise UnfairError("the stages do not hold every block once")
        require_seen(options[0], orders_of(scene.blocks), COUNTED)
        order = _only_order(scene, stages)
        if order is None:
            raise UnfairError("what rests on what leaves more than one order, or none")
        return order if of_kind(question) == "or-build" else order[::-1]


def _draft_from(scene: Scene, plain: QuestionPicture, rng: np.random.Generator) -> Iterator[Draft]:
    for _ in range(_CUTS_TRIED):
        stages = _cut(scene, rng)
        if _only_order(scene, stages) is None or _is_sorted_by_eye(plain, stages):
            continue
        kind, pair = pick(rng, ("or-build", "or-apart")), pick(rng, _PAIRS)
        in_order = stages if kind == "or-build" else stages[::-1]
        options = []
        for stage in in_order:
            blocks = (replace(b, color=pair[b.order not in stage]) for b in plain.blocks)
            options.append(replace(plain, blocks=tuple(blocks)))
        if are_told_apart(options):
            slots: dict[str, str] = {"color": pair[0], "other": pair[1]}
            facts: dict[str, Any] = {"stages": [sorted(stage) for stage in stages]}
            yield draft(scene, rng, kind, options, [], slots, value=kind, **facts)
            return


def _cut(scene: Scene, rng: np.random.Generator) -> Stages:
    """A random order of building, tower by tower rather than layer by layer, cut in four."""
    order: list[int] = []
    while len(order) < len(scene):
        ready = scene.graph.ready(sum(1 << vertex for vertex in order))
        on_last = [v for v in ready if order and order[-1] in scene.graph.depends_on[v]]
        go_on = on_last and rng.random() < _GO_ON
        order.append(pick(rng, sorted(on_last if go_on else ready)))
    places = 1 + rng.choice(len(scene) - 1, size=_STAGES - 1, replace=False)
    ends = [0, *sorted(places.tolist()), len(scene)]
    orders = [scene.blocks[vertex].order for vertex in order]
    return tuple(frozenset(orders[a:b]) for a, b in itertools.pairwise(ends))


def _only_order(scene: Scene, stages: Stages) -> tuple[int, ...] | None:
    """Places of the stages in the one order in which they can follow; None unless there is one."""
    stage_of = {order: place for place, stage in enumerate(stages) for order in stage}
    before = {
        (stage_of[below], stage_of[block.order])
        for block in scene.blocks
        for below in block.depend
        if stage_of[below] != stage_of[block.order]
    }
    fitting = [
        order
        for order in itertools.permutations(range(len(stages)))
        if all(order.index(early) < order.index(late) for early, late in before)
    ]
    return fitting[0] if len(fitting) == 1 else None


def _stage_in(scene: Scene, option: QuestionPicture, slots: Mapping[str, str]) -> frozenset[int]:
    """Orders of the blocks that a picture highlights; UnfairError when it shows another scene."""
    goal = {block.order: block for block in scene.blocks}
    if any(block.color not in (slots["color"], slots["other"]) for block in option.blocks):
        raise UnfairError(f"picture {option.label} shows other colors than the text names")
    plain = [replace(b, color=goal[b.order].color) for b in option.blocks if b.order in goal]
    if len(option.blocks) != len(scene) or not same_blocks(plain, scene.blocks):
        raise UnfairError(f"picture {option.label} does not show the whole structure")
    return frozenset(b.order for b in option.blocks if b.color == slots["color"])


def _is_sorted_by_eye(plain: QuestionPicture, stages: Stages) -> bool:
    """True if size or height of what is highlighted, either way round, gives the order.

    By numbers of blocks and pixels, and by heights in the world and in the picture.
    """
    shown, looks = seen(plain).block, []
    for stage in stages:
        blocks = [(i, b.position_m[2]) for i, b in enumerate(plain.blocks) if b.order in stage]
        rows = np.nonzero(np.isin(shown, [i for i, _ in blocks]))[0]
        heights = [height for _, height in blocks]
        levels = (float(np.mean(heights)), max(heights), min(heights))
        looks.append((len(stage), len(rows), *levels, rows.mean(), rows.min(), rows.max()))
    columns = map(list, zip(*looks, strict=True))
    return any(column in (sorted(column), sorted(column)[::-1]) for column in columns)
