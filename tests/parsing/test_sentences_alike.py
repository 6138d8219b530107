"""Kinds of sentence in several languages, each beside those that are alike in words and mean else.

What a reader learned from single replies is a rule of what it says, so that each rule stands here
with its neighbours.
"""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import pytest

from phyblock.parsing import parse_answer, parse_plan
from phyblock.parsing.move import parse_move

SHAPES = ("red cube", "blue cylinder", "yellow prism", "green arch")
COUNTS = ("5", "6", "7", "8")
STEPS = "Step1: Move block with index 3\nStep2: Move block with index 5\n\n"

PLANS: list[tuple[str, list[int] | None]] = [
    ("Put 3 down first, then 5 beside it, then 12 on top of both.", [3, 5, 12]),
    ("Lege zuerst 4 hin, dann 4 noch einmal, dann 9 quer darüber und zuletzt 13.", [4, 4, 9, 13]),
    ("Use 3 as the base, then add 9 on top of it.", [3, 9]),
    ("Use 3 cubes and 2 arches.", None),
    ("Place 3 cubes first, then 2 arches.", None),
    ("Place 3 up to 5 cm from the edge.", None),
    ("Prima il blocco 2, poi il blocco 9 sopra e infine il blocco 14.", [2, 9, 14]),
    ("Сначала блок 2, затем блок 5, потом блок 9 сверху и наконец блок 14.", [2, 5, 9, 14]),
    ("Schritt eins: Baustein 4. Schritt zwei: Baustein 8.", [4, 8]),
    ("1st: 4, 2nd: 4, 3rd: 8", [4, 4, 8]),
    ("1 -> 3\n2 -> 5\n3 -> 9", [3, 5, 9]),
    ("4 (two times), 8, 13", None),
    ("Probably 4, 4, 8.", [4, 4, 8]),
    ("Build from the bottom: 4, 4; then 8; then 13.", [4, 4, 8, 13]),
    ("Build from the bottom: 4, 4; it stands well.", [4, 4]),
    (f"{STEPS}Step3: ...", None),
    (f"{STEPS}Step3: Move block with", [3, 5]),
    ("The old plan is now 2, 3, 4.", None),
    ("Alter Plan: 3, 5, 9\nNeuer Plan: 5, 3, 9", [5, 3, 9]),
    ("Ancien plan : 3, 5, 9\nNouveau plan : 5, 3, 9", [5, 3, 9]),
    ("There are two possible sequences:\n- 3, 5, 9\n- 5, 3, 9", None),
    (f"{STEPS}Hang on. The full plan:\n\n{STEPS}Step3: Move block 12", [3, 5, 12]),
    (f"{STEPS}Hold on, step 2 should be block 6 instead.", [3, 6]),
    ("Schritt 1: Baustein 3\nSchritt 2: Baustein 5\n\nHalt, Schritt 2 muss 6 sein.", [3, 6]),
    ("Étape 1 : bloc 3\nÉtape 2 : bloc 5\n\nPardon, l'étape 2 doit être le bloc 6.", [3, 6]),
    ("Paso 1: bloque 3\nPaso 2: bloque 5\n\nPerdón, el paso 2 debe ser el bloque 6.", [3, 6]),
    (f"{STEPS}Swap the last two steps.", None),
    (f"{STEPS}Steps 1 and 2 may be swapped.", [3, 5]),
    (f"{STEPS}Candidates 7 and 8 look much like 5, and 2 is 5 cm long instead of 10.", [3, 5]),
    (f"{STEPS}Candidate 4 has the same shape as 5.", [3, 5]),
    (f"{STEPS}Block 12 goes on top.", None),
    ("Étape 1 : bloc 3\nÉtape 2 : bloc 5\n\nLe bloc 7 n'est pas utilisé.", [3, 5]),
    ("Шаг 1: блок 3\nШаг 2: блок 5\n\nБлок 7 не нужен.", [3, 5]),
    ("Шаг 1: блок 3\nШаг 2: блок 5\n\nБлок 7 сверху.", None),
    ("1. Block 14\n2. Block 9\n3. Block 3\n\nBuild them in the opposite order.", [3, 9, 14]),
    ("Order: 3, 7, 9. Block 7 points in the opposite direction.", [3, 7, 9]),
    ("Order: 3, 7, 9. Block 7 lies the other way round.", [3, 7, 9]),
    ("Seen from the top down: 14, 9, 3. Place them in reverse.", [3, 9, 14]),
    ("First row: 4, 4\nSecond row: 8\nTop: 13", [4, 4, 8, 13]),
    ("Top:\n- 14\nMiddle:\n- 9\nBottom:\n- 3, 5", [3, 5, 9, 14]),
    ("第一层:\n- 积木3\n- 积木5\n\n第二层:\n- 积木9", [3, 5, 9]),
    ("Obere Schicht:\n- Baustein 9\n\nUntere Schicht:\n- Baustein 3\n- Baustein 5", [3, 5, 9]),
    ("Layer 1:\n- 2 cubes\n- 1 arch\n\nLayer 2:\n- 1 roof", None),
    ("Layer 1:\n- 2\n- 3\n\nLayer 2:\n- 1", None),
    ("Layer 1:\n- Block 3\n\nLayer 2:\n- Block 9\n\nNow I look for the roof. It is", None),
    ("Vom Dach bis zum Boden: 14, 9, 3, 3", [3, 3, 9, 14]),
    ("From the top: 14, 9, 3, 3. So build 3, 3, 9, 14.", [3, 3, 9, 14]),
    ("Blocks I see:\n- block 4: red\n- block 2: blue", None),
    ("order:\n- block: 4\n- block: 2", [4, 2]),
    ("Step1–Step3: Move block with index 6\nStep4: Move block with index 3", [6, 6, 6, 3]),
    ("Schritt 1 bis Schritt 2: Lege Block 6\nSchritt 3: Lege Block 3", [6, 6, 3]),
    ("Steps 1 through 3: Move block 6\nStep 4: Move block 3", [6, 6, 6, 3]),
    ("Step 1 to Step 3: Move blocks 6, 7 and 8\nStep 4: Move block 3", [6, 7, 8, 3]),
    ("Step 1 - Step 2: Move block 6 (x2)\nStep 3: Move block 3", [6, 6, 3]),
    (f"{STEPS}Step 1 to step 2: Move block 3 first, as it carries 5.", [3, 5]),
    (f"{STEPS}Step 1 and step 2: Move block 8 instead.", None),
    ("| Step | Block | How many |\n|---|---|---|\n| 1 | 4 | 2 |\n| 2 | 9 | 1 |", [4, 4, 9]),
    ("| Step | Block | Amount |\n|---|---|---|\n| 1 | 4 | twice |\n| 2 | 9 | |", [4, 4, 9]),
    ("| Step | Block | Menge |\n|---|---|---|\n| 1 | 4 | ×2 |\n| 2 | 9 | ×1 |", [4, 4, 9]),
    ("| Step | Block | How many left |\n|---|---|---|\n| 1 | 4 | 2 |\n| 2 | 9 | 1 |", [4, 9]),
    ("| Step | Block | How many holes |\n|---|---|---|\n| 1 | 4 | 2 |\n| 2 | 9 | 1 |", [4, 9]),
    ("| Step | Blocks | Count |\n|---|---|---|\n| 1 | 4, 5 | 2 |\n| 2 | 9 | 1 |", [4, 5, 9]),
    ("| Step | Block | Count |\n|---|---|---|\n| 1 | 4 | 2 |\n| 2 | 4 | 2 |\n| 3 | 9 | 1 |", None),
    ("| Step | Block | Pieces |\n|---|---|---|\n| 1 | 4 | 1 |\n| 2 | 4 | 2 |\n| 3 | 9 | 3 |", None),
    ("| Step | Block | x |\n|---|---|---|\n| 1 | 4 | 2 |\n| 2 | 9 | 1 |", [4, 9]),
    ("手順1: ブロック3を置く\n手順2: ブロック5を置く\n\n以上の2手順です。", [3, 5]),
    ("手順は次の通りです。\n1. ブロック3を置く\n2. ブロック5を置く", [3, 5]),
    (f"{STEPS}Explanation: Block 3 carries 5. Blocks 2 and 11 look close to 5.", [3, 5]),
    (f"{STEPS}Explanation: Blocks 2 and 11 have another color.<|im_end|>", [3, 5]),
    (f"{STEPS}Begründung: Block 11 sieht fast so aus, ist aber lila.", [3, 5]),
    (f"{STEPS}Explanation: Block 11 goes on top of them.", None),
    (f"{STEPS}Explanation: Block 11 is missing in this plan.", None),
    (f"{STEPS}Explanation: 5, 3", None),
    (f"{STEPS}Explanation: Block 3 carries it. Wait, step 2 should be block 11.", [3, 11]),
    (f"{STEPS}Correction: Block 11 looks right.", None),
    ("Place block 3, then block 5 and to finish the blue cone (#8).", [3, 5, 8]),
    ("Place block 3, then block 5 and to finish, block 8.", [3, 5, 8]),
    ("Place block 3, then add block 5 and to finish the row of block 3 add block 8.", [3, 5, 8]),
    ("Place block 3, then block 5 to finish the row of block 3.", [3, 5]),
]  # fmt: skip

CHOICES: list[tuple[str, tuple[str, ...], str | None]] = [
    ("The second option might be wrong.", SHAPES, None),
    ("The third option seems to be too long.", SHAPES, None),
    ("The second option matches the color but not the shape.", SHAPES, None),
    ("I would exclude the second option.", SHAPES, None),
    ("The second option is right.", SHAPES, "B"),
    ("The second option matches.", SHAPES, "B"),
    ("I pick the second option.", SHAPES, "B"),
    ("Die zweite Option ist richtig.", SHAPES, "B"),
    ("A is too long, B has the wrong color, D is turned. Only C is left.", SHAPES, "C"),
    ("A shows a cube. B shows a cylinder.", SHAPES, None),
    ("B shows the cylinder, as asked.", SHAPES, "B"),
    ("It isn't A. It isn't B either. It can't be D. So one option is left.", SHAPES, "C"),
    ("Ce n'est ni A ni B, et D est impossible. Il reste C.", SHAPES, "C"),
    ("不是A,也不是B,D也不对。所以只剩下C。", SHAPES, "C"),
    ("Not A, as it's red. Only B and C remain.", SHAPES, None),
    ("If it is not A, not B and not D, one is left.", SHAPES, None),
    ("Answer: B? No, C.", SHAPES, "C"),
    ("B, I think.", SHAPES, "B"),
    ("Probably B.", SHAPES, "B"),
    ("It is a blue cylinder, not a red cube.", SHAPES, "B"),
    ("It is not a blue cylinder.", SHAPES, None),
    ("I count 7, maybe 8.", COUNTS, None),
    ("I count 7.", COUNTS, "C"),
    ("Answer: A\n\nHold on, I left out a cube.\n\nAnswer: B", COUNTS, "B"),
    ("Antwort: A\n\nHalt, ich habe einen Würfel übersehen.\n\nAntwort: B", COUNTS, "B"),
    ("Réponse : A\n\nAttendez, j'ai oublié un cube.\n\nRéponse : B", COUNTS, "B"),
    ("Respuesta: A\n\nEspera, olvidé un cubo.\n\nRespuesta: B", COUNTS, "B"),
    ("Ответ: A\n\nПодождите, я пропустил один куб.\n\nОтвет: B", COUNTS, "B"),
    ("Answer: A\n\nAnswer: B", COUNTS, None),
]

ORDERS: list[tuple[str, str | None]] = [
    ("C, A, B, D is the order from last to first.", "DBAC"),
    ("C, A, B, D (from last to first)", "DBAC"),
    ("D, B, A, C (the reverse of C, A, B, D)", "DBAC"),
    ("Zuerst D, dann B, dann A, zuletzt C.", "DBAC"),
    ("Primero D, luego B, después A y por último C.", "DBAC"),
    ("先D,再B,然后A,最后C。", "DBAC"),
    ("D, then either A or B, then C.", None),
]

MOVES: list[tuple[str, int | str | None]] = [
    ("Done. All 6 blocks are placed.", "done"),
    ("Done. Wait, the roof is missing: Move(14)", 14),
    ("Done with the base.", None),
    ("Everything is in place, so done.", "done"),
    ("Als nächstes kommt Baustein 7 auf Baustein 3.", 7),
    ("El siguiente bloque es el 7.", 7),
    ("次は7番のブロックです。", 7),
    ("The next block is 7 or 9.", None),
    ("Next to block 3 there is room.", None),
    ("Block 7 is still missing.", 7),
    ("It's either done or block 6 is missing; I can't tell.", None),
]


@pytest.mark.parametrize(("text", "meant"), PLANS)
def test_a_plan_is_read_by_what_its_sentences_say(text: str, meant: list[int] | None) -> None:
    read = parse_plan(text, 16)
    assert (list(read.plan.steps) if read.rule else None) == meant


@pytest.mark.parametrize(("text", "options", "meant"), CHOICES)
def test_a_choice_is_read_by_what_is_said_of_it(
    text: str, options: tuple[str, ...], meant: str | None
) -> None:
    assert parse_answer(text, options, False).letters == meant


@pytest.mark.parametrize(("text", "meant"), ORDERS)
def test_an_order_is_read_in_its_direction(text: str, meant: str | None) -> None:
    assert parse_answer(text, SHAPES, True).letters == meant


@pytest.mark.parametrize(("text", "meant"), MOVES)
def test_a_move_is_read_where_it_is_the_next_one(text: str, meant: int | str | None) -> None:
    read = parse_move(text)
    assert ("done" if read.is_done else read.move) == meant
