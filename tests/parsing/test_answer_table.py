"""Replies as models write them, and the option that each of them chooses."""

# ruff: noqa: E501, RUF001 -- replies are long and come in other scripts

from __future__ import annotations

import pytest

from phyblock.parsing import ParsedAnswer, parse_answer

SHAPES = ("cube", "arch", "cylinder", "cuboid")
COUNTS = ("2", "3", "4", "5")
LENGTHS = ("5 cm", "10 cm", "15 cm", "20 cm")
PICTURES = ("<img1>", "<img2>", "<img3>", "<img4>")
PLACES = ("place A", "place B", "place C", "place D")
RELATIONS = ("to the left of it", "to the right of it", "in front of it", "behind it")
BLOCKS = ("the red cube", "the blue cylinder", "the red arch", "the green cuboid")
OUTCOMES = (
    "nothing moves",
    "only the red arch falls",
    "the red arch and the blue cube fall",
    "the whole structure collapses",
)

BARE = [
    ("B", "B"), ("b", "B"), ("B.", "B"), ("B)", "B"), ("(B)", "B"), ("(b)", "B"), ("[B]", "B"),
    ("{B}", "B"), ("<B>", "B"), ("**B**", "B"), ("*B*", "B"), ("__B__", "B"), ("`B`", "B"),
    ('"B"', "B"), ("'B'", "B"), ("“B”", "B"), ("B\n", "B"), ("\n\n  B  \n", "B"), ("B!", "B"),
    ("$B$", "B"), ("Ｂ", "B"), ("（Ｂ）", "B"), ("A", "A"), ("a", "A"), ("A.", "A"), ("(A)", "A"),
    ("D", "D"), ("Option B", "B"), ("option b", "B"), ("Choice B", "B"), ("Letter B", "B"),
    ("Picture B", "B"), ("Image B.", "B"), ("The answer: B", "B"), ("Answer B", "B"),
    ("B. arch", "B"), ("B. Arch", "B"), ("B) Arch.", "B"), ("(B) arch", "B"), ("B: arch", "B"),
    ("B - arch", "B"), ("B, arch", "B"), ("**B. Arch**", "B"), ("**B.** Arch", "B"),
    ("B (arch)", "B"), ("[B] arch", "B"), ("B. An arch", "B"), ("A. cube", "A"), ("A cube", "A"),
]  # fmt: skip

MARKED = [
    (r"\boxed{B}", "B"), (r"$\boxed{B}$", "B"), (r"\boxed{\text{B}}", "B"),
    (r"The final answer is $\boxed{\mathrm{D}}$.", "D"), (r"\[ \boxed{(C)} \]", "C"),
    (r"\boxed{\textbf{(A)}}", "A"), (r"\boxed{cylinder}", "C"), (r"\boxed{B. arch}", "B"),
    (r"First \boxed{A}. Wait, that is wrong: \boxed{B}", "B"),
    ("<answer>B</answer>", "B"), ("<answer> (C) </answer>", "C"), ("<Answer>arch</Answer>", "B"),
    ("<reasoning>A or C? A.</reasoning><answer>C</answer>", "C"), ("<answer>\nD\n</answer>", "D"),
    ("<think>The answer is A. Or B?</think>\n\nC", "C"), ("<thinking>A</thinking>\nAnswer: B", "B"),
    ("<think>It is A</think><answer>B</answer>", "B"),
    ('{"answer": "B"}', "B"), ("{'answer': 'B'}", "B"), ('{"answer":"B. arch"}', "B"),
    ('```json\n{"reasoning": "A looks close, C does not", "answer": "D"}\n```', "D"),
    ('{"answer": "cylinder", "confidence": 0.9}', "C"), ('{"final_answer": "(A)"}', "A"),
    ('{"choice": "b"}', "B"), ('{"answer": 2}', "B"), ('{"Answer": ["C"]}', "C"),
]  # fmt: skip

STATED = [
    ("The answer is B", "B"), ("The answer is B.", "B"), ("the answer is (B)", "B"),
    ("The correct answer is **B**.", "B"), ("The correct answer is: **(C) cylinder**", "C"),
    ("The answer is option D.", "D"), ("The correct option is B.", "B"),
    ("The correct choice is (D) cuboid.", "D"), ("The best answer would be C.", "C"),
    ("So the answer is B: Arch", "B"), ("My answer is A.", "A"), ("My choice is C", "C"),
    ("Answer: B", "B"), ("answer: b", "B"), ("ANSWER: B", "B"), ("Answer - B", "B"),
    ("Answer = B", "B"), ("Answer:B", "B"), ("Answer: (B)", "B"), ("Answer: **B**", "B"),
    ("**Answer: B**", "B"), ("**Answer:** B", "B"), ("**Answer**: B", "B"), ("Answer: B. Arch", "B"),
    ("Final answer: B", "B"), ("**Final Answer:** B", "B"), ("**Final Answer**\n\nB", "B"),
    ("### Final Answer\n**B**", "B"), ("Final Answer: $B$", "B"), ("> Answer: C", "C"),
    ("- Answer: C", "C"), ("Answer:\nC", "C"), ("Answer:\n\nC", "C"), ("Answer: option C", "C"),
    ("I choose B.", "B"), ("I would choose option B.", "B"), ("I'd go with option C.", "C"),
    ("I will go with (D).", "D"), ("I pick A.", "A"), ("I'll select B", "B"),
    ("Option B is correct.", "B"), ("B is the correct answer.", "B"), ("(B) is correct", "B"),
    ("**B** is the best match.", "B"), ("B (arch) is the correct answer.", "B"),
    ("A is correct.", "A"), ("Among these, C is the most likely.", "C"),
    ("The answer to the question is D.", "D"), ("The correct picture is C.", "C"),
    ("The answer is A because the block has six equal faces.", "A"),
    ("The answer is A, since it is a cube", "A"), ("The answer is A - a cube.", "A"),
    ("The answer is option A, not B.", "A"), ("The answer must be D.", "D"),
]  # fmt: skip

REASONED = [
    ("Option A shows a cube and option C a cylinder. The block is an arch, so the answer is B.", "B"),
    ("A is too tall.\nC is too round.\nD is too long.\n\nB", "B"),
    ("A) cube: no, it is hollow.\nB) arch: yes.\nC) cylinder: no.\nD) cuboid: no.\n\nAnswer: B", "B"),
    ("Let me look at the options:\nA. cube\nB. arch\nC. cylinder\nD. cuboid\n\nThe block is round.\n\n**C. cylinder**", "C"),
    ("The answer is A. Wait, actually the answer is C.", "C"),
    ("At first sight the answer is A. However, the shadow shows that the answer is D.", "D"),
    ("Answer: A\n\nLet me double-check. The top is round, so that was wrong.\n\nAnswer: C", "C"),
    ("The answer is A if we see it from above.\n\nFinal answer: B", "B"),
    ("If it were hollow, the answer would be B. It is solid, so the answer is A.", "A"),
    ("B\n\nThe block spans two supports with an opening below, which A, C and D lack.", "B"),
    ("B because A is solid and C is round.", "B"), ("B, because it is hollow", "B"),
    ("**B** – it is the only hollow one.", "B"), ("C) The block is round.", "C"),
    ("D. The block is longer than it is high.", "D"), ("A: all its edges are equal.", "A"),
    ("Comparing A, B and C with the picture, it must be C.", "C"),
    ("I looked at the picture and compared it with every option. It is D.", "D"),
    ("The block has an opening below it. This matches option B.", "B"),
    ("The one that fits the picture is **(C)**", "C"),
    ("Step 1: find the block.\nStep 2: A block with a round top is a cylinder.\nStep 3: choose.\n\nTherefore, the answer is C.", "C"),
    ("The structure has A-shaped legs. The answer is B.", "B"),
]  # fmt: skip

BY_TEXT = [
    ("arch", "B"), ("Arch", "B"), ("Arch.", "B"), ("an arch", "B"), ("The arch", "B"), ("**arch**", "B"),
    ("Answer: cube", "A"), ("The answer is a cylinder.", "C"), ("The answer is A cylinder.", "C"),
    ("A cylinder", "C"), ("a cylinder", "C"), ("It is a cuboid.", "D"), ("The shape is an arch.", "B"),
    ("The red block on top is a cylinder.", "C"), ("A cube is on top.", "A"),
    ("Its opening goes from end to end, as in no other block.\n\nSo I would say that it is an arch.", "B"),
    ("Option 2", "B"), ("option number 3", "C"), ("2", "B"), ("(2)", "B"), ("Answer: 3", "C"),
    ("The second option", "B"), ("The correct answer is the third option.", "C"),
]  # fmt: skip

LANGUAGES = [
    ("答案是B。", "B"), ("答案：B", "B"), ("答案：Ｂ", "B"), ("正确答案是C", "C"), ("选B", "B"), ("应该选择C。", "C"),
    ("正解はBです", "B"), ("答えはDです。", "D"), ("回答: A", "A"), ("정답: D", "D"), ("정답은 B입니다.", "B"),
    ("La respuesta es C.", "C"), ("La respuesta correcta es la opción B.", "B"), ("La réponse est B.", "B"),
    ("Réponse : D", "D"), ("Die Antwort ist D", "D"), ("Antwort: B", "B"), ("A resposta é C.", "C"),
    ("La risposta è B.", "B"), ("Ответ: B", "B"), ("Правильный ответ: C", "C"), ("Jawaban: B", "B"),
    ("Cevap: B", "B"), ("Odpowiedź: C", "C"), ("因此，答案是D。", "D"), ("Antwoord: A", "A"), ("Svar: B", "B"),
]  # fmt: skip

UNREADABLE = [
    "", "   \n", "?", "...", "E", "Answer: E", "The answer is E.", "(F)", "Option 7", "Answer: 9",
    "I'm sorry, I can't help with that.", "I cannot see any picture.", "I am unable to view images.",
    "I'm sorry, but I cannot determine the shape; option A is not visible.",
    "There is not enough information to choose between the options.",
    "Answer: A or B", "Answer: A and C", "A or B", "A, C", "B/C", "I think it's B or C", "Answer: B, C",
    "Answer: A\nAnswer: B", "The answer is A.\nThe answer is B.", r"\boxed{A} \boxed{B}",
    "<answer>A</answer><answer>C</answer>", '{"answer": "B"} {"answer": "C"}',
    "A) cube\nB) arch\nC) cylinder\nD) cuboid", "A. cube B. arch C. cylinder D. cuboid",
    "The answer is not A.", "It is not a cube.", "None of the above", "Answer: none", "Answer: unknown",
    "B. Cylinder", "The answer is C, arch.", "A red block is on top.", "A tower of blocks is shown.",
    "a red thing", "The picture shows toy blocks.", "It is a cube or a cylinder.", "Answer:", "Answer: ",
    "Both B and C are possible.", "<answer></answer>", "{}", "null", "I do not know.",
]  # fmt: skip

OF_OTHER_OPTIONS = [
    (COUNTS, "3", "B"), (COUNTS, "Answer: 3", "B"), (COUNTS, "There are three blocks.", "B"),
    (COUNTS, "There are 4 blocks.", "C"), (COUNTS, "the answer is four", "C"), (COUNTS, "B. 3", "B"),
    (COUNTS, "I count 1 red and 2 blue: in total 3.\n\nSo the answer is 3.", "B"),
    (COUNTS, "Answer: B", "B"), (COUNTS, "B. 4", None), (COUNTS, "Answer: 7", None), (COUNTS, "1", None),
    (COUNTS, "option 3", None), (COUNTS, "**5**", "D"), (COUNTS, "The number of blocks is 12.", None),
    (COUNTS, "Two red ones and three blue ones", None), (COUNTS, "The answer is 5 (option D).", "D"),
    (LENGTHS, "10", "B"), (LENGTHS, "10 cm", "B"), (LENGTHS, "10cm", "B"), (LENGTHS, "Answer: 15 cm", "C"),
    (LENGTHS, "about 10 cm tall", "B"), (LENGTHS, "The height is 10.0 cm", "B"), (LENGTHS, "12 cm", None),
    (LENGTHS, "Answer: C. 15 cm", "C"), (LENGTHS, "C (15 cm)", "C"), (LENGTHS, "5 cm + 5 cm = 10 cm", None),
    (PICTURES, "B", "B"), (PICTURES, "<img2>", "B"), (PICTURES, "Picture C", "C"), (PICTURES, "Image D.", "D"),
    (PICTURES, "Picture C shows the same structure.", "C"), (PICTURES, "Answer: picture A", "A"),
    (PICTURES, "The goal picture and picture B have the same blocks.", "B"),
    (PLACES, "B", "B"), (PLACES, "Place C", "C"), (PLACES, "Answer: place D", "D"), (PLACES, "B. place B", "B"),
    (PLACES, "The block stays at place C.", "C"), (PLACES, "Position B", "B"), (PLACES, "Place A or D", None),
    (RELATIONS, "behind it", "D"), (RELATIONS, "Answer: to the right of it", "B"), (RELATIONS, "C", "C"),
    (RELATIONS, "The red cube stands in front of it.", "C"), (RELATIONS, "D. Behind it", "D"),
    (BLOCKS, "The blue cylinder", "B"), (BLOCKS, "blue cylinder.", "B"), (BLOCKS, "A. The red cube", "A"),
    (BLOCKS, "The red cube rests on the blue cylinder.", None), (BLOCKS, "Answer: the red arch", "C"),
    (OUTCOMES, "Only the red arch falls.", "B"), (OUTCOMES, "Answer: C", "C"),
    (OUTCOMES, "D. The whole structure collapses.", "D"), (OUTCOMES, "Nothing moves", "A"),
    (OUTCOMES, "The answer is B: only the red arch falls, because it rests on that block alone.", "B"),
]  # fmt: skip

ROUNDS = ("half cylinder", "cylinder", "arch", "cube")
NO_HALF = ("cylinder", "arch", "cube", "rectangular prism")
TURNS = ("90 degrees clockwise", "90 degrees counterclockwise", "0 degrees", "180 degrees")
TURNED_DOWN = [
    "Option A is wrong.", "It is not option A.", "Option A shows a cube, which does not match.",
    "A: incorrect. The block is round.", "A. No, that is a cube.", "A is wrong", "C is incorrect.",
    "Let me look closely. Option A shows a cube, which", "First (A): its top is round and,",
    "C isn't it", "B) not round", "B cannot be it", "Answer: A) cube and B) arch",
]  # fmt: skip
NEARLY_OPTIONS = [
    (LENGTHS, "Answer: 7.5 cm", None), (LENGTHS, "12.5 cm", None), (LENGTHS, "Answer: 10 mm", None),
    (LENGTHS, "10 inches", None), (LENGTHS, "10 centimeters", "B"), (LENGTHS, "Answer: 0.10 m", None),
    (COUNTS, "Answer: 2.5", None), (COUNTS, "1/2", None), (COUNTS, "3D view", None),
    (ROUNDS, "It is a half-cylinder.", "A"), (ROUNDS, "Half-cylinder", "A"), (ROUNDS, "cylinder", "B"),
    (NO_HALF, "It is a half-cylinder.", None), (NO_HALF, "Answer: half cylinder", None),
    (NO_HALF, "a semi-cylinder", None), (NO_HALF, "rectangular-prism", "D"),
    (TURNS, "90° counter-clockwise", "B"), (TURNS, "It is turned 90 degrees anticlockwise.", "B"),
    (TURNS, "Answer: 180°", "D"), (TURNS, "Answer: 90°", None), (TURNS, "90° clockwise", "A"),
    (PICTURES, "There are 2 red blocks in the picture.", None), (PICTURES, "Option 2", "B"),
    (PICTURES, "Picture A differs in the green block.", None), (PICTURES, "Answer: 2", "B"),
    (SHAPES, "The answer is probably B.", "B"), (SHAPES, "The answer is most likely (B).", "B"),
    (SHAPES, "B, not C", "B"), (SHAPES, "B is the one that is not solid.", "B"),
    (OUTCOMES, "A. Nothing moves", "A"),
    (SHAPES, "A is wrong: the block is hollow. It must be B.", "B"),
    (SHAPES, "Option B fits. I looked at nothing else, not even twice.", "B"),
]  # fmt: skip


def letters_of(text: str, options: tuple[str, ...], *, is_ordering: bool = False) -> str | None:
    parsed = parse_answer(text, options, is_ordering)
    assert (parsed.letters is None) == (parsed.rule is None)
    return parsed.letters


@pytest.mark.parametrize(
    ("text", "letters"), [*BARE, *MARKED, *STATED, *REASONED, *BY_TEXT, *LANGUAGES]
)
def test_a_reply_is_read_as_the_option_it_means(text: str, letters: str) -> None:
    assert letters_of(text, SHAPES) == letters


@pytest.mark.parametrize("text", UNREADABLE)
def test_a_reply_that_names_no_one_option_is_a_parse_failure(text: str) -> None:
    assert parse_answer(text, SHAPES, False) == ParsedAnswer(None, None)


@pytest.mark.parametrize(("options", "text", "letters"), OF_OTHER_OPTIONS)
def test_options_of_every_kind_are_read(
    options: tuple[str, ...], text: str, letters: str | None
) -> None:
    assert letters_of(text, options) == letters


@pytest.mark.parametrize("text", TURNED_DOWN)
def test_an_option_that_is_turned_down_is_not_chosen(text: str) -> None:
    assert parse_answer(text, SHAPES, False) == ParsedAnswer(None, None)


@pytest.mark.parametrize(("options", "text", "letters"), NEARLY_OPTIONS)
def test_what_is_nearly_an_option_is_none_and_spellings_do_not_matter(
    options: tuple[str, ...], text: str, letters: str | None
) -> None:
    assert letters_of(text, options) == letters


ORDERS = [
    "B, A, D, C", "BADC", "badc", "B A D C", "B-A-D-C", "b-a-d-c", "B > A > D > C", "B → A → D → C",
    "B->A->D->C", "B, A, D and C", "(B, A, D, C)", "[B, A, D, C]", "**B, A, D, C**", "`BADC`",
    "(B)(A)(D)(C)", "2-1-4-3", "2, 1, 4, 3", "2143", "[2, 1, 4, 3]", '["B", "A", "D", "C"]',
    "Answer: BADC", "Answer: B, A, D, C", "Final answer: B-A-D-C", "The answer is BADC.",
    "The correct order is: **B, A, D, C**.", "The correct sequence is 2, 1, 4, 3",
    '{"answer": ["B", "A", "D", "C"]}', '{"answer": "BADC"}', '{"order": [2, 1, 4, 3]}',
    r"\boxed{BADC}", r"\boxed{B, A, D, C}", r"\boxed{B \rightarrow A \rightarrow D \rightarrow C}",
    "<answer>B, A, D, C</answer>", "<think>A, C, B, D?</think>B, A, D, C",
    "Picture B, picture A, picture D, picture C", "Image B -> Image A -> Image D -> Image C",
    "First B, then A, then D, and finally C.", "First picture B, then A, followed by D and C",
    "1. B\n2. A\n3. D\n4. C", "1) Picture B\n2) Picture A\n3) Picture D\n4) Picture C\n",
    "1. B: only the base\n2. A: two blocks\n3. D: the arch\n4. C: all of them",
    "The pictures A, B, C and D show stages. The order is B, A, D, C.",
    "A has two blocks, B one, C four, D three.\n\nB, A, D, C",
    "At first it seems to be A, B, C, D.\n\nAnswer: A, B, C, D\n\nWait, that is wrong.\n\nAnswer: B, A, D, C",
    "Correct order of the pictures: B, A, D, C", "The order in which it is built is B, A, D, C.",
    "答案：B、A、D、C", "答案是BADC。", "Ответ: B, A, D, C",
]  # fmt: skip
NO_ORDERS = [
    "", "B", "The answer is B.", "B, A, D", "B, A, D, D", "BADCE", "1-2-3", "1-2-3-5", "0-1-2-3",
    "Answer: B, A", "Answer: BADC or ABDC", "Answer: BADC\nAnswer: ABCD",
    "The pictures A, B, C and D show stages.", "I cannot tell the order of A, B, D, C.",
    "I'm sorry, I can't help with that.", "BAD", "a cab d", "12-34-56",
]  # fmt: skip


@pytest.mark.parametrize("text", ORDERS)
def test_an_order_is_read_whatever_stands_between_its_letters(text: str) -> None:
    assert letters_of(text, PICTURES, is_ordering=True) == "BADC"


@pytest.mark.parametrize("text", NO_ORDERS)
def test_what_is_no_order_of_all_pictures_is_a_parse_failure(text: str) -> None:
    assert parse_answer(text, PICTURES, True) == ParsedAnswer(None, None)


def test_the_order_in_which_the_pictures_are_shown_can_be_an_answer() -> None:
    for text in (
        "A, B, C, D",
        "Answer: ABCD",
        "The correct order is A, B, C, D.",
        "A -> B -> C -> D",
    ):
        assert letters_of(text, PICTURES, is_ordering=True) == "ABCD"


def test_the_rule_that_matched_is_named() -> None:
    rules = {
        "B": "whole",
        "<answer>B</answer> A": "tag",
        r"so \boxed{B}": "boxed",
        'so {"answer": "B"}': "json",
        "A? No. Answer: B": "stated",
        "A? C?\nB": "outer_line",
        "B because it is hollow": "leading",
        "What is hollow? It must be B.": "concluded",
        "I see the hollow (B) there": "only_one_named",
        "A hollow arch, I see": "only_text",
    }
    assert {text: parse_answer(text, SHAPES, False).rule for text in rules} == rules
    orders = {"1. B\n2. A\n3. D\n4. C": "numbered_list", "It goes B, A, D, C I think": "only_order"}
    assert {text: parse_answer(text, PICTURES, True).rule for text in orders} == orders
