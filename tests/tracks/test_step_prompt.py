"""The messages of a step: their order, what the history tells, and what the memory hides."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data import read_builtin
from phyblock.errors import PromptError
from phyblock.models.request import Image, Message
from phyblock.parsing.move import MOVE_PROBLEMS
from phyblock.records.reply import Reply
from phyblock.resources import bundled
from phyblock.scoring.steps import MOVE_OUTCOMES
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks import PicturePolicy, Pictures, TemplatePrompt
from phyblock.tracks.step_planning import Feedback, PastStep, StepPlanning, StepPrompt, StepRules
from phyblock.types import Setting

TEMPLATE = TemplatePrompt(bundled("prompts", "step_planning.j2"), "default")
GOAL, CANDIDATES = Image(b"g", "goal", 1, 1), Image(b"c", "candidates", 1, 1)
BUILT_IN = Path(__file__).parents[2] / "benchmarks" / "data" / "phyblock-400"


def current(n: int) -> Image:
    return Image(f"state {n}".encode(), "current", 1, 1)


def past(*outcomes: str) -> list[PastStep]:
    return [
        PastStep(f"Move({n})", outcome, f"reply {n}", current(n))  # type: ignore[arg-type]
        for n, outcome in enumerate(outcomes, 1)
    ]


def ask(
    history: str, steps: list[PastStep], memory: int | None = None, feedback: Feedback = "success"
) -> tuple[Message, ...]:
    prompt = StepPrompt(TEMPLATE, feedback, history, memory, cot=True)  # type: ignore[arg-type]
    return prompt.messages((GOAL, CANDIDATES), current(len(steps) + 1), steps, 16, 8)


def text(message: Message) -> str:
    return next(part for part in message.parts if isinstance(part, str))


def pictures(message: Message) -> list[bytes]:
    return [part.data for part in message.parts if isinstance(part, Image)]


def test_one_message_holds_goal_candidates_current_picture_and_history_in_this_order() -> None:
    system, user = ask("text", past("placed", "overflow"))
    assert (system.role, user.role) == ("system", "user")
    assert pictures(user) == [b"g", b"c", b"state 3"]
    assert isinstance(user.parts[-1], str)
    said = text(user)
    assert "1. Move(1): it worked, the block is placed\n2. Move(2): it failed" in said
    assert "step 3 of at most 8" in said
    assert said.index("Your steps so far") > said.index("Move(N) takes")


def test_a_first_step_has_no_history() -> None:
    _, user = ask("text", [])
    assert "so far" not in text(user)
    assert len(ask("turns", [])) == 2


def test_turns_are_a_conversation_in_which_every_state_is_seen_once() -> None:
    messages = ask("turns", past("placed", "overflow"))
    assert [message.role for message in messages] == [
        *("system", "user", "assistant", "user", "assistant", "user")
    ]
    seen = [picture for message in messages for picture in pictures(message)]
    assert seen == [b"g", b"c", b"state 1", b"state 2", b"state 3"]
    assert [text(message) for message in messages if message.role == "assistant"] == [
        "reply 1",
        "reply 2",
    ]
    assert "It worked" in text(messages[3])
    assert "It failed" in text(messages[5])
    assert "step 3 of at most 8" in text(messages[5])


@pytest.mark.parametrize("history", ["text", "turns"])
@settings(deadline=None)
@given(st.integers(0, 12), st.integers(1, 5))
def test_memory_bounds_what_is_shown_and_always_ends_with_the_state_as_it_is(
    history: str, n: int, memory: int
) -> None:
    messages = ask(history, past(*["placed"] * n), memory)
    shown = [pictures(message) for message in messages if message.role == "user"]
    assert shown[0][:2] == [b"g", b"c"]
    assert shown[-1][-1] == f"state {n + 1}".encode()
    kept = min(n, memory)
    everything = "\n".join(text(message) for message in messages)
    assert len(messages) == 2 + (2 * kept if history == "turns" else 0)
    assert (f"({n - memory} earlier step" in everything) == (n > memory)
    for place in range(1, n + 1):
        told = f"Move({place}):" in everything or f"reply {place}\n" in everything + "\n"
        assert told == (place > n - kept)


@pytest.mark.parametrize("feedback", get_args(Feedback))
def test_feedback_tells_no_more_than_it_may(feedback: Feedback) -> None:
    outcomes = [*MOVE_OUTCOMES, *MOVE_PROBLEMS]
    told = {outcome: past(outcome)[0].report(feedback) for outcome in outcomes}
    if feedback == "none":
        assert set(told.values()) == {""}
        return
    assert told["placed"] == "it worked, the block is placed"
    wrong = {told[outcome] for outcome in MOVE_OUTCOMES if outcome != "placed"}
    assert len(wrong) == (5 if feedback == "error_type" else 1)
    assert all(words.startswith("it failed") for words in wrong)
    assert told["no_move"] == "it failed, no operation could be read"


def test_without_reasoning_the_answer_is_one_line() -> None:
    answers = []
    for cot in (True, False):
        prompt = StepPrompt(TEMPLATE, "success", "text", None, cot)
        answers.append(text(prompt.messages((GOAL, CANDIDATES), current(1), [], 16, 8)[1]))
    assert "First think" in answers[0]
    assert "First think" not in answers[1]
    assert "one line and nothing else" in answers[1]


def test_layer_gating_is_told() -> None:
    prompt = StepPrompt(TEMPLATE, "success", "text", None, True, "layer")
    said = text(prompt.messages((GOAL, CANDIDATES), current(1), [], 16, 8)[1])
    assert "every block of the layers below" in said


def test_a_composite_is_described_as_one() -> None:
    prompt = StepPrompt(TEMPLATE, "success", "text", None, True)
    both = Image(b"b", "composite", 2, 1)
    (_, user) = prompt.messages((both,), current(1), [], 9, 8)
    assert pictures(user) == [b"b", b"state 1"]
    assert "two halves" in text(user)
    assert "9 blocks" in text(user)


def test_the_scale_of_the_candidates_is_told_where_it_is_known() -> None:
    prompt = StepPrompt(TEMPLATE, "success", "text", None, True)
    said = [
        text(prompt.messages((GOAL, CANDIDATES), current(1), [], 16, 8, scale)[1])
        for scale in ("common", "fit", None)
    ]
    assert ["drawn at one scale" in one for one in said] == [True, False, False]
    assert ["drawn to fill its cell" in one for one in said] == [False, True, False]


def test_an_empty_reply_stands_in_a_conversation_as_words() -> None:
    steps = [PastStep("(no operation)", "empty", " ", current(1))]
    assert text(ask("turns", steps)[2]) == "(no answer)"


def test_pictures_of_states_are_drawn_and_kept(tmp_path: Path) -> None:
    """An episode sees one picture a state; a second episode finds them all."""
    task = read_builtin(BUILT_IN).tasks[0]
    policy = PicturePolicy("render", "separate", ("goal", "candidates"), PictureStyle(128))
    prompt = StepPrompt(TEMPLATE, "success", "text", None, True)

    async def play(track: StepPlanning) -> list[list[bytes]]:
        episode = track.start(task, 0, {}, with_messages=True)
        seen = []
        while (request := await episode.request()) is not None:
            seen.append(pictures(request.messages[1]))
            move = request.subject.valid[0]  # type: ignore[union-attr]
            episode.take(request, Reply(text=f"Move({move})"))
        return seen

    found = []
    for expected in (2 + len(task.scene), 0):
        drawn = Pictures(tmp_path, policy, 1)
        track = StepPlanning(StepRules(physics="settle"), prompt, drawn, (task,))
        found.append(asyncio.run(play(track)))
        assert drawn.rendered == expected
        outlines = list(track.outlines(task))
        assert [is_real for _, is_real in outlines] == [True] + [False] * (len(outlines) - 1)
        track.close()
    assert found[0] == found[1]
    assert len({step[2] for step in found[0]}) == len(task.scene)


@pytest.mark.parametrize(
    ("accepts", "needed"),
    [("A", "same type, color and orientation that"), ("B", "same type and color that")],
)
def test_the_model_is_told_what_the_simulator_goes_by(accepts: Setting, needed: str) -> None:
    prompt = StepPrompt(TEMPLATE, "success", "text", None, cot=True, accepts=accepts)
    _, user = prompt.messages((GOAL, CANDIDATES), current(1), [], 16, 8)
    lines = text(user).splitlines()
    place = next(n for n, line in enumerate(lines) if line.startswith("- Move(N)"))
    assert needed in lines[place]
    assert ("counts as a mistake" in lines[place]) == (accepts == "B")
    assert lines[place + 1].startswith("- Done")


def test_a_template_without_turns_is_no_conversation(tmp_path: Path) -> None:
    path = tmp_path / "mine.j2"
    path.write_text("{% block user %}Go on.{% endblock %}", encoding="utf-8")
    template = TemplatePrompt(path, "mine")
    StepPrompt(template, "success", "text", None, cot=True)
    with pytest.raises(PromptError, match=r"mine\.j2.*has no turn block"):
        StepPrompt(template, "success", "turns", None, cot=True)
