"""Plans with poses: what is read, and over a hundred replies that are refused by name, never guessed."""

# ruff: noqa: E501, RUF001 -- replies are long and come in other scripts

from __future__ import annotations

import hashlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from phyblock.domain import PoseStep
from phyblock.parsing import (
    MOST_POSE_STEPS,
    POSE_PROBLEMS,
    POSE_READER_VERSION,
    parse_poses,
    pose_form,
)

P = [(3, (5.0, 10.0, 2.5)), (5, (0.0, -5.0, 7.5))]
TWO = "Step1: block 3 at (5, 10, 2.5)\nStep2: block 5 at (0, -5, 7.5)"
KEYS = ("block", "x", "y", "z")
STEP = dict(zip(KEYS, (3, 5, 10, 2.5), strict=True))


def plan(*steps: object, **more: object) -> str:
    return json.dumps({"reasoning": "", "plan": list(steps), **more})


READ = [
    TWO,
    f"The goal has two blocks.\n\n{TWO}",
    f"<think>Step1: block 9 at (1, 1, 1)</think>\n{TWO}",
    TWO.replace("block", "Move block with index"),
    TWO.replace("block", "Place the block"),
    TWO.replace("block", "block #").replace("Step", "Step "),
    f"**{TWO}**",
    "1. Block 3 at (5, 10, 2.5)\n2. Block 5 at (0, -5, 7.5)",
    "- block 3 at (5, 10, 2.5)\n- block 5 at (0, -5, 7.5)",
    "block 3: (5, 10, 2.5)\n\nblock 5: (0, -5, 7.5)",
    "Step1: block 3 at [5, 10, 2.5]\nStep2: block 5 -> [0, -5, 7.5]",
    "Step1: block 3 at (5; 10; 2.5)\nStep2: block 5 at (0; -5; 7.5)",
    "Step1: block 3 at (x=5, y=10, z=2.5)\nStep2: block 5 at z = 7.5, x = 0, y = -5",
    "Step1: block 3 at (5 cm, 10 cm, 2.5 cm)\nStep2: block 5 at (0, -5, 7.5) cm",
    "Step1: block 3 at (50 mm, 100 mm, 25 mm)\nStep2: block 5 at (0, -5, 7.5) in cm",
    "Step1: block 3 at (0.05, 0.1, 0.025) m\nStep2: block 5 at (0.0, -0.05, 0.075) meters",
    "Step1: block 3 at (5, 10, 2.5), on the floor\nStep2: block 5 at (0, −5, 7.5), on top of block 3",
    "Step1: block 3 at (5., 1e1, +2.5)\nStep2: block 5 at (0, -5, 75e-1)",
    "Step1: block 3 with its center at (5, 10, 2.5)\nStep2: block 5 centered at (0, -5, 7.5).",
    f"{TWO}\n\nCheck:\n{TWO}",
    f"Draft:\nStep1: block 1 at (0, 0, 0)\n\nFinal answer:\n{TWO}",
    f"Block 3 is the arch and block 5 the cube.\nStep 1 is the base.\n{TWO}",
    "Step1: block 3 at (5, 10, 2.5) turned (0, 0, 0)\nStep2: block 5 at (0, -5, 7.5)",
    plan(STEP, dict(zip(KEYS, (5, 0, -5, 7.5), strict=True))),
    "```json\n" + plan(STEP, dict(zip(KEYS, (5, 0, -5, 7.5), strict=True))) + "\n```",
    "Here it is: " + plan(STEP, dict(zip(KEYS, (5, 0, -5, 7.5), strict=True))),
]


@pytest.mark.parametrize("text", READ)
def test_what_means_one_thing_is_read(text: str) -> None:
    parsed = parse_poses(text, 16, free=False)
    assert parsed.problem is None
    assert [(s.candidate, pytest.approx(s.center_cm)) for s in parsed.plan.steps] == P


FRAMES = (
    *("<answer>{}</answer>", "<answer>\n{}\n</answer>", "\\boxed{{{}}}", "$\\boxed{{\n{}\n}}$"),
    *("<|begin_of_box|>{}<|end_of_box|>", "<|begin_of_box|>\n{}\n<|end_of_box|>"),
    *("<think>It stands.</think>{}", "~~Step1: block 9 at (1, 1, 1)~~\n{}", "{}<|im_end|>user"),
)
FRAMED = [
    TWO,
    TWO.replace("5, 10", "5,\\ 10"),
    TWO.replace("at", "->"),
    plan(STEP),
    "Step1: block 3 at (1, 2, 3)",
]


@pytest.mark.parametrize("text", FRAMED)
def test_a_frame_around_a_plan_changes_nothing(text: str) -> None:
    alone = parse_poses(text, 16, free=False)
    assert alone.plan.steps
    framed = {frame: parse_poses(frame.format(text), 16, free=False) for frame in FRAMES}
    assert {frame: parsed.plan for frame, parsed in framed.items()} == dict.fromkeys(
        FRAMES, alone.plan
    )
    if "{" not in text:
        behind_a_draft = f"Step1: block 9 at (1, 1, 1)\n\\boxed{{{text}}}"
        assert parse_poses(behind_a_draft, 16, free=False).problem == "two_plans"


def test_readings_of_stored_texts_change_with_the_version_alone() -> None:
    """A new row changes the digest; a row that is read otherwise than before raises the version."""
    texts = [*READ, *(text for text, _ in REFUSED), *(f.format(t) for f in FRAMES for t in FRAMED)]
    readings = [parse_poses(text, 16, free=free) for text in texts for free in (False, True)]
    digest = hashlib.sha256(repr(readings).encode()).hexdigest()[:16]
    assert (POSE_READER_VERSION, digest) == (3, "737bdc6a25256808")


def one(rest: str, label: str = "Step1: ") -> str:
    return f"{label}block 3 at {rest}"


REFUSED: list[tuple[str, str]] = [
    ("", "empty"),
    (" \n\t\n", "empty"),
    ("<think>block 3 at (5, 5, 5)", "thoughts_only"),
    ("I cannot see the picture.", "no_plan"),
    ("Step1: look at the goal", "no_plan"),
    ("3, 5, 12", "no_plan"),
    ("Step1: Move block with index 3\nStep2: Move block with index 5", "no_place"),
    ("Step1: block 3", "no_place"),
    ("(5, 5, 5)", "no_plan"),
    ("Step1: (5, 5, 5)", "unclear_step"),
    ("Step1: block at (5, 5, 5)", "unclear_step"),
    ("Step1: block three at (5, 5, 5)", "unclear_step"),
    ("Step1: block 3.5 at (5, 5, 5)", "unclear_step"),
    ("Step1: block 99999999999999 at (5, 5, 5)", "unclear_step"),
    ("Step1: blocks 3 and 4 at (5, 5, 5)", "unclear_step"),
    ("Step1: block 3 or block 4 at (5, 5, 5)", "unclear_step"),
    (one("(5, 5)"), "missing_coordinate"),
    (one("(5)"), "missing_coordinate"),
    (one("()"), "missing_coordinate"),
    (one("(,,)"), "missing_coordinate"),
    (one("(5, 5, )"), "missing_coordinate"),
    (one("(x=5, y=5)"), "missing_coordinate"),
    (one("x=5, y=5"), "missing_coordinate"),
    (one("(x=5, x=5, z=5)"), "unclear_step"),
    (one("(x=5, y=5, z=5, x=6)"), "unclear_step"),
    (one("(5, 5, 5, 5)"), "too_many_coordinates"),
    (one("(5, 5, 5, 0, 0, 90)"), "too_many_coordinates"),
    (one("(1,000, 5, 5)"), "too_many_coordinates"),
    (one("(5,0, 10,0, 2,5)"), "too_many_coordinates"),
    (one("(5,0; 10,0; 2,5)"), "not_a_number"),
    (one("(nan, 5, 5)"), "not_a_number"),
    (one("(NaN, NaN, NaN)"), "not_a_number"),
    (one("(inf, 5, 5)"), "not_a_number"),
    (one("(-Infinity, 5, 5)"), "not_a_number"),
    (one("(∞, 5, 5)"), "not_a_number"),
    (one("(1e308, 5, 5)"), "out_of_range"),
    (one("(1e999, 5, 5)"), "not_a_number"),
    (one("(-1e308, 1e308, 1e308)"), "out_of_range"),
    (one("(5, 5, 1001)"), "out_of_range"),
    (one("(20 m, 0 m, 0 m)"), "out_of_range"),
    (one("(99999999999999999999, 5, 5)"), "not_a_number"),
    (one("(five, five, five)"), "not_a_number"),
    (one("(5+2.5, 5, 5)"), "not_a_number"),
    (one("(5/2, 5, 5)"), "not_a_number"),
    (one("(2 1/2, 5, 5)"), "not_a_number"),
    (one("(~5, 5, 5)"), "not_a_number"),
    (one("(5±1, 5, 5)"), "not_a_number"),
    (one("(5-6, 5, 5)"), "not_a_number"),
    (one("(<5, 5, 5)"), "not_a_number"),
    (one("(?, ?, ?)"), "not_a_number"),
    (one("(x, y, z)"), "not_a_number"),
    (one("(X, Y, 2.5)"), "not_a_number"),
    (one("(null, null, null)"), "not_a_number"),
    (one("(0x10, 5, 5)"), "not_a_number"),
    (one("(5.5.5, 5, 5)"), "not_a_number"),
    (one("(--5, 5, 5)"), "not_a_number"),
    (one("(5, 5, half)"), "not_a_number"),
    (one("(½, 5, 5)"), "not_a_number"),
    (one("(2 in, 4 in, 1 in)"), "other_unit"),
    (one("(2 inches, 4 inches, 1 inch)"), "other_unit"),
    (one("(2, 4, 1) inches"), "other_unit"),
    (one("(2, 4, 1) in inches"), "other_unit"),
    (one('(2", 4", 1")'), "other_unit"),
    (one("(2″, 4″, 1″)"), "other_unit"),
    (one("('5', '5', '5')"), "other_unit"),
    (one('("5", "5", "5")'), "other_unit"),
    (one("(1 ft, 1 ft, 1 ft)"), "other_unit"),
    (one("(1, 1, 1) feet"), "other_unit"),
    (one("(120 px, 80 px, 40 px)"), "other_unit"),
    (one("(120, 80, 40) pixels"), "other_unit"),
    (one("(1, 2, 1) units"), "other_unit"),
    (one("(1, 2, 1) blocks"), "other_unit"),
    (one("(1 dm, 2 dm, 1 dm)"), "other_unit"),
    (one("(50 µm, 50 µm, 50 µm)"), "other_unit"),
    (one("(10%, 20%, 5%)"), "other_unit"),
    (one("(45°, 20°, 5°)"), "other_unit"),
    (one("(50 mm, 10, 2.5)"), "mixed_units"),
    (one("(50 mm, 10 cm, 2.5 cm)"), "mixed_units"),
    (one("(5 cm, 10 cm, 0.025 m)"), "mixed_units"),
    (one("(50 mm, 100 mm, 25 mm) cm"), "mixed_units"),
    (f"All positions are in meters.\n{one('(0.05, 0.1, 0.025)')}", "other_unit"),
    (f"Units: inches\n{one('(2, 4, 1)')}", "other_unit"),
    (f"Coordinates (in mm):\n{one('(50, 100, 25)')}", "other_unit"),
    (f"Positions in metres:\n{one('(0.05, 0.1, 0.025)')}", "other_unit"),
    (f"{one('(2, 4, 1)')}\nAll values are given in inches.", "other_unit"),
    (f"Coordinates (feet)\n{one('(2, 4, 1)')}", "other_unit"),
    (one("(5, 5, 5) or (6, 6, 6)"), "two_places"),
    (one("(5, 5, 5), then at (6, 6, 6)"), "two_places"),
    (one("(5, 5, 5) to (6, 6, 6)"), "two_places"),
    (one("(5, 5, 5), 7"), "unclear_step"),
    (one("(5, 5, 5) turned 90 degrees"), "unclear_step"),
    (one("(5, 5, 5) turned (0, 0, 90)"), "turned"),
    (one("(5, 5, 5), rotation (0, 0, 90) degrees"), "turned"),
    (one("(5, 5, 5) rotated (0, 0, 1.57 rad)"), "other_unit"),
    (one("((5, 5), 5)"), "unclear_step"),
    (one("[[5, 5, 5]]"), "unclear_step"),
    (one("[[5, 5, 5], [6, 6, 6]]"), "unclear_step"),
    (one("{5, 5, 5}"), "no_place"),
    (one("(5, 5, 5"), "unclear_step"),
    (one("5, 5, 5"), "no_place"),
    (one("the origin"), "no_place"),
    (one("the left of (5, 5, 5)"), "unclear_step"),
    (
        f"{TWO}\n\nOr else:\nStep1: block 3 at (5, 10, 2.5)\nStep2: block 5 at (0, 5, 7.5)",
        "two_plans",
    ),
    (f"Plan A\n{TWO}\nPlan B\nStep1: block 1 at (0, 0, 2.5)", "two_plans"),
    ("block 3 at (5, 5, 5)\nNow the next.\nblock 5 at (0, 0, 5)", "two_plans"),
    ("Step1: block 3 at (5, 5, 5)\nStep3: block 5 at (0, 0, 5)", "broken_list"),
    ("Step2: block 3 at (5, 5, 5)", "broken_list"),
    ("Step0: block 3 at (5, 5, 5)", "broken_list"),
    (
        "Step1: block 3 at (5, 5, 5)\nStep2: block 4 at (5, 5)\nStep3: block 5 at (0, 0, 5)",
        "missing_coordinate",
    ),
    (
        "\n".join(f"Step{i}: block 3 at (5, 5, {i % 90})" for i in range(1, 10_001)),
        "too_many_steps",
    ),
    ("\n".join("block 3 at (5, 5, 5)" for _ in range(MOST_POSE_STEPS + 1)), "too_many_steps"),
    (plan(*[STEP] * 10_000), "too_many_steps"),
    (plan(3, 5), "no_place"),
    (plan([3, 5, 10, 2.5]), "no_place"),
    (plan([STEP]), "no_place"),
    (plan("block 3 at (5, 10, 2.5)"), "no_place"),
    (plan({"block": 3}), "missing_coordinate"),
    (plan({"block": 3, "x": 5, "y": 10}), "missing_coordinate"),
    (plan({"x": 5, "y": 10, "z": 2.5}), "unclear_step"),
    (plan(STEP | {"block": "3"}), "unclear_step"),
    (plan(STEP | {"block": 3.0}), "unclear_step"),
    (plan(STEP | {"block": True}), "unclear_step"),
    (plan(STEP | {"block": None}), "unclear_step"),
    (plan(STEP | {"block": 10**30}), "unclear_step"),
    (plan(STEP | {"x": "5"}), "not_a_number"),
    (plan(STEP | {"x": "5 cm"}), "not_a_number"),
    (plan(STEP | {"x": None}), "not_a_number"),
    (plan(STEP | {"x": True}), "not_a_number"),
    (plan(STEP | {"x": [5]}), "not_a_number"),
    (plan(STEP | {"x": {"value": 5}}), "not_a_number"),
    (plan(STEP | {"x": 1e308}), "out_of_range"),
    (plan(STEP | {"x": 10**400}), "not_a_number"),
    (plan(STEP | {"x": float("nan")}), "not_a_number"),
    (plan(STEP | {"x": float("inf")}), "not_a_number"),
    (plan(STEP | {"unit": "inch"}), "unknown_key"),
    (plan(STEP | {"x_m": 0.05}), "unknown_key"),
    (plan({"block": 3, "position": [5, 10, 2.5]}), "unknown_key"),
    (plan(STEP | {"rotation": [0, 0, 90]}), "turned"),
    (plan(STEP | {"rx": 0, "ry": 0, "rz": 90}), "turned"),
    (plan(STEP | {"rz": 90}), "missing_rotation"),
    (plan(STEP, units="inches"), "other_unit"),
    (plan(STEP, unit="mm"), "other_unit"),
    (json.dumps({"plan": STEP}), "wrong_json"),
    (json.dumps({"plan": "block 3"}), "wrong_json"),
    (json.dumps({"plan": None}), "wrong_json"),
    ('{"plan": [{"block": 3, "x": 5, "x": 6, "y": 1, "z": 1}]}', "wrong_json"),
    (plan(STEP)[:-9], "broken_json"),
    (f"{plan(STEP)}\n{plan(STEP | {'x': 6})}", "several_json"),
]


CENTIMETERS = (
    "cm", "CM", "cms", "cm.", "centimeter", "centimeters", "centimetre", "Centimetres", "**cm**",
    "`cm`", '"cm"', "(cm)", "centimeters (cm)", "the cm shown", "units of 1 cm", "units of cm",
)  # fmt: skip
SAID_OF_ALL = (
    "All coordinates are in {}", "All values are in {}, not in m", "All numbers are in {} (not m)",
    "Units: {}", "Unit = {}", "Positions: in {}", "Everything is measured in {} rather than in mm",
    "All lengths given are\nin {}", "Coordinates are in\n{}", "The dimensions are in {}",
)  # fmt: skip


@pytest.mark.parametrize("unit", CENTIMETERS)
def test_a_reply_may_say_of_all_its_numbers_that_they_are_centimeters(unit: str) -> None:
    for said in SAID_OF_ALL:
        sentence = said.format(unit)
        for reply in (one("(5, 10, 2.5)"), plan(STEP)):
            for text in (f"{sentence}.\n{reply}", f"{reply}\n\n{sentence}"):
                parsed = parse_poses(text, 16, free=False)
                assert (parsed.problem, len(parsed.plan)) == (None, 1), text


@pytest.mark.parametrize(
    "unit",
    ["m", "mm", "dm", "in", "inches", "ft", "feet", "yards", "meters", "decimetres", "px", "cells",
     "**meters**", "_mm_", '"in"', "units of 5", "µm", "the grid units", "blocks"],
)  # fmt: skip
def test_a_reply_that_says_that_they_are_others_is_refused(unit: str) -> None:
    for said in ("All coordinates are in {}", "Units: {}", "Positions are given in {}"):
        for reply in (one("(5, 10, 2.5)"), plan(STEP)):
            for text in (f"{said.format(unit)}.\n{reply}", f"{reply}\n\n{said.format(unit)}"):
                parsed = parse_poses(text, 16, free=False)
                assert (parsed.problem, len(parsed.plan)) == ("other_unit", 0), text


def test_there_are_enough_of_them() -> None:
    assert len(REFUSED) >= 120
    assert {problem for _, problem in REFUSED} == set(POSE_PROBLEMS)


@pytest.mark.parametrize(("text", "problem"), REFUSED)
def test_what_could_mean_something_else_is_refused_by_name(text: str, problem: str) -> None:
    parsed = parse_poses(text, 16, free=False)
    assert (parsed.problem, parsed.rule, len(parsed.plan)) == (problem, None, 0)


def test_rotations_are_read_where_they_are_asked_for_and_never_left_out() -> None:
    text = "Step1: block 3 at (5, 10, 2.5) turned (0, 90, -45)\nStep2: block 5 at (0, -5, 7.5), rotation (0°, 0°, 0°)"
    steps = parse_poses(text, 16, free=True).plan.steps
    assert steps == (
        PoseStep(3, (5, 10, 2.5), (0, 90, -45)),
        PoseStep(5, (0, -5, 7.5), (0, 0, 0)),
    )
    assert parse_poses(TWO, 16, free=True).problem == "missing_rotation"
    assert parse_poses(plan(STEP), 16, free=True).problem == "missing_rotation"
    assert parse_poses(one("(5, 5, 5) turned (0, 0, 1e9)"), 16, free=True).problem == "out_of_range"


def test_blocks_that_no_candidate_is_stay_in_the_plan() -> None:
    text = "Step1: block 0 at (5, 5, 5)\nStep2: block 17 at (5, 5, 5)\nStep3: block -2 at (5, 5, 5)"
    assert [s.candidate for s in parse_poses(text, 16, free=False).plan.steps] == [0, 17, -2]


NUMBERS = st.floats(-999, 999).map(lambda value: round(value, 3) + 0.0)
STEPS = st.lists(st.tuples(st.integers(1, 16), *[NUMBERS] * 6), max_size=12)


@given(STEPS, st.booleans())
def test_what_is_written_in_either_form_is_read_again(
    steps: list[tuple[float, ...]], free: bool
) -> None:
    form = pose_form(16, free=free)
    names = ("block", "x", "y", "z", *(("rx", "ry", "rz") if free else ()))
    value = [dict(zip(names, step, strict=False)) for step in steps]
    Draft202012Validator(form.schema).validate({"reasoning": "", "plan": value})
    meant = tuple(PoseStep(int(s[0]), s[1:4], s[4:7] if free else None) for s in steps)  # type: ignore[arg-type]
    parsed = parse_poses(form.write(value), 16, free=free)
    assert (parsed.plan.steps, parsed.rule) == (meant, "json_schema")
    turned = (lambda s: f" turned {s[4:7]}") if free else (lambda _: "")
    text = "\n".join(
        f"Step{i}: block {s[0]} at {s[1:4]}{turned(s)}" for i, s in enumerate(steps, 1)
    )
    assert parse_poses(text, 16, free=free).plan.steps == meant


ALPHABET = st.sampled_from(
    [*"()[]{},;:=x yz.0159-+e\n\"'", "Step1: ", "block 3 ", " at ", " cm", "NaN", "plan"]
)


@given(st.lists(ALPHABET, max_size=60).map("".join) | st.text(max_size=80), st.booleans())
def test_nothing_crashes_it(text: str, free: bool) -> None:
    parsed = parse_poses(text, 16, free=free)
    assert (parsed.rule is None) == (parsed.problem is not None)
    assert parsed.problem is None or parsed.problem in POSE_PROBLEMS


def test_the_example_in_the_prompt_is_no_answer() -> None:
    for free in (False, True):
        assert parse_poses(pose_form(16, free=free).example, 16, free=free).rule is None
