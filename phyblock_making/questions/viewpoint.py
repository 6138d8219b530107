"""VP: which picture shows the same structure from elsewhere, or how it looks from a given side.

The four options of a match are versions of one block among which the true one is drawn evenly,
so that they differ pairwise in that block alone and none of them is the odd one out.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from phyblock.domain.blocks import COLORS, BlockType, Euler
from phyblock.domain.question import Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block, Scene
from phyblock.sim.outcomes import OUTCOME_SETTINGS, holds
from phyblock.sim.seeing import seen, shown_pixels
from phyblock.sim.support import bounds_m, drop_height_m, find_overlaps
from phyblock_making.poses import POSES
from phyblock_making.questions.choices import pick, shuffled
from phyblock_making.questions.goal_view import GOAL_VIEW
from phyblock_making.questions.pictured_drafts import (
    are_told_apart,
    draft,
    of_kind,
    only_index,
    option_pictures,
    picture_of,
    same_blocks,
    state,
)
from phyblock_making.questions.question_draft import Draft, UnfairError
from phyblock_making.questions.wording import slots_of
from phyblock_making.symmetry import Symmetry, fingerprint, transformed

__all__ = ["ViewpointMaker"]

View = tuple[float, float]
Shift = tuple[float, float]
_TURNS_DEG = (-120.0, -90.0, -60.0, 60.0, 90.0, 120.0, 180.0)
_ELEVATIONS_DEG = (22.0, 32.0)
_FRONTS_DEG = (0.0, 90.0, 180.0, 270.0)
"""Straight on: a mirror image of a slanted view can be a true view of the same side."""
_SIDES: dict[str, float] = {"its right side": 90.0, "its left side": -90.0, "behind": 180.0}
_BLOCKS_TRIED = 4
_VERSIONS_TRIED = 8
_LEAST_SHOWN = 60
_SEEN_EVERYWHERE = 24
_SIDE_PIXELS = 500
"""Whole pictures are compared by side, not versions of one block."""
_LIFT_M = 0.4
_SHIFTS_M = ((0.0, 0.0), (0.025, 0.0), (-0.025, 0.0), (0.0, 0.025), (0.0, -0.025))
_TYPES: tuple[BlockType, ...] = ("cube", "cuboid1", "cuboid2", "triangle", "semi_cylinder", "arch")


class ViewpointMaker:
    """Kinds: `vp-color` and `vp-form`, which match versions of one block; `vp-side`."""

    subtask: Subtask = "VP"
    scenes_tried = 180
    drafts_a_scene = 2

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """One draft of each kind at most."""
        for kind in shuffled(rng, ("vp-color", "vp-form", "vp-side")):
            if kind == "vp-side":
                yield from _side(scene, rng)
            else:
                yield from _match(scene, rng, kind)

    def rederive(self, question: Question) -> tuple[int, ...]:
        """By the blocks in the pictures, whichever side they are seen from."""
        slots = slots_of(question)
        shown, options = picture_of(question, "scene"), option_pictures(question)
        if of_kind(question) == "vp-side":
            if shown.view_deg[0] not in _FRONTS_DEG:
                raise UnfairError("the first picture is not straight from the front")
            azimuth = shown.view_deg[0] + _SIDES[slots["side_words"]]
            right = [(option.view_deg[0] - azimuth) % 360 == 0 for option in options]
            alike = [same_blocks(shown.blocks, option.blocks) for option in options]
            return only_index([a and b for a, b in zip(right, alike, strict=True)])
        form = fingerprint(shown.blocks)
        return only_index([fingerprint(option.blocks) == form for option in options])


def _match(scene: Scene, rng: np.random.Generator, kind: str) -> Iterator[Draft]:
    other = ((GOAL_VIEW[0] + pick(rng, _TURNS_DEG)) % 360, pick(rng, _ELEVATIONS_DEG))
    for block in shuffled(rng, _shown_from_both(scene, other))[:_BLOCKS_TRIED]:
        versions = _colored(block, rng) if kind == "vp-color" else _formed(scene, block, rng)
        chosen = _told_apart(scene, versions, (GOAL_VIEW, other))
        if chosen is None:
            continue
        dealt = shuffled(rng, chosen)
        shown = state(scene, _with(scene, dealt[0]), GOAL_VIEW)
        options = [state(scene, _with(scene, one), other) for one in dealt]
        yield draft(scene, rng, kind, options, [shown], kind, facts={"block": block.order})
        return


def _shown_from_both(scene: Scene, other: View) -> list[Block]:
    """Blocks that both views show well."""
    counts = []
    for view in (GOAL_VIEW, other):
        picture = state(scene, scene.blocks, view)
        counts.append(shown_pixels(picture, seen(picture)))
    return [b for b in scene.blocks if min(one[b.order] for one in counts) >= 2 * _LEAST_SHOWN]


def _colored(block: Block, rng: np.random.Generator) -> list[Block]:
    return [replace(block, color=color) for color in shuffled(rng, COLORS)]


def _formed(scene: Scene, block: Block, rng: np.random.Generator) -> list[Block]:
    """Blocks of other types and poses in the place of one that carries nothing, at rest there."""
    if any(block.order in other.depend for other in scene.blocks):
        return []
    rest = [other for other in scene.blocks if other.order != block.order]
    versions = [block]
    for block_type, euler, shift in _pool(block, rng):
        version = _let_down(replace(block, type=block_type, euler_deg=euler), shift, rest, block)
        if version is not None:
            versions.append(version)
        if len(versions) > _VERSIONS_TRIED:
            break
    return versions


def _pool(block: Block, rng: np.random.Generator) -> list[tuple[BlockType, Euler, Shift]]:
    """Poses, and shifts from the middle; those of the same type come first, as harder to tell."""
    same = [(block.type, e, shift) for e in POSES[block.type].values() for shift in _SHIFTS_M]
    other = [(t, e, (0.0, 0.0)) for t in _TYPES if t != block.type for e in POSES[t].values()]
    return shuffled(rng, same) + shuffled(rng, other)


def _let_down(
    version: Block, shift: tuple[float, float], rest: Sequence[Block], model: Block
) -> Block | None:
    """The version over the model's middle, let down onto what the model rests on, if it stays."""
    middle, now = bounds_m(model).mean(axis=0), bounds_m(version).mean(axis=0)
    x, y, z = version.position_m
    x, y = x + float(middle[0] - now[0]) + shift[0], y + float(middle[1] - now[1]) + shift[1]
    lifted = replace(version, position_m=(x, y, z + _LIFT_M))
    fall = drop_height_m(lifted, rest)
    lowered = (round(x, 4) + 0.0, round(y, 4) + 0.0, round(z + _LIFT_M - fall, 4) + 0.0)
    placed = replace(version, position_m=lowered)
    if abs(bounds_m(placed)[0, 2] - bounds_m(model)[0, 2]) > 0.0005:
        return None
    if find_overlaps((*rest, placed)):
        return None
    stays = holds((*rest, placed), placed.order, OUTCOME_SETTINGS[:1])
    return placed if stays else None


def _told_apart(
    scene: Scene, versions: Sequence[Block], views: Sequence[View]
) -> list[Block] | None:
    """Four versions of a block that every view tells from one another."""
    chosen: list[Block] = []
    for version in versions:
        tried = [*chosen, version]
        states = [_with(scene, one) for one in tried]
        if len({fingerprint(blocks) for blocks in states}) < len(tried):
            continue
        if len(tried) == 1 or all(
            are_told_apart([state(scene, blocks, view) for blocks in states]) for view in views
        ):
            chosen = tried
        if len(chosen) == 4:
            return chosen
    return None


def _with(scene: Scene, version: Block) -> tuple[Block, ...]:
    return tuple(version if b.order == version.order else b for b in scene.blocks)


def _side(scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
    """Left, right and back of a structure, and the mirror image of the one that is asked for."""
    front = pick(rng, _FRONTS_DEG)
    shown = state(scene, scene.blocks, (front, 22.0))
    if min(shown_pixels(shown, seen(shown)).values()) < _SEEN_EVERYWHERE:
        return
    side = pick(rng, tuple(_SIDES))
    order = [side, *(name for name in _SIDES if name != side)]
    views = [((front + _SIDES[name]) % 360, 22.0) for name in order]
    options = [state(scene, scene.blocks, view) for view in views]
    options.append(_mirrored(scene, views[0]))
    if are_told_apart([shown, *options], least=_SIDE_PIXELS):
        yield draft(scene, rng, "vp-side", options, [shown], side, {"side_words": side})


def _mirrored(scene: Scene, view: View) -> QuestionPicture:
    """What a mirror beside the camera shows: the structure mirrored across the camera's plane."""
    mirrored = transformed(scene.blocks, Symmetry(0, True))
    turned = (180.0 - view[0]) % 360
    return QuestionPicture("scene", mirrored, (turned, view[1]))
