"""Templates of several files: what they include is read once, sandboxed and named."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.errors import PromptError
from phyblock.models.request import Message
from phyblock.resources import bundled
from phyblock.tracks import TemplatePrompt
from tests.fuzz.strategies import TEMPLATES
from tests.workspace import Workspace

FACTS = {"pictures": ["goal", "candidates"], "n_candidates": 16}
MACROS = "{% macro twice(x) %}{{ x }}{{ x }}{% endmacro %}{% set rules = 'R' %}"


def prompt(folder: Path, body: str, **files: str) -> TemplatePrompt:
    """A template with this block `user`, or with blocks of its own; other files are `NAME.j2`."""
    for name, text in files.items():
        (folder / f"{name}.j2").write_text(text, encoding="utf-8")
    whole = body if "block" in body else f"{{% block user %}}{body}{{% endblock %}}"
    (folder / "mine.j2").write_text(whole, encoding="utf-8")
    return TemplatePrompt(folder / "mine.j2", "mine")


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("a{% include 'rules.j2' %}", "aof 16"),
        ("{% include ['gone.j2', 'rules.j2'] %}", "of 16"),
        ("a{% include 'gone.j2' ignore missing %}", "a"),
        ("{% import 'macros.j2' as m %}{{ m.twice('x') }}{{ m.rules }}", "xxR"),
        ("{% from 'macros.j2' import twice %}{% block user %}{{ twice('x') }}{% endblock %}", "xx"),
        (MACROS + "{% block user %}{{ twice(rules) }}{% endblock %}", "RR"),
        ("{% include 'outer.j2' %}", "(of 16)"),
    ],
)
def test_parts_are_included_and_imported(tmp_path: Path, body: str, said: str) -> None:
    files = {"rules": "of {{ n_candidates }}", "outer": "({% include 'rules.j2' %})"}
    made = prompt(tmp_path, body, macros=MACROS, **files)
    assert made.messages((), FACTS) == (Message("user", (said,)),)


def test_bundled_files_are_found_behind_those_beside_the_template(tmp_path: Path) -> None:
    name = "full_planning.j2"
    body = f"{{% include '{name}' %}}"
    facts = {**FACTS, "is_blind": False, "candidate_scale": None}
    bundled_text = TemplatePrompt(bundled("prompts", name), "x").text("user", facts)
    assert bundled_text in prompt(tmp_path, body).text("user", facts)
    (tmp_path / name).write_text("own", encoding="utf-8")
    assert prompt(tmp_path, body).text("user", facts) == "own"


@given(first=st.text("ab", max_size=3), second=st.text("ab", max_size=3))
@settings(max_examples=15, deadline=None)
def test_an_edit_of_what_is_included_is_another_prompt(
    tmp_path_factory: pytest.TempPathFactory, first: str, second: str
) -> None:
    folder = tmp_path_factory.mktemp("prompts")
    body = "a{% include 'outer.j2' %}"
    versions = [
        prompt(folder, body, outer="({% include 'rules.j2' %})", rules=text).version
        for text in (first, second)
    ]
    assert (versions[0] == versions[1]) == (first == second)


def test_what_is_edited_later_is_not_said(tmp_path: Path) -> None:
    made = prompt(tmp_path, "{% include 'rules.j2' %}", rules="old")
    (tmp_path / "rules.j2").write_text("new", encoding="utf-8")
    assert made.messages((), FACTS) == (Message("user", ("old",)),)


@pytest.mark.parametrize(
    ("body", "part", "where", "said"),
    [
        ("{% include 'gone.j2' %}", "", "mine.j2:1", "no such file"),
        ("\n{% include n_candidates %}", "", "mine.j2:2", "not named in quotes"),
        ("{% include '../mine.j2' %}", "", "mine.j2:1", "of another folder"),
        ("{% include '/etc/hostname' %}", "", "mine.j2:1", "of another folder"),
        ("{% include 'a/../../b' %}", "", "mine.j2:1", "of another folder"),
        ("{% include 'link.j2' %}", "", "mine.j2:1", "no template"),
        ("{% include 'below/link.j2' %}", "", "mine.j2:1", "no template"),
        ("{% include '.env' %}", "", "mine.j2:1", "no template"),
        ("{% include 'keys.txt' %}", "", "mine.j2:1", "no template"),
        ("{% include '.below/part.j2' %}", "", "mine.j2:1", "no template"),
        ("{% include 'inside.j2' %}", "", "mine.j2:1", "no template"),
        ("{% set n_candidates = 4 %}{% block user %}a{% endblock %}", "", "mine.j2:1",
         "n_candidates, set outside of the blocks, is a fact"),
        ("{% macro pictures() %}{% endmacro %}{% block user %}a{% endblock %}", "", "mine.j2:1",
         "pictures, set outside of the blocks, is a fact"),
        ("{% import 'part.j2' as pictures %}{% block user %}a{% endblock %}", "", "mine.j2:1",
         "pictures, set outside of the blocks, is a fact"),
        ("{% extends 'part.j2' %}{% block user %}{% endblock %}", "", "mine.j2:1", "extend"),
        ("{% include 'part.j2' %}", "a\n\n{{ wrong }}", "part.j2:3", "'wrong' is undefined"),
        ("{% include 'part.j2' %}", "a\n{% if %}", "part.j2:2", "is not valid Jinja"),
        ("{% include 'part.j2' %}", "\n{% include 'gone.j2' %}", "part.j2:2", "no such file"),
        ("{% set x = wrong ~ 1 %}\n{% block user %}a{% endblock %}", "", "mine.j2:1", "undefined"),
        ("{% import 'part.j2' as p %}{{ p.f() }}",
         "{% macro f() %}\n{{ 1 // 0 }}{% endmacro %}", "part.j2:2", "division"),
        ("{% include 'part.j2' %}", "{% include 'part.j2' %}", "part.j2:1",
         "nested too deeply"),
        ("{% include 'part.j2' %}", "{{ pictures.__class__ }}", "part.j2:1", "is unsafe"),
        ("{% include 'part.j2' %}", "x" * 300_000, "part.j2", "cannot be read"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said_with_the_file_that_is_included(
    tmp_path: Path, body: str, part: str, where: str, said: str
) -> None:
    (tmp_path / "secret.txt").write_text("secret", encoding="utf-8")
    folder = tmp_path / "prompts"
    (folder / "below").mkdir(parents=True)
    (folder / ".below").mkdir()
    for name in (".env", "keys.txt", ".below/part.j2"):
        (folder / name).write_text("secret", encoding="utf-8")
    (folder / "inside.j2").symlink_to(".env")
    (folder / "link.j2").symlink_to(tmp_path / "secret.txt")
    (folder / "below" / "link.j2").symlink_to("../../secret.txt")
    with pytest.raises(PromptError) as caught:
        prompt(folder, body, part=part).messages((), FACTS)
    (problem,) = caught.value.problems
    assert said in problem.message
    assert problem.where.endswith(where)


def test_a_macro_that_sees_no_facts_is_told_how(tmp_path: Path) -> None:
    part = "{% macro f() %}{{ n_candidates }}{% endmacro %}"
    body = "{% import 'part.j2' as p CONTEXT %}{{ p.f() }}"
    with pytest.raises(PromptError, match=r"hint: .* with context"):
        prompt(tmp_path, body.replace("CONTEXT", ""), part=part).messages((), FACTS)
    told = prompt(tmp_path, body.replace("CONTEXT", "with context"), part=part)
    assert str(FACTS["n_candidates"]) in str(told.messages((), FACTS)[-1].parts[-1])


def test_validate_names_what_is_included(workspace: Workspace) -> None:
    folder = workspace.root / "prompts"
    folder.mkdir()
    workspace.write_suite(models=["alpha"])
    workspace.write_models("http://127.0.0.1:9", "alpha")
    body = "{% block user %}{% include 'rules.j2' %}{% endblock %}"
    (folder / "full_planning.j2").write_text(body, encoding="utf-8")
    (folder / "rules.j2").write_text("Build.", encoding="utf-8")
    done = workspace.phyblock("validate", "suite.yaml")
    assert done.code == 0, done.err
    assert "full_planning.j2 (with rules.j2)" in done.out.replace("\n", "")


UNREADABLE = {
    "digits": "{{ " + "9" * 10_000 + " }}",
    "hex": "{{ 0x" + "f" * 10_000 + " }}",
    "brackets": "{{ " + "(" * 5_000 + "1" + ")" * 5_000 + " }}",
    "chain": "{{ 1" + " + 1" * 20_000 + " }}",
    "loops": "{% for i in x %}" * 60 + "{% endfor %}" * 60,
    "ifs": "{% if x %}" * 2_000 + "{% endif %}" * 2_000,
    "open": "{{ " * 9_000,
    "large": "x" * 300_000,
    "bytes": b"{% block user %}\xff{% endblock %}",
}


@pytest.mark.parametrize("body", UNREADABLE.values(), ids=UNREADABLE)
def test_a_template_that_cannot_be_compiled_is_refused(tmp_path: Path, body: str | bytes) -> None:
    path = tmp_path / "mine.j2"
    path.write_bytes(
        body if isinstance(body, bytes) else f"{{% block user %}}{body}{{% endblock %}}".encode()
    )
    with pytest.raises(PromptError) as caught:
        TemplatePrompt(path, "mine").text("user", FACTS)
    (problem,) = caught.value.problems
    assert not problem.message.rstrip().endswith(":")


HONEST = {
    "{{ pictures | join(', then ') }}": "goal, then candidates",
    "{% for p in pictures %}{{ loop.index }}/{{ loop.length }} {{ p }};{% endfor %}":
        "1/2 goal;2/2 candidates;",
    "{% for k, v in {'a': 1, 'b': 5000}.items() %}{{ k ~ v }}{% endfor %}": "a1b5000",
    "{{ x | default(4096) }}": "4096",
    "{% set n = n_candidates * 2 %}{{ '%03d' % n }} {{ '{:>4}'.format(n) }}": "032   32",
    "{{ pictures[:1] + ['x'] }}": "['goal', 'x']",
    "{{ 5000 | tojson }} {{ 2.345 | round(1) }} {{ pictures | map('upper') | first }}":
        "5000 2.3 GOAL",
    "{% macro m(a, b=2) %}<{{ a }}{{ b }}{{ caller() }}>{% endmacro %}"
    "{% call m(1) %}!{% endcall %}": "<12!>",
    "{{ 'yes' if 'goal' in pictures and n_candidates is divisibleby(4) else 'no' }}": "yes",
    "{% for i in [1, [2]] recursive %}{{ loop(i) if i is iterable else i }}{% endfor %}": "12",
    "{% for p in pictures if p != 'goal' %}{{ p }}{% else %}none{% endfor %}": "candidates",
    "{{ none }} {{ (1, 2) }} {{ -n_candidates }} {{ 2 ** 10 }} {{ 7 // 2 }}":
        "None (1, 2) -16 1024 3",
}  # fmt: skip


@pytest.mark.parametrize("body", HONEST)
def test_expressions_of_jinja_can_be_used(tmp_path: Path, body: str) -> None:
    text = prompt(tmp_path, body).text("user", FACTS)
    assert text == HONEST[body]


def test_a_template_that_is_no_file(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.j2")
    with pytest.raises(PromptError, match="cannot be read: it is not a regular file"):
        TemplatePrompt(tmp_path / "pipe.j2", "mine")


@settings(deadline=None, max_examples=40)
@given(TEMPLATES)
def test_any_bytes_are_a_prompt_or_a_prompt_error(
    tmp_path_factory: pytest.TempPathFactory, data: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "law.j2"
    path.write_bytes(data)
    with contextlib.suppress(PromptError):
        (message,) = TemplatePrompt(path, "mine").messages((), FACTS)
        assert isinstance(message, Message)
