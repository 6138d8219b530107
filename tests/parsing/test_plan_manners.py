"""Plans in the manners of today's models, and what is no plan although it looks like one.

Every reply was written for this table; none is a recorded one.
"""

# ruff: noqa: E501, RUF001 -- replies are long and come in other scripts

from __future__ import annotations

import pytest

from phyblock.parsing import parse_plan

Row = tuple[str, tuple[int, ...]]

JSON: list[Row] = [
    ('{"plan":[3,5,12],"unused":[1,2,4,6,7]}', (3, 5, 12)),
    ('{"unused":[1,2,4],"plan":[3,5,12]}', (3, 5, 12)),
    ('{"layer1":[3,4],"layer2":[12],"layer3":[5,7]}', (3, 4, 12, 5, 7)),
    ('{"layer2":[12],"layer1":[3,4]}', (3, 4, 12)),
    ('{"bottom_layer":[3,4],"middle_layer":[12],"top_layer":[5]}', (3, 4, 12, 5)),
    ('{"top":[5],"middle":[12],"bottom":[3,4]}', (3, 4, 12, 5)),
    ('{"sequence": [8, 8, 2]}', (8, 8, 2)),
    ('{"order": ["3", "5", "12"]}', (3, 5, 12)),
    ('{"steps": [{"step": 1, "block": 3}, {"step": 2, "block": 5}]}', (3, 5)),
    ('{"steps": [{"step": 2, "block": 5}, {"step": 1, "block": 3}]}', (3, 5)),
    ('{"steps": ["Move block with index 3", "Move block with index 5 onto block with index 3"]}', (3, 5)),
    ('[{"action": "place", "block_id": 4}, {"action": "place", "block_id": 9}]', (4, 9)),
    ('{"plan": [{"layer": 1, "blocks": [3, 4]}, {"layer": 2, "blocks": [12]}]}', (3, 4, 12)),
    ('{"plan": [{"block": 6, "count": 2}, {"block": 1, "count": 1}]}', (6, 6, 1)),
    ('{"reasoning": "block 1 and block 2 are distractors", "plan": [3, 5]}', (3, 5)),
    ('{"candidates": [1, 2, 3, 4, 5, 6], "answer": [2, 6]}', (2, 6)),
    ('{"answer": {"Step1": "Move block with index 7", "Step2": "Move block with index 2"}}', (7, 2)),
    ('{"Step1": "Move(3)", "Step2": "Move(5)"}', (3, 5)),
    ('{"Step1": 3, "Step2": 5, "Step3": 5}', (3, 5, 5)),
    ('{"1": 3, "2": 5, "3": 12}', (3, 5, 12)),
    ("{'plan': [3, 5, 12]}", (3, 5, 12)),
    ('{"plan": [3, 5, 12,],}', (3, 5, 12)),
    ('```json\n{\n  "blocks_needed": [1, 2, 3],\n  "assembly_order": [3, 1, 2]\n}\n```', (3, 1, 2)),
    ('{"Structure1_Step1": "Move block with index 3", "Structure1_Step2": "Move block with index 5", "Structure2_Step1": "Move block with index 9"}', (3, 5, 9)),
    ('{"Structure 1": {"Step1": "Move block with index 3", "Step2": "Move block with index 4"}, "Structure 2": {"Step1": "Move block with index 5"}}', (3, 4, 5)),
    ('{"distractors": [1, 2], "plan": {"left": [3, 5], "right": [9]}}', (3, 5, 9)),
    ('Draft: {"plan": [1, 2]}\n\nThat misses the roof. Final: {"plan": [1, 2, 14]}', (1, 2, 14)),
    ('{"plan_a": [3, 5], "plan_b": [5, 3], "chosen": "plan_a"}', (3, 5)),
    ('{"final_plan": [4, 4, 11], "initial_plan": [4, 11]}', (4, 4, 11)),
    ('{"plan": "3, 5, 12"}', (3, 5, 12)),
    ('{"plan": "Step1: Move block with index 3\\nStep2: Move block with index 5"}', (3, 5)),
    ('{"moves": ["Move(3)", "Move(5)"], "done": true}', (3, 5)),
    ('[3, 5, 12]', (3, 5, 12)),
    ('{"计划": [3, 5, 12]}', (3, 5, 12)),
    ('{"reverse": false, "plan": [3, 5, 7]}', (3, 5, 7)),
    ('{"is_reversed": false, "plan": [3, 5, 7]}', (3, 5, 7)),
    ('{"reversed": null, "plan": [3, 5, 7]}', (3, 5, 7)),
    ('{"reversed": "no", "plan": [3, 5, 7]}', (3, 5, 7)),
    ('{"top_down": 0, "plan": [3, 5, 7]}', (3, 5, 7)),
    ('{"order": "not reversed", "plan": [3, 5, 7]}', (3, 5, 7)),
    ('{"note": "Do not build it in reverse order", "plan": [3, 5, 7]}', (3, 5, 7)),
    ('{"reverse_order": true, "plan": [3, 5, 7]}', (7, 5, 3)),
    ('{"reversed": "Yes.", "plan": [3, 5, 7]}', (7, 5, 3)),
    ('{"top_to_bottom": [3, 5, 7]}', (7, 5, 3)),
]  # fmt: skip

FRAMES: list[Row] = [
    ("Final answer: 3, 5, 12", (3, 5, 12)),
    ("**Final Answer:** 3, 5, 12", (3, 5, 12)),
    ("Final answer: [3, 5, 12]", (3, 5, 12)),
    ("Final answer: 3 -> 5 -> 12", (3, 5, 12)),
    ("The base needs block 1 or block 2.\n\nAnswer: 3, 5", (3, 5)),
    (r"The plan is \boxed{3, 5, 12}.", (3, 5, 12)),
    (r"$\boxed{3 \rightarrow 5 \rightarrow 12}$", (3, 5, 12)),
    (r"\boxed{[3, 5]}", (3, 5)),
    ("<answer>3, 5, 12</answer>", (3, 5, 12)),
    ("<answer>[3, 5, 12]</answer>", (3, 5, 12)),
    ("<answer>\nStep1: Move block with index 3\nStep2: Move block with index 5\n</answer>", (3, 5)),
    ("<think>blocks 1, 2?</think><answer>3 5 12</answer>", (3, 5, 12)),
    ('<answer>{"plan": [3, 5]}</answer>', (3, 5)),
    ("Step1: Move block with index 1\n\nWait, that is the wrong arch.\n\n<answer>2, 5</answer>", (2, 5)),
    ("Order: 3, 5, 12", (3, 5, 12)),
    ("Assembly order: 3 → 5 → 12", (3, 5, 12)),
    ("The sequence is 3, 5, 12.", (3, 5, 12)),
    ("Build order = [3, 5, 5]", (3, 5, 5)),
    ("Plan: block 3, block 5, block 12", (3, 5, 12)),
    ("3, 5, 12", (3, 5, 12)),
    ("3 → 5 → 12", (3, 5, 12)),
    ("Candidates needed: 3, 5, 12\nOrder: 12, 3, 5", (12, 3, 5)),
    ("**Plan**\n3, 5, 12", (3, 5, 12)),
]  # fmt: skip

CALLS: list[Row] = [
    ("Move(3)\nMove(5)\nMove(12)", (3, 5, 12)),
    ("Move(3), Move(5), Move(12)", (3, 5, 12)),
    ("Move(3) -> Move(5) -> Done", (3, 5)),
    ("```python\nmove(3)\nmove(5)\n```", (3, 5)),
    ("1. Move(3)\n2. Move(5)\n3. Done", (3, 5)),
    ("Step 1: Move(3)\nStep 2: Move(5)", (3, 5)),
    ("place_block(3)\nplace_block(5)", (3, 5)),
    ("robot.place(block=3)\nrobot.place(block=5)", (3, 5)),
    ("- Move(7)\n- Move(7)\n- Move(2)", (7, 7, 2)),
]  # fmt: skip

TABLES: list[Row] = [
    ("| Step | Block |\n|---|---|\n| 1 | 3 |\n| 2 | 5 |\n| 3 | 12 |", (3, 5, 12)),
    ("| Step | Action | Index |\n|:--|:--|--:|\n| 1 | Place base | 3 |\n| 2 | Place roof | 5 |", (3, 5)),
    ("| # | Move | Reason |\n|---|---|---|\n| 1 | Move block with index 3 | base |\n| 2 | Move block with index 5 | rests on block 3 |", (3, 5)),
    ("| Order | Block index | Times |\n|---|---|---|\n| 1 | 6 | 2 |\n| 2 | 1 | 1 |", (6, 6, 1)),
    ("| Index | Shape | Color |\n|---|---|---|\n| 1 | arch | red |\n| 2 | cube | blue |\n\nStep1: Move block with index 2\nStep2: Move block with index 1", (2, 1)),
    ("Step | Block\n--- | ---\n1 | 9\n2 | 4", (9, 4)),
    ("| Schritt | Baustein |\n|---|---|\n| 1 | 3 |\n| 2 | 5 |", (3, 5)),
    ("| 步骤 | 积木编号 |\n|---|---|\n| 1 | 3 |\n| 2 | 5 |", (3, 5)),
    ("| Step | Block | Supports |\n|---|---|---|\n| 1 | **3** (red arch) | ground |\n| 2 | **5** (cube) | 3 |", (3, 5)),
]  # fmt: skip

STATEMENTS: list[Row] = [
    ("Step1: On top of block with index 3, move block with index 5", (5,)),
    ("Step 1: Place block 3.\nStep 2: On top of block 3, place block 5.", (3, 5)),
    ("1. Move block 3\n2. Next to block 3, move block 4\n3. Across blocks 3 and 4, move block 9", (3, 4, 9)),
    ("Step 1: Move block 6 (x2)\nStep 2: Move block 1", (6, 6, 1)),
    ("Step 1: Move block with index 6 x3\nStep 2: Move block with index 1", (6, 6, 6, 1)),
    ("1. Move block 6 twice\n2. Move block 1", (6, 6, 1)),
    ("1. Move block 6 (3 times)\n2. Move block 1", (6, 6, 6, 1)),
    ("Step 1: Move 2x block #6\nStep 2: Move block #1", (6, 6, 1)),
    ("Step 1: Move two blocks with index 6\nStep 2: Move block with index 1", (6, 6, 1)),
    ("Step 1: Move blocks 1-4\nStep 2: Move block 9", (1, 2, 3, 4, 9)),
    ("Step 1: Move blocks 1 to 4\nStep 2: Move block 9", (1, 2, 3, 4, 9)),
    ("Step 1: Move blocks 1 through 3", (1, 2, 3)),
    ("Step 1: Move blocks with indices 5–7", (5, 6, 7)),
    ("Step 1: Move block 3 and block 4\nStep 2: Move block 9", (3, 4, 9)),
    ("Step 1: Move block 3, then move block 4 on top of it\nStep 2: Move block 9", (3, 4, 9)),
    ("Step 1: Move the red arch (index 3)\nStep 2: Move the blue cube (index 5) onto the arch (index 3)", (3, 5)),
    ("Step 1: Move block 5 instead of block 6\nStep 2: Move block 2, not block 1", (5, 2)),
    ("Step 1: Do not use block 4; move block 5\nStep 2: Move block 2", (5, 2)),
    ("Step 1: Move ~~block 4~~ block 5\nStep 2: Move block 2", (5, 2)),
    ("Step 1: Block 3 is placed on the ground\nStep 2: Block 5 is placed on block 3", (3, 5)),
    ("Step 1: 3\nStep 2: 5\nStep 3: 12", (3, 5, 12)),
    ("Step 1: #3\nStep 2: #5", (3, 5)),
    ("Step 1 → block 3\nStep 2 → block 5", (3, 5)),
    ("Step 1. Move block 3. Step 2. Move block 5. Step 3. Move block 12.", (3, 5, 12)),
    ("Step 1: Move block 3; Step 2: Move block 5", (3, 5)),
    ("1. Move block 3 2. Move block 5 3. Move block 12", (3, 5, 12)),
    ("1) block 3\n2) block 5\n3) block 12", (3, 5, 12)),
    ("First, place block 3. Then place block 5 on block 3. Finally, put block 12 on top.", (3, 5, 12)),
    ("Start with block 3, then add block 5, and finish by placing block 12 on block 5.", (3, 5, 12)),
    ("Step 1: Place block 9 at (0, 0, 1)\nStep 2: Place block 4 at (0, 0, 3), rotated by 90 degrees", (9, 4)),
    ("Step 1: Move block three\nStep 2: Move block twelve", (3, 12)),
    ("Step 1: Move block with index 3 (2 cm above block 5)\nStep 2: Move block with index 5", (3, 5)),
    ("Step 1: Use block 3 as the base\nStep 2: Use block 5 as the roof, supported by block 3", (3, 5)),
    ("Step 1: Move block 3 to the left\nStep 2: Move block 3 to the right\nStep 3: Move block 9 across blocks 3 and 3", (3, 3, 9)),
]  # fmt: skip

HEADINGS: list[Row] = [
    ("Structure1_Step1: Move block with index 3\nStructure1_Step2: Move block with index 5\nStructure2_Step1: Move block with index 9\nStructure2_Step2: Move block with index 4", (3, 5, 9, 4)),
    ("1. **Step 1:**\n   - Move block with index 3.\n   - Move block with index 4.\n2. **Step 2:**\n   - Move block with index 9.\n   - Move block with index 9.", (3, 4, 9, 9)),
    ("**Step 1: Base**\n- Move block 3\n- Move block 4\n\n**Step 2: Roof**\n- Move block 9", (3, 4, 9)),
    ("### Layer 1\n1. Move block 3\n2. Move block 4\n### Layer 2\n1. Move block 9", (3, 4, 9)),
    ("### Step 1: Ground\n1. Move block 3\n2. Move block 4\n### Step 2: Top\n1. Move block 9", (3, 4, 9)),
    ("Assembly order:\n- Layer 1: 3, 4\n- Layer 2: 12\n- Layer 3: 5", (3, 4, 12, 5)),
    ("**Left tower**\n```\nStep1: Move block with index 3\nStep2: Move block with index 5\n```\n**Right tower**\n```\nStep1: Move block with index 3\n```", (3, 5, 3)),
    ("1. Left part:\n   a) Move block 3\n   b) Move block 5\n2. Right part:\n   a) Move block 9", (3, 5, 9)),
    ("Step 1: Lay the base\n  * Block: 3\n  * Position: ground\nStep 2: Add the roof\n  * Block: 5\n  * Position: on block 3", (3, 5)),
]  # fmt: skip

REPEATED: list[Row] = [
    ("### Order\n1. Move block with index 3\n2. Move block with index 5\n3. Move block with index 9\n\n### Final instructions\n```json\n{\n \"Step1\": \"Move block with index 3\",\n \"Step2\": \"Move bl", (3, 5, 9)),
    ("Step1: Move block with index 3\nStep2: Move block with index 5\n\nAgain, as JSON:\n{\"Step1\": \"Move block with index 3\", \"Step2\": \"Mo", (3, 5)),
    ("Step1: Move block with index 1\nStep2: Move block with index 2\n\nHmm, block 1 is turned. Corrected plan:\nStep1: Move block with index 4\nStep2: Move block with index 2", (4, 2)),
    ("Plan:\n1. Move block 3\n2. Move block 5\n\nExplanation:\n1. Block 3 is the base.\n2. Block 5 rests on block 3.", (3, 5)),
    ("Step1: Move block with index 3\nStep2: Move block with index 5\n\nThe plan follows the picture:\n- First, place the arch (index 3)\n- Then, place the cube (index 5)", (3, 5)),
    ("Step1: Move block with index 3\nStep2: Move block with index 5\n\nUnused candidates: 1, 2, 4, 6", (3, 5)),
    ("Step1: Move block with index 3\nStep2: Move block with index 5\n\nBlocks not used:\n- Block 1\n- Block 2", (3, 5)),
    ("Candidates:\n1. Block 1: red arch\n2. Block 2: blue cube\n3. Block 3: green cube\n\nPlan:\nStep1: Move block with index 3\nStep2: Move block with index 1", (3, 1)),
    ("Example output:\nStep1: Move block with index 7\nStep2: Move block with index 8\n\nMy plan:\nStep1: Move block with index 3\nStep2: Move block with index 5", (3, 5)),
    ("My plan:\nStep1: Move block with index 3\nStep2: Move block with index 5\n\n(It follows the example:\nStep1: Move block with index 7)", (3, 5)),
]  # fmt: skip

CHOSEN: list[Row] = [
    ("Plan A:\n1. Move block 3\n2. Move block 5\n\nPlan B:\n1. Move block 5\n2. Move block 3\n\nI choose Plan A.", (3, 5)),
    ("Plan A:\n1. Move block 3\n2. Move block 5\n\nPlan B:\n1. Move block 5\n2. Move block 3\n\nPlan B is better.", (5, 3)),
    ("Option 1:\nStep1: Move block with index 3\n\nOption 2:\nStep1: Move block with index 4\n\nI go with option 1.", (3,)),
    ("**Plan A**\n- Move block 3\n- Move block 5\n\n**Plan B**\n- Move block 9\n\nFinal decision: Plan A", (3, 5)),
    ("Lösung A:\n1. Bewege Block 3\n2. Bewege Block 5\n\nLösung B:\n1. Bewege Block 5\n\nIch wähle Lösung A.", (3, 5)),
]  # fmt: skip

REVERSED: list[Row] = [
    ("Listed from top to bottom; build in reverse:\n1. Block 12\n2. Block 5\n3. Block 3", (3, 5, 12)),
    ("1. Block 12\n2. Block 5\n3. Block 3\n\nThe steps above are listed top to bottom, so build in reverse order.", (3, 5, 12)),
    ("Blocks, from top to bottom: 12, 5, 3. Build them in reverse order.", (3, 5, 12)),
    ("In reverse order (last to first):\nStep1: Move block with index 9\nStep2: Move block with index 4", (4, 9)),
    ("Die Schritte stehen in umgekehrter Reihenfolge:\n1. Bewege Block 9\n2. Bewege Block 4", (4, 9)),
    ("I looked at the picture from top to bottom.\n\nStep1: Move block with index 9\nStep2: Move block with index 4", (9, 4)),
    ("Do not build it in reverse order:\nStep1: Move block with index 9\nStep2: Move block with index 4", (9, 4)),
]  # fmt: skip

LANGUAGES: list[Row] = [
    ("Schritt 1: Bewege Block 3\nSchritt 2: Lege Block 5 auf Block 3\nSchritt 3: Setze Block 12 auf Block 5", (3, 5, 12)),
    ("Schritt 1: Block mit Index 3\nSchritt 2: Block mit Index 5", (3, 5)),
    ("1. Block Nr. 3 auf den Boden legen\n2. Block Nr. 5 auf Block Nr. 3 legen", (3, 5)),
    ("Zuerst Block drei bewegen:\nSchritt 1: Block drei\nSchritt 2: Block fünf", (3, 5)),
    ("Reihenfolge: 3, 5, 12", (3, 5, 12)),
    ("Antwort: 3, 5, 12", (3, 5, 12)),
    ("步骤1：移动积木3\n步骤2：将积木5放在积木3上\n步骤3：移动积木12", (3, 5, 12)),
    ("第1步：放置3号积木\n第2步：放置5号积木", (3, 5)),
    ("1. 移动编号3的积木\n2. 移动编号5的积木", (3, 5)),
    ("顺序：3、5、12", (3, 5, 12)),
    ("最终答案：3, 5, 12", (3, 5, 12)),
    ("Étape 1 : Placez le bloc 3\nÉtape 2 : Placez le bloc 5 sur le bloc 3", (3, 5)),
    ("Paso 1: Mueve el bloque 3\nPaso 2: Coloca el bloque 5 sobre el bloque 3", (3, 5)),
    ("Passo 1: Mova o bloco 3\nPasso 2: Coloque o bloco 5", (3, 5)),
    ("Шаг 1: Переместить блок 3\nШаг 2: Поставить блок 5 на блок 3", (3, 5)),
    ("ステップ1: ブロック3を置く\nステップ2: ブロック5を置く", (3, 5)),
    ("Ordre : 3, 5, 12", (3, 5, 12)),
    ("Orden: 3, 5, 12", (3, 5, 12)),
]  # fmt: skip

FAILURES: list[tuple[str, str]] = [
    ("", "empty"),
    ("  \n", "empty"),
    ("<think>Step1: Move block with index 3\nStep2: Move block with index 5", "thoughts_only"),
    ("<think>\nStep1: Move block with index 3\n</think>", "thoughts_only"),
    ("<thinking>First I try:\nStep1: Move block with index 9\nbut", "thoughts_only"),
    ("I'm sorry, I can't determine the plan. I can see blocks 3, 5 and 12.", "refusal"),
    ("I cannot build this. The candidates are:\n1. Block 1: red arch\n2. Block 2: blue cube\n3. Block 3: green cube", "refusal"),
    ("I'm unable to view the image. A plan could look like this:\nStep1: Move block with index 1\nStep2: Move block with index 2", "refusal"),
    ("Es tut mir leid, ich kann das nicht bestimmen. Block 3 und Block 5 sind rot.", "refusal"),
    ("抱歉，我无法确定。图中有积木3和积木5。", "refusal"),
    ("1. **Block 1:**\n   - Index: 1\n   - Shape: cube\n   - Color: red\n2. **Block 2:**\n   - Index: 2\n   - Shape: arch\n   - Color: blue\n3. **Block 3:**\n   - Index: 3\n   - Sha", "catalogue"),
    ("1. **Block 1:** red cube\n2. **Block 2:** blue arch\n3. **Block 3:** green cube", "catalogue"),
    ("### Block dictionary\n- Block 1: red cube\n- Block 2: blue arch\n- Block 3: yellow roof", "catalogue"),
    ("### Required blocks\n- Red arch: Index 3\n- Blue cube: Index 5", "catalogue"),
    ("Required blocks: 3, 5, 12", "catalogue"),
    ("Unused: 1, 2, 4", "catalogue"),
    ("| Index | Shape | Color |\n|---|---|---|\n| 1 | arch | red |\n| 2 | cube | blue |", "catalogue"),
    ('[{"index": 1, "shape": "cube", "color": "red"}, {"index": 2, "shape": "arch", "color": "blue"}]', "catalogue"),
    ('{"unused": [1, 2, 4]}', "catalogue"),
    ('{"distractors": [1, 2], "n_blocks": 5}', "catalogue"),
    ("Plan A:\n1. Move block 3\n2. Move block 5\n\nPlan B:\n1. Move block 5\n2. Move block 3", "two_plans"),
    ("Option 1:\nStep1: Move block with index 3\n\nOption 2:\nStep1: Move block with index 4\n\nBoth would stand.", "two_plans"),
    ("Step1: Move block with index 3\nStep2: Move block with index 5\n\nor\n\nStep1: Move block with index 5\nStep2: Move block with index 3", "two_plans"),
    ('{"plan_a": [3, 5], "plan_b": [5, 3]}', "catalogue"),
    ("The structure has 5 blocks in 3 layers.", "no_plan"),
    ("Step 1: Look at the picture.\nStep 2: Count the blocks.", "no_plan"),
    ("For example:\nStep1: Move block with index 7\nStep2: Move block with index 8", "catalogue"),
    ("Move N blocks.", "no_plan"),
    ("4", "catalogue"),
    ("null", "no_plan"),
]  # fmt: skip

READ = [*JSON, *FRAMES, *CALLS, *TABLES, *STATEMENTS, *HEADINGS, *REPEATED, *CHOSEN, *REVERSED, *LANGUAGES]  # fmt: skip


def test_there_are_replies_enough() -> None:
    texts = [text for text, _ in [*READ, *FAILURES]]
    assert len(set(texts)) == len(texts) >= 150


@pytest.mark.parametrize(("text", "plan"), READ)
def test_a_plan_is_read_as_it_is_meant(text: str, plan: tuple[int, ...]) -> None:
    parsed = parse_plan(text, 16)
    assert (parsed.plan.steps, parsed.problem) == (plan, None)


@pytest.mark.parametrize(("text", "problem"), FAILURES)
def test_what_is_no_plan_is_a_failure_with_its_name(text: str, problem: str) -> None:
    parsed = parse_plan(text, 16)
    assert (parsed.plan.steps, parsed.rule, parsed.problem) == ((), None, problem)
