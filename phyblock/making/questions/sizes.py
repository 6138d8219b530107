"""Size: which of four blocks is the tallest, longest, largest; how many times as tall one is."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from phyblock.domain.question import Question, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.making.questions.measures import height_m, length_m, volume_m3
from phyblock.making.questions.picture_view import (
    STUDIED,
    View,
    goal_picture,
    require_seen,
    shown_picture,
)
from phyblock.making.questions.properties import with_own_colors
from phyblock.making.questions.question_draft import Draft, UnfairError
from phyblock.making.questions.referring import resolve_one
from phyblock.making.questions.selection import pick, shuffled
from phyblock.making.questions.static_drafts import StaticMaker, draft, index_of, seen_blocks
from phyblock.making.questions.wording import slots_of

__all__ = ["SizeMaker"]

_LEAST_RATIO = 1.3
_TRIES = 6
_TIMES: tuple[tuple[float, str], ...] = (
    (0.25, "a quarter as tall"),
    (0.5, "half as tall"),
    (1.0, "just as tall"),
    (2.0, "twice as tall"),
    (4.0, "four times as tall"),
)
_EXACT = 0.01


@dataclass(frozen=True)
class _Comparison:
    measure: Callable[[Block], float]
    sign: int


_WHICH: Mapping[str, _Comparison] = {
    "tallest": _Comparison(height_m, 1),
    "flattest": _Comparison(height_m, -1),
    "longest": _Comparison(length_m, 1),
    "largest": _Comparison(volume_m3, 1),
    "smallest": _Comparison(volume_m3, -1),
}


class SizeMaker(StaticMaker):
    """SI: blocks are named by colors of their own, because a shape's name would tell its size."""

    subtask: Subtask = "SI"

    def seen_from(self, view: View, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Comparisons of four blocks, and of two, in turns."""
        seen = seen_blocks(goal_picture(scene, view), STUDIED)
        for _ in range(_TRIES):
            if len(seen) >= 4:
                yield from _which_of_four(view, scene, shuffled(rng, seen)[:4], rng)
            if len(seen) >= 2:
                yield from _how_many_times(view, scene, shuffled(rng, seen)[:2], rng)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """From the measures of the blocks that the text or the options name."""
        picture = shown_picture(question)
        slots = slots_of(question)
        if "comparison" in slots:
            named = [resolve_one(option, picture) for option in question.options]
            require_seen(picture, [block.order for block in named], STUDIED)
            return (named.index(_extreme(named, slots["comparison"])),)
        one, other = (resolve_one(slots[name], picture) for name in ("block", "other"))
        require_seen(picture, [one.order, other.order], STUDIED)
        return index_of(question, _times(one, other))


def _which_of_four(
    view: View, scene: Scene, chosen: Sequence[Block], rng: np.random.Generator
) -> Iterator[Draft]:
    comparison = pick(rng, list(_WHICH))
    try:
        right = _extreme(chosen, comparison)
    except UnfairError:
        return
    shown = with_own_colors(scene, [block.order for block in chosen], rng)
    colors = {block.order: block.color for block in shown.blocks}
    wrong = [block for block in chosen if block is not right]
    options = [f"the {colors[block.order]} block" for block in (right, *wrong)]
    measure = _WHICH[comparison].measure
    yield draft(
        shown,
        goal_picture(shown, view),
        rng,
        f"si-{_stem(comparison)}",
        {"comparison": comparison},
        options,
        colors[right.order],
        comparison,
        measures={str(block.order): round(measure(block), 6) for block in chosen},
    )


def _how_many_times(
    view: View, scene: Scene, chosen: Sequence[Block], rng: np.random.Generator
) -> Iterator[Draft]:
    one, other = chosen
    try:
        right = _times(one, other)
    except UnfairError:
        return
    words = [word for _, word in _TIMES]
    start = pick(rng, [i for i in (0, 1) if right in words[i : i + 4]])
    wrong = [word for word in words[start : start + 4] if word != right]
    shown = with_own_colors(scene, [one.order, other.order], rng)
    colors = {block.order: block.color for block in shown.blocks}
    slots = {"block": f"{colors[one.order]} block", "other": f"{colors[other.order]} block"}
    heights = {str(block.order): round(height_m(block), 6) for block in chosen}
    picture = goal_picture(shown, view)
    options = [right, *wrong]
    yield draft(shown, picture, rng, "si-times", slots, options, right, "times", measures=heights)


def _stem(comparison: str) -> str:
    return {"tallest": "height", "flattest": "height", "longest": "length"}.get(
        comparison, "volume"
    )


def _extreme(blocks: Sequence[Block], comparison: str) -> Block:
    """The one that stands out by a clear margin; UnfairError when none does."""
    if comparison not in _WHICH:
        raise UnfairError(f"{comparison!r} is no comparison")
    rule = _WHICH[comparison]
    ranked = sorted(blocks, key=lambda block: -rule.sign * rule.measure(block))
    sizes = sorted(rule.measure(block) for block in ranked[:2])
    if sizes[1] < _LEAST_RATIO * sizes[0]:
        raise UnfairError(f"two of the blocks are about as {comparison}")
    return ranked[0]


def _times(one: Block, other: Block) -> str:
    ratio = height_m(one) / height_m(other)
    for known, word in _TIMES:
        if abs(ratio - known) < _EXACT:
            return word
    raise UnfairError(f"is {ratio:.2f} times as tall, which no option says")
