"""What a person picks is what the track reads, in whatever form the prompt asks for."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain import LETTERS, Question
from phyblock.parsing.answer import parse_answer
from phyblock.parsing.move import parse_move
from phyblock.parsing.plan import parse_plan
from phyblock.parsing.poses import parse_poses
from phyblock.resources import bundled
from phyblock.run.plan import open_dataset
from phyblock.sim.pictures import joined_size_px
from phyblock.tracks.baselines import Picking, Spot, picks_of
from phyblock.tracks.full_planning import PlanSubject, pick_plan
from phyblock.tracks.pose_planning import PoseSubject, pick_poses
from phyblock.tracks.questions import ChoiceSubject, pick_answer
from phyblock.tracks.step_planning import StepSubject, pick_step

DATA = open_dataset("builtin", bundled("benchmarks", "data", "phyblock-400"))
TASK = DATA.tasks[0]
N = len(TASK.candidates)
TEXTS = ("a red cube", "place B", "Done", "the arch")
PICTURES = tuple(f"<img{n}>" for n in range(1, 5))


@given(st.lists(st.integers(0, N - 1), min_size=1, max_size=99))
def test_a_plan_is_read_as_it_was_picked(picks: list[int]) -> None:
    reply = pick_plan(PlanSubject(TASK.scene, TASK.candidates)).reply(picks_of(picks))
    steps = tuple(pick + 1 for pick in picks)
    assert parse_plan(reply, N).plan.steps == steps
    assert parse_plan(reply, N, "official").plan.steps == steps


@pytest.mark.parametrize("pick", range(N + 1))
def test_a_step_is_read_as_it_was_picked(pick: int) -> None:
    picking = pick_step(StepSubject(TASK.scene, TASK.candidates, (), ()))
    reply, wanted = picking.reply(picks_of([pick])), pick + 1 if pick < N else "Done"
    parsed = parse_move(reply)
    assert ("Done" if parsed.is_done else parsed.move) == wanted


@given(st.permutations(range(4)), st.sampled_from([TEXTS, PICTURES]), st.booleans())
def test_an_answer_is_read_as_it_was_picked(
    order: list[int], options: tuple[str, ...], is_ordering: bool
) -> None:
    subtask = "OR" if is_ordering else "SH"
    question = Question("q", subtask, TASK.scene, "Which?", options, (0,))
    picks = order if is_ordering else order[:1]
    reply = pick_answer(ChoiceSubject(question, {}.__getitem__)).reply(picks_of(picks))
    letters = "".join(LETTERS[pick] for pick in picks)
    assert parse_answer(reply, options, is_ordering).letters == letters


CENTIMETERS = st.integers(-100_000, 100_000).map(lambda n: n / 100)
DEGREES = st.integers(-3600, 3600).map(lambda n: n / 10)


@given(
    st.lists(
        st.tuples(
            st.integers(0, N - 1),
            st.tuples(CENTIMETERS, CENTIMETERS, CENTIMETERS),
            st.tuples(DEGREES, DEGREES, DEGREES),
        ),
        min_size=1,
        max_size=100,
    ),
    st.booleans(),
)
def test_places_and_turns_are_read_as_they_were_given(
    steps: list[tuple[int, tuple[float, ...], tuple[float, ...]]], is_free: bool
) -> None:
    picking = pick_poses(PoseSubject(TASK.scene, TASK.candidates, is_free))
    numbers = [(*place, *turn) if is_free else place for _, place, turn in steps]
    reply = picking.reply(picks_of([pick for pick, _, _ in steps], numbers))
    read = parse_poses(reply, N, free=is_free).plan.steps
    assert [step.candidate - 1 for step in read] == [pick for pick, _, _ in steps]
    given_numbers = [(*step.center_cm, *(step.euler_deg or ())) for step in read]
    assert given_numbers == numbers


@pytest.mark.parametrize(
    ("numbers", "error"),
    [
        ([], "0 numbers with a pick in place of 3"),
        ([[1, 2]], "2 numbers with a pick in place of 3"),
        ([[1, 2, 3, 0, 0, 0]], "6 numbers with a pick in place of 3"),
        ([[1, 2, 3], [1, 2, 3]], "numbers of 2 picks"),
        ([[1, -1000.5, 3]], "y -1000.5 outside of ±1000 cm"),
        ([[1, 2, float("nan")]], "z nan outside"),
        ([[1, 2, float("inf")]], "z inf outside"),
        ([[0.125, 2, 3]], "x 0.125 with more than 2 decimals"),
        ([[10**400, 2, 3]], "outside of the range of numbers"),
    ],
)
def test_numbers_that_are_lacking_or_not_allowed_are_refused(
    numbers: list[list[float]], error: str
) -> None:
    picking = pick_poses(PoseSubject(TASK.scene, TASK.candidates, is_free=False))
    with pytest.raises(ValueError, match=error):
        picking.reply(picks_of([0], numbers))


def picking(least: int = 1, most: int = 3, *, repeats: bool = False) -> Picking:
    choices = pick_plan(PlanSubject(TASK.scene, TASK.candidates)).choices[:4]
    return Picking(
        choices,
        least,
        most,
        repeats,
        "step",
        lambda picks: "-".join(str(pick.place) for pick in picks),
    )


@settings(max_examples=50)
@given(st.lists(st.integers(-2, 6), max_size=5), st.booleans())
def test_picks_that_make_no_answer_are_refused(picks: list[int], repeats: bool) -> None:
    is_right = 1 <= len(picks) <= 3 and all(0 <= pick < 4 for pick in picks)
    is_right = is_right and (repeats or len(set(picks)) == len(picks))
    if is_right:
        assert picking(repeats=repeats).reply(picks_of(picks)) == "-".join(map(str, picks))
    else:
        with pytest.raises(ValueError, match="holds"):
            picking(repeats=repeats).reply(picks_of(picks))


def test_in_pictures_of_a_data_set_nothing_is_clicked_but_whole_pictures() -> None:
    plan = pick_plan(PlanSubject(TASK.scene, TASK.candidates))
    assert all(choice.spots for choice in plan.choices)
    assert not any(choice.spots for choice in plan.without_cells().choices)
    question = Question("q", "VP", TASK.scene, "Which?", PICTURES, (0,))
    shown = pick_answer(ChoiceSubject(question, {}.__getitem__)).without_cells().choices
    assert [choice.spots for choice in shown] == [(Spot(letter),) for letter in LETTERS]


@pytest.mark.parametrize("side", [128, 511, 1024])
def test_candidates_are_clicked_where_the_grid_is_drawn(side: int) -> None:
    """Corners of cells, in pixels, in the composite and in the grid by itself."""
    for width, start in ((joined_size_px(side)[0], joined_size_px(side)[0] - side), (side, 0)):
        for cell in range(16):
            left, top, wide, high = Spot("composite", cell).box(width, side)
            row, column = divmod(cell, 4)
            assert left * width == pytest.approx(start + column * side / 4)
            assert top * side == pytest.approx(row * side / 4)
            assert (wide * width, high * side) == pytest.approx((side / 4, side / 4))
