"""Prompts: blocks become messages, faults are named, nothing is given away."""

import contextlib
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.data.official import official_prompt, recorded_models
from phyblock.errors import PromptError
from phyblock.models.request import Image, Message
from phyblock.tracks.prompts import OfficialPrompt, TemplatePrompt
from tests.fuzz.strategies import TEMPLATES
from tests.workspace import problem_of

GOAL, GRID = Image(b"goal", "goal", 8, 8), Image(b"grid", "candidates", 8, 8)
FACTS = {"pictures": ["goal", "candidates"], "n_candidates": 16, "candidate_scale": "common"}
MACROS = "{% macro twice(x) %}{{ x }}{{ x }}{% endmacro %}{% set rules = 'R' %}"


def prompt(folder, body):
    """A template with this block `user`, or with blocks of its own."""
    whole = body if "block" in body else f"{{% block user %}}{body}{{% endblock %}}"
    (folder / "mine.j2").write_text(whole, encoding="utf-8")
    return TemplatePrompt(folder / "mine.j2", "mine")


def test_blocks_become_messages_with_captioned_pictures_before_the_user_text(tmp_path):
    blocks = "{% block system %} Be short. {% endblock %} {# a note #} "
    blocks += "{% block caption %}{{ number }}. {{ label }}{% endblock %}"
    user = "{% block user %}\n{{ n_candidates }}{% block mine %}!{% endblock %}\n{% endblock %}"
    made = prompt(tmp_path, blocks + user)
    assert made.messages((GRID, GOAL), FACTS) == (
        Message("system", ("Be short.",)),
        Message("user", ("1. candidates", GRID, "2. goal", GOAL, "16!")),
    )
    bare = prompt(tmp_path, "{% block system %} \n {% endblock %}{% block user %}a{% endblock %}")
    assert bare.messages((GOAL,), FACTS) == (Message("user", (GOAL, "a")),)
    loop = "{% for p in pictures %}{{ loop.index }} {{ twice(p) }};{% endfor %}{{ rules }}"
    macros = prompt(tmp_path, MACROS + f"{{% block user %}}{loop}{{% endblock %}}")
    said = "1 goalgoal;2 candidatescandidates;R"
    assert macros.messages((), FACTS) == (Message("user", (said,)),)


@given(first=st.text("ab", max_size=3), second=st.text("ab", max_size=3))
@settings(max_examples=15)
def test_an_edit_is_another_prompt(tmp_path_factory, first, second):
    folder = tmp_path_factory.mktemp("prompts")
    one, other = (prompt(folder, f"x{text}").version for text in (first, second))
    assert (one == other) == (first == second)


TOO_LONG = ("(" * 5_000 + "1" + ")" * 5_000, "1" + " + 1" * 20_000, "0x" + "f" * 10_000)
OTHER_FILES = (
    *("{% include 'secret.txt' %}", "{% include '/etc/hostname' ignore missing %}"),
    *("{% import 'mine.j2' as m %}", "{% extends 'part.j2' %}{% block user %}{% endblock %}"),
    "{% from 'secret.txt' import x %}{% block user %}a{% endblock %}",
)


@pytest.mark.parametrize(
    ("body", "where", "said"),
    [
        ("\n\n{% if %}", "mine.j2:3", "is not valid Jinja"),
        ("{% block usr %}{% endblock %}", "mine.j2", "has no user block"),
        ("\n{{ goal }}\n", "mine.j2:2", "'goal' is undefined"),
        ("{{ lipsum(9) }}", "mine.j2:1", "'lipsum' is undefined"),
        ("\n\n{{ 1 // 0 }}", "mine.j2:3", "division"),
        ("{{ pictures.__class__ }}", "mine.j2:1", "is unsafe"),
        ("\n {% if 0 %}a{% endif %}\n", "mine.j2", "says nothing"),
        ("{% block sytem %}{% endblock %}{% block user %}a{% endblock %}", "mine.j2:1",
         "is a block that nothing uses"),
        ("{% block user %}a{% endblock %}\nb", "mine.j2:2", "is outside of the blocks"),
        *((body, "mine.j2:1", "a prompt is one file") for body in OTHER_FILES),
        ("\n{% include n_candidates %}", "mine.j2:2", "a prompt is one file"),
        ("{% macro f() %}\n{{ 1 // 0 }}{% endmacro %}{% block user %}{{ f() }}{% endblock %}",
         "mine.j2:2", "division"),
        ("{% macro f() %}{{ f() }}{% endmacro %}{% block user %}{{ f() }}{% endblock %}",
         "mine.j2:1", "nested too deeply"),
        ("x" * 300_000, "mine.j2", "cannot be read"),
        *((f"{{{{ {body} }}}}", "mine.j2", "is not valid Jinja") for body in TOO_LONG),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_file_and_line(tmp_path, body, where, said):
    (tmp_path / "secret.txt").write_text("secret", encoding="utf-8")
    problem = problem_of(PromptError, lambda: prompt(tmp_path, body).messages((), FACTS))
    assert said in problem.message
    assert where in problem.where


@settings(max_examples=40)
@given(TEMPLATES)
def test_any_bytes_are_a_prompt_or_a_prompt_error(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "law.j2"
    path.write_bytes(data)
    with contextlib.suppress(PromptError):
        (message,) = TemplatePrompt(path, "mine").messages((), FACTS)
        assert isinstance(message, Message)


def test_the_official_prompt_is_the_recorded_text_to_the_letter(official_checkout):
    text = official_prompt(official_checkout)
    sent = OfficialPrompt(text).messages((GOAL, GRID), FACTS)
    assert sent == (Message("user", (GOAL, GRID, text)),)
    recorded = [
        json.loads(path.read_bytes())
        for name, folder in recorded_models(official_checkout).items()
        if name.startswith("InternVL")
        for path in folder.glob("*.json")
    ]
    # Marks of the two pictures stand before the text, the goal's first.
    assert {raw["instruction"] for raw in recorded} == {"<IMG_CONTEXT>" * 2 + text}
    assert all("cand" not in raw["image"][0] and "cand" in raw["image"][1] for raw in recorded)
