"""Prompts: blocks become messages, pictures stand first and in order, nothing is given away."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from phyblock.data import official_prompt, read_builtin, recorded_models
from phyblock.errors import PromptError
from phyblock.models.request import Image, Message
from phyblock.parsing.answer import choice_form
from phyblock.parsing.move import move_form, parse_move
from phyblock.parsing.plan import parse_plan, plan_form
from phyblock.parsing.structured import AnswerForm
from phyblock.resources import bundled
from phyblock.tracks import OfficialPrompt, TemplatePrompt, kinds
from phyblock.tracks.full_planning import FullPlanning, PlanningRules
from phyblock.tracks.prompts import form_facts
from tests.workspace import Workspace

GOAL = Image(b"goal", "goal", 8, 8)
GRID = Image(b"grid", "candidates", 8, 8)
BOTH = Image(b"both", "composite", 16, 8)
FACTS = {"pictures": ["goal", "candidates"], "n_candidates": 16, "candidate_scale": "common"}


def template(folder: Path, text: str) -> TemplatePrompt:
    path = folder / "mine.j2"
    path.write_text(text, encoding="utf-8")
    return TemplatePrompt(path, "mine.j2")


def test_blocks_become_messages_with_the_pictures_before_the_user_text(tmp_path: Path) -> None:
    system = "{% block system %} Be short. {% endblock %}"
    prompt = template(tmp_path, system + "{% block user %}\n{{ n_candidates }}\n{% endblock %}")
    assert prompt.messages((GRID, GOAL), FACTS) == (
        Message("system", ("Be short.",)),
        Message("user", (GRID, GOAL, "16")),
    )


@pytest.mark.parametrize("system", ["", "{% block system %} \n {% endblock %}"])
def test_an_empty_system_part_is_not_sent(tmp_path: Path, system: str) -> None:
    prompt = template(tmp_path, system + "{% block user %}Build.{% endblock %}")
    assert prompt.messages((BOTH,), FACTS) == (Message("user", (BOTH, "Build.")),)


def test_text_outside_the_blocks_is_not_sent(tmp_path: Path) -> None:
    prompt = template(tmp_path, "Before {% block user %}in{% endblock %} after")
    assert prompt.messages((), FACTS) == (Message("user", ("in",)),)


def test_the_version_follows_the_text_alone(tmp_path: Path) -> None:
    one = template(tmp_path, "{% block user %}a{% endblock %}")
    (tmp_path / "other").mkdir()
    assert template(tmp_path / "other", "{% block user %}a{% endblock %}").version == one.version
    assert template(tmp_path, "{% block user %}b{% endblock %}").version != one.version


@pytest.mark.parametrize(
    ("text", "where", "said"),
    [
        ("{% block user %}\n\n{% if %}{% endblock %}", ":3", "is not valid Jinja"),
        ("{% block usr %}{% endblock %}", "", "has no user block"),
        ("{% block user %}\n{{ goal }}\n{% endblock %}", ":2", "'goal' is undefined"),
        ("{% block user %}\n\n{{ 1 // 0 }}{% endblock %}", ":3", "division"),
        ("{% block user %}{{ pictures.__class__ }}{% endblock %}", ":1", "is unsafe"),
        ("{% block user %}\n {% if 0 %}a{% endif %}\n{% endblock %}", "", "says nothing"),
        (
            "{% block sytem %}Be short.{% endblock %}\n{% block user %}a{% endblock %}",
            ":1",
            "is a block that nothing uses",
        ),
    ],
)
def test_what_is_wrong_is_said_with_file_and_line(
    tmp_path: Path, text: str, where: str, said: str
) -> None:
    with pytest.raises(PromptError) as caught:
        template(tmp_path, text).messages((BOTH,), FACTS)
    (problem,) = caught.value.problems
    assert problem.where == f"{tmp_path / 'mine.j2'}{where}"
    assert said in problem.message


def test_a_block_inside_another_is_a_part_of_it(tmp_path: Path) -> None:
    prompt = template(tmp_path, "{% block user %}a{% block mine %}b{% endblock %}{% endblock %}")
    assert prompt.messages((), FACTS) == (Message("user", ("ab",)),)


@pytest.mark.parametrize(
    "labels",
    [("composite",), ("goal", "candidates"), ("candidates", "goal"), ("candidates",)],
)
@pytest.mark.parametrize("scale", ["common", "fit", None])
def test_the_default_prompt_speaks_of_the_pictures_that_are_sent(
    labels: tuple[str, ...], scale: str | None
) -> None:
    prompt = TemplatePrompt(bundled("prompts", "full_planning.j2"), "default")
    sent = tuple(Image(b"", label, 8, 8) for label in labels)
    is_blind = labels == ("candidates",)
    facts = {"pictures": list(labels), "n_candidates": 9, "candidate_scale": scale}
    facts["is_blind"] = is_blind
    system, user = prompt.messages(sent, facts)
    assert (system.role, user.role) == ("system", "user")
    *pictures, text = user.parts
    assert pictures == list(sent)
    assert isinstance(text, str)
    assert "grid of 9 blocks" in text
    assert ("drawn at one scale" in text) == (scale == "common")
    assert ("drawn to fill its cell" in text) == (scale == "fit")
    assert ("goal, a finished structure of blocks, is not available" in text) == is_blind
    assert ("study the goal" in text) != is_blind
    if is_blind:
        assert "one picture: the candidates" in text
    elif len(labels) == 2:
        assert "in this order: " + ", then ".join(labels) in text
    else:
        assert "left half shows the goal" in text
    # The form that is asked for is read, and the example in it is no plan.
    assert parse_plan(text, 16, "steps").plan.steps == ()
    assert parse_plan("Step1: Move block with index 4", 16, "steps").plan.steps == (4,)


def test_facts_hold_what_is_shown_alone(workspace: Workspace) -> None:
    track = FullPlanning(PlanningRules("steps", ("A",), ("optimal",), None))
    for task in read_builtin(workspace.root / "data").tasks:
        facts = track.facts(task, (GOAL, GRID))
        assert facts == {
            "pictures": ["goal", "candidates"],
            "n_candidates": len(task.candidates),
            "candidate_scale": None,
            "is_blind": False,
            "answer_format": "text",
            "answer_schema": None,
            "answer_example": None,
        }


def test_the_official_prompt_is_the_recorded_text_to_the_letter(official_checkout: Path) -> None:
    text = official_prompt(official_checkout)
    prompt = OfficialPrompt(text)
    assert prompt.messages((GOAL, GRID), FACTS) == (Message("user", (GOAL, GRID, text)),)
    recorded = [
        json.loads(path.read_bytes())
        for name, folder in recorded_models(official_checkout).items()
        if name.startswith("InternVL")
        for path in folder.glob("*.json")
    ]
    assert recorded
    # Marks of the two pictures stand before the text, the goal's first.
    assert {raw["instruction"] for raw in recorded} == {"<IMG_CONTEXT>" * 2 + text}
    assert all("cand" not in raw["image"][0] and "cand" in raw["image"][1] for raw in recorded)


def rendered(name: str, facts: dict[str, object]) -> str:
    """The text of a bundled prompt."""
    *_, user = TemplatePrompt(bundled("prompts", f"{name}.j2"), "default").messages((), facts)
    return "\n".join(part for part in user.parts if isinstance(part, str))


def both_ways(name: str, facts: dict[str, object], form: AnswerForm[Any]) -> tuple[str, str]:
    """A bundled prompt that asks for text, and the one that asks for JSON."""
    text, asked = (
        rendered(f"{name}{ending}", {**facts, **form_facts(known)})
        for ending, known in (("", None), ("_json", form))
    )
    assert form.example in asked
    assert json.dumps(form.schema) in asked
    return text, asked


@pytest.mark.parametrize("labels", [("composite",), ("goal", "candidates"), ("candidates",)])
@pytest.mark.parametrize("scale", ["common", "fit", None])
def test_a_plan_is_asked_for_in_the_same_words_in_both_formats(
    labels: tuple[str, ...], scale: str | None
) -> None:
    facts = {"pictures": list(labels), "n_candidates": 9, "candidate_scale": scale}
    facts["is_blind"] = labels == ("candidates",)
    text, asked = both_ways("full_planning", facts, plan_form(9))
    head, mark, _ = text.partition("End your answer with the plan")
    assert mark
    assert asked.startswith(f"{head}Answer with one JSON object")
    assert parse_plan(asked, 9).rule is None


@pytest.mark.parametrize("is_ordering", [True, False])
@pytest.mark.parametrize("is_blind", [True, False])
def test_a_question_is_asked_in_the_same_words_in_both_formats(
    is_ordering: bool, is_blind: bool
) -> None:
    options = [{"letter": x, "text": f"text {x}", "is_picture": is_ordering} for x in "ABCD"]
    facts: dict[str, object] = {"question": "Which?", "options": options, "letters": list("ABCD")}
    facts |= {"is_ordering": is_ordering, "pictures": ["scene"], "is_blind": is_blind}
    form = choice_form([f"text {x}" for x in "ABCD"], is_ordering)
    text, asked = both_ways("vqa", facts, form)
    head, mark, _ = text.partition(" Give a short reason")
    assert mark
    assert asked.startswith(f"{head} Answer with one JSON object")
    assert form.read(asked) is None


@pytest.mark.parametrize("cot", [True, False])
@pytest.mark.parametrize("setting", ["A", "B"])
def test_a_step_is_asked_for_in_the_same_words_in_both_formats(setting: str, cot: bool) -> None:
    past = {"step": 1, "operation": "Move(2)", "told": "it worked"}
    facts: dict[str, object] = {
        "pictures": ["goal", "candidates", "current"], "n_candidates": 9, "candidate_scale": "fit",
        "step": 3, "max_steps": 8, "setting": setting, "gating": "aov", "history": [past],
        "n_hidden": 1, "told": "it worked", "cot": cot, "is_blind": False, "answer": "(answer)",
    }  # fmt: skip
    form = move_form(9, reasons=cot)
    templates = [
        TemplatePrompt(bundled("prompts", f"step_planning{ending}.j2"), "default")
        for ending in ("", "_json")
    ]
    for block in ("system", "user", "turn"):
        one, other = (template.text(block, facts) for template in templates)
        assert one == other
    facts |= form_facts(form)
    asked = templates[1].text("answer", facts)
    assert form.example in asked
    assert json.dumps(form.schema) in asked
    assert ("first think" in asked) == cot
    assert parse_move(asked).problem is not None


def test_only_prompts_for_json_say_the_form() -> None:
    for kind in kinds().values():
        assert kind.template is not None
        assert kind.json_template is not None
        assert not TemplatePrompt(kind.template, "text").says_form
        assert TemplatePrompt(kind.json_template, "json").says_form
