"""The full-planning track: what is asked, and what a reply is worth."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.data import AssemblyTask, read_builtin
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks import PicturePolicy, Pictures, TemplatePrompt
from phyblock.tracks.full_planning import FullPlanning, PlanningRules
from tests.data.broken import write_scenes
from tests.workspace import SCENES

RULES = PlanningRules("steps", ("A", "B"), ("optimal", "paper"), "selection")


@pytest.fixture(scope="module")
def task(tmp_path_factory: pytest.TempPathFactory) -> AssemblyTask:
    """A red cube under a blue one; candidate 1 is the red cube, 3 the blue one."""
    return read_builtin(write_scenes(tmp_path_factory.mktemp("data"), SCENES[0])).tasks[0]


def steps(*numbers: int) -> str:
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(numbers, 1))


@pytest.mark.parametrize(
    ("text", "counts"),
    [
        (steps(1, 3), (2, 0, 0)),
        (steps(3, 1), (1, 1, 1)),
        (steps(1), (1, 0, 1)),
        (steps(1, 3, 3), (2, 1, 0)),
        ("I cannot say.", (0, 0, 2)),
        (None, (0, 0, 2)),
    ],
)
def test_a_reply_is_scored_under_every_setting_and_matcher(
    task: AssemblyTask, text: str | None, counts: tuple[int, int, int]
) -> None:
    judged = FullPlanning(RULES).judge(task, text)
    aov = [score for score in judged.scores if score.criterion == "aov"]
    assert {(s.setting, s.matcher) for s in aov} == {
        (setting, matcher) for setting in "AB" for matcher in ("optimal", "paper")
    }
    assert {(s.counts.tp, s.counts.fp, s.counts.fn) for s in aov} == {counts}
    level1 = [s for s in judged.scores if s not in aov]
    assert [(s.criterion, s.setting) for s in level1] == [("selection", "A"), ("selection", "B")]


@given(st.text(max_size=300) | st.lists(st.integers(-2, 20), max_size=8).map(lambda n: steps(*n)))
def test_any_reply_is_judged_and_every_goal_block_accounted_for(
    task: AssemblyTask, text: str
) -> None:
    judged = FullPlanning(RULES).judge(task, text)
    for score in judged.scores:
        assert score.counts.tp + score.counts.fn == len(task.scene)
        assert score.counts.tp + score.counts.fp == len(judged.parsed.plan.steps)
    assert all(1 <= step <= len(task.candidates) for step in judged.parsed.plan.steps)


def test_a_request_holds_the_question_and_the_seed(task: AssemblyTask, tmp_path: Path) -> None:
    path = tmp_path / "mine.j2"
    path.write_text("{% block user %}{{ pictures | join }}{% endblock %}", encoding="utf-8")
    policy = PicturePolicy("render", "separate", ("candidates", "goal"), PictureStyle(size_px=128))
    pictures = Pictures(tmp_path / "cache", policy, shop=1)
    prompt = TemplatePrompt(path, "mine.j2")
    track = FullPlanning(RULES, prompt, pictures)
    try:
        asked = asyncio.run(track.request(task, 7, {"top_p": 0.5}, with_messages=True))
        bare = asyncio.run(track.request(task, 7, {}, with_messages=False))
        ((outline, real),) = track.outlines(task)
    finally:
        pictures.close()
    (message,) = asked.messages
    *sent, text = message.parts
    assert [picture.label for picture in sent] == ["candidates", "goal"]  # type: ignore[union-attr]
    assert text == "candidatesgoal"
    assert (asked.key, asked.seed, asked.params) == ("t1", 7, {"top_p": 0.5})
    assert asked.prompt_version == prompt.version
    assert bare.messages == ()
    assert real
    assert outline.messages == asked.messages
