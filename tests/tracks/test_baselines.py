"""Answers without a model: guesses of questions, plans without the goal, picks of people."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain.blocks import COLORS, KIT_PALETTE
from phyblock.domain.question import LETTERS, Question
from phyblock.domain.scene import Candidate, CandidateSet, Plan, Scene
from phyblock.making.questions.guesses import text_rule
from phyblock.parsing.answer import parse_answer, parse_move
from phyblock.parsing.plan import parse_plan, parse_poses
from phyblock.scoring.plan import Goal
from phyblock.sim.pictures import joined_size_px
from phyblock.tracks import full_planning as plans
from phyblock.tracks.base import Choice, Pick, Picking
from phyblock.tracks.full_planning import FullPlanning, PlanSubject, goal_blind_plans
from phyblock.tracks.pose_planning import PosePlanning
from phyblock.tracks.questions import FOLDS, ChoiceSubject, Folds, Vqa, guesses_of, majority_rule
from phyblock.tracks.step_planning import StepPlanning, StepSubject
from tests.scoring.cases import block, plans_f1
from tests.shipped import TASKS

WORDS = ("cube", "arch", "cylinder", "cuboid", "cone", "prism")


def made_by(rule, n=200):
    """Questions of which a rule gives the options, the right one first."""
    rng, made = np.random.default_rng(3), []
    for number in range(n):
        options, order = rule(rng), rng.permutation(4).tolist()
        scene = Scene(f"s{number}", (2,), (), (f"base{number % 40}",))
        text = f"Which one is it, {WORDS[number % 6]} or not?"
        shown = tuple(str(options[place]) for place in order)
        made.append(Question(f"sh-{number}", "SH", scene, text, shown, (order.index(0),)))
    return made


def fair(rng):
    return rng.permutation(WORDS)[:4]


def cube_is_right(rng):
    return ["cube", *rng.permutation(WORDS[1:])[:3]]


def largest_is_right(rng):
    return [f"{number} cm" for number in sorted(rng.integers(0, 100_000, 4))[::-1]]


def most_alike_is_right(rng):
    a, b, c, d, e, f = rng.permutation(WORDS)
    return [f"{a} {b}", f"{a} {c}", f"{d} {b}", f"{e} {f}"]


@pytest.mark.parametrize(
    ("learn", "rule", "least", "most"),
    [
        *((learn, fair, 0, 0.36) for learn in (majority_rule, text_rule)),
        *((learn, cube_is_right, 1, 1) for learn in (majority_rule, text_rule)),
        *((text_rule, rule, 0.9, 1) for rule in (largest_is_right, most_alike_is_right)),
        *((majority_rule, rule, 0, 0.5) for rule in (largest_is_right, most_alike_is_right)),
    ],
)
def test_a_tell_is_found_by_the_rule_that_can_see_it(learn, rule, least, most):
    questions = made_by(rule)
    guesses = guesses_of(questions, learn)
    assert least <= sum(guesses(one) == one.answer for one in questions) / len(questions) <= most


def test_what_is_learned_from_shares_no_base_scene_with_what_is_answered():
    found = [
        replace(one, scene=replace(one.scene, parents=(f"base{n % 40}", f"base{n * 7 % 40}")))
        for n, one in enumerate(made_by(fair, 120))
    ]
    folds = Folds(found)
    for fold in range(FOLDS):
        held_out = {one.scene.parents[0] for one in found if folds.of(one) == fold}
        known = {base for q in found if folds.is_known(fold, q) for base in q.scene.parents}
        assert held_out
        assert known
        assert not held_out & known


KIT = tuple(Candidate(*kind, (0.0, 0.0, 0.0)) for kind in KIT_PALETTE)


def scene(name, needed, parents=()):
    """Blocks beside one another: any order is right."""
    blocks = (block(order, (*one.kind, one.euler_deg)) for order, one in enumerate(needed, 1))
    return Scene(name, (2,), tuple(blocks), parents or (name,))


@st.composite
def drawn_sets(draw):
    """Scenes of one to three blocks, some of them made from others, each with a set of the kit."""
    scenes = []
    sets = {}
    for number in range(draw(st.integers(2, 8))):
        offered = draw(st.permutations(KIT))[: draw(st.integers(3, 8))]
        needed = tuple(draw(st.lists(st.sampled_from(offered), min_size=1, max_size=3)))
        names = [one.id for one in scenes]
        parents = draw(st.lists(st.sampled_from(names), max_size=2)) if names else []
        scenes.append(scene(f"s{number}", needed, tuple(dict.fromkeys(parents))))
        sets[f"s{number}"] = CandidateSet(tuple(offered))
    return scenes, sets


@given(drawn_sets(), st.sampled_from(["A", "B"]), st.booleans())
@settings(max_examples=25)
def test_a_plan_names_candidates_of_its_set(drawn, setting, repeats):
    scenes, sets = drawn
    guessed = goal_blind_plans(scenes, sets, setting, repeats=repeats)
    assert set(guessed) == set(sets)
    for name, plan in guessed.items():
        assert plan.steps
        assert {*plan.steps} <= {*range(1, 1 + len(sets[name]))}
        assert repeats or len(set(plan.steps)) == len(plan)


@given(drawn_sets(), st.sampled_from(["A", "B"]), st.data())
@settings(max_examples=25)
def test_no_goal_has_a_part_in_what_is_learned_for_its_own_base_scene(drawn, setting, data):
    """Another goal in place of a scene's own changes no chance in the scenes it is related to."""
    scenes, sets = drawn
    at = data.draw(st.integers(0, len(scenes) - 1))
    own = sets[scenes[at].id].candidates
    others = tuple(data.draw(st.lists(st.sampled_from(own), min_size=1, max_size=5)))
    changed = [*scenes[:at], scene(scenes[at].id, others, scenes[at].parents), *scenes[at + 1 :]]
    kin = plans.related(scenes)
    areas = {color: data.draw(st.sampled_from([0.0, 0.15, 0.5])) for color in COLORS}
    offered = [plans.units(sets[one.id], setting, areas) for one in scenes]
    goals = [[Goal(one, sets[one.id], setting) for one in known] for known in (scenes, changed)]
    for key in (*plans.KEYS, *plans.AREA_KEYS):
        before, after = (plans.chances(offered, known, kin, key) for known in goals)
        for place in kin[at]:
            np.testing.assert_array_equal(before[place], after[place])


@pytest.mark.parametrize("setting", ["A", "B"])
@pytest.mark.parametrize("is_drawn", [False, True])
def test_a_planted_tell_is_found(setting, is_drawn):
    """The needed ones are all of a color: red, or one drawn for each scene, which areas tell."""
    rng = np.random.default_rng(3)
    scenes, sets = [], {}
    for number in range(40):
        offered = [KIT[int(i)] for i in rng.permutation(len(KIT))[:8]]
        color = offered[int(rng.integers(8))].color if is_drawn else COLORS[0]
        needed = [one for one in offered if one.color == color] or offered[:1]
        scenes.append(scene(f"s{number}", tuple(needed)))
        sets[f"s{number}"] = CandidateSet(tuple(offered))
    areas = {one.id: plans.color_areas(one, "oblique") for one in scenes}
    assert all(areas[one.id] == {one.blocks[0].color: 1.0} for one in scenes)
    every = {name: Plan(tuple(range(1, 9))) for name in sets}
    evenly = goal_blind_plans(scenes, sets, setting, [lambda _: None])
    learned = goal_blind_plans(scenes, sets, setting)
    seen = goal_blind_plans(scenes, sets, setting, plans.AREA_KEYS, areas=areas)
    found = [seen, learned] if is_drawn else [learned]
    f1, *others = (plans_f1(scenes, sets, one, setting) for one in (*found, every, evenly))
    assert f1 > 0.8 > 0.6 > max(others)


TASK = TASKS[0]
N = len(TASK.candidates)
OPTIONS = (("a red cube", "place B", "Done", "the arch"), ("<img1>", "<img2>", "<img3>", "<img4>"))
CENTIMETERS = st.integers(-100_000, 100_000).map(lambda n: n / 100)
PLACED = st.tuples(st.integers(0, N - 1), st.tuples(CENTIMETERS, CENTIMETERS, CENTIMETERS))


@given(st.lists(PLACED, min_size=1, max_size=99), st.integers(0, N))
def test_plans_steps_and_places_are_read_as_they_were_picked(placed, step):
    subject, steps = PlanSubject(TASK.scene, TASK.candidates), tuple(n + 1 for n, _ in placed)
    reply = FullPlanning.by_hand(subject).reply([Pick(number) for number, _ in placed])
    for parser in ("steps", "official"):
        assert parse_plan(reply, N, parser).plan.steps == steps
    reply = PosePlanning.by_hand(subject).reply([Pick(*one) for one in placed])
    read = parse_poses(reply, N).steps
    assert [(one.candidate - 1, one.center_cm) for one in read] == placed
    picking = StepPlanning.by_hand(StepSubject(TASK.scene, TASK.candidates))
    parsed = parse_move(picking.reply([Pick(step)]))
    assert parsed.is_done if step == N else parsed.move == step + 1


@given(st.permutations(range(4)), st.sampled_from(OPTIONS), st.booleans())
def test_an_answer_is_read_as_it_was_picked(order, options, is_ordering):
    subtask = "OR" if is_ordering else "SH"
    question = Question("q", subtask, TASK.scene, "Which?", options, (0,))
    picks = order if is_ordering else order[:1]
    reply = Vqa.by_hand(ChoiceSubject(question, {}.__getitem__)).reply(list(map(Pick, picks)))
    letters = "".join(LETTERS[pick] for pick in picks)
    assert parse_answer(reply, options, is_ordering).letters == letters


NOT_NUMBERS = ((), (1, 2), (1, 2, 3, 0, 0, 0), (1, -1000.5, 3), (0.125, 2, 3), (10**400, 2, 3))


@pytest.mark.parametrize("numbers", [*NOT_NUMBERS, (1, 2, float("nan")), (1, 2, float("inf"))])
def test_numbers_that_are_lacking_or_not_allowed_are_refused(numbers):
    picking = PosePlanning.by_hand(PlanSubject(TASK.scene, TASK.candidates))
    with pytest.raises(ValueError, match="make no answer"):
        picking.reply([Pick(0, numbers)])


@settings(max_examples=50)
@given(st.lists(st.integers(-2, 6), max_size=5), st.booleans())
def test_picks_that_make_no_answer_are_refused(picks, repeats):
    choices = FullPlanning.by_hand(PlanSubject(TASK.scene, TASK.candidates)).choices[:4]
    picking = Picking(choices, lambda them: [pick.place for pick in them], most=3, repeats=repeats)
    is_right = 1 <= len(picks) <= 3 and {*picks} <= {0, 1, 2, 3}
    if is_right and (repeats or len(set(picks)) == len(picks)):
        assert picking.reply(list(map(Pick, picks))) == picks
    else:
        with pytest.raises(ValueError, match="holds"):
            picking.reply(list(map(Pick, picks)))


@pytest.mark.parametrize("side", [128, 511, 1024])
def test_candidates_are_clicked_where_the_grid_is_drawn(side):
    """Corners of cells, in pixels, in the composite and in the grid by itself."""
    for width, start in ((joined_size_px(side)[0], joined_size_px(side)[0] - side), (side, 0)):
        for cell in range(16):
            left, top, wide, high = Choice("1", "", ("composite",), cell).box(width, side)
            row, column = divmod(cell, 4)
            assert left * width == pytest.approx(start + column * side / 4)
            assert top * side == pytest.approx(row * side / 4)
            assert (wide * width, high * side) == pytest.approx((side / 4, side / 4))
