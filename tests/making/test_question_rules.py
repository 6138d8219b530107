"""Rules by which questions are drafted and answers derived: names, lengths, places, ranks."""

import contextlib
import itertools
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain.blocks import COLORS, SHAPES
from phyblock.domain.question import LETTERS, Mark, QuestionPicture
from phyblock.domain.scene import SYMMETRIES, Scene
from phyblock.making.questions import base, dynamics
from phyblock.making.questions.base import Draft, UnfairError, four_alike
from phyblock.making.questions.guesses import keeping_odds
from phyblock.making.questions.production import even_letters
from phyblock.making.questions.properties import layers_of, sure_blocks
from phyblock.making.questions.relations import AXIS_TURNS, LENGTHS, images, phrases, put_beside
from phyblock.making.questions.sight import SHAPE_WORDS, names, resolve, resolve_seen
from phyblock.making.scenes.sketch import POSES, lowered, transformed
from phyblock.sim.balance import is_balanced
from phyblock.sim.contact import find_gaps, find_overlaps, support_graph
from phyblock.sim.question_pictures import seen, seen_order
from tests.shipped import TASKS
from tests.sim.structures import block, tower

SCENES = [task.scene for task in TASKS]
FEATURES = ("color", "type", "layer", "side", "support")
scenes = st.sampled_from(SCENES[::9])
seeds = st.integers(0, 2**32 - 1)


@given(
    st.sampled_from(SCENES[::10]), st.sets(st.sampled_from(FEATURES), min_size=1), st.floats(0, 360)
)
def test_a_name_fits_its_block_alone_and_speaks_of_what_it_may(scene, features, azimuth):
    picture = QuestionPicture("scene", scene.blocks, (azimuth, 25.0))
    for one in scene.blocks:
        for name in names(one, picture, sorted(features)):
            assert resolve(name, picture) == resolve(name, picture, loosely=True) == (one.order,)
            assert resolve_seen([f"the {name}"], picture, 0.0) == [one]
            if "color" not in features:
                assert not {*COLORS} & set(name.split())
            if "type" not in features:
                assert not any(word in name for word in SHAPE_WORDS)


@pytest.mark.parametrize(
    ("text", "place", "azimuth", "orders"),
    [
        # From azimuth 45 degrees, larger y is to the right.
        ("leftmost cube", (0, 0.2, 0.025), 45.0, (1,)),
        ("rightmost cube", (0, 0.2, 0.025), 45.0, (2,)),
        ("leftmost cube", (0, 0.2, 0.025), 225.0, (2,)),
        ("leftmost cube", (0, 0, 0.075), 45.0, ()),
        ("highest cube", (0, 0, 0.075), 45.0, (2,)),
        ("highest cube", (0, 0.06, 0.025), 45.0, ()),
        ("blue cube resting on the red cube", (0, 0, 0.075), 45.0, (2,)),
        ("blue cube in layer 2", (0, 0, 0.075), 45.0, (2,)),
    ],
)
def test_words_for_places_fit_one_block_or_none(text, place, azimuth, orders):
    other = block(2, "cube", place, color="blue", depend=(1,) if place[2] > 0.05 else ())
    picture = QuestionPicture("scene", (*tower(1), other), (azimuth, 22.0))
    assert resolve(text, picture) == orders


@given(st.sampled_from([name for name, shape in SHAPES.items() if shape.is_long]), st.data())
def test_a_turn_is_the_one_that_was_made(kind, data):
    euler = data.draw(st.sampled_from(sorted(POSES[kind].values())))
    lying = block(1, kind, (0, 0, 0.1), euler)
    try:
        turned = [replace(lying, euler_deg=euler) for _, euler in images("rr-axis", lying)]
    except UnfairError:
        return
    assert AXIS_TURNS[0] in phrases("rr-axis", lying, lying)
    said = {name for one in turned for name in phrases("rr-axis", one, lying)}
    assert said == set(AXIS_TURNS)


@settings(max_examples=30)
@given(scenes, seeds)
def test_a_loose_block_stands_free_on_the_ground(scene, seed):
    loose = put_beside(scene.blocks[0], scene.blocks, np.random.default_rng(seed))
    every = (*scene.blocks, loose)
    assert not find_overlaps(every)
    assert support_graph(every)[loose.order] == {0}
    assert len({one.order for one in every}) == len(every)


@settings(max_examples=40)
@given(scenes)
def test_layers_are_one_more_than_what_is_below(scene):
    below = support_graph(scene.blocks)
    with contextlib.suppress(UnfairError):
        layers = layers_of(scene.blocks)
        for order, layer in layers.items():
            assert layer == 1 + max(layers.get(other, 0) for other in below[order])


@settings(max_examples=40)
@given(scenes, st.sampled_from(SYMMETRIES), st.sampled_from(sorted(LENGTHS)))
def test_lengths_stay_what_they_are_in_a_mirror_and_after_a_turn(scene, symmetry, rule):
    other = transformed(scene.blocks, symmetry)
    pairs = itertools.permutations(zip(scene.blocks, other, strict=True), 2)
    for (a, x), (b, y) in itertools.islice(pairs, 20):
        try:
            length = LENGTHS[rule](a, b, scene.blocks)
        except UnfairError:
            continue
        assert LENGTHS[rule](x, y, other) == pytest.approx(length, abs=1e-5)


def test_a_hidden_block_is_sure_where_one_that_shows_rests_on_it_alone():
    wall = [block(i, "cube", (0.06, y, 0.025)) for i, y in enumerate((-0.05, 0.0, 0.05), 1)]
    low, high = block(5, "cube", (0, 0, 0.025)), block(6, "cube", (0, 0, 0.075), depend=(5,))
    assert sure_blocks(QuestionPicture("scene", (*wall, low, high), (0.0, 18.0))) == 5
    with pytest.raises(UnfairError, match="nothing that can be seen rests on block 5"):
        sure_blocks(QuestionPicture("scene", (*wall, low), (0.0, 18.0)))


def benches(rng, has_pillar):
    """Yield a bench on a top of each scene that has one."""
    for scene in SCENES:
        if tops := dynamics.free_tops(scene.blocks):
            first = len(scene) + 1
            yield dynamics.bench(scene.blocks, tops[0], first, rng, has_pillar=has_pillar)


@pytest.mark.parametrize("has_pillar", [False, True])
def test_a_bench_leaves_the_scene_as_it_is_and_its_lever_says_what_stays(has_pillar):
    """Mostly, but for other tops; what rests on a block that goes is not always what falls."""
    rng = np.random.default_rng(3)
    said, broken = Counter(), 0
    for on in itertools.islice(benches(rng, has_pillar), 12):
        near, far = on.limits_m
        for plan in on.plans_m(20, rng):
            lean_m, blocks = abs(float(on.leans_m(plan))), on.laid(plan.tolist())
            if blocks is None or near < lean_m < far:
                continue
            assert not find_gaps(blocks)
            assert blocks[: len(on.base)] == on.base
            stands = is_balanced(blocks)
            said[lean_m <= near, stands] += 1
            if stands:
                resting = dynamics.resting_on(blocks, on.loose[-1].order)
                assert dynamics.resting_on(blocks, on.loose[-1].order, only=True) <= resting
                broken += bool(resting) is dynamics.is_sure(blocks[:-1], ())
    for stays in (True, False):
        assert said[stays, stays] > 4 * said[stays, not stays]
    assert broken


@pytest.mark.parametrize(
    ("sides", "euler", "is_on_edges"),
    [("triangle", (135.0, 0.0, 0.0), True), ("cube", (0.0, 0.0, 0.0), False)],
)
def test_what_lies_on_edges_when_a_block_goes_is_told_from_what_lies_on_tops(
    sides, euler, is_on_edges
):
    """A roof over a cube, beside which are two ramps, or two cubes."""
    blocks = (
        *tower(1),
        block(2, sides, (0.0, 0.05, 0.025), euler),
        block(3, sides, (0.0, -0.05, 0.025), (euler[0], 0.0, 180.0)),
        block(4, "triangle", (0.0, 0.0, 0.05), depend=(1, 2, 3)),
    )
    assert dynamics.balances_on_edges(blocks, 1, frozenset()) is is_on_edges
    assert not dynamics.balances_on_edges(blocks, 1, frozenset({4}))


def test_what_plainly_becomes_of_a_block_is_what_statics_say():
    """Nearly always: only what a block is set on is looked at, not what is further below."""
    rng, said = np.random.default_rng(4), Counter()
    drafts = (dynamics.AffordanceMaker().drafts(scene, rng) for scene in SCENES[::40])
    for draft in itertools.islice(itertools.chain.from_iterable(drafts), 4):
        plain, (put,) = draft.pictures[0], draft.pictures[1].blocks
        shown = {seen_order(plain, seen(plain), mark.position_m) for mark in draft.options}
        assert len(shown - {None}) == len(LETTERS)
        points = dynamics.points_of(plain, rng)
        outcomes = dynamics.outcomes_of(plain.blocks, put, points)
        for at, outcome in zip(points.at_m.tolist(), outcomes.tolist(), strict=True):
            if outcome:
                lowest = lowered(put, plain.blocks, *at[:2])
                group = dynamics.group_of((*plain.blocks, lowest), put.order)
                said[outcome, is_balanced(group) is (outcome == dynamics.STAYS)] += 1
    assert {outcome for outcome, _ in said} == {1, 2, 3}
    for outcome in (1, 2, 3):
        assert said[outcome, True] > 9 * said[outcome, False]


@pytest.mark.parametrize("rank", range(3))
def test_of_four_next_steps_one_stays_however_far_its_plank_hangs_over(rank):
    """All lean by steps, with margins to either side of what the top bears."""
    rng, others = np.random.default_rng(3), set()
    for on, other in zip(benches(rng, True), itertools.cycle(range(4))):
        plans = dynamics.four_plans(on, (rank, other), rng)
        if not plans:
            continue
        leans, over = on.leans_m(np.array(plans)), np.abs(plans)[:, 0]
        near, far = on.limits_m
        assert abs(leans[0]) <= near < far <= np.abs(leans[1:]).min()
        off = np.abs(leans - on.middle_m)
        assert over[0] not in over[1:]
        assert (over[1:] < over[0]).sum() == rank
        assert (off[1:] < off[0]).sum() == other
        others.add(other)
    assert len(others) > 2


@pytest.mark.parametrize(
    ("y_m", "stays"), [(0, True), (-0.068, False), (0.05, False), (-0.053, None)]
)
def test_a_block_stays_where_the_plank_does_not_tip(y_m, stays):
    """A wall is in the way of one end; unsure is where the weights are nearly over the edge."""
    plank = block(2, "cuboid3", (0, 0, 0.0625), (0, 0, 90))
    wall = block(3, "cuboid3", (0.055, 0.05, 0.075), (0, 90, 0))
    put, place_m = block(4, "cuboid3", (0, 0, 0), (90, 0, 0)), (0, y_m, 0.075)
    blocks = (*tower(1), plank, wall)
    plain = QuestionPicture("scene", blocks, (300.0, 35.0), marks=(Mark("A", place_m),))
    assert dynamics.stays_at(plain, put, place_m) is stays


@given(seed=seeds)
def test_options_that_are_taken_are_apart_and_one_is_right(seed):
    rng = np.random.default_rng(seed)
    measures = rng.normal(size=(10, 4))
    unlike = rng.random((len(measures),) * 2)
    unlike += unlike.T
    four = four_alike(measures, unlike, 0.7, rng)
    if four:
        assert len(set(four)) == 4
        assert four[0] == 0
        assert all(unlike[a, b] >= 0.7 for a, b in itertools.combinations(four, 2))


def test_no_rank_is_more_often_right_than_another():
    """The right one would always be the largest if it were not matched."""
    ranks, unlike = Counter(), np.ones((14, 14))
    for seed in range(200):
        rng = np.random.default_rng(seed)
        measures = rng.normal(size=(14, 1))
        measures[0] += 1
        if four := four_alike(measures, unlike, 0.5, rng):
            below = base.ranks_among(measures, unlike, four[0], np.array([four[1:]]))
            ranks[round(float(below[0, 0]))] += 1
    assert min(ranks[rank] for rank in range(4)) > 0.15 * ranks.total()


@given(st.integers(0, 200), seeds)
def test_every_letter_is_right_about_as_often(count, seed):
    letters = Counter(even_letters(count, np.random.default_rng(seed)))
    assert letters.total() == count
    for index in range(len(LETTERS)):
        # In hundredths, since 0.28 of 150 is no whole number in floating point.
        low, high = (round(100 * share) * count for share in base.BALANCE)
        assert low // 100 <= letters[index] <= -(-high // 100)


base.WORDINGS["told"] = "{text}"
SHAPE_TEXTS = ("cube", "arch", "cylinder", "prism", "half cylinder")


def told(name, text, options):
    return Draft("told", Scene(name, (1,), (), (name,)), (), {"text": text}, options)


def pool(count, odds, seed):
    """Drafts in which shapes are right as often as `odds` say, the more so of what is on top."""
    rng = np.random.default_rng(seed)
    made = []
    for number in range(count):
        word = "topmost" if rng.random() < 0.5 else "leftmost"
        chances = np.array(odds) ** (2 if word == "topmost" else 1)
        right = int(rng.choice(len(SHAPE_TEXTS), p=chances / chances.sum()))
        others = [int(i) for i in rng.permutation(len(SHAPE_TEXTS)) if i != right][:3]
        options = tuple(SHAPE_TEXTS[i] for i in (right, *others))
        made.append(told(f"s{number % 60}", f"What shape is the {word} block?", options))
    return made


def rate_off(texts):
    """Return the largest distance from chance of a shape that is offered."""
    right = Counter(one.options[0] for one in texts)
    offered = Counter(option for one in texts for option in one.options)
    return max(abs(right[shape] / offered[shape] - 0.25) for shape in SHAPE_TEXTS)


def test_of_the_drafts_kept_each_option_is_right_equally_often():
    texts, rng = pool(3000, (0.4, 0.25, 0.15, 0.1, 0.1), 1), np.random.default_rng(2)
    odds = dict(zip(map(id, texts), keeping_odds(texts), strict=True))
    for word in ("topmost", "leftmost"):
        before = [one for one in texts if word in one.text]
        assert rate_off(before) > 0.15
        assert rate_off([one for one in before if rng.random() < odds[id(one)]]) < 0.08
    assert np.mean(keeping_odds(pool(800, (0.2,) * 5, 3))) > 0.7
    assert keeping_odds([told("s", "Which picture?", ())] * 5).tolist() == [1.0] * 5
