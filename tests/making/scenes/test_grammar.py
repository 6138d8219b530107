from __future__ import annotations

import functools
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from phyblock.domain import KIT_PALETTE, Scene
from phyblock.domain.symmetry import canonical_form
from phyblock.making.scenes.designs import BUILDINGS, COMPOSITIONS, CREATURES, beside
from phyblock.making.scenes.production import GROUP_LEVELS, Request, draw
from phyblock.making.scenes.sketch import PALETTES, Draft
from phyblock.sim.contact import bounds_m, find_gaps, find_overlaps
from tests.designs.acceptance import form_problems

GROUPS = tuple(GROUP_LEVELS)
seeds = st.integers(0, 2**31)
requests = st.builds(
    Request, seeds, st.sampled_from(["kit", "full"]), st.sampled_from(GROUPS), st.integers(0, 999)
)


@functools.cache
def some(group: str, count: int, palette: str = "kit") -> tuple[Request, ...]:
    found = (Request(5, palette, group, number) for number in range(200))
    return tuple(islice((request for request in found if draw(request) is not None), count))


@given(requests)
@example(Request(13, "full", "3", 15))
@settings(deadline=None, max_examples=40)
def test_what_the_grammar_draws_keeps_its_limits(request_: Request) -> None:
    scene = draw(request_)
    if scene is not None:
        assert scene.levels == GROUP_LEVELS[request_.group]
        assert form_problems(scene, PALETTES[request_.palette]) == ()
        assert find_overlaps(scene.blocks) == ()
        assert find_gaps(scene.blocks) == ()
        assert len({block.look for block in scene.blocks}) <= 14


@pytest.mark.parametrize("group", GROUPS)
def test_most_requests_give_a_scene_and_the_same_one_again(group: str) -> None:
    scenes = [draw(Request(1, "kit", group, number)) for number in range(20)]
    assert sum(scene is not None for scene in scenes) >= 12
    assert scenes == [draw(Request(1, "kit", group, number)) for number in range(20)]


@pytest.mark.parametrize("name", sorted({**BUILDINGS, **CREATURES, **COMPOSITIONS}))
def test_every_theme_varies(name: str) -> None:
    theme = {**BUILDINGS, **CREATURES, **COMPOSITIONS}[name]
    forms = set()
    for seed in range(10):
        draft = Draft(np.random.default_rng(seed))
        theme(draft)
        assert [block.order for block in draft.blocks] == list(range(1, len(draft) + 1))
        assert {block.kind for block in draft.blocks} <= set(KIT_PALETTE)
        forms.add(canonical_form(draft.blocks))
    assert len(forms) >= 4


def test_a_recolored_scene_is_its_parent_but_for_colors() -> None:
    for parent in some("3", 6, "full"):
        original = draw(parent)
        varied = draw(Request(5, "full", "3", 0, (parent,)))
        assert varied is not None
        assert varied.id == "recolored"
        assert gray(varied) == gray(original)
        assert canonical_form(varied.blocks) != canonical_form(original.blocks)


def gray(scene: Scene) -> object:
    return canonical_form([replace(block, color="red") for block in scene.blocks])


def test_a_combined_scene_holds_both_parents() -> None:
    parents = some("2", 2)
    scene = next(
        found
        for number in range(20)
        if (found := draw(Request(5, "kit", "3", number, parents))) is not None
    )
    whole = [draw(parent) for parent in parents]
    assert len(scene) == sum(len(one) for one in whole)
    split = len(whole[0])
    assert canonical_form(scene.blocks[:split]) == canonical_form(whole[0].blocks)
    assert canonical_form(scene.blocks[split:]) == canonical_form(whole[1].blocks)


@given(st.integers(0, 3), st.integers(0, 3), st.sampled_from([0.0, 1.0, 2.5]), st.booleans())
@settings(deadline=None, max_examples=20)
def test_parts_stand_beside_one_another_with_their_gap(one, other, gap, deep) -> None:
    axis = 0 if deep else 1
    parts = [draw(request).blocks for request in (some("2", 4)[one], some("2", 4)[other])]
    row = beside(parts, gap, axis)
    low = min(bounds_m(block)[0][axis] for block in row[len(parts[0]) :])
    high = max(bounds_m(block)[1][axis] for block in row[: len(parts[0])])
    assert low - high == pytest.approx(gap * 0.025, abs=1e-5)
    assert [block.order for block in row] == list(range(1, len(row) + 1))
