"""Which questions a suite asks: by subtask and level, spread evenly, under two limits."""

from __future__ import annotations

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from phyblock.data import QuestionTask
from phyblock.domain import SUBTASKS, Question, Scene, Subtask
from phyblock.tracks.questions import select_questions

LEVELS = (1, 2, 3, 4)


def task(number: int, subtask: Subtask) -> QuestionTask:
    scene = Scene(f"s{number}", (number % 4 + 1,), (), ())
    question = Question(f"q{number}", subtask, scene, "?", ("a", "b", "c", "d"), (0,))
    return QuestionTask(question)


tasks = st.lists(st.sampled_from(SUBTASKS[:4]), max_size=60).map(
    lambda names: [task(number, name) for number, name in enumerate(names)]
)
some = st.lists(st.sampled_from(SUBTASKS[:7]), min_size=1, unique=True)


@given(tasks, some, st.none() | st.integers(1, 5), st.none() | st.integers(1, 40))
def test_no_more_than_wanted_of_each_and_in_all(
    given_tasks: list[QuestionTask],
    subtasks: list[Subtask],
    per_subtask: int | None,
    limit: int | None,
) -> None:
    chosen = select_questions(given_tasks, subtasks, LEVELS, per_subtask, limit)
    found = Counter(one.question.subtask for one in given_tasks)
    counts = Counter(one.question.subtask for one in chosen)
    most = {name: min(found[name], per_subtask or found[name]) for name in subtasks}
    assert all(counts[name] <= most.get(name, 0) for name in SUBTASKS)
    assert len(chosen) == min(sum(most.values()), limit or sum(most.values()))
    positions = [given_tasks.index(one) for one in chosen]
    assert positions == sorted(set(positions))


@given(tasks, some, st.integers(1, 5), st.integers(1, 40))
def test_a_higher_limit_asks_all_that_a_lower_one_asks(
    given_tasks: list[QuestionTask], subtasks: list[Subtask], per_subtask: int, limit: int
) -> None:
    def keys(most_of_each: int | None, most: int | None) -> set[str]:
        kept = select_questions(given_tasks, subtasks, LEVELS, most_of_each, most)
        return {task.key for task in kept}

    assert keys(None, limit) <= keys(None, limit + 1)
    assert keys(per_subtask, None) <= keys(per_subtask + 1, None)
    assert keys(per_subtask, limit) <= keys(per_subtask, limit + 1)


@given(tasks, st.lists(st.sampled_from(LEVELS), min_size=1, unique=True))
def test_levels_are_those_of_the_scenes(given_tasks: list[QuestionTask], levels: list[int]) -> None:
    chosen = select_questions(given_tasks, SUBTASKS, levels, None, None)
    assert list(chosen) == [one for one in given_tasks if set(one.scene.levels) & set(levels)]


def test_those_kept_are_spread_over_the_set() -> None:
    many = [task(number, "SH") for number in range(100)]
    chosen = select_questions(many, ["SH"], LEVELS, 4, None)
    assert [many.index(one) for one in chosen] == [0, 25, 50, 75]
