"""Plans that are hard to read, and texts that only look like plans. All were written for this table."""

# ruff: noqa: E501, RUF001 -- replies are long and come in other scripts

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.parsing import parse_plan

PLANS: list[tuple[str, tuple[int, ...]]] = [
    ('Step 1: I would move block 3 first, because block 5 rests on it.\nStep 2: Then block 5 follows.', (3, 5)),
    ('The answer is: block 3, then block 5, then block 12.', (3, 5, 12)),
    ('Top layer: [12]\nMiddle: [9]\nBottom: [3, 4]', (3, 4, 9, 12)),
    ('**Step 1** – `Move block with index 3`\n**Step 2** – `Move block with index 5`', (3, 5)),
    ('Plan (5 steps): 3, 5, 12, 1, 1', (3, 5, 12, 1, 1)),
    ('1. Block 3 ×2\n2. Block 5', (3, 3, 5)),
    ('Steps:\n3\n5\n12', (3, 5, 12)),
    ('```\n3\n5\n12\n```', (3, 5, 12)),
    ('<plan><step>3</step><step>5</step></plan>', (3, 5)),
    ('<step id="1">Move block with index 3</step>\n<step id="2">Move block with index 5</step>', (3, 5)),
    ('plan:\n  - 3\n  - 5\n  - 12', (3, 5, 12)),
    ('steps:\n- block: 3\n- block: 5', (3, 5)),
    ('(1) Move block 3 (2) Move block 5', (3, 5)),
    ('Block order is 3 then 5 then 12.', (3, 5, 12)),
    ('Move blocks 3, 5 and 12, in this order.', (3, 5, 12)),
    ('Step 1: Move block with index 3 -> Step 2: Move block with index 5', (3, 5)),
    ('Steps 1-3: Move block 6\nStep 4: Move block 1', (6, 6, 6, 1)),
    ('You asked for "Step1: Move block with index N".\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('Step1: Move block with index 3\nStep2: Move block with index 5\n\nMy final plan is the same as above.', (3, 5)),
    ('Step1: Move block with index 3\nStep2: Move block with index 5\n\nCheck: block 3 supports block 5; block 12 is not needed.', (3, 5)),
    ('1. Move block 3\n2. Move block 4\n3. Move block 9\n\nVerification:\n1. Block 9 is placed on block 3 and block 4: stable.', (3, 4, 9)),
    ('Step1: Move block with index 3\nStep2: Move block with index 5\n\nConfidence: 80', (3, 5)),
    ('Step1: Move block with index 3\nStep2: Move block with index 5\n\nTotal blocks: 2', (3, 5)),
    ('Total steps: 2\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('Here is the plan.\n\nStep1: Move block with index 3\nStep2: Move block with index 5\n\nNote: block 7 could replace block 5.', (3, 5)),
    ('## Plan\n\n1. **Block 3** – red arch, ground\n2. **Block 5** – blue cube on block 3\n3. **Block 12** – roof', (3, 5, 12)),
    ('## Placement order\n- Block 3\n- Block 5\n- Block 12', (3, 5, 12)),
    ('Sorry, I made a mistake above. Corrected:\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ("I can't see the back, but this is my best plan:\nStep1: Move block with index 3\nStep2: Move block with index 5", (3, 5)),
    ('I am not able to rotate blocks, so:\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('{"plan": [3, 5], "alternatives": [[5, 3]]}', (3, 5)),
    ('{"thought": "use [1,2]?", "plan": [3,5]}', (3, 5)),
    ('{"plan":[{"step":1,"index":3,"position":[0,0,1]},{"step":2,"index":5,"position":[0,0,2]}]}', (3, 5)),
    ('{"result": {"sequence": [{"id": 3}, {"id": 5}]}}', (3, 5)),
    ('{"assembly": {"layer_1": ["block 3", "block 4"], "layer_2": ["block 9"]}}', (3, 4, 9)),
    ('```json\n[{"step":1,"move":"block 3"},{"step":2,"move":"block 5"}]\n```', (3, 5)),
    ('{"Step 1": {"block": 3, "on": "ground"}, "Step 2": {"block": 5, "on": 3}}', (3, 5)),
    ('{"actions":[{"type":"place","block":3},{"type":"place","block":5}]}', (3, 5)),
    ('{"plan":[3,5]}\n\nwhere block 3 is the arch and block 5 the cube.', (3, 5)),
    ('Draft plan: 1, 2, 3\nFinal plan: 3, 2, 1', (3, 2, 1)),
    ('Order: 1, 2, 3\n\nActually block 2 goes first. Order: 2, 1, 3', (2, 1, 3)),
    ('Plan A: 3, 5\nPlan B: 5, 3\nI prefer plan B.', (5, 3)),
    ('Step1: Move block with index 3\nStep2: Move block with index 5\nStep3: Move block with index 5 again\nStep4: Done', (3, 5, 5)),
    ('Step 1: Place block 3 (index 3) on the table\nStep 2: Place block 5 (index 5) on block 3', (3, 5)),
    ('Step 1: Select block 3\nStep 2: Select block 5', (3, 5)),
    ('Step 1 (base): block 3\nStep 2 (roof): block 5', (3, 5)),
    ('S1: Move block with index 3\nS2: Move block with index 5', (3, 5)),
    ('Step one: Move block with index 3\nStep two: Move block with index 5', (3, 5)),
    ('1 - Move block 3\n2 - Move block 5', (3, 5)),
    ('1: 3\n2: 5\n3: 12', (3, 5, 12)),
    ('Move block with index 3.\n\nMove block with index 5.\n\nMove block with index 12.', (3, 5, 12)),
    ('Place the red arch (3), the blue cube (5) and the roof (12).', (3, 5, 12)),
    ('The bottom is block 3, block 5 stands on it and block 12 is the roof.\n\nStep1: Move block with index 3\nStep2: Move block with index 5\nStep3: Move block with index 12', (3, 5, 12)),
    ('<tool_call>{"name": "submit_plan", "arguments": {"plan": [3, 5]}}</tool_call>', (3, 5)),
    ('The final answer is $\\boxed{3,5,12}$', (3, 5, 12)),
    ('Let $x$ be. \\boxed{\\text{3, 5, 12}}', (3, 5, 12)),
    ('Antwort:\n1. Block 3\n2. Block 5', (3, 5)),
    ('Wir brauchen die Blöcke 1, 3 und 5.\nReihenfolge: 5, 3, 1', (5, 3, 1)),
    ('最终方案：\n1. 积木3\n2. 积木5\n3. 积木12', (3, 5, 12)),
    ('首先放置积木3，然后放置积木5，最后放置积木12。', (3, 5, 12)),
    ("D'abord le bloc 3, puis le bloc 5.", (3, 5)),
    ('Order from bottom to top: 3, 5, 12', (3, 5, 12)),
    ('From bottom to top:\n- block 3\n- block 5\n- block 12', (3, 5, 12)),
    ('From top to bottom: block 12, block 5, block 3. So the building order is the reverse.', (3, 5, 12)),
    ('The steps in order:\nStep1: Move block with index 3\nStep2: Move block with index 5\nTo take it apart, follow the steps in reverse.', (3, 5)),
    ('Do not place block 7.\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('Step1: Move block with index 3\nStep2: Move block with index 17\nStep3: Move block with index 5', (3, 5)),
    ('Step1: Remove block 4\nStep2: Move block with index 5', (5,)),
    ('In the example of the prompt, block 7 comes first. Here:\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('Step1: Move block with index 3 [or 4 if 3 is taken]\nStep2: Move block with index 5', (3, 5)),
    ('Candidates 1-16 are shown. I use 3 blocks.\n1. Block 3\n2. Block 5\n3. Block 12', (3, 5, 12)),
    ('The structure has 3 layers.\nLayer 1: 2 blocks\nLayer 2: 1 block\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('Sequence of indices: 3-5-12-1', (3, 5, 12, 1)),
    ('Sequence: 3 | 5 | 12', (3, 5, 12)),
    ('Answer: Step 1: 3, Step 2: 5, Step 3: 12', (3, 5, 12)),
    ('1st: block 3\n2nd: block 5\n3rd: block 12', (3, 5, 12)),
    ('① Move block 3\n② Move block 5', (3, 5)),
    ('a) Move block 3\nb) Move block 5', (3, 5)),
    ('I. Move block 3\nII. Move block 5', (3, 5)),
    ('* **Move block with index 3** – the base.\n* **Move block with index 5** – rests on block 3.', (3, 5)),
    ('Step1: Move block with index 3\n\n(then wait)\n\nStep2: Move block with index 5', (3, 5)),
    ('Step 1: Move block with index 3 (not index 4, which is turned)\nStep 2: Move block with index 5', (3, 5)),
    ('Step 1: Take block 3 and put it on the ground\nStep 2: Take block 5 and put it on block 3', (3, 5)),
    ('Step 1: Put block 3 down.\nStep 2: Put block 5 down next to it.\nStep 3: Bridge blocks 3 and 5 with block 9.', (3, 5, 9)),
    ('Step 1: Move block 3\nStep 2: Stack on it block 5', (3, 5)),
    ('Step 1: block 3 -> ground\nStep 2: block 5 -> on block 3', (3, 5)),
    ('Step 1: block_3\nStep 2: block_5', (3, 5)),
    ('Step 1: [3]\nStep 2: [5]', (3, 5)),
    ('Step 1: Move {block: 3}\nStep 2: Move {block: 5}', (3, 5)),
    ('Step 1: Move block with index=3\nStep 2: Move block with index=5', (3, 5)),
    ('Step1:Move block with index3\nStep2:Move block with index5', (3, 5)),
    ('step 1 move block with index 3\nstep 2 move block with index 5', (3, 5)),
    ('STEP 1: MOVE BLOCK WITH INDEX 3\nSTEP 2: MOVE BLOCK WITH INDEX 5', (3, 5)),
    ('Step 1 : Move block with index 3 .\nStep 2 : Move block with index 5 .', (3, 5)),
    ('Step 01: Move block with index 03\nStep 02: Move block with index 05', (3, 5)),
    ('Step 1/2: Move block with index 3\nStep 2/2: Move block with index 5', (3, 5)),
    ('Step 10: Move block with index 3\nStep 20: Move block with index 5', (3, 5)),
    ('Step1: Move block with index 3\nStep2: Move block with index 5\nStep4: Move block with index 9', (3, 5, 9)),
    ('Phase 1: Move blocks 3 and 4.\nPhase 2: Move block 9.', (3, 4, 9)),
    ('Layer 1 (bottom): [3, 4]\nLayer 2: [9]\nLayer 3 (top): [12]', (3, 4, 9, 12)),
    ('The plan: first the two cylinders (7 and 8), then the bar (9), then the roof (14).', (7, 8, 9, 14)),
    ('The goal has 4 blocks, so 4 steps: 3, 5, 9, 12.', (3, 5, 9, 12)),
    ('Plan = 3,5,9,12', (3, 5, 9, 12)),
    ('**3 → 5 → 9 → 12**', (3, 5, 9, 12)),
    ('Build order (bottom to top): **3**, **5**, **9**', (3, 5, 9)),
    ('```\n3, 5, 9\n```', (3, 5, 9)),
    ('So the answer is [3, 5, 9].', (3, 5, 9)),
    ('Blocks used: 3, 5, 9\nPlan: 9, 5, 3', (9, 5, 3)),
    ('Plan: 9, 5, 3\nBlocks used: 3, 5, 9', (9, 5, 3)),
    ('Plan: 9, 5, 3\nNot used: 1, 2', (9, 5, 3)),
    ('Distractors: 1, 2, 4\nPlan: 9, 5', (9, 5)),
    ("I'll skip blocks 1 and 2.\nPlan: 9, 5", (9, 5)),
    ('Plan: 9, 5 (blocks 1 and 2 are distractors)', (9, 5)),
    ('We could start with 5, 3, but that falls. Plan: 3, 5', (3, 5)),
    ('Plan: 3, 5\n\nA wrong plan would be: 5, 3', (3, 5)),
    ('Incorrect: 5, 3\nCorrect: 3, 5', (3, 5)),
    ('Attempt 1: 5, 3 (falls)\nAttempt 2: 3, 5 (stands)', (3, 5)),
    ('Plan 1:\nStep1: Move block with index 3\nStep2: Move block with index 5\n\nPlan 2:\nStep1: Move block with index 9\n\nPlan 1 is the better one.', (3, 5)),
    ('Version A\nStep1: Move block with index 3\nStep2: Move block with index 5\nVersion B\nStep1: Move block with index 9\n\nI submit version A', (3, 5)),
    ('# House 1\nStep1: Move block with index 3\nStep2: Move block with index 5\n# House 2\nStep1: Move block with index 9', (3, 5, 9)),
    ('{"plan":[3,5,12],"not_used":[1,2,4]}', (3, 5, 12)),
    ('{"used":[3,5],"unused":[1,2]}', (3, 5)),
    ('{"rejected_plan":[1,2],"final_answer":[3,5]}', (3, 5)),
    ('{"plan":{"unused":[1],"sequence":[3,5]}}', (3, 5)),
    ('{"goal_blocks": 3, "answer": "3 -> 5 -> 12"}', (3, 5, 12)),
    ('{"step_1":{"action":"place","block":3},"step_2":{"action":"place","block":5}}', (3, 5)),
    ('{"layers":[[3,4],[12],[5]]}', (3, 4, 12, 5)),
    ('{"layers":[{"level":2,"blocks":[12]},{"level":1,"blocks":[3,4]}]}', (3, 4, 12)),
    ('{"plan":[{"id":3,"support":[]},{"id":5,"support":[3]}]}', (3, 5)),
    ('{"plan":[{"block":3,"on":"table"},{"block":5,"on":"block 3"}]}', (3, 5)),
    ('{"plan":["3: red arch","5: blue cube"]}', (3, 5)),
    ('{"plan":["red arch (3)","blue cube (5)"]}', (3, 5)),
    ('{"order":["block_3","block_5"]}', (3, 5)),
    ('{"build":[3,5,12]}', (3, 5, 12)),
    ('{"selected_blocks":[3,5,12],"order":[12,5,3]}', (12, 5, 3)),
    ('```json\n{"Step1": "Move block with index 3", "Step2": "Move block with index 5"}\n```\nThe above is only a sketch. The actual plan:\n```json\n{"Step1": "Move block with index 9"}\n```', (9,)),
    ('First attempt:\n{"Step1": "Move block with index 3", "Step2": "Move block with index 5"}\n\nI made an error. Second attempt:\n{"Step1": "Move block with index 5", "Step2": "Move block with index 3"}', (5, 3)),
    ('<scratchpad>Step1: Move block with index 9</scratchpad>\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('<analysis>\nStep1: Move block with index 9\n</analysis>\n<final>\nStep1: Move block with index 3\nStep2: Move block with index 5\n</final>', (3, 5)),
    ('<think>Step1: Move block with index 3\nStep2: Move block with index 5</think>\nFinal answer: 5, 3', (5, 3)),
    ('Thinking...\nStep1: Move block with index 9\n...done thinking.\n\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('◁think▷Step1: Move block with index 9◁/think▷Step1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('<|channel|>analysis<|message|>Step1: Move block with index 9<|end|><|start|>assistant<|channel|>final<|message|>Step1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('Here are the candidates:\n1. Block 1 - red\n2. Block 2 - blue\n\nOrder: 2, 1', (2, 1)),
    ('Candidates in the plan order: 3, 5, 12', (3, 5, 12)),
    ('I cannot place block 4, as it does not exist. Step1: Move block with index 3 Step2: Move block with index 5', (3, 5)),
    ('Sorry, I can\'t be sure, but:\n{"Step1": "Move block with index 3", "Step2": "Move block with index 5"}', (3, 5)),
    ('Order of blocks (bottom to top): 3, 5, 12\nColors: red, blue, green', (3, 5, 12)),
    ('| Placement order | Candidate # | Color |\n|---|---|---|\n| 1st | 3 | red |\n| 2nd | 5 | blue |', (3, 5)),
    ('| Step | Move |\n|------|------|\n| Step1 | Move block with index 3 |\n| Step2 | Move block with index 5 |', (3, 5)),
    ('Step | Index | Qty\n-----|-------|----\n1 | 6 | 3\n2 | 9 | 1', (6, 6, 6, 9)),
    ('Step 1: Move blocks 1–3 (three arches)\nStep 2: Move block 9', (1, 2, 3, 9)),
    ('Step 1: Move blocks 1, 2 & 3\nStep 2: Move block 9 ×2', (1, 2, 3, 9, 9)),
    ('Step 1: Move block 3, block 4 and block 5\nStep 2: Move block 9', (3, 4, 5, 9)),
    ('Step 1: Move three copies of block 6\nStep 2: Move block 9', (6, 6, 6, 9)),
    ('Step 1: Move block 6 four times', (6, 6, 6, 6)),
    ('Step 1: Move block 6 (2 of them)\nStep 2: Move block 9', (6, 6, 9)),
    ('Step 1: Move both blocks 3 and 4\nStep 2: Move block 9', (3, 4, 9)),
    ('Step 1: Move block 3 (2nd arch from left)\nStep 2: Move block 9 (3 units high)', (3, 9)),
    ('Step 1: Move block 3 [layer 1]\nStep 2: Move block 9 [layer 2]', (3, 9)),
    ('Step 1: Move block 3 to position 2\nStep 2: Move block 9 to slot 4', (3, 9)),
    ('Step 1: In layer 2, move block 9', (9,)),
    ('Step 1: Using block 3 as support, place block 5', (5,)),
    ('Step 1: With block 3 below, move block 5', (5,)),
    ('Step 1: Once block 3 is placed, move block 5', (5,)),
    ('Step 1: Block 5 goes on block 3', (5,)),
    ('Step 1: Block 5 rests on blocks 3 and 4', (5,)),
    ('Step 1: The support for block 5 is block 3; move block 5', (5,)),
    ('Step 1: Lege den roten Bogen (Block 3) auf den Tisch\nStep 2: Lege Block 5 auf Block 3', (3, 5)),
    ('第一步：移动积木3\n第二步：移动积木5', (3, 5)),
    ('步骤一：移动方块3\n步骤二：移动方块5', (3, 5)),
    ('先放3号，再放5号，最后放12号。', (3, 5, 12)),
    ('最终答案：3→5→12', (3, 5, 12)),
    ('从上到下依次是12、5、3，所以搭建顺序为3、5、12。', (3, 5, 12)),
    ('Die Reihenfolge lautet: 3, 5, 12.', (3, 5, 12)),
    ('Zuerst Block 3, dann Block 5, zuletzt Block 12.', (3, 5, 12)),
    ('El orden es 3, 5, 12.', (3, 5, 12)),
    ('Primero el bloque 3, luego el bloque 5.', (3, 5)),
    ('La réponse finale est : 3, 5, 12', (3, 5, 12)),
    ('Ответ: 3, 5, 12', (3, 5, 12)),
    ('答え: 3, 5, 12', (3, 5, 12)),
    ('정답: 3, 5, 12', (3, 5, 12)),
    ('Top to bottom: 12, 5, 3\nReverse this to build.', (3, 5, 12)),
    ('Steps (read from the bottom):\n1. Block 12\n2. Block 5\n3. Block 3', (3, 5, 12)),
    ('Disassembly order: 12, 5, 3. Reverse it to assemble.', (3, 5, 12)),
    ('Disassembly order: 12, 5, 3\nAssembly order: 3, 5, 12', (3, 5, 12)),
    ('The order is 3, 5, 12 (not 12, 5, 3).', (3, 5, 12)),
    ('Plan A: 3, 5\nPlan B: 5, 3\nDecision: B', (5, 3)),
    ('Plan A: 3, 5\nPlan B: 5, 3\nThe answer is Plan A because it stands.', (3, 5)),
    ('Plan A:\nStep1: Move block with index 3\nStep2: Move block with index 5\n\nPlan B:\nStep1: Move block with index 9\n\nPlan B is unstable, so I choose plan A.', (3, 5)),
    ('There are two options. Step1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
    ('{"solution": {"moves": [{"n": 1, "block": 3}, {"n": 2, "block": 5}]}}', (3, 5)),
    ('{"plan": [3, 5], "discarded": [1, 2]}', (3, 5)),
    ('{"distractor_blocks": [1,2,4], "assembly_sequence": [3,5]}', (3, 5)),
    ('{"blocks_to_place": [3,5], "blocks_to_ignore": [1,2]}', (3, 5)),
    ('{"layer_1": {"blocks": [3,4]}, "layer_2": {"blocks": [9]}}', (3, 4, 9)),
    ('Layer 1: blocks 3, 4; layer 2: block 9; layer 3: block 12', (3, 4, 9, 12)),
    ('**Assembly**\n\nBottom: 3, 4\nMiddle: 9\nTop: 12', (3, 4, 9, 12)),
    ('Step 1: On block 3 place block 5.', (5,)),
    ('Step 1: Next to block 3, add block 4.\nStep 2: Over both, lay block 9.', (4, 9)),
    ('Plan A is 3, 5. Plan B is 5, 3. Plan A is best.', (3, 5)),
    ('Step 1: Move block 6 ×3\nStep 2: Move block 9', (6, 6, 6, 9)),
    ('Move block 6 three times, then block 9.', (6, 6, 6, 9)),
    ('Move blocks 1 – 3, then 9', (1, 2, 3, 9)),
    ('The steps are listed top to bottom, build in reverse.\nStep1: Move block with index 9\nStep2: Move block with index 4', (4, 9)),
    ('Build in reverse of: 9, 4, 3', (3, 4, 9)),
    ('Reverse order of placement: 9, 4, 3', (3, 4, 9)),
    ('The example in the prompt was:\nStep1: Move block with index 3\nStep2: Move block with index 5\n\nMy plan:\nStep1: Move block with index 9', (9,)),
    ('Final answer: `3, 5, 12`', (3, 5, 12)),
    ('Final answer:\n3\n5\n12', (3, 5, 12)),
    ('**Final plan:** Move(3) → Move(5) → Move(12)', (3, 5, 12)),
    ('final_plan = [3, 5, 12]', (3, 5, 12)),
    ("plan = ['Move(3)', 'Move(5)']", (3, 5)),
    ('for i in [3, 5, 12]: move(i)', (3, 5, 12)),
    ('move(block=3); move(block=5)', (3, 5)),
    ('| Step | Block index | Placed on |\n|---|---|---|\n| 1 | 3 | table |\n| 2 | 5 | block 3 |', (3, 5)),
    ('Schritt 1: Nimm Block 3 und stelle ihn auf den Boden.\nSchritt 2: Setze Block 5 darauf.', (3, 5)),
    ('1. 将3号积木放在地面\n2. 将5号积木放在3号积木上', (3, 5)),
    ('按顺序放置:3,5,12', (3, 5, 12)),
    ('Step1: Move block with index 3\nStep2: Move block with index 5\nStep3: Move block with index 9\n\nHmm, block 9 is not needed. Without it:\nStep1: Move block with index 3\nStep2: Move block with index 5', (3, 5)),
]  # fmt: skip

NONE = [
    'Final answer:\n\nNone of the candidates fit.',
    'Let me think. Block 1 is a red cube. Block 2 is blue. The goal has a red cube.',
    'The plan cannot be made from these candidates.',
    '{"error": "cannot determine", "plan": []}',
    '{"plan": null}',
    'Plan A: 3, 5\nPlan B: 5, 3',
    'Either 3, 5 or 5, 3.',
    'The needed blocks are 3, 5 and 12, but I do not know the order.',
    'Layer 1: 2 blocks\nLayer 2: 1 block',
    'Goal blocks: 5\nUsed blocks: 3',
    'Step1: Move block with index 3\nStep2: Move block with index 5\n\nAlternatively:\nStep1: Move block with index 5\nStep2: Move block with index 3',
    "I'm sorry, but I cannot help with that request.",
    "As an AI, I can't see images. Typical: Step1: Move block with index 1",
    'Unfortunately the image is not visible. Please provide the goal picture. Candidates 1 to 16 were listed.',
    'Please provide the images first. Then I would answer like this:\nStep1: Move block with index 1\nStep2: Move block with index 2',
    'I need to see the image. Step1: Move block with index X',
    'Candidates: 1 red arch, 2 blue cube, 3 green cube.',
    '1. red arch\n2. blue cube\n3. green cube',
    '1. Red arch (Index 1)\n2. Blue cube (Index 2)\n3. Green cube (Index 3)',
    'Needed:\n1. Red arch (Index 5)\n2. Blue cube (Index 2)\n3. Green cube (Index 9)',
    'The goal consists of:\n- Block 3 (red arch)\n- Block 5 (blue cube)',
    'Block 3 is red. Block 5 is blue. Block 9 is on top of block 5.',
    "I can't. Blocks: 3, 5, 12",
    '| Block | Color |\n|---|---|\n| 3 | red |\n| 5 | blue |',
    'I can tell you which blocks are red: 1, 2 and 3. But not the plan.',
    'The goal picture is too dark; I see block 3, block 5 and block 12 among the candidates.',
    'Two orders work: 3, 5 and 5, 3.',
    'e.g.\nStep1: Move block with index 3\nStep2: Move block with index 5',
    '<think>\nStep1: Move block with index 3\nStep2: Move block with index 5\nHmm',
    '<think>a</think>\n<think>\nStep1: Move block with index 3\nStep2: Move block with index 5',
    '| Index | Block | Needed? |\n|---|---|---|\n| 1 | arch | no |\n| 2 | cube | yes |',
    '1. Block 1: red arch, needed\n2. Block 2: blue cube, not needed\n3. Block 3: green, needed',
]  # fmt: skip


LATER: list[tuple[str, tuple[int, ...] | None]] = [
    ('The structure has ten blocks. Blocks 1-4 form the base, then 9.\n\nStep1: Move block with index 1\nStep2: Move block with index 2\nStep3: Move block with index 3\nStep4: Move block with index 4\nStep5: Move block with index 9', (1, 2, 3, 4, 9)),
    ('Blocks 1-4 form the base, then block 9 goes on top, then block 12 as the roof.', (1, 2, 3, 4, 9, 12)),
    ('1. Block 6, 2 at each side\n2. Block 9 across the top', (6, 6, 6, 6, 9)),
    ('1. Block 6, one at each side\n2. Block 9 across them', (6, 6, 9)),
    ('Step 1: Move block with index 7 (the first of 3 pillars)\nStep 2: Move block with index 7 (the second of 3 pillars)\nStep 3: Move block with index 7 (the third of 3 pillars)\nStep 4: Move block with index 10', (7, 7, 7, 10)),
    ('Build order: blocks 2 through 4 as the foundation, then 8, then 11.', (2, 3, 4, 8, 11)),
    ('The goal consists of 5 blocks in 3 layers: 3 in layer 1, 1 in layer 2 and 1 in layer 3.\n\n**Plan**\n1. Block 4\n2. Block 4\n3. Block 13\n4. Block 7\n5. Block 16', (4, 4, 13, 7, 16)),
    ('Layers from the ground up:\n- Layer 1 (3 blocks): 2, 2, 5\n- Layer 2 (1 block): 9\n- Layer 3 (1 block): 14', (2, 2, 5, 9, 14)),
    ("I'll analyze the goal structure carefully.\n\n**Goal structure:**\n- Ground level: two red cubes (candidate 3) side by side, and a blue pillar (candidate 8) to their right\n- Middle: an orange bar lying across (candidate 12)\n- Top: a yellow half cylinder (candidate 15)\n\n**Support relations:**\n- 12 rests on both 3s and 8\n- 15 rests on 12\n\nStep1: Move block with index 3\nStep2: Move block with index 3\nStep3: Move block with index 8\nStep4: Move block with index 12\nStep5: Move block with index 15", (3, 3, 8, 12, 15)),
    ("Looking at this image, I need to identify which candidates match.\n\nCandidates: 1 red arch, 2 blue cube, 3 blue cube (rotated), 4 green triangle, 5 orange bar.\n\nWait, let me reconsider: the bar in the goal stands upright, so it's candidate 5, not candidate 9.\n\nStep1: Move block with index 5\nStep2: Move block with index 2\n\nHmm, actually the cube has to come first since the bar leans on nothing but the cube is under it.\n\nStep1: Move block with index 2\nStep2: Move block with index 5\nStep3: Move block with index 4", (2, 5, 4)),
    ("I don't see the goal's rear side, so two blocks may be hidden. My plan covers only what I can see.\n\nStep1: Move block with index 11\nStep2: Move block with index 6", (11, 6)),
    ("I apologize, but I can't make out a goal structure in this picture: the left half looks blank to me. The right half shows 16 candidates, such as a red cube (1), a blue arch (2) and a green triangle (3). Could you send the picture again?", None),
    ('**Build sequence**\n\n| # | Candidate | Role |\n|---|---|---|\n| 1 | 8 | left pillar |\n| 2 | 8 | right pillar |\n| 3 | 13 | lintel on 8 and 8 |\n| 4 | 2 | roof |', (8, 8, 13, 2)),
    ("Step1: Move block with index 9\nStep2: Move block with index 1\nStep3: Move block with index 1\n\nIf you'd like, I can also provide the plan with coordinates or explain how blocks 9 and 1 were identified.", (9, 1, 1)),
    ('Bottom → top: 10, 10, 4, 16', (10, 10, 4, 16)),
    ('Place 10 twice for the pillars, bridge them with 4, and finish with 16.', (10, 10, 4, 16)),
    ("Step1: Move block with index 5\nStep2: Move block with index 5\n…\nI'm not certain about the remaining blocks; the third could be 7 or 14, but I would leave it out.", (5, 5)),
    ('```text\nStep1: Move block with index 14\nStep2: Move block with index 3\nStep3: Move block with index 3\n```\n\n**Why this order:** 14 is the base plate; the two 3s stand on it.', (14, 3, 3)),
    ("Here's a breakdown of the goal structure and how it can be built:\n\n*   **Base:** The base is a long brown block. This corresponds to candidate **12**.\n*   **Pillars:** There are two red cylinders. These match candidate **7**.\n*   **Roof:** A blue triangle. That's candidate **1**.\n\nTherefore, the plan is:\n\nStep1: Move block with index 12\nStep2: Move block with index 7\nStep3: Move block with index 7\nStep4: Move block with index 1", (12, 7, 7, 1)),
    ('```json\n{\n  "analysis": {"n_blocks": 4, "layers": [2, 1, 1]},\n  "plan": {\n    "layers": [\n      {"layer": 1, "moves": [{"candidate": 6, "reason": "left of 11"}, {"candidate": 11, "reason": "right of 6"}]},\n      {"layer": 2, "moves": [{"candidate": 2, "reason": "rests on 6 and 11"}]},\n      {"layer": 3, "moves": [{"candidate": 15, "reason": "roof"}]}\n    ]\n  }\n}\n```', (6, 11, 2, 15)),
    ('{"goal": {"blocks": [{"type": "cube", "color": "red"}, {"type": "arch", "color": "blue"}]}, "matches": {"red cube": 5, "blue arch": 9}, "assembly_plan": [{"step_number": 1, "candidate_index": 5, "depends_on": []}, {"step_number": 2, "candidate_index": 9, "depends_on": [1]}]}', (5, 9)),
    ('[\n  {"step": 1, "action": "Move block with index 4", "rationale": "block 4 carries block 8"},\n  {"step": 2, "action": "Move block with index 8", "rationale": "on block 4"},\n  {"step": 3, "action": "Move block with index 13", "rationale": "beside block 4"}\n]', (4, 8, 13)),
    ('{"status": "uncertain", "confidence": 0.4, "plan": [2, 2, 6], "alternative_plan": [2, 6, 2]}', (2, 2, 6)),
    ('{"error": "The goal image could not be processed", "plan": []}', None),
    ('<think>\nOkay, let me see. The goal has a house: two cubes, a bar, a triangle. Candidates: 3 is a red cube, 7 the bar, 11 the triangle. Plan maybe 3, 3, 7, 11. Check: Step1: Move block with index 11? No.\n</think>\n\n### Plan\n\nStep1: Move block with index 3  \nStep2: Move block with index 3  \nStep3: Move block with index 7  \nStep4: Move block with index 11', (3, 3, 7, 11)),
    ('<think>\nThe tower has 4 blocks. Block 2 at the bottom, then 2, then 9, then 16.\nStep1: Move block with index 2\nStep2: Move block with index 2\nStep3: Move block with index 9\nStep4: Move block', None),
    ('Okay, so I need to figure out the order. The base seems to be block 13. On it stand blocks 4 and 6. Hmm, maybe it is block 5 instead of 6. No, 6 has the right color.\n\n**Final Answer**\n\nStep1: Move block with index 13\nStep2: Move block with index 4\nStep3: Move block with index 6', (13, 4, 6)),
    ('### Final Plan\n\n- Step 1: Move block with index `1` (gray cuboid, ground)\n- Step 2: Move block with index `1` (gray cuboid, ground, 5 cm to the right)\n- Step 3: Move block with index `10` (spans both)', (1, 1, 10)),
    ('Das Ziel besteht aus 4 Blöcken: zwei Säulen, ein Balken, ein Dach.\n\nSchritt 1: Bewege den Block mit Index 7 (linke Säule)\nSchritt 2: Bewege den Block mit Index 7 (rechte Säule)\nSchritt 3: Bewege den Block mit Index 12 auf die beiden Säulen\nSchritt 4: Bewege den Block mit Index 3 auf Block 12', (7, 7, 12, 3)),
    ('Ich setze zuerst die Blöcke 2 und 5 auf den Boden, darauf Block 8 und ganz oben Block 14.', (2, 5, 8, 14)),
    ('**Aufbaureihenfolge (von unten nach oben)**\n\n1. Kandidat 9 – blauer Quader\n2. Kandidat 9 – blauer Quader, 2 cm daneben\n3. Kandidat 4 – roter Bogen', (9, 9, 4)),
    ('Leider ist auf dem Bild kein Ziel zu erkennen. Zu sehen sind nur die Kandidaten 1 bis 16.', None),
    ('目标结构共有4个积木：底层2个，中层1个，顶层1个。\n\n步骤1：移动编号为6的积木\n步骤2：移动编号为6的积木\n步骤3：移动编号为11的积木\n步骤4：移动编号为2的积木', (6, 6, 11, 2)),
    ('搭建顺序如下：先放置2个6号积木作为底座，再放11号积木，最后放2号积木。', (6, 6, 11, 2)),
    ('底层：3号、8号；第二层：12号；顶层：15号。', (3, 8, 12, 15)),
    ('抱歉，图片中没有显示目标结构，无法给出搭建计划。候选积木包括1号红色立方体、2号蓝色拱形等。', None),
    ('Most likely plan (not fully certain):\n\n1) 4\n2) 4\n3) 10 — or 11 if the roof is the darker one\n4) 16', (4, 4, 10, 16)),
    ('Option 1 (roof first): 16, 4, 10\nOption 2 (base first): 4, 10, 16\n\nOnly option 2 respects the supports, so my answer is option 2.', (4, 10, 16)),
    ('It could be 4, 10, 16 or it could be 10, 4, 16; both orders stand, and I cannot tell which one you want.', None),
    ('The goal can be built with 6 blocks: 3 cubes (index 5), 2 arches (index 9) and 1 roof (index 14).', None),
]  # fmt: skip
"""Forty replies in the manners of today's models, each written with its reading before any parser
read it: 31 were read rightly then, 4 failed, 5 were misread."""

LAST: list[tuple[str, tuple[int, ...] | None]] = [
    ('Start with 4, put 9 on top of it, then 13.', (4, 9, 13)),
    ('1. Index 2 (base, left)\n2. Index 2 (base, right)\n3. Index 11 (beam)\n4. Index 5 x2 (towers)\n5. Index 16 (roof)', (2, 2, 11, 5, 5, 16)),
    ('The plan has 6 steps.\n\nStep 1 → 4\nStep 2 → 4\nStep 3 → 8\nStep 4 → 1\nStep 5 → 1\nStep 6 → 15', (4, 4, 8, 1, 1, 15)),
    ('Ground: 3, 3, 7\nSecond layer: 10\nThird layer: 12, 12\nTop: 14', (3, 3, 7, 10, 12, 12, 14)),
    ('**Answer:** `[6, 6, 2, 9]`\n\n*Blocks 1, 3 and 4 are distractors.*', (6, 6, 2, 9)),
    ('Ich beginne mit Block 5. Danach kommt Block 11 darauf. Zum Schluss lege ich Block 2 oben auf.', (5, 11, 2)),
    ('Schritt 1: Block 4\nSchritt 2: Block 4 (zweite Säule)\nSchritt 3: Block 10 quer darüber', (4, 4, 10)),
    ('第1步：放置7号积木\n第2步：放置7号积木\n第3步：在上面放置12号积木', (7, 7, 12)),
    ('搭建计划：[7, 7, 12, 3]', (7, 7, 12, 3)),
    ('{"thinking": "3 layers", "steps": [{"n": 1, "move": {"block": 9}}, {"n": 2, "move": {"block": 4}}]}', (9, 4)),
    ('{"sequence": [{"order": 1, "candidate": "#8"}, {"order": 2, "candidate": "#8"}, {"order": 3, "candidate": "#13"}]}', (8, 8, 13)),
    ("I'm honestly not sure, but I'd go: 2 → 2 → 14 → 7.", (2, 2, 14, 7)),
    ("I can't give a reliable plan because the picture is too blurry; the candidates seem to include 2, 7 and 14.", None),
    ('Place two of candidate 6 on the ground 5 cm apart, lay candidate 10 across both, and finish by adding candidate 3.', (6, 6, 10, 3)),
    ('1. Move block with index 12\n2. Move block with index 4\n   - it rests on 12\n3. Move block with index 4\n   - it rests on 12 as well\n4. Move block with index 9\n   - across the two 4s', (12, 4, 4, 9)),
    ('Left tower: 2, 5, 8\nRight tower: 2, 5, 9\nBridge: 13', (2, 5, 8, 2, 5, 9, 13)),
    ('Step1: Move block with index 3\nStep2: Move block with index 3\nStep3: Move block with index 6\n\nWait, the goal shows a third pillar. Updated plan:\n\nStep1: Move block with index 3\nStep2: Move block with index 3\nStep3: Move block with index 3\nStep4: Move block with index 6', (3, 3, 3, 6)),
    ('<answer>\nStep1: Move block with index 16\nStep2: Move block with index 1\n</answer>', (16, 1)),
    ('Blocks needed: 2x red cube (index 4), 1x arch (index 7), 1x roof (index 12).', None),
    ('Steps 1 and 2: index 4 (both pillars). Step 3: index 7. Step 4: index 12.', (4, 4, 7, 12)),
]  # fmt: skip
"""Twenty more, written in the same way when those were mended: 14 were read rightly then, 3 failed,
3 were misread."""

HARD = {
    'Place 10 twice for the pillars, bridge them with 4, and finish with 16.': "bare numbers behind verbs of all kinds",
    'Ich beginne mit Block 5. Danach kommt Block 11 darauf. Zum Schluss lege ich Block 2 oben auf.': "verbs of another language",
    "I'm honestly not sure, but I'd go: 2 → 2 → 14 → 7.": "a chain behind doubts",
    'Left tower: 2, 5, 8\nRight tower: 2, 5, 9\nBridge: 13': "parts without a height",
}  # fmt: skip
"""Plans that a person reads and that may fail, and what is hard about them; all others are read."""

ALIKE: list[tuple[str, tuple[int, ...] | None]] = [
    ('Blocks 1-4 form the base, then 9.', (1, 2, 3, 4, 9)),
    ('The base is blocks 1-4, then 9 on top.', (1, 2, 3, 4, 9)),
    ('1. Block 6, 2 on each side\n2. Block 9', (6, 6, 6, 6, 9)),
    ('1. Block 6, one at each corner\n2. Block 9', (6, 6, 6, 6, 9)),
    ('Blocks 1-4 form the base.', None),
    ('Move block 3 first, then 2 more cubes on top', (3,)),
    ('Step 1: Move block 3, then step 2', (3,)),
]  # fmt: skip
"""Written after that, of the same kinds: counts, ranges, what goes on with a number alone."""

STEPS = "Step 1: block 3\nStep 2: block 5\nStep 3: block 7"
ITEMS = "1. Block 3\n2. Block 5\n3. Block 7"
NEIGHBOURS: list[tuple[str, tuple[int, ...] | None]] = [
    # Explanations that go over a part of the plan, and corrections.
    (f"{STEPS}\n\nExplanation:\nHowever, some supports matter.\nStep 1: block 3\nStep 2: block 5", (3, 5, 7)),
    (f"{STEPS}\n\nCheck:\nBut block 3 is low.\nStep 1: block 3\nStep 2: block 5", (3, 5, 7)),
    (f"{STEPS}\n\nVerification:\nTherefore it stands.\nStep 1: block 3\nStep 2: block 5", (3, 5, 7)),
    (f"{STEPS}\n\nNote:\nSo far so good.\nStep 1: block 3\nStep 2: block 7", (3, 5, 7)),
    (f"{STEPS}\n\nExplanation:\nBut blocks 5 and 3 carry.\nStep 1: block 5\nStep 2: block 3\nStep 3: block 7", (3, 5, 7)),
    (f"{STEPS}\n\nCheck:\nSo step 2 has to be 6. The rest holds.\n\nStep 1: block 3\nStep 2: block 6\nStep 3: block 7", (3, 6, 7)),
    (f"{STEPS}\n\nCheck:\nWait, I overlooked that 7 is a distractor.\nStep 1: block 3\nStep 2: block 5", (3, 5)),
    (f"{STEPS}\n\nCheck:\nThe roof is heavy. So it goes:\nStep 1: block 5\nStep 2: block 3\nStep 3: block 7", (5, 3, 7)),
    # Not to see the back is no refusal; not to see the picture is one.
    (f"There is no picture of the back.\n{ITEMS}", (3, 5, 7)),
    (f"{ITEMS}\nThere is no picture of the back.", (3, 5, 7)),
    (f"No picture shows the rear.\n{ITEMS}", (3, 5, 7)),
    (f"The back of the structure is not visible.\n{ITEMS}", (3, 5, 7)),
    (f"I need to see the back, but here is a plan.\n{ITEMS}", (3, 5, 7)),
    (f"The image is not visible.\n{ITEMS}", None),
    (f"No image was provided. It could be:\n{ITEMS}", None),
    # A length, a size, a height is no count.
    ("1. Put the 3 cm tall blocks with index 6", (6,)),
    ("1. Put the 5 mm thin blocks with index 6\n2. Put block 1", (6, 1)),
    ("1. Put the 2.5 cm cubes with index 6\n2. Put block 1", (6, 1)),
    ("1. Put the 4 inch blocks with index 6\n2. Put block 1", (6, 1)),
    ("1. Put the 90 degrees turned blocks with index 6\n2. Put block 1", (6, 1)),
    ("1. Put the 10 x 5 blocks with index 6\n2. Put block 1", (6, 1)),
    ("1. At height 3 put blocks with index 6\n2. Put block 1", (6, 1)),
    ("1. On stage 2 stack blocks of index 6\n2. Put block 1", (6, 1)),
    ("1. Put the 3 red blocks with index 6\n2. Put block 1", (6, 6, 6, 1)),
    ("1. Put 2 more blocks with index 6\n2. Put block 1", (6, 6, 1)),
    ("1. Place 2 of the blocks with index 6\n2. Put block 1", (6, 6, 1)),
    # Numbers that are said of the plan, and those that are it.
    ("The layers are now 2, 3, 4.", None),
    ("The layers are 2, 3, 4.", None),
    ("The heights are 2, 3, 4.", None),
    ("The supports are now 2, 3, 4.", None),
    ("The top layer is now 2, 3, 4.", None),
    ("The blocks left are now 2, 3, 4.", None),
    ("The order is now 2, 3, 4.", (2, 3, 4)),
    ("The steps are therefore 2, 3, 4.", (2, 3, 4)),
    ("The full plan is therefore 2, 3, 4.", (2, 3, 4)),
    ("The order of the layers is 2, 3, 4", (2, 3, 4)),
    ("Layers: 2, 3, 4", (2, 3, 4)),
]  # fmt: skip
"""Replies beside those from which a rule was learned: alike in words and other in meaning."""


@pytest.mark.parametrize(("text", "plan"), NEIGHBOURS)
def test_what_is_only_alike_in_words_is_not_read_alike(
    text: str, plan: tuple[int, ...] | None
) -> None:
    assert reading(text) == plan


@pytest.mark.parametrize(("text", "plan"), PLANS)
def test_a_hard_plan_is_read_as_it_is_meant(text: str, plan: tuple[int, ...]) -> None:
    assert parse_plan(text, 16).plan.steps == plan


@pytest.mark.parametrize("text", NONE)
def test_what_only_looks_like_a_plan_is_a_failure(text: str) -> None:
    parsed = parse_plan(text, 16)
    assert (parsed.plan.steps, parsed.rule) == ((), None)
    assert parsed.problem is not None


def reading(text: str) -> tuple[int, ...] | None:
    parsed = parse_plan(text, 16)
    return None if parsed.rule is None else parsed.plan.steps


@pytest.mark.parametrize(("text", "plan"), [*LATER, *LAST])
def test_replies_that_were_written_first_are_read_as_a_person_reads_them(
    text: str, plan: tuple[int, ...] | None
) -> None:
    read = reading(text)
    assert read == plan or (read is None and text in HARD)


@pytest.mark.parametrize(("text", "plan"), ALIKE)
def test_counts_are_no_blocks_and_sequences_go_on(text: str, plan: tuple[int, ...] | None) -> None:
    assert reading(text) == plan


@settings(deadline=None)
@given(
    st.lists(st.integers(1, 16), min_size=2, max_size=6),
    st.sampled_from(
        ["Put block {}", "Move block with index {}", "Block {}", "Place the block #{}"]
    ),
    st.sampled_from(
        [
            "on each side",
            "at both ends",
            "for every corner",
            "on either side of it",
            "per the picture",
        ]
    ),
)
def test_a_number_that_is_called_a_block_is_never_a_count(
    blocks: list[int], move: str, where: str
) -> None:
    lines = [f"{n}. {move.format(block)} {where}" for n, block in enumerate(blocks, start=1)]
    assert parse_plan("\n".join(lines), 16).plan.steps == tuple(blocks)


@pytest.mark.parametrize(
    ("text", "plan"),
    [
        ("1. Place blocks 2 and 3 on either side\n2. Place block 4", (2, 3, 4)),
        ('{"plan":{"base":[1,2],"top":5}}', (1, 2, 5)),
        ('{"final_plan":{"bottom":3,"middle":[4,5],"top":6}}', (3, 4, 5, 6)),
        ('{"plan":{"count":3,"layer":1,"blocks":[4,5]}}', (4, 5)),
    ],
)
def test_blocks_beside_lists_are_kept_and_counts_are_not(text: str, plan: tuple[int, ...]) -> None:
    assert parse_plan(text, 16).plan.steps == plan
