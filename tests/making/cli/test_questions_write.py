"""`phyblock questions write` against a local server: what is accepted, and why the rest is not."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from typing import Any

import pytest

from phyblock.making.questions.rewording import fault_of_form, texts_in
from tests.fork_server import Done
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.vqa_set import write_questions
from tests.workspace import Raw, Workspace, tower

GOOD = "The {block}: what shape has it?"
FLIPPED = "What shape does the {block} not have?"
WRITTEN = [
    GOOD,
    FLIPPED,
    "What shape is it?",
    "Is the {block} like the {block}?",
    "What is the shape of the {block}?",
    "Choose an option for the {block}?",
    "The {block} has which shape",
    "The {block has which shape?",
]
SCENE = tower("t1", [1, 2], ("red", "blue"))
QUESTION: Raw = {
    "id": "sh-001",
    "subtask": "SH",
    "scene_id": "t1",
    "wording": "sh-1",
    "question": "What is the shape of the blue block?",
    "options": ["arch", "cube", "cylinder", "triangular prism"],
    "answer": "B",
    "pictures": [{"label": "scene", "view": [45, 22]}],
    "evidence": {"slots": {"block": "blue block"}},
}


class Writer(OpenAIChat):
    """Writes `texts`, and finds the truth for what asks the same thing."""

    def __init__(self, texts: object, find: Callable[[str, str], str]) -> None:
        super().__init__()
        self._texts = texts
        self._find = find

    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        text = str(seen.parts[-1])
        truth = re.search(r"Its right answer is: (.*)", text)
        said = json.dumps(self._texts) if truth is None else self._find(text, truth[1])
        body["choices"][0]["message"]["content"] = f"```json\n{said}\n```"
        return body


def sees_negations(text: str, truth: str) -> str:
    asked = text.partition("same picture:")[2]
    wanted = "something else is asked" if " not " in asked else truth
    letter = re.search(rf"^([A-E])\. {re.escape(wanted)}", text, re.MULTILINE)
    assert letter is not None
    return f"Answer: {letter[1]}"


def write(
    workspace: Workspace, server: OpenAIChat, *args: str, questions: Sequence[Raw] = (QUESTION,)
) -> Done:
    workspace.write_scenes(SCENE)
    write_questions(workspace.root / "questions", questions)
    with Running(server) as running:
        workspace.write_models(running.url, "alpha", transport="direct")
        places = ("--questions", "./questions", "--data", "./data", "--out", "found.jsonl")
        return workspace.phyblock("questions", "write", "--model", "alpha", *places, *args)


def written(workspace: Workspace) -> list[Raw]:
    text = (workspace.root / "found.jsonl").read_text(encoding="utf-8")
    return [json.loads(line) for line in text.splitlines()]


def test_only_what_is_intact_new_and_true_is_accepted(workspace: Workspace) -> None:
    server = Writer(WRITTEN, sees_negations)
    done = write(workspace, server)
    assert (done.code, done.err) == (0, "")
    assert "8 paraphrases, 1 accepted" in done.out
    found = written(workspace)
    assert [one["template"] for one in found] == WRITTEN
    assert [one["wording"] for one in found] == [f"sh-m{n}" for n in range(1, 9)]
    faults = [one["fault"] for one in found]
    assert faults[0] is None
    expected = ("model answers", "slots", "slots", "not new", "options", "does not end", "braces")
    for fault, word in zip(faults[1:], expected, strict=True):
        assert word in fault
    assert server.requests == 3


def test_an_answer_that_the_scene_denies_is_never_accepted(workspace: Workspace) -> None:
    server = Writer([GOOD], sees_negations)
    write(workspace, server, questions=[QUESTION | {"answer": "A"}])
    (one,) = written(workspace)
    assert not one["accepted"]
    assert "the answer is B, not A" in one["fault"]
    assert server.requests == 1


def test_a_reply_without_a_list_does_not_stop_the_others(workspace: Workspace) -> None:
    class Wordy(Writer):
        """Lists wordings of shapes, and talks where it is asked for those of colors."""

        def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
            body = super().reply(seen, ending)
            if "What is the color of" in str(seen.parts[-1]):
                body["choices"][0]["message"]["content"] = "There are many ways to ask this."
            return body

    color = {
        "id": "co-001",
        "subtask": "CO",
        "wording": "co-1",
        "question": "What is the color of the topmost block?",
        "options": ["red", "blue", "green", "yellow"],
        "evidence": {"slots": {"block": "topmost block"}},
    }
    done = write(workspace, Wordy([GOOD], sees_negations), questions=[QUESTION, QUESTION | color])
    assert (done.code, done.err) == (0, "")
    talk, good = sorted(written(workspace), key=lambda one: one["subtask"])
    assert talk["fault"] == "the reply holds no JSON list of texts"
    assert talk["template"] == "There are many ways to ask this."
    assert (good["template"], good["accepted"], talk["accepted"]) == (GOOD, True, False)


def test_an_unknown_model_and_a_taken_file_are_refused(workspace: Workspace) -> None:
    workspace.write_models("http://127.0.0.1:9", "alpha")
    (workspace.root / "taken.jsonl").touch()
    for model, out, message in (("alfa", "new", "alpha"), ("alpha", "taken", "already there")):
        done = workspace.phyblock("questions", "write", "--model", model, "--out", f"{out}.jsonl")
        assert done.code == 2
        assert message in done.errors[0]


@pytest.mark.parametrize("slot", ["{block!r}", "{block:>40}", "{block.text}", "{}", "{other}"])
def test_a_slot_that_is_not_filled_in_as_it_is_is_another_one(slot: str) -> None:
    fault = fault_of_form(f"Which shape has the {slot}?", ["What is the shape of the {block}?"])
    assert fault is not None
    assert "slots" in fault


@pytest.mark.parametrize(
    ("reply", "texts"),
    [
        ('Here: ["a  b", "c"].', ["a b", "c"]),
        ("[" * 200_000, None),
        ("[" * 100_000 + "]" * 100_000, None),
        ("[" + "9" * 100_000 + "]", None),
        ('["a", 1]', None),
        ("] [", None),
        ("none", None),
    ],
)
def test_any_reply_is_a_list_of_texts_or_none(reply: str, texts: list[str] | None) -> None:
    assert texts_in(reply) == texts
