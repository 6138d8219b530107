"""What the default parser makes of replies as models write them."""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import pytest

from phyblock.parsing import parse_plan

N = 16

STEP_LISTS = {
    "the asked form": (
        "{\n    Step1: Move block with index 3\n    Step2: Move block with index 1\n}",
        (3, 1),
    ),
    "with analysis before it": (
        "The base needs block with index 9 and block with index 2.\n\n"
        "Step1: Move block with index 9\nStep2: Move block with index 2\n",
        (9, 2),
    ),
    "a space in the head": (
        "Step 1: Move block with index 12\nStep 2: move block index 4",
        (12, 4),
    ),
    "bold heads": ("- **Step 1:** Move block with index 5.\n- **Step 2:** block index 6.", (5, 6)),
    "bold words": ("**Step 1**: Move **block with index 5**\n**Step 2**: index **6**", (5, 6)),
    "JSON": (
        '```json\n{\n  "Step1": "Move block with index 7",\n  "Step2": "index 7"\n}\n```',
        (7, 7),
    ),
    "one-line JSON": (
        '{"Step1": "Move block with index 2", "Step2": "Move block with index 10"}',
        (2, 10),
    ),
    "one-line braces": ("{Step1: Move block with index 2; Step2: Move block with index 3}", (2, 3)),
    "JSON keys with an underscore": ('{"step_1": "index 4",\n "step_2": "index 5"}', (4, 5)),
    "zero-based": ("Step 0: Move block with index 8\nStep 1: Move block with index 9", (8, 9)),
    "dashes": ("Step 1 - Move block with index 8\nStep 2 \u2013 Move block with index 9", (8, 9)),
    "parentheses": ("(Step 1) Move block with index 8\n(Step 2) Move block with index 9", (8, 9)),
    "block on the next line": ("### Step 1\nMove block with index 8\n### Step 2\nindex 9", (8, 9)),
    "a Markdown quotation": ("> Step 1: index 8\n> Step 2: index 9", (8, 9)),
    "index in braces": (
        "Step1: Move block with index {3}\nStep2: Move block with index {1}",
        (3, 1),
    ),
    "index with a hash": (
        "Step1: Move block with index #5\nStep2: Move block with index #6",
        (5, 6),
    ),
    "index in quotation marks": ("Step1: index '5'\nStep2: index \"6\"", (5, 6)),
    "colon before the number": ("Step1: block index: 5\nStep2: block index = 6", (5, 6)),
    "colors in the name": (
        "Step 1: Move green block (Index 9)\nStep 2: Move red arch block (index 1)",
        (9, 1),
    ),
    "another verb": ("Step 1: Place block with index 6 on top\nStep 2: Add index 2", (6, 2)),
    "a support named in a step": (
        "Step1: Move block with index 3\n"
        "Step2: Move block with index 4 on top of block with index 3",
        (3, 4),
    ),
    "another step named in a step": (
        "Step1: Move block with index 3\nStep2: Move block with index 6 on top of Step1\n"
        "Step3: Move block with index 7 on the block of step 2, step 1 below it",
        (3, 6, 7),
    ),
    "another step named after a comma": (
        "Step1: Move block with index 3\nStep2: Move block with index 6, step 1 holds it\n"
        "Step3: Move block with index 7",
        (3, 6, 7),
    ),
    "several blocks in a step": (
        "Step 1: Move blocks with index 1, 2 and 5\nStep 2: Move blocks with indices 7 & 8",
        (1, 2, 5, 7, 8),
    ),
    "a comma before 'and'": ("Step 1: Move blocks with indices 1, 2, and 5", (1, 2, 5)),
    "alternatives": (
        "Step 1: Move block with index 5 or 6 on top of block with index 2\n"
        "Step 2: Move block with index 13/14\nStep 3: Move block with index 1, 2, or 3",
        (5, 13, 1),
    ),
    "one line for two steps": (
        "Step 1: Move block with index 4\nStep 2 & 3: Move block with index 7\n"
        "Step 4-5: Move blocks with indices 1 and 2\nStep 6: Move block with index 3",
        (4, 7, 7, 1, 2, 3),
    ),
    "a step that names none": (
        "Step 1: Move block with index 4\nStep 2: Check it.\nStep 3: Move block with index 5",
        (4, 5),
    ),
    "a draft, then the answer": (
        "Draft:\nStep1: Move block with index 1\nStep2: Move block with index 2\n\n"
        "Wait, the arch is number 3. Final answer:\n"
        "Step1: Move block with index 3\nStep2: Move block with index 2",
        (3, 2),
    ),
    "the same list twice": (
        "```\nStep1: Move block with index 1\nStep2: Move block with index 2\n```\n\n"
        "```\nStep1: Move block with index 1\nStep2: Move block with index 2\n```",
        (1, 2),
    ),
    "a corrected structure": (
        "Left structure:\nStep1: Move block with index 1\n\n"
        "Corrected left structure:\nStep1: Move block with index 2",
        (2,),
    ),
    "two parts under headings": (
        "**Left structure**\nStep1: Move block with index 1\nStep2: Move block with index 2\n\n"
        "**Right structure**\nStep1: Move block with index 3\nStep2: Move block with index 1",
        (1, 2, 3, 1),
    ),
    "two equal parts under headings": (
        "Left tower:\nStep1: Move block with index 1\nRight tower:\nStep1: Move block with index 1",
        (1, 1),
    ),
    "two parts in two code blocks": (
        '```json\n{\n  "Step1": "Move block with index 1"\n}\n```\n\n'
        '```json\n{\n  "Step1": "Move block with index 2",\n  "Step2": "index 3"\n}\n```',
        (1, 2, 3),
    ),
    "two parts in labeled keys": (
        '{"Left structure: Step1": "Move block with index 1",\n'
        ' "Left structure: Step2": "Move block with index 2",\n'
        ' "Right structure: Step1": "Move block with index 3"}',
        (1, 2, 3),
    ),
    "an explanation after the plan": (
        '{\n  "Step1": "Move block with index 1",\n  "Step2": "Move block with index 7"\n}\n\n'
        "**Explanation of the steps:**\n\n* **Step 1:** The long block (index 1) is the base.\n"
        "* **Step 2:** Then comes the roof (index 9, seen from the left).",
        (1, 7),
    ),
    "an explanation in two parts": (
        "Step1: Move block with index 1\nStep2: Move block with index 7\n\nExplanation:\n"
        "Step 1: index 1 is the base.\n\nRight structure:\nStep 1: index 9 is the roof.",
        (1, 7),
    ),
    "headings that are called steps": (
        "### Step 1: Analyze\nThree blocks.\n### Step 2: Select\n- index 1\n- index 2\n"
        '### Step 3: Order\n```json\n{\n  "Step1": "Move block with index 2",\n'
        '  "Step2": "Move block with index 1"\n}\n```',
        (2, 1),
    ),
    "reasoning before the answer": (
        "<think>Step1: Move block with index 9\nStep2: Move block with index 8</think>\n"
        "Step1: Move block with index 4",
        (4,),
    ),
    "cut off in the list": (
        "Step1: Move block with index 3\nStep2: Move block with index 5\nStep3: Move block wi",
        (3, 5),
    ),
    "Chinese around it": (
        "好的，以下是组装顺序：\n步骤如下：\nStep1：Move block with index 3（红色拱形）\n"
        "Step2：Move block with index 4（蓝色立方体）\n完成。",
        (3, 4),
    ),
    "German around it": (
        "Hier ist die Reihenfolge der Blöcke:\n\nStep1: Move block with index 11\n"
        "Step2: Move block with index 2\n\nDamit steht das Haus.",
        (11, 2),
    ),
    "Windows line ends": (
        "Step1: Move block with index 3\r\nStep2: Move block with index 4\r\n",
        (3, 4),
    ),
}

OTHER_RULES = {
    "a numbered list": (
        "numbered",
        "1. Move block with index 10\n2. Move block with index 9\n3. Place block with index 4.",
        (10, 9, 4),
    ),
    "numbers and steps": (
        "steps",
        "1. **Step 1**: Move block with index 8.\n2. **Step 2**: Move block with index 4.",
        (8, 4),
    ),
    "numbered parts": (
        "numbered",
        "#### Structure 1:\n1. Move block with index 9\n2. Move block with index 6\n\n"
        "#### Structure 2:\n1. Move block with index 1\n2. Move block with index 7",
        (9, 6, 1, 7),
    ),
    "nested numbers": (
        "numbered",
        "1. Left structure\n   1. Move block with index 3\n   2. Move block with index 4\n"
        "2. Right structure\n   1. Move block with index 5\n",
        (3, 4, 5),
    ),
    "a numbered plan under headings that are called steps": (
        "numbered",
        "### Step 1: Analyze\nThe base is index 9.\n### Step 2: Plan\n"
        "1. Move block with index 9\n2. Move block with index 4\n3. Move block with index 2\n",
        (9, 4, 2),
    ),
    "an analysis list, then the plan": (
        "numbered",
        "1. Red arch: index 1\n2. Blue cube: index 5\n\nPlan:\n"
        "1. Move block with index 5\n2. Move block with index 1",
        (5, 1),
    ),
    "steps without the word index": (
        "steps",
        "Step1: Move block 13 (orange)\nStep2: Move block #2\nStep3: Add block 4 and 5",
        (13, 2, 4, 5),
    ),
    "steps that count blocks": (
        "steps",
        "Step1: Place 2 orange blocks, block 7 first\nStep2: Move block 3",
        (7, 3),
    ),
    "sentences": (
        "marked",
        "First, move block with index 3. Then place block with index 4 on it and finally put the "
        "block with index 9 on top.",
        (3, 4, 9),
    ),
    "bullets": ("marked", "- Move block with index 3\n- Move block with index 4", (3, 4)),
    "JSON objects on one line": (
        "json",
        '[{"step": 1, "action": "Move block with index 3"}, {"step": 2, "action": "move", '
        '"index": 5}]',
        (3, 5),
    ),
    "numbers without the word index": (
        "numbered",
        "1. Block 3 as the base\n2. Block 5 on top",
        (3, 5),
    ),
    "JSON objects": (
        "json",
        '[\n {"step": 1, "block_index": 3, "at": [0, 0, 1]},\n {"step": 2, "block_index": "5"}\n]',
        (3, 5),
    ),
    "an array": ("labeled", "The order is [3, 5, 5, 1].", (3, 5, 5, 1)),
    "an array in JSON": ("json", '```json\n{"plan": ["3", "5"]}\n```', (3, 5)),
    "arrays, the last one counts": ("labeled", "Maybe [1, 2]? No: [2, 1]", (2, 1)),
}

NOTHING = {
    "thoughts alone, for moves too": "<think>\nStep1: index 9\n</think>\n",
    "empty": "",
    "blank": " \n\t\n",
    "a refusal": "I'm sorry, but I can't help with identifying what is in these images.",
    "an analysis alone": "The structure has 5 blocks in 3 layers: two red arches, 2 blue cubes.",
    "steps without blocks": "Step 1: Look at the image.\nStep 2: Count the 4 blocks.",
    "a list without blocks": "1. Red arch\n2. Blue cube\n3. 2 green cuboids",
    "a loop": "1 yellow block, " * 400,
    "alternatives in words": "Either one of the arches would do as a base.",
}


JSON_LISTS = {
    *("JSON", "one-line JSON", "JSON keys with an underscore", "two parts in two code blocks"),
    *("two parts in labeled keys", "an explanation after the plan"),
    "headings that are called steps",
}
"""Step lists that are whole JSON, which is read by its keys."""


@pytest.mark.parametrize("name", STEP_LISTS)
def test_step_lists_are_read(name: str) -> None:
    text, plan = STEP_LISTS[name]
    parsed = parse_plan(text, N)
    assert (parsed.plan.steps, parsed.dropped) == (plan, ())
    other = "numbered" if name == "parentheses" else "steps"
    assert parsed.rule == ("json" if name in JSON_LISTS else other)


@pytest.mark.parametrize("name", OTHER_RULES)
def test_looser_forms_are_read_by_the_rule_that_is_named(name: str) -> None:
    rule, text, plan = OTHER_RULES[name]
    parsed = parse_plan(text, N)
    assert (parsed.plan.steps, parsed.rule, parsed.dropped) == (plan, rule, ())


@pytest.mark.parametrize("name", NOTHING)
@pytest.mark.parametrize("parser", ["steps", "official"])
def test_a_text_without_a_plan_is_a_parse_failure(name: str, parser: str) -> None:
    parsed = parse_plan(NOTHING[name], N, parser)  # type: ignore[arg-type]
    assert (parsed.plan.steps, parsed.rule, parsed.dropped) == ((), None, ())


def test_numbers_that_no_candidate_has_are_dropped_and_reported() -> None:
    text = "Step1: Move block with index 0\nStep2: index 3\nStep3: index 17\nStep4: index 16"
    parsed = parse_plan(text, N)
    assert (parsed.plan.steps, parsed.dropped) == ((3, 16), (0, 17))
    parsed = parse_plan(text, 3)
    assert (parsed.plan.steps, parsed.dropped) == ((3,), (0, 17, 16))


def test_a_plan_of_unknown_blocks_alone_is_no_parse_failure() -> None:
    parsed = parse_plan("Step1: Move block with index 99", N)
    assert (parsed.plan.steps, parsed.rule, parsed.dropped) == ((), "steps", (99,))


def test_the_official_rule_reads_every_mention_of_the_whole_text() -> None:
    text = (
        "<think>block with index 9</think> We need a block with index 2 and index 5.\n"
        "Step1: Move block with index 2\nStep2: Move Block with index 3\n"
        "Step3: Move block with index {4}\nStep4: Move block with index 44"
    )
    parsed = parse_plan(text, N, "official")
    assert (parsed.plan.steps, parsed.rule) == ((9, 2, 2), "block_with_index")
    assert parsed.dropped == (44,)
