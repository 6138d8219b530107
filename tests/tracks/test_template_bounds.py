"""Templates end soon: what is huge, endless or nested without end is refused and named."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path

import pytest
from hypothesis import given, settings

from phyblock.errors import PromptError
from phyblock.models.request import Message
from phyblock.tracks import TemplatePrompt
from tests.fuzz.strategies import TEMPLATES

FACTS = {"pictures": ["goal", "candidates"], "n_candidates": 16}
STEPS, TEXT, WIDTH = "more than 500,000 steps", "longer than 200,000 characters", "width of more"
BITS, RANGE, PRODUCT = "more than 1,024 bits", "range of more than 10,000", "at once"
NOT_THERE, UNDEFINED = "not available in prompts", "is undefined"


def text_of(path: Path, body: str | bytes, before: str = "") -> str:
    data = body if isinstance(body, bytes) else f"{before}{{% block user %}}{body}{{% endblock %}}"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return TemplatePrompt(path, "mine").text("user", FACTS)


LOOP = "{% for i in range(9999) %}"
BOMBS = {
    "nested loops": (LOOP * 3 + "x" + "{% endfor %}" * 3, STEPS),
    "empty loops": (LOOP * 3 + "{% endfor %}" * 3, STEPS),
    "false loops": ("{% for i in range(9999) %}{% for j in range(9999) if false %}{% endfor %}"
                    "{% endfor %}", STEPS),
    "text in loops": (LOOP + "x" * 900 + "{% endfor %}", TEXT),
    "text set in loops": ("{% set y %}" + LOOP + "x" * 900 + "{% endfor %}{% endset %}", STEPS),
    "many statements in loops": (LOOP + "{% set a = 1 %}" * 500 + "{% endfor %}", STEPS),
    "too much text": ("x" * 200_001, TEXT),
    "range": ("{{ range(10**9) | list }}", RANGE),
    "lipsum": ("{{ lipsum(10**6) }}", UNDEFINED),
    "cycler": ("{{ cycler(1) }}", UNDEFINED),
    "times": ("{{ 'x' * 10**9 }}", STEPS),
    "times turned": ("{{ 10**9 * 'x' }}", STEPS),
    "list times": ("{{ [1] * 10**9 }}", STEPS),
    "power": ("{{ 9 ** 9 ** 99 }}", BITS),
    "numbers": ("{% set x = 2 ** 1000 %}{{ x * x }}", BITS),
    "doubling": ("{% set x = 'x' %}" + "{% set x = x ~ x %}" * 40 + "{{ x }}", STEPS),
    "adding": ("{% set x = 'x' %}" + "{% set x = x + x %}" * 40 + "{{ x }}", STEPS),
    "list of lists": ("{% set x = [] %}" + "{% set x = [x, x] %}" * 40 + "{{ x }}", STEPS),
    "tuples": ("{% set x = 1 %}" + "{% set x = (x, x) %}" * 40 + "{{ {x: 1} }}", STEPS),
    "mappings": ("{% set x = 1 %}" + "{% set x = {1: x, 2: x} %}" * 40 + "{{ x }}", STEPS),
    "joined": ("{% set x = 'xxxx' %}" + "{% set x = x | join(x) %}" * 20 + "{{ x }}", ""),
    "replaced": ("{% set x = 'xxxx' %}" + "{% set x = x | replace('x', x) %}" * 9 + "{{ x }}", ""),
    "replaced by method": ("{% set x = 'xx' %}" + "{% set x = x.replace('x', x) %}" * 9, ""),
    "center": ("{{ 'x' | center(10**9) }}", WIDTH),
    "center named": ("{{ 'x' | center(width=10**9) }}", WIDTH),
    "mapped center": ("{{ ['x'] | map('center', 10**9) | list }}", WIDTH),
    "filter block": ("{% filter center(10**9) %}x{% endfilter %}", WIDTH),
    "indent": ("{{ 'a\nb' | indent(10**9) }}", WIDTH),
    "batch": ("{{ [1] | batch(10**9, 'x') | list }}", WIDTH),
    "slice": ("{{ [1] | slice(10**9) | list }}", WIDTH),
    "round": ("{{ 5 | round(-10**9) }}", WIDTH),
    "round up": ("{{ 5 | round(10**9, 'ceil') }}", WIDTH),
    "tojson": ("{{ [1] | tojson(indent=10**9) }}", WIDTH),
    "sums of lists": ("{{ [[1], [2]] | sum(start=[]) }}", NOT_THERE),
    "ljust": ("{{ 'x'.ljust(10**9) }}", WIDTH),
    "zfill": ("{{ ('x' | attr('zfill'))(10**9) }}", WIDTH),
    "tabs": ("{{ '\t'.expandtabs(10**9) }}", WIDTH),
    "to_bytes": ("{{ (1).to_bytes(10**9, 'big') }}", NOT_THERE),
    "fromkeys": ("{{ {}.fromkeys(range(9)) }}", NOT_THERE),
    "append": ("{% set x = [] %}{{ x.append(x) }}", "unsafe"),
    "percent": ("{{ '%1000000000d' % 1 }}", WIDTH),
    "percent precision": ("{{ '%.1000000000f' % 1 }}", WIDTH),
    "percent star": ("{{ '%*d' % (10**9, 1) }}", WIDTH),
    "percent filter": ("{{ '%1000000000d' | format(1) }}", WIDTH),
    "percent many": ("{% set x = 'x' * 9999 %}{{ ('%(a)s' * 9999) % {'a': x} }}", PRODUCT),
    "braces": ("{{ '{:>1000000000}'.format(1) }}", WIDTH),
    "braces nested": ("{{ '{:{}}'.format(1, 10**9) }}", WIDTH),
    "braces map": ("{{ '{a:>1000000000}'.format_map({'a': 1}) }}", WIDTH),
    "comparing": ("{% set x = [1] %}{% set y = [1] %}"
                  + "{% set x = [x, x] %}{% set y = [y, y] %}" * 40 + "{{ x == y }}", STEPS),
    "self": ("{{ self.user() }}", "nested too deeply"),
    "loop": ("{% for i in [[1]] recursive %}{{ loop([i]) }}{% endfor %}", "nested too deeply"),
    "import": ("{% import 'x' as x %}", "no such file"),
}  # fmt: skip


@pytest.mark.parametrize(("body", "said"), BOMBS.values(), ids=BOMBS)
def test_a_template_that_does_too_much_is_refused(tmp_path: Path, body: str, said: str) -> None:
    path = tmp_path / "mine.j2"
    with pytest.raises(PromptError) as caught:
        text_of(path, body)
    (problem,) = caught.value.problems
    assert problem.where.startswith(f"{path}:")
    assert said in problem.message
    assert len(str(problem)) < 1000


MACROS = {
    "endless": ("{% macro m(n) %}{{ m(n + 1) }}{% endmacro %}{{ m(0) }}", "nested too deeply"),
    "branching": ("{% macro m(n) %}{% if n %}{{ m(n - 1) }}{{ m(n - 1) }}{% endif %}{% endmacro %}"
                  "{{ m(30) }}", STEPS),
    "growing": ("{% macro m(n) %}{% if n %}{{ m(n - 1) ~ m(n - 1) }}{% else %}x{% endif %}"
                "{% endmacro %}{{ m(30) }}", STEPS),
    "called": ("{% macro m() %}{{ caller() }}{{ caller() }}{% endmacro %}"
               + "{% call m() %}" * 18 + "x" * 9 + "{% endcall %}" * 18, STEPS),
}  # fmt: skip


@pytest.mark.parametrize(("body", "said"), MACROS.values(), ids=MACROS)
def test_macros_end(tmp_path: Path, body: str, said: str) -> None:
    with pytest.raises(PromptError, match=said):
        text_of(tmp_path / "mine.j2", body)


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
    with pytest.raises(PromptError) as caught:
        text_of(tmp_path / "mine.j2", body)
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
    "{% for i in range(2000) %}line {{ i }} of a long prompt{% endfor %}": None,
}  # fmt: skip


@pytest.mark.parametrize("body", HONEST)
def test_what_prompts_do_goes_on_as_before(tmp_path: Path, body: str) -> None:
    text = text_of(tmp_path / "mine.j2", body)
    assert HONEST[body] is None or text == HONEST[body]


def test_each_rendering_begins_anew(tmp_path: Path) -> None:
    path = tmp_path / "mine.j2"
    path.write_text("{% block user %}{{ 'x' * 90000 }}{% endblock %}", encoding="utf-8")
    prompt = TemplatePrompt(path, "mine")
    assert {len(prompt.text("user", FACTS)) for _ in range(9)} == {90_000}


def test_an_error_without_a_text_is_said_in_words(tmp_path: Path) -> None:
    class Mute:
        def __str__(self) -> str:
            raise NotImplementedError

    path = tmp_path / "mine.j2"
    path.write_text("{% block user %}{{ thing }}{% endblock %}", encoding="utf-8")
    with pytest.raises(PromptError, match="cannot be rendered: not implemented error"):
        TemplatePrompt(path, "mine").text("user", {"thing": Mute()})


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
