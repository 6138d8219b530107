"""Items: those that are asked about, how a seed presents them, and worked examples."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data import AssemblyTask
from phyblock.domain.symmetry import Symmetry, canonical_form
from phyblock.errors import DataError, SpecError
from phyblock.making.scenes.sketch import transformed
from phyblock.models.request import Image
from phyblock.records.record import Reply
from phyblock.tracks.items import (
    Others,
    Presentation,
    ShownTask,
    examples_of,
    file_plan,
    in_order,
    shown_order,
    spread,
    stratified,
)
from phyblock.tracks.pictures import Workshop
from tests.tracks.opened import BUILT_IN, track_of


def goals_of(pool: Sequence[AssemblyTask]) -> Others[AssemblyTask]:
    return Others(pool, lambda task: task.scene.level)


SIZES = st.lists(st.integers(1, 200), min_size=1, max_size=4)
SHUFFLED = Presentation("shuffled")
seeds = st.integers(0, 2**31 - 1)
plans = st.lists(st.integers(-1, 18), max_size=8)
names = st.lists(st.sampled_from([task.key for task in BUILT_IN.tasks]), max_size=3, unique=True)


@given(SIZES, st.integers(1, 900))
def test_shares_are_as_near_to_proportional_as_can_be(sizes: list[int], limit: int) -> None:
    """Webster's law: moving a place from one group to another never brings them nearer. Groups
    with their first place alone hold it whatever their size, and a higher limit takes from none.
    """
    shares = stratified(sizes, limit)
    assert sum(shares) == min(limit, sum(sizes))
    assert all(0 <= share <= size for share, size in zip(shares, sizes, strict=True))
    assert limit < len(sizes) or min(shares) >= 1
    for size, share in zip(sizes, shares, strict=True):
        for other, held in zip(sizes, shares, strict=True):
            if share < size and held >= 2:
                assert (2 * share + 1) * other >= (2 * held - 1) * size
    assert all(a <= b for a, b in zip(shares, stratified(sizes, limit + 1), strict=True))


@given(st.integers(1, 300), st.data())
def test_the_first_positions_are_spread(size: int, data: st.DataObject) -> None:
    share = data.draw(st.integers(1, size))
    kept = sorted(spread(size)[:share])
    assert len(set(kept)) == share
    assert max(b - a for a, b in pairwise([*kept, size])) <= 4 * size / share


@given(seeds)
def test_an_order_has_every_candidate_once_and_is_that_of_scene_and_seed(
    tasks: tuple[AssemblyTask, ...], seed: int
) -> None:
    orders = [shown_order(task, seed) for task in tasks]
    for task, order in zip(tasks, orders, strict=True):
        assert sorted(order) == list(range(1, len(task.candidates) + 1))
        shown = SHUFFLED.of(task, seed)
        assert [shown.candidates[n] for n in range(1, 17)] == [task.candidates[n] for n in order]
        about = _track("full_planning").about(shown)
        assert about == {"shown": {"order": list(order), "goal": task.key}}
    assert len(set(orders)) == len(orders)


def test_orders_stay_as_they_were_drawn(tasks: tuple[AssemblyTask, ...]) -> None:
    """Stored plans are read by them."""
    assert shown_order(tasks[0], 0)[:6] == (5, 9, 7, 4, 2, 11)
    assert shown_order(tasks[0], 1)[:6] == (14, 12, 15, 11, 13, 10)
    for order in ([1, 1, 2], [0, 1], [17]):
        with pytest.raises(DataError, match="no order of its candidates"):
            in_order(tasks[0], order, tasks[0])


@given(st.integers(0, 4), seeds, plans)
def test_a_plan_is_worth_the_same_in_either_numbering(
    tasks: tuple[AssemblyTask, ...], place: int, seed: int, plan: list[int]
) -> None:
    def text(steps: Any) -> str:
        return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(steps, 1))

    task, track = tasks[place], _track("full_planning")
    shown = SHUFFLED.of(task, seed)
    here = track.judge(shown, text(plan)).fields
    in_file = here["parse"]["file_plan"]
    again = track.judge(task, text(in_file)).fields
    assert here["scores"] == again["scores"]
    assert again["parse"]["file_plan"] is None
    named = [shown.candidates[n] for n in here["parse"]["plan"]]
    assert named == [task.candidates[n] for n in in_file]


_TRACKS: dict[str, Any] = {}


def _track(name: str) -> Any:
    if name not in _TRACKS:
        more = {"steps": {"physics": "off"}} if name == "step_planning" else {}
        _TRACKS[name] = track_of(name, **more)
    return _TRACKS[name]


@given(st.integers(0, 4), seeds, st.lists(st.integers(-1, 18), max_size=5))
@settings(deadline=None)
def test_an_episode_goes_the_same_in_either_numbering(
    tasks: tuple[AssemblyTask, ...], place: int, seed: int, moves: list[int]
) -> None:
    async def play(task: AssemblyTask, steps: Any) -> dict[str, Any]:
        episode = _track("step_planning").start(task, 0, {}, with_messages=False)
        for step in steps:
            if await episode.request() is None:
                break
            episode.take(Reply(text=f"Next plan: Move({step})"))
        return episode.judgement().fields

    shown = SHUFFLED.of(tasks[place], seed)
    here = asyncio.run(play(shown, moves))
    there = asyncio.run(play(tasks[place], file_plan(shown, moves)))
    for name in ("scores", "outcomes", "ending", "progress"):
        assert here[name] == there[name]
    assert list(here["parse"]["file_plan"]) == there["parse"]["plan"]


@given(seeds)
def test_another_goal_is_of_the_same_level_and_shares_no_base_scene(
    tasks: tuple[AssemblyTask, ...], seed: int
) -> None:
    others = Presentation(others=goals_of(tasks))
    for task in tasks[:4]:
        shown = others.of(task, seed)
        assert isinstance(shown, ShownTask)
        assert shown.goal is not None
        assert shown.goal.scene.level == task.scene.level
        assert not set(shown.goal.scene.parents) & set(task.scene.parents)
        assert shown == others.of(task, seed)
        assert (shown.scene, shown.candidates) == (task.scene, task.candidates)


def test_a_plain_presentation_changes_nothing_and_a_goal_without_another_is_named(
    tasks: tuple[AssemblyTask, ...],
) -> None:
    assert all(Presentation().of(task, 5) is task for task in tasks)
    assert file_plan(tasks[0], [1, 2]) is None
    plain, blind = (
        track_of("full_planning", tasks, seeds=[0, 1], full_planning={"blind": is_blind})
        for is_blind in (False, True)
    )
    assert plain.about(tasks[0]) == {}
    assert (plain.drawn_seeds, blind.drawn_seeds) == ((0,), (0, 1))
    with pytest.raises(SpecError, match=r"scene t5.*full_planning\.wrong_image"):
        track_of("full_planning", tasks, full_planning={"wrong_image": True})


def bases(task: Any) -> set[str]:
    return {task.scene.id, *task.scene.parents}


@given(first=names, n=st.integers(0, 6), seed=st.integers(0, 9))
@settings(max_examples=8, deadline=None)
def test_no_example_is_kin_of_what_is_asked_about(first: list[str], n: int, seed: int) -> None:
    suite: Any = SimpleNamespace(examples=first or n, seeds=(seed, 77))
    asked = BUILT_IN.tasks[seed::20]
    found = examples_of(suite, BUILT_IN.tasks, asked, "scene")
    for task in asked:
        shown = found.get(task.key, ())
        assert len({one.scene.id for one in shown}) == len(shown) == (len(first) or n)
        assert all(bases(task).isdisjoint(bases(one)) for one in shown)
        forms = {canonical_form(one.scene.blocks) for one in shown}
        assert canonical_form(task.scene.blocks) not in forms
        may = [name for name in first if name in {one.key for one in shown}]
        assert [one.key for one in shown][: len(may)] == may


@given(turns=st.integers(0, 3), mirrored=st.booleans(), place=st.integers(0, 399))
@settings(max_examples=20, deadline=None)
def test_a_goal_turned_or_mirrored_is_no_example(turns: int, mirrored: bool, place: int) -> None:
    task = BUILT_IN.tasks[place]
    blocks = transformed(task.scene.blocks, Symmetry(turns, mirrored))
    twin = replace(task, scene=replace(task.scene, id="twin", parents=("twin",), blocks=blocks))
    assert canonical_form(blocks) == canonical_form(task.scene.blocks)
    suite: Any = SimpleNamespace(examples=["twin"], seeds=(0,), where=lambda *_: "suite")
    others = [twin, BUILT_IN.tasks[place - 1], BUILT_IN.tasks[place - 200]]
    (shown,) = examples_of(suite, others, [task], "scene")[task.key]
    assert shown.key != "twin"


@pytest.mark.parametrize("form", ["text", "json_schema"])
def test_the_answers_of_examples_are_right_and_follow_no_order_of_the_file(form: str) -> None:
    track = track_of("full_planning", answer_format=form, limit=1)
    first, expected = 0, []
    for task in BUILT_IN.tasks[::4]:
        fields = track.judge(task, track.right_answer(task)).fields
        score = next(score for score in fields["scores"] if score["criterion"] == "aov")
        assert (score["tp"], score["fp"], score["fn"]) == (len(task.scene), 0, 0)
        assert (fields["parse"]["rule"] == "json") == (form == "json_schema")
        ready = [task.scene.blocks[vertex].look for vertex in task.scene.graph.ready()]
        if len(set(ready)) == len(ready) > 1:
            first += fields["parse"]["plan"][0] == task.candidates.index_of(ready[0])
            expected.append(1 / len(ready))
    assert abs(first - sum(expected)) < 4 * math.sqrt(sum(p * (1 - p) for p in expected))


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        ("full_planning", {}),
        (
            "full_planning",
            {
                "answer_format": "json_schema",
                "candidates": {"order": "shuffled"},
                "full_planning": {"blind": True},
            },
        ),
        ("vqa", {"vqa": {"options_as": "letters"}}),
        ("vqa", {"answer_format": "json_schema", "vqa": {"blind": True, "circular": True}}),
    ],
)
def test_examples_are_turns_before_the_question(
    shop: Workshop, name: str, fields: dict[str, Any]
) -> None:
    plain = track_of(name, shop=shop, limit=16, **fields)
    shown = track_of(name, shop=shop, limit=16, examples=2, **fields)
    sources = {task.key: task for task in getattr(plain, "questions", BUILT_IN).tasks}
    for item in plain.items:
        (bare,), (asked,) = plain.outlines(item), shown.outlines(item)
        assert [m.role for m in asked.messages] == [
            *("system", "user", "assistant", "user", "assistant", "user")
        ]
        assert (asked.messages[0], asked.messages[-1]) == bare.messages
        assert (len(asked.examples), bare.examples) == (2, ())
        turns = zip(asked.examples, asked.messages[1::2], asked.messages[2::2], strict=False)
        for key, question, answer in turns:
            pictures = [part for part in question.parts if isinstance(part, Image)]
            assert all(part.label.startswith(f"example {key}: ") for part in pictures)
            assert pictures or name == "vqa"
            assert bases(sources[key]).isdisjoint(bases(item))
            rule = shown.judge(item, answer.parts[0]).fields["parse"]["rule"]
            assert rule
            assert (rule == "json") == ("answer_format" in fields)
            if name == "vqa":
                assert sources[key].question.subtask == item.question.subtask


@pytest.mark.parametrize(
    ("name", "examples", "told"),
    [
        ("full_planning", ["nowhere"], "examples[0]: is no scene that an example can be about"),
        ("full_planning", ["l1-001-animals"], "did you mean l1-001-animal?"),
        ("full_planning", 16, "has fewer others to be shown as examples"),
        ("step_planning", 1, "shows no worked examples"),
    ],
)
def test_what_cannot_be_shown_is_refused(
    shop: Workshop, name: str, examples: Any, told: str
) -> None:
    with pytest.raises(SpecError) as caught:
        track_of(name, BUILT_IN.tasks[:9], shop, limit=2, examples=examples)
    assert told in str(caught.value)
