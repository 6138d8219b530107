"""Answers asked for as JSON: what is written is read, and nothing else is read in its place."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from phyblock.parsing import (
    AnswerForm,
    ParsedMove,
    choice_form,
    move_form,
    parse_answer,
    parse_asked_answer,
    parse_asked_move,
    parse_asked_plan,
    parse_move,
    parse_plan,
    plan_form,
)
from phyblock.parsing.answer_form import EXACT_RULE, KEY_RULE

N = 16
OPTIONS = ("red cube", "blue cube", "an arch", "none of them")
FORMS: dict[str, AnswerForm[Any]] = {
    "plan": plan_form(N),
    "move": move_form(N),
    "move without reasons": move_form(N, reasons=False),
    "choice": choice_form(OPTIONS, is_ordering=False),
    "order": choice_form(OPTIONS, is_ordering=True),
}
VALUES: dict[str, st.SearchStrategy[Any]] = {
    "plan": st.lists(st.integers(1, N), max_size=30),
    "move": st.sampled_from([*(f"Move({n})" for n in range(1, N + 1)), "Done"]),
    "choice": st.sampled_from("ABCD"),
    "order": st.permutations("ABCD").map(list),
}
VALUES["move without reasons"] = VALUES["move"]
ANSWERS = st.sampled_from(list(FORMS)).flatmap(lambda name: st.tuples(st.just(name), VALUES[name]))
MISLEADING = (
    "Step1: Move block with index 3\nStep2: Move block with index 4",
    'First {"plan": [9]}, then "answer": "D"',
    "</think> Answer: C",
    "<think>",
    "``` Next plan: Move(7) ```",
    "~~1~~ {{{ [[[",
    "\\",
)
REASONS = st.text(max_size=60) | st.sampled_from(MISLEADING)


def meant(name: str, value: Any) -> Any:
    if name == "plan":
        return tuple(value)
    if name.startswith("move"):
        is_done = value == "Done"
        return ParsedMove(None if is_done else int(value[5:-1]), is_done)
    return "".join(value)


@given(ANSWERS, REASONS)
def test_what_is_written_is_read_whatever_the_reasons_say(
    answer: tuple[str, Any], reasons: str
) -> None:
    name, value = answer
    text = FORMS[name].write(value, reasons)
    Draft202012Validator(FORMS[name].schema).validate(json.loads(text))
    reading = FORMS[name].read(text)
    assert reading is not None
    assert (reading.answer, reading.rule) == (meant(name, value), EXACT_RULE)


FRAMES = (
    "```json\n{}\n```",
    "Here it is:\n\n{}",
    "{}\n\nThat is all.",
    '<think>It is {{"plan": [1]}}.</think>\n```\n{}\n```',
)


@given(ANSWERS, st.sampled_from(FRAMES))
def test_a_frame_around_it_changes_the_rule_alone(answer: tuple[str, Any], frame: str) -> None:
    name, value = answer
    reading = FORMS[name].read(frame.format(FORMS[name].write(value, "It is small.")))
    assert reading is not None
    assert (reading.answer, reading.rule) == (meant(name, value), KEY_RULE)


@given(ANSWERS, REASONS, st.data())
def test_what_is_cut_off_gives_no_answer(
    answer: tuple[str, Any], reasons: str, data: st.DataObject
) -> None:
    name, value = answer
    text = FORMS[name].write(value, reasons)
    cut = text[: data.draw(st.integers(0, len(text) - 1))]
    assert parsed_by(name)(cut) is None


JSON_VALUES = st.recursive(
    st.none() | st.booleans() | st.integers(-2, N + 2) | st.text(max_size=4)
    | st.sampled_from(["Move(3)", "Done", "A", "D", "B, A, C, D", "Move(99)", 10**30]),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner),
    max_leaves=6,
)  # fmt: skip


@given(st.sampled_from(list(FORMS)), JSON_VALUES, JSON_VALUES, st.booleans())
def test_the_exact_rule_is_the_schema(name: str, value: Any, reasons: Any, more: bool) -> None:
    form = FORMS[name]
    found = {"reasoning": reasons, form.key: value, **({"more": 1} if more else {})}
    reading = form.read(json.dumps(found))
    assert reading is not None
    if not Draft202012Validator(form.schema).is_valid(found):
        assert reading.rule != EXACT_RULE
    elif name != "order":
        # That letters differ is more than schemas of all providers can say.
        assert reading.rule == EXACT_RULE
    assert (reading.rule is None) == (reading.answer is None) == (reading.problem is not None)


HOSTILE_NUMBERS = (
    *("2.0", "2.5", "1e308", "1e999", "-1e-7", "NaN", "Infinity", "null", "true", '""', '"two"'),
    *('"2.0"', "[2]", '{"index": 2}', "{}", "1234567", "9" * 5000, '"Step 2"', "02", "+2", "'2'x"),
)


@given(st.lists(st.integers(1, N), max_size=5), st.sampled_from(HOSTILE_NUMBERS), st.data())
def test_a_plan_with_one_thing_that_is_no_block_is_no_plan(
    plan: list[int], hostile: str, data: st.DataObject
) -> None:
    items = [str(number) for number in plan]
    items.insert(data.draw(st.integers(0, len(items))), hostile)
    text = f'{{"reasoning": "", "plan": [{", ".join(items)}]}}'
    for reply in (text, f"```json\n{text}\n```", f"The plan:\n{text}"):
        parsed = parse_asked_plan(reply, N)
        assert (parsed.plan.steps, parsed.rule) == ((), None)
        assert parsed.problem in ("wrong_json", "broken_json")


@pytest.mark.parametrize(
    ("text", "plan", "rule", "problem"),
    [
        ('{"plan": [3, 5]}', (3, 5), "json_key", None),
        ('{"reasoning": "", "plan": []}', (), "json_schema", None),
        ('{"plan": [3, 5], "unused": [1, 2]}', (3, 5), "json_key", None),
        ('{"plan": ["3", "#5"]}', (3, 5), "json_key", None),
        ('{"reasoning": "", "plan": [3, 99, 0, -4, 5]}', (3, 5), "json_key", None),
        ("{'plan': [3, 5,]}", (3, 5), "json_key", None),
        ('{"plan": [3]}\n{"plan": [3]}', (3,), "json_key", None),
        ('{"reasoning": "...", "plan": [N, N, ...]}\n{"plan": [3]}', (3,), "json_key", None),
        ('{"plan": [3]}\n{"plan": [4]}', (), None, "several_json"),
        ('{"plan": [3]} or rather {"plan": [4', (), None, "broken_json"),
        ('{"plan": [3], "plan": [3]}', (), None, "wrong_json"),
        ('{"plan": {"1": 3}}', (), None, "wrong_json"),
        ('{"plan": "3, 5"}', (), None, "wrong_json"),
        ('{"reasoning": "...", "plan": [N, N, ...]}', (), None, "broken_json"),
        ('{"reasoning": "</think>Step1: Move block with index 3', (), None, "broken_json"),
        ('{"reasoning": "Step1: Move block with index 3', (), None, "broken_json"),
        # JSON of another form is read as any text is, but for what that would pass over.
        ('{"steps": [3, 5]}', (3, 5), "json", None),
        ('{"answer": {"plan": [3, 5]}}', (3, 5), "json", None),
        ('{"answer": {"plan": [3, 5.5]}}', (), None, "wrong_json"),
        ('{"steps": [3], "steps": [5]}', (), None, "wrong_json"),
        ("[3, 5.5]", (), None, "wrong_json"),
        ("Step1: Move block with index 3", (3,), "steps", None),
        ("I cannot see the picture.", (), None, "refusal"),
        ("", (), None, "empty"),
    ],
)
def test_plans(text: str, plan: tuple[int, ...], rule: str | None, problem: str | None) -> None:
    parsed = parse_asked_plan(text, N)
    assert (parsed.plan.steps, parsed.rule, parsed.problem) == (plan, rule, problem)


def test_numbers_that_no_candidate_has_are_told() -> None:
    assert parse_asked_plan('{"plan": [3, 99, 0, -4]}', N).dropped == (99, 0, -4)


@pytest.mark.parametrize(
    ("value", "letters", "rule"),
    [
        ('"a"', "A", "json_key"),
        ('"B."', "B", "json_key"),
        ('"blue cube"', "B", "json_key"),
        ('"not A"', None, None),
        ('"A or B"', None, None),
        ('"A. blue cube"', None, None),
        ('"E"', None, None),
        ('["A"]', None, None),
        ("1", None, None),
        ("null", None, None),
        ('"A", "answer": "B"', None, None),
    ],
)
def test_choices(value: str, letters: str | None, rule: str | None) -> None:
    parsed = parse_asked_answer(f'{{"answer": {value}}}', OPTIONS, False)
    assert (parsed.letters, parsed.rule) == (letters, rule)
    assert (parsed.problem is None) == (rule is not None)


@pytest.mark.parametrize(
    ("value", "letters"),
    [
        ('"C, A, B, D"', "CABD"),
        ('["c", "a", "b", "d"]', "CABD"),
        ('["C", "A", "B"]', None),
        ('["C", "A", "B", "B"]', None),
        ('["C", "A", "B", "D", "D"]', None),
        ('["C", "A", "B", 4]', None),
        ('["CABD"]', None),
        ('"C, A, B"', None),
    ],
)
def test_orders(value: str, letters: str | None) -> None:
    assert parse_asked_answer(f'{{"answer": {value}}}', OPTIONS, True).letters == letters


@pytest.mark.parametrize(
    ("value", "move"),
    [
        ('"move(3)."', 3),
        ('"Move( 3 )"', 3),
        ("3", 3),
        ('"3"', 3),
        ('"Move(99)"', 99),
        ('"done"', "Done"),
        ('"Done()"', "Done"),
        ('"Move(3), Move(4)"', None),
        ('"Not Done"', None),
        ('"Move(3) or Done"', None),
        ("3.0", None),
        ("[3]", None),
        ("null", None),
        ("true", None),
        ('{"move": 3}', None),
    ],
)
def test_moves(value: str, move: int | str | None) -> None:
    parsed = parse_asked_move(f'{{"operation": {value}}}', move_form(N))
    assert ("Done" if parsed.is_done else parsed.move) == move
    assert (parsed.problem == "wrong_json") == (move is None)


def parsed_by(name: str) -> Callable[[str], Any]:
    """Reads a reply to the answer as the track would; None for none."""
    if name == "plan":
        return lambda text: parse_asked_plan(text, N).rule
    if name.startswith("move"):
        form = move_form(N, reasons=name == "move")
        return lambda text: getattr(parse_asked_move(text, form), "rule", None)
    return lambda text: parse_asked_answer(text, OPTIONS, name == "order").letters


@given(st.text(max_size=200).filter(lambda text: "{" not in text and "[" not in text))
def test_a_text_without_json_is_read_as_any_text_is(text: str) -> None:
    assert parse_asked_plan(f"I say {text}", N) == parse_plan(f"I say {text}", N)
    assert parse_asked_move(f"I say {text}", move_form(N)) == parse_move(f"I say {text}")
    for is_ordering in (False, True):
        ways = (parse_asked_answer, parse_answer)
        one, other = (parse(f"I say {text}", OPTIONS, is_ordering) for parse in ways)
        assert one == other


@given(st.text('{}[]",:.0123456789 \n`planswero(M)e-+NaN\\', max_size=120))
def test_no_text_raises(text: str) -> None:
    for name in FORMS:
        parsed_by(name)(text)


@pytest.mark.parametrize("name", FORMS)
def test_the_example_is_no_answer_and_the_schema_is_one_that_all_providers_know(name: str) -> None:
    form = FORMS[name]
    assert parsed_by(name)(form.example) is None
    assert list(form.schema["properties"]) == form.schema["required"]
    Draft202012Validator.check_schema(form.schema)
    text = json.dumps(form.schema)
    for word in ("minimum", "minItems", "pattern", "anyOf", "$ref", "uniqueItems", "null"):
        assert word not in text
    assert form.response_format["json_schema"]["strict"] is True
