"""Scenes as a seed shows them: orders of candidates, no goal, the goal of another scene."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data import AssemblyTask, read_builtin, read_official
from phyblock.domain import Plan
from phyblock.errors import DataError, SpecError
from phyblock.models.request import Image
from phyblock.records.reply import Reply, Usage
from phyblock.sim.pictures import PictureStyle, candidates_png, goal_png
from phyblock.tracks import PicturePolicy, Pictures
from phyblock.tracks.full_planning import FullPlanning, PlanningRules
from phyblock.tracks.goal_blind import goal_blind_plans
from phyblock.tracks.items import (
    Showing,
    ShownTask,
    TaskShowing,
    file_plan,
    in_order,
    showing_fields,
    shown_order,
)
from phyblock.tracks.step_planning import StepPlanning, StepRules
from tests.data.broken import write_scenes
from tests.workspace import SCENES

RULES = PlanningRules("steps", ("A", "B"), ("optimal", "paper"), "selection")
STYLE = PictureStyle(size_px=128)
SHUFFLED = TaskShowing(Showing("shuffled"))
seeds = st.integers(0, 2**31 - 1)
plans = st.lists(st.integers(-1, 18), max_size=8)


@pytest.fixture(scope="module")
def tasks(tmp_path_factory: pytest.TempPathFactory) -> tuple[AssemblyTask, ...]:
    return read_builtin(write_scenes(tmp_path_factory.mktemp("data"), *SCENES)).tasks


def text(steps: Any) -> str:
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))


@given(seeds)
def test_an_order_has_every_candidate_once_and_is_that_of_scene_and_seed(
    tasks: tuple[AssemblyTask, ...], seed: int
) -> None:
    orders = [shown_order(task, seed) for task in tasks]
    for task, order in zip(tasks, orders, strict=True):
        assert sorted(order) == list(range(1, len(task.candidates) + 1))
        shown = SHUFFLED.of(task, seed)
        assert [shown.candidates[n] for n in range(1, 17)] == [task.candidates[n] for n in order]
        assert showing_fields(shown) == {"shown": {"order": list(order), "goal": task.key}}
    assert len(set(orders)) == len(orders)


def test_orders_stay_as_they_were_drawn(tasks: tuple[AssemblyTask, ...]) -> None:
    """Stored plans are read by them."""
    assert shown_order(tasks[0], 0)[:6] == (5, 9, 7, 4, 2, 11)
    assert shown_order(tasks[0], 1)[:6] == (14, 12, 15, 11, 13, 10)


@given(st.integers(0, 4), seeds, plans)
def test_a_plan_is_worth_the_same_in_either_numbering(
    tasks: tuple[AssemblyTask, ...], place: int, seed: int, plan: list[int]
) -> None:
    task = tasks[place]
    track = FullPlanning(RULES, items=tasks, showing=SHUFFLED)
    shown = track.shown(task, seed)
    judged = track.judge(shown, text(plan))
    in_file = judged.fields()["parse"]["file_plan"]
    again = FullPlanning(RULES).judge(task, text(in_file))
    assert judged.scores == again.scores
    assert again.fields()["parse"]["file_plan"] is None
    assert [shown.candidates[n] for n in judged.steps] == [task.candidates[n] for n in in_file]


@given(st.integers(0, 4), seeds, st.lists(st.integers(-1, 18), max_size=5))
@settings(deadline=None)
def test_an_episode_goes_the_same_in_either_numbering(
    tasks: tuple[AssemblyTask, ...], place: int, seed: int, moves: list[int]
) -> None:
    track = StepPlanning(StepRules(), items=tasks, showing=SHUFFLED)
    shown = track.shown(tasks[place], seed)

    async def play(task: AssemblyTask, steps: Any) -> dict[str, Any]:
        episode = track.start(task, 0, {}, with_messages=False)
        for step in steps:
            if (request := await episode.request()) is None:
                break
            episode.take(
                request,
                Reply(
                    text=f"Next plan: Move({step})",
                    usage=Usage(prompt_tokens=0, completion_tokens=0),
                ),
            )
        return episode.fields()

    here = asyncio.run(play(shown, moves))
    there = asyncio.run(play(tasks[place], file_plan(shown, moves)))
    for name in ("scores", "outcomes", "ending", "progress"):
        assert here[name] == there[name]
    assert list(here["parse"]["file_plan"]) == there["parse"]["plan"]


def test_plain_showing_changes_nothing(tasks: tuple[AssemblyTask, ...]) -> None:
    plain = TaskShowing(Showing(seeds=(0, 1)))
    assert all(plain.of(task, 5) is task for task in tasks)
    assert showing_fields(tasks[0]) == {}
    assert file_plan(tasks[0], [1, 2]) is None
    assert plain.each(tasks) == list(tasks)
    assert len(TaskShowing(Showing("shuffled", seeds=(0, 1))).each(tasks)) == 10


def test_an_order_that_is_none_is_an_error(tasks: tuple[AssemblyTask, ...]) -> None:
    for order in ([1, 1, *range(3, 17)], range(1, 16), []):
        with pytest.raises(DataError, match="no order of its candidates"):
            in_order(tasks[0], list(order), tasks[0])


@given(seeds)
def test_another_goal_is_of_the_same_level_and_shares_no_base_scene(
    tasks: tuple[AssemblyTask, ...], seed: int
) -> None:
    alike = tasks[:4]
    showing = TaskShowing(Showing(wrong_image=True), alike, tasks)
    for task in alike:
        shown = showing.of(task, seed)
        assert isinstance(shown, ShownTask)
        assert shown.goal is not None
        assert shown.goal.scene.level == task.scene.level
        assert not set(shown.goal.scene.parents) & set(task.scene.parents)
        assert shown == showing.of(task, seed)
        assert (shown.scene, shown.candidates) == (task.scene, task.candidates)


def test_a_scene_without_another_to_show_is_named(tasks: tuple[AssemblyTask, ...]) -> None:
    with pytest.raises(SpecError, match=r"scene t5.*full_planning\.wrong_image"):
        TaskShowing(Showing(wrong_image=True), tasks, tasks, "full_planning.wrong_image")


def sent(pictures: Pictures, task: AssemblyTask) -> tuple[Image, ...]:
    return asyncio.run(pictures.of(task))


@pytest.mark.parametrize("layout", ["separate", "composite"])
def test_pictures_follow_what_is_shown(
    tasks: tuple[AssemblyTask, ...], layout: Any, pictures_dir: Path
) -> None:
    policy = PicturePolicy("render", layout, ("goal", "candidates"), STYLE)
    pictures = Pictures(pictures_dir, policy, shop=1)
    try:
        plain = sent(pictures, tasks[0])
        blind = TaskShowing(Showing("shuffled", blind=True)).of(tasks[0], 1)
        (grid,) = sent(pictures, blind)
        assert grid.data == candidates_png(blind.candidates, STYLE)
        assert pictures.outline(blind) == ((grid,), True)
        wrong = TaskShowing(Showing(wrong_image=True), tasks[:1], tasks).of(tasks[0], 0)
        assert isinstance(wrong, ShownTask)
        assert wrong.goal is not None
        other = sent(pictures, wrong)
        assert [image.label for image in other] == [image.label for image in plain]
        if layout == "separate":
            assert other[0].data == goal_png(wrong.goal.scene, STYLE) != plain[0].data
            assert other[1] == plain[1]
        assert pictures.keys(wrong) != pictures.keys(tasks[0]) != pictures.keys(blind)
    finally:
        pictures.close()


def test_pictures_of_the_data_set_can_leave_out_or_exchange_the_goal(
    official_checkout: Path, tmp_path: Path
) -> None:
    tasks = read_official(official_checkout).tasks
    task = next(one for one in tasks if one.composite is not None)
    pool = [one for one in tasks if one.composite is not None]
    blind = TaskShowing(Showing(blind=True)).of(task, 0)
    wrong = TaskShowing(Showing(wrong_image=True), [task], pool).of(task, 0)
    assert isinstance(wrong, ShownTask)
    assert wrong.goal is not None
    policy = PicturePolicy("dataset", "separate", ("goal", "candidates"), STYLE)
    apart = Pictures(tmp_path, policy, shop=1)
    joined = Pictures(tmp_path, replace(policy, layout="composite"), shop=1)
    goal, grid = sent(apart, task)
    assert sent(apart, blind) == sent(joined, blind) == (grid,)
    assert sent(apart, wrong) == (sent(apart, wrong.goal)[0], grid)
    (composite,) = sent(joined, wrong)
    assert composite.label == "composite"
    assert composite.data != sent(joined, task)[0].data
    assert len(apart.keys(wrong)) == 2
    assert goal != sent(apart, wrong)[0]


def test_learned_plans_are_those_of_the_order_shown(tasks: tuple[AssemblyTask, ...]) -> None:
    track = FullPlanning(RULES, items=tasks[:2], showing=SHUFFLED, pool=tasks)
    for seed in (0, 7):
        shown = [SHUFFLED.of(task, seed) for task in tasks]
        plans = goal_blind_plans(
            [one.scene for one in shown], {one.key: one.candidates for one in shown}, "A"
        )
        for task in tasks[:2]:
            ((request, _),) = track.outlines(track.shown(task, seed))
            subject: Any = request.subject
            assert subject.guess() == plans[task.key] != Plan()
