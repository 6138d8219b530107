"""Plans: a table of replies with what they say, laws of decoration, order and numbering, and counts
of readings of the official recordings.
"""

import json
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.parsing.plan import parse_plan
from tests.shipped import reply_texts
from tests.workspace import csv_rows
from tests.workspace import plan_text as asked

N = 16
COUNTS = Path(__file__).with_name("recordings.csv")
"""Readings of the official recordings, by model."""


PLAN = (7, 7, 12, 3, 5, 9, 14, 2, 1)
TEXT = asked(*PLAN)

READ = {
    "7 12 3": [
        "Step1: Move block with index 7\n\nStep2: Move block with index 12\nStep3: block 3",
        "**Step 1:** Move block with index 7\n**Step 2:** Move block #12\n**Step 3:** block 3.",
        "1. **Step 1**: Move block with index 7\n2. **Step 2**: block 12\n3. **Step 3**: block 3",
        "| Step 1 | Move block with index 7 |\n| Step 2 | block 12 |\n| Step 3 | block 3 |",
        "| Step | Block |\n|---|---|\n| 1 | 7 |\n| 2 | 12 |\n| 3 | 3 |",
        '{"Step1": "Move block with index 7", "Step2": "Move block with index 12",\n'
        '"Step3": "Move block with index 3"}',
        '{"Left: Step1": "block 7", "Left: Step2": "block 12", "Left: Step3": "block 3"}',
        '```json\n{\n "Step 1": "block 7",\n "Step 2": "block 12",\n "Step 3": "block 3"\n}\n```',
        "Step1: Move block with index {7}\nStep2: Move block with index [12]\nStep3: index (3)",
        "Step1: red arch (index 7)\nStep2: cube - index: 12\nStep3: Place block_3 on it",
        "Step1: Move 7\nStep2: 12\nStep3: Move the orange cone (3) on top",
        "1. Move block with index 7\n2. Move block with index 12\n3. Move block with index 3",
        "- Move block 7 to the floor\n- Move block 12 next to it\n- Move block 3 on block 7",
        "Move block with index 7\nMove block with index 12\nMove block with index 3",
        "1) 7\n2) 12\n3) 3",
        "**Step 1:**\n   - Move block with index 7\n\n**Step 2:**\n   - block 12\n   - block 3",
        "Steps 1 & 2: Place the two arches (index 7 and 12)\nStep 3: Move block with index 3",
        '{"reasoning": "7 first", "plan": [7, 12, 3]}',
        'Draft: {"plan": [1]}\nSo: ```json\n{"plan": ["7", "12", "3"]}\n```\nDone.',
        '{"plan": [{"step": 1, "block": 7}, {"step": 2, "block": 12}, {"step": 3, "block": 3}]}',
        "The order of assembly is [7, 12, 3].",
        "Final plan: 7, 12, 3",
        "Answer: 7 -> 12 -> 3 (3 blocks)",
        "[7, 12, 3]",
        "<think>Step1: Move block with index 1</think>\n" + asked(7, 12, 3),
        "Step1: Move block with index 9\n</think>\n" + asked(7, 12, 3),
        f"<answer>{asked(7, 12, 3)}</answer><|im_end|>",
        "Step\uff11\uff1a block \uff17\nStep\uff12: block \uff11\uff12\nStep\uff13: block \uff13",
        "Step1:\u00a0block\u00a07\nStep2: block 12\u200b\nStep3: block 3",
        "~~Step1: block 1~~\n" + asked(7, 12, 3),
        f"Step 1: Look. Step 2: Choose the blocks.\n\n## Plan\n{asked(7, 12, 3)}",
    ],
    # Several lists.
    "7 3 12 5": [
        "Step1: block 7\nStep2: block 3\n\n### Right structure\nStep3: block 12\nStep4: block 5",
        "### Left structure:\nStep1: block 7\nStep2: block 3\n### Right structure:\n"
        "Step1: block 12\nStep2: block 5",
        '{"Structure 1": {"Step1": "block 7", "Step2": "block 3"},\n "Structure 2": {\n'
        '"Step1": "block 12", "Step2": "block 5"}}',
        "Assembly for the house:\nStep1: block 7\nStep2: block 3\nAssembly for the tower:\n"
        "Step1: block 12\nStep2: block 5",
        "Layer 1:\n- Move block 7\n- Move block 3\n\nLayer 2:\n- Move block 12\n- Move block 5",
        "- Left:\n  1. Move block 7\n  2. Move block 3\n- Right:\n  3. Move block 12\n  4. Place 5",
        f"{asked(1, 2, 3)}\n\n### Final plan\n{asked(7, 3, 12, 5)}",
        f"{asked(7, 3, 12, 5)}\n\nThe same as JSON:\n```json\n{asked(7, 3, 12, 5)}\n```",
        f"{asked(7, 3, 12, 5)}\n\n**Explanation:**\n- Step 1: block 7 is low.\n- Step 4: block 5",
        f"{asked(7, 12)}\n\n"
        + json.dumps({f"Step{i}": f"block {n}" for i, n in enumerate((7, 3, 12, 5), 1)}),
        f"{asked(7, 3, 12, 5)}\n\n1. Block 2 is not used.\n2. Block 4 is not used.",
        "Required blocks:\n1. Block 9 (red)\n2. Block 4 (blue)\n\nAssembly order:\n"
        + asked(7, 3, 12, 5),
        f"Two attempts.\n{asked(1, 2)}\nHmm, block 2 is the wrong one, let me start over.\n"
        f"{asked(7, 3, 12, 5)}",
    ],
    # A step that places more than one block.
    "7 7 3": [
        "Step1: Move block with index 7 (left wheel) twice\nStep2: Move block with index 3",
        "Step1: Move block with index 7 (x2)\nStep2: Move block with index 3",
        "Step1: 2x block 7\nStep2: Move block with index 3 (2 x 4 x 1)",
        "Steps 1-2: Move block with index 7\nStep3: Move block with index 3 on blocks 7 and 7",
        "Step1: Move blocks 7 and 7 (the wheels)\nStep2: Move block 3 on top of block 7",
    ],
}


@pytest.mark.parametrize(
    ("text", "said"), [(text, said) for said, texts in READ.items() for text in texts]
)
def test_a_plan_is_read_in_whatever_decoration(text, said):
    parsed = parse_plan(text, N)
    assert (" ".join(map(str, parsed.plan.steps)), parsed.truncated) == (said, False)
    assert parsed.rule in ("json", "steps", "list", "numbers")
    assert parsed.problem is None


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "empty"),
        (" \n\t", "empty"),
        ("<think>Step1: Move block with index 3", "thoughts_only"),
        ("I cannot see any picture.", "no_plan"),
        ("Step1: look\nStep2: think", "no_plan"),
        ("Step1: Move block with index N\nStep2: Move block with index N", "no_plan"),
        ("### Required blocks\n- Block 1: red cube\n- Block 2: green cube", "no_plan"),
        ("Block indices: 1, 2, 3", "no_plan"),
        ("The structure has 9 blocks in 3 layers.", "no_plan"),
        (f"Step1: block {'9' * 5000}", "no_plan"),
    ],
)
def test_a_reply_without_a_plan_is_a_named_problem(text, problem):
    parsed = parse_plan(text, N)
    assert (parsed.plan.steps, parsed.rule, parsed.problem) == ((), None, problem)


CUT = (
    "Step1: Move block with index 7,\nStep2: Move block with index 12,\nStep3: Move block with ind"
)


@pytest.mark.parametrize(
    ("text", "said", "truncated"),
    [
        (f"```json\n{{\n{CUT}", (7, 12), True),
        ("**Step 1**: block 7\n**Step 2**: block 12\n**Step 3**:", (7, 12), True),
        (f"{asked(7, 12, 3, 4)}\n\n```json\n{{{CUT}", (7, 12, 3, 4), False),
        (f"1. Move block 7\n2. Move block 12\n3. Move block 4\n\n```\n{CUT}", (7, 12, 4), False),
        (f"{asked(5, 6, 8, 9)}\n\nFinal plan:\n```json\n{{{CUT}", (7, 12), True),
        (f"{asked(7)}\n\nFinal plan:\n```json\n{{{CUT}", (7, 12), True),
        ('{"Step1": "Move block with index 7", "Step2": "Move block with index 1', (7,), True),
        ('{"Step1": "Move block with index 1", "Step2": "Move block with index 7', (1, 7), True),
        ('{"reasoning": "", "plan": [7, 12, 1', (7, 12), True),
        ("Step1: Move block with index 7\nStep2: Move block with index 1", (7, 1), False),
    ],
)
def test_a_plan_that_the_text_breaks_off_in_is_read_as_far_as_it_goes(text, said, truncated):
    parsed = parse_plan(text, N)
    assert (parsed.plan.steps, parsed.truncated) == (said, truncated)


HARMLESS = [
    "The structure is built in three layers with a total of 9 blocks.",
    "I chose block 12 because block 9 has its roof facing the wrong way.",
    "Note: 14 and 16 are mirrored.",
    "This places 9 blocks (8 blocks in the tower).",
    "Steps 7 and 8 could be reversed.",
    "To take it down, go in reverse order.",
    "Seen from behind the order would be reversed.",
    "Blocks 4, 6 and 8 are not used.",
    "1. The base is stable.\n2. Block 3 rests on block 12.",
    "- Step 3 needs block 12 on the floor.",
    "| Block | Used |\n|---|---|\n| 4 | no |",
    "Correction: in step 4 it should be block 14.",
    "```\nheight: 3\n```",
    "Alternatively block 15 could replace block 14, but I am not sure.",
]


@pytest.mark.parametrize("text", HARMLESS)
def test_what_stands_around_a_plan_changes_nothing(text):
    for whole in (f"{TEXT}\n\n{text}", f"{text}\n\n{TEXT}", f"{text}\n\n{TEXT}\n\n{text}"):
        assert parse_plan(whole, N).plan.steps == PLAN


def test_the_official_rule_reads_every_mention_and_nothing_else():
    text = f"I take block with index 4, not block 5.\n{TEXT}\nblock with index 99"
    parsed = parse_plan(text, N, "official")
    assert (parsed.plan.steps, parsed.dropped) == ((4, *PLAN), (99,))
    assert parsed.rule == "block_with_index"


numbers = st.lists(st.integers(1, N), min_size=1, max_size=30)
prose = st.lists(
    st.text(
        st.characters(codec="utf-8", exclude_characters='0123456789{}[]`"<>~'), max_size=60
    ).filter(lambda line: not any(c.isdigit() for c in line)),
    max_size=4,
).map("\n".join)


@given(numbers, prose, prose)
def test_text_without_numbers_around_the_asked_form_never_changes_it(steps, before, behind):
    assert parse_plan(f"{before}\n\n{asked(*steps)}\n\n{behind}", N).plan.steps == tuple(steps)


DRESSES = (
    *("{}", "**{}**", "- {}", "> {}", "* *{}*", "`{}`", "| {} |", '"{}",', "   {}  ", "{}."),
    "# {}",
)


@given(
    numbers,
    st.sampled_from(DRESSES),
    st.sampled_from(("\n", "\n\n", "  \n", "\r\n")),
    st.booleans(),
)
def test_decoration_and_fences_change_nothing(steps, dress, between, is_fenced):
    lines = between.join(dress.format(line) for line in asked(*steps).split("\n"))
    text = f"```json\n{{\n{lines}\n}}\n```" if is_fenced else lines
    assert parse_plan(text, N).plan.steps == tuple(steps)


@given(numbers, st.permutations(range(1, N + 1)))
def test_numbering_candidates_otherwise_numbers_the_plan_otherwise(steps, order):
    for write in (asked, lambda *plan: json.dumps({"reasoning": "", "plan": plan})):
        moved = [order[step - 1] for step in steps]
        assert parse_plan(write(*moved), N).plan.steps == tuple(moved)


def test_every_recorded_reply_is_read_as_counted(official_checkout):
    found = {}
    for (model, _), text in reply_texts(official_checkout).items():
        parsed = parse_plan(text, 16)
        official = parse_plan(text, 16, "official").plan
        counts = found.setdefault(model, Counter())
        counts["replies"] += 1
        counts[parsed.rule or "unread"] += 1
        counts["truncated"] += parsed.truncated
        counts["blocks"] += len(parsed.plan.steps)
        counts["dropped"] += len(parsed.dropped)
        counts["as_official"] += parsed.plan == official
    known = {row.pop("model"): row for row in csv_rows(COUNTS)}
    for model, counts in found.items():
        assert {name: str(counts[name]) for name in known[model]} == known[model], model
    assert found
