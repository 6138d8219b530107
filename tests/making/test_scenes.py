"""Sketches, designs, the grammar and the production of scenes: sound, varied, the same again."""

import functools
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from phyblock.domain.blocks import BLOCK_TYPES, KIT_PALETTE, SHAPES
from phyblock.domain.scene import SYMMETRIES, canonical_form
from phyblock.making.checks import FORM, PHYSICS, SceneFacts, check_set, findings_of
from phyblock.making.scenes import production, sketch
from phyblock.making.scenes.production import GROUPS, Request, Share, builtin_forms, draw
from phyblock.sim import dynamics
from phyblock.sim.balance import surely_falls, surely_stands
from phyblock.sim.contact import bounds_m, find_gaps, find_overlaps, support_graph
from phyblock.sim.dynamics import groups, is_proven
from phyblock.sim.engine import installed_engines
from phyblock.sim.pictures import drawn_m, hidden_blocks
from phyblock.workers import open_workers
from tests.shipped import TASKS
from tests.sim.structures import block, turned

grid = st.integers(-3, 3)
posed = st.sampled_from([(kind, pose) for kind in BLOCK_TYPES for pose in sketch.POSES[kind]])


@given(st.lists(st.tuples(posed, grid, grid), min_size=1, max_size=8))
@settings(max_examples=40)
def test_whatever_is_put_down_neither_overlaps_nor_floats(drawn):
    draft = sketch.Draft(np.random.default_rng(0))
    for (block_type, pose), y, x in drawn:
        draft.put(block_type, y, x, pose)
    assert not find_overlaps(draft.blocks, 1e-5)
    assert not find_gaps(draft.blocks, 1e-5)


palettes, levels = st.sampled_from(["kit", "full"]), st.sampled_from(sorted(GROUPS))
requests = st.builds(Request, st.integers(0, 2**31), palettes, levels, st.integers(0, 999))


@functools.cache
def some(group, count, palette="kit"):
    found = (Request(5, palette, group, number) for number in range(200))
    return tuple(islice((request for request in found if draw(request) is not None), count))


@given(requests)
@example(Request(13, "full", "3", 15))
@settings(max_examples=40)
def test_what_the_grammar_draws_keeps_its_limits(request_):
    scene = draw(request_)
    if scene is not None:
        assert scene.levels == tuple(GROUPS[request_.group].levels)
        assert list(findings_of(SceneFacts(scene), FORM)) == []
        assert {block.kind for block in scene.blocks} <= {*sketch.PALETTES[request_.palette]}
        assert not find_overlaps(scene.blocks)
        assert not find_gaps(scene.blocks)
        assert len({block.look for block in scene.blocks}) <= 14


@pytest.mark.parametrize("group", GROUPS)
def test_most_requests_give_a_scene_and_the_same_one_again(group):
    asked = [Request(1, "kit", group, number) for number in range(20)]
    scenes = list(map(draw, asked))
    assert scenes.count(None) <= 8
    production._drawn_base.cache_clear()
    assert scenes == list(map(draw, asked))


@pytest.mark.parametrize("name", sorted({t for group in GROUPS.values() for t in group.themes}))
def test_every_theme_varies(name):
    forms = set()
    for seed in range(10):
        draft = sketch.Draft(np.random.default_rng(seed))
        draft.follow(name)
        assert [block.order for block in draft.blocks] == list(range(1, len(draft.blocks) + 1))
        assert {block.kind for block in draft.blocks} <= set(KIT_PALETTE)
        forms.add(canonical_form(draft.blocks))
    assert len(forms) >= 4


def test_a_recolored_scene_is_its_parent_but_for_colors():
    for parent in some("3", 6, "full"):
        original = draw(parent)
        varied = draw(Request(5, "full", "3", 0, (parent,)))
        assert varied.id == "recolored"
        assert sketch.colorless(varied.blocks) == sketch.colorless(original.blocks)
        assert canonical_form(varied.blocks) != canonical_form(original.blocks)


def test_a_combined_scene_holds_both_parents():
    parents = some("2", 2)
    scene = next(filter(None, (draw(Request(5, "kit", "3", n, parents)) for n in range(20))))
    one, other = (draw(parent).blocks for parent in parents)
    for part, whole in ((scene.blocks[: len(one)], one), (scene.blocks[len(one) :], other)):
        assert canonical_form(part) == canonical_form(whole)


@given(st.integers(0, 3), st.integers(0, 3), st.sampled_from([0.0, 1.0, 2.5]), st.booleans())
@settings(max_examples=20)
def test_parts_stand_beside_one_another_with_their_gap(one, other, gap, deep):
    axis = 0 if deep else 1
    parts = [draw(request).blocks for request in (some("2", 4)[one], some("2", 4)[other])]
    row = sketch.beside(parts, gap, axis)
    low = min(bounds_m(block)[0][axis] for block in row[len(parts[0]) :])
    high = max(bounds_m(block)[1][axis] for block in row[: len(parts[0])])
    assert low - high == pytest.approx(gap * 0.025, abs=1e-5)
    assert [block.order for block in row] == list(range(1, len(row) + 1))


SMALL = (Share("1", 3, 1), Share("2", 4, 2), Share("3", 2, 1))


@pytest.fixture(scope="module")
def scenes():
    with open_workers(1) as workers:
        made = production.Production(8, "kit", workers, frozenset()).tasks(SMALL)
        return [task.scene for task in made]


@given(st.integers(1, 5000), st.sets(st.integers(1, 5), min_size=1))
def test_shares_add_up(count, levels):
    found = production.shares(count, sorted(levels))
    assert sum(share.base + share.varied for share in found) == count
    assert {level for share in found for level in map(int, share.group.split("+"))} <= levels


@pytest.mark.parametrize("every", [3, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("engine", installed_engines())
def test_every_scene_is_accepted_again_in_every_engine_without_its_proof(
    scenes, engine, every, monkeypatch
):
    assert check_set(scenes) == ()
    assert all(is_proven(group) for scene in scenes for group in groups(scene.blocks))
    monkeypatch.setenv("PHYBLOCK_PHYSICS", engine)
    monkeypatch.setattr(dynamics, "is_proven", lambda _: False)
    for scene in scenes[::every]:
        assert list(findings_of(SceneFacts(scene), (*FORM, *PHYSICS))) == []
        assert hidden_blocks(scene) == ()


@pytest.mark.parametrize("seed", range(4))
def test_a_crane_holds_only_where_its_weight_is_there_first(seed):
    draft = sketch.Draft(np.random.default_rng(seed))
    draft.follow("crane")
    beam = next(one.order for one in draft.blocks if one.type == "cuboid3")
    weight, load = beam, beam + 1
    assert surely_stands(draft.blocks)
    assert surely_falls([one for one in draft.blocks if one.order != weight + 1])
    order = list(range(len(draft.blocks)))
    order[weight], order[load] = load, weight
    assert sketch.scene_of("crane", (5,), draft.blocks).graph.is_valid(order)


def test_splits_share_no_scene_with_one_another_or_with_the_built_in_set():
    split = production.split_tasks
    train = list(islice(split("train", 3, levels=(1, 2, 3, 4)), 12))
    dev = list(islice(split("dev", 3, levels=(1, 2)), 3))
    known, kept = ({sketch.colorless(one.scene.blocks) for one in tasks} for tasks in (train, dev))
    assert not known & kept
    assert not builtin_forms() & (known | kept)
    assert {level for one in train for level in one.scene.levels} == {1, 2, 3, 4}
    assert all(not task.candidates.missing(task.scene) for task in train)
    assert list(islice(split("train", 3, first=1, step=3), 4)) == train[1::3]
    other = next(split("train", 3, excluded=known))
    assert sketch.colorless(other.scene.blocks) not in known


@pytest.mark.parametrize(("count", "jobs"), [(20, 1), pytest.param(200, 2, marks=pytest.mark.slow)])
def test_no_generated_scene_has_a_form_of_the_built_in_set(count, jobs):
    with open_workers(jobs) as workers:
        made_here = production.Production(3, "kit", workers, builtin_forms())
        made = list(made_here.tasks(production.shares(count)))
    assert made_here.rejected
    assert not builtin_forms() & {sketch.colorless(task.scene.blocks) for task in made}


angles = st.floats(-180, 180).map(lambda angle: round(angle, 3))
turns = st.tuples(angles, st.sampled_from([-90.0, 0.0, 90.0]) | angles, angles)
edged = st.sampled_from([kind for kind in BLOCK_TYPES if not SHAPES[kind].is_round])
symmetries = st.sampled_from(SYMMETRIES)
structures = st.sampled_from(TASKS[::7]).map(lambda task: task.scene.blocks)


@given(posed | st.tuples(edged, turns), symmetries)
def test_the_image_of_a_block_fills_the_image_of_its_space(pose, symmetry):
    kind, turn = pose
    one = block(1, kind, (0.03, -0.11, 0.2), sketch.POSES[kind].get(turn, turn))
    (image,) = sketch.transformed([one], symmetry)
    # An upright cylinder turned by 90 degrees has its 18 corners halfway between: 4.4 mm away.
    tolerance_m = 0.005 if SHAPES[one.type].is_round else 1e-5
    first, second = drawn_m(one) @ symmetry.matrix.T, drawn_m(image)
    apart_m = np.linalg.norm(first[:, None] - second[None], axis=2)
    assert max(apart_m.min(axis=0).max(), apart_m.min(axis=1).max()) < tolerance_m


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_known_poses_map_to_known_poses_one_to_one(symmetry):
    for kind in BLOCK_TYPES:
        known = sorted(sketch.POSES[kind].values())
        images = sketch.transformed(
            [block(1, kind, (0.03, -0.11, 0.2), e) for e in known], symmetry
        )
        assert sorted(image.euler_deg for image in images) == known


@given(structures, symmetries, st.tuples(angles, angles), st.randoms())
def test_the_form_is_kept_by_turning_mirroring_shifting_and_order(blocks, symmetry, shift, random):
    shift_m = (shift[0] * 0.001, shift[1] * 0.001)
    moved = turned(sketch.transformed(blocks, symmetry), 0.0, shift_m)
    random.shuffle(moved)
    assert canonical_form(moved) == canonical_form(blocks)


@given(structures, st.integers(0, 50))
def test_another_color_or_place_is_another_form(blocks, pick):
    one = blocks[pick % len(blocks)]
    x, y, z = one.position_m
    color = "red" if one.color != "red" else "blue"
    for changed in (replace(one, color=color), replace(one, position_m=(x, y, z + 0.003))):
        whole = [changed if b is one else b for b in blocks]
        assert canonical_form(whole) != canonical_form(blocks)


@given(structures, symmetries)
@settings(max_examples=25)
def test_contacts_are_kept(blocks, symmetry):
    image = sketch.transformed(blocks, symmetry)
    assert support_graph(image) == support_graph(blocks)
    assert find_overlaps(image) == find_overlaps(blocks)
