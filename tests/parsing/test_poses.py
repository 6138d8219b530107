"""Plans with poses: replies that say one plan, replies that are refused by name, and laws."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain.scene import PoseStep
from phyblock.parsing.poses import MOST_POSE_STEPS, parse_poses, pose_form

TWO = "Step1: block 3 at (5, 10, 2.5)\nStep2: block 5 at (0, -5, 7.5)"
STEPS = [(3, (5.0, 10.0, 2.5)), (5, (0.0, -5.0, 7.5))]
IN_JSON = json.dumps(
    {"plan": [{"block": n, "x": x, "y": y, "z": z} for n, (x, y, z) in STEPS], "reasoning": "{"}
)

READ = [
    TWO,
    f"The goal has two blocks.\n\n{TWO}\n\nThe structure has 2 blocks.",
    f"<think>Step1: block 9 at (1, 1, 1)</think>\n{TWO}",
    f"Step1: block 9 at (1, 1, 1)\n\nFinal plan:\n{TWO}",
    f"**{TWO}**",
    f"```\n{TWO}\n```",
    TWO.replace("block", "Move block with index"),
    TWO.replace("block", "block #").replace("Step", "Step "),
    TWO.replace("(", "[").replace(")", "]"),
    TWO.replace(", ", "; "),
    TWO.replace("at", "->").replace("-5", "\u22125"),
    "1. Block 3 at (5, 10, 2.5)\n2. Block 5 at (0, -5, 7.5)",
    "- Place block 3 at (5, 10, 2.5)\n- Place block 5 at (0, -5, 7.5)",
    "Step1: block 3 at (x=5, y=10, z=2.5)\nStep2: block 5 at x = 0, y = -5, z = 7.5",
    "Step1: block 3 at (5 cm, 10 cm, 2.5 cm)\nStep2: block 5 at (0, -5, 7.5) cm",
    "Step1: block 3 at (50 mm, 100 mm, 25 mm)\nStep2: block 5 at (0, -5, 7.5)",
    "Step1: block 3 at (0.05, 0.1, 0.025) m\nStep2: block 5 at (0.0, -0.05, 0.075) meters",
    "Step1: block 3 at (5., 1e1, +2.5)\nStep2: block 5 at (0, -5, 75e-1), on block 3",
    "Step1: block 3 at (5, 10, 2.5) in a corner\nStep2: block 5 at (0, -5, 7.5)",
    "| Step | Block | x | y | z |\n|---|---|---|---|---|\n| 1 | 3 | 5 | 10 | 2.5 |\n"
    "| 2 | 5 | 0 | -5 | 7.5 |",
    IN_JSON,
    f"Here it is:\n```json\n{IN_JSON}\n```",
]


@pytest.mark.parametrize("text", READ)
def test_a_plan_is_read_in_whatever_decoration(text: str) -> None:
    parsed = parse_poses(text, 16)
    assert parsed.problem is None
    assert [(step.candidate, pytest.approx(step.center_cm)) for step in parsed.steps] == STEPS


def one(rest: str) -> str:
    return f"Step1: block 3 at {rest}\nStep2: block 5 at (0, -5, 7.5)"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "empty"),
        ("<think>block 3 at (5, 5, 5)", "thoughts_only"),
        ("I cannot see the picture.", "no_plan"),
        ("Step1: look at the goal", "no_plan"),
        ("Step1: block 3\nStep2: block 5", "unclear_step"),
        (one("(5, 5)"), "unclear_step"),
        (one("(5, 5, 5, 5)"), "unclear_step"),
        (one("(five, 5, 5)"), "unclear_step"),
        (one("(5+2.5, 5, 5)"), "unclear_step"),
        (one("(1,000, 5, 5)"), "unclear_step"),
        (one("(x=5, y=5)"), "unclear_step"),
        (one("(z=5, y=5, x=5)"), "unclear_step"),
        (one("(5, 5, 1001)"), "out_of_range"),
        (one("(1e300, 5, 5)"), "out_of_range"),
        (one("(20 m, 0 m, 0 m)"), "out_of_range"),
        (one("(2 in, 4 in, 1 in)"), "other_unit"),
        (one("(2, 4, 1) inches"), "other_unit"),
        (one("(50 mm, 10 cm, 2 cm)"), "other_unit"),
        (one("(5, 5, 5) turned (0, 0, 90)"), "unclear_step"),
        ('{"plan": [{"block": 3, "x": 1, "y": 2}]}', "unclear_step"),
        ('{"plan": [{"block": 3, "x": 1, "y": 2, "z": NaN}]}', "out_of_range"),
        ('{"plan": [{"block": 3, "x": 1, "y": 2, "z": "3"}]}', "unclear_step"),
        ('{"plan": [{"block": 3, "x": 1, "y": 2, "z": 3, "w": 4}]}', "unclear_step"),
        ("\n".join(f"Step{i}: block 3 at (1, 1, {i})" for i in range(1, 102)), "too_many_steps"),
    ],
)
def test_a_step_that_cannot_be_read_is_the_problem_of_the_plan(text: str, problem: str) -> None:
    parsed = parse_poses(text, 16)
    assert (parsed.steps, parsed.rule, parsed.problem) == ((), None, problem)


lengths = st.integers(-100_000, 100_000).map(lambda n: n / 100)
steps = st.builds(PoseStep, st.integers(1, 16), st.tuples(lengths, lengths, lengths))


@given(st.lists(steps, min_size=1, max_size=MOST_POSE_STEPS), st.booleans())
def test_every_plan_of_the_asked_forms_is_read_as_it_is_written(
    plan: list[PoseStep], is_json: bool
) -> None:
    lines = [f"Step{i}: block {one.candidate} at {one.center_cm}" for i, one in enumerate(plan, 1)]
    items = [
        {"block": one.candidate, **dict(zip("xyz", one.center_cm, strict=True))} for one in plan
    ]
    text = json.dumps({"reasoning": "", pose_form(16).key: items}) if is_json else "\n".join(lines)
    assert parse_poses(text, 16).steps == tuple(plan)
