"""Answers with a turn in them: conditions, second thoughts, quotations, opposite orders.

What a reply takes back, quotes or ties to a condition is no answer.
"""

# ruff: noqa: RUF001 -- replies come in other scripts

from __future__ import annotations

import pytest

from phyblock.parsing import parse_answer

SHAPES = ("cube", "arch", "cylinder", "cuboid")
PICTURES = ("<img1>", "<img2>", "<img3>", "<img4>")

CHOICES: list[tuple[str, str | None]] = [
    ("I would answer A, however the picture shows that it is D.", "D"),
    ("I would answer A, but the picture shows that it is D", "D"),
    ("At first I would say A. However, the picture shows that it is D.", "D"),
    ("A if mirrored, otherwise B", None),
    ("A if the picture is mirrored, otherwise B.", None),
    ("If the picture is mirrored, the answer is A.", None),
    ("The answer is A if seen from behind, B if seen from the front.", None),
    ('The instructions say to end with "Answer: A". I think it is C.\n\nAnswer: C', "C"),
    ('You asked me to reply as "Answer: A". The block is round, so it is C.', "C"),
    ('The format is "Answer: X".\nAnswer: B', "B"),
    ('For example, "Answer: A" would be wrong. My answer: D', "D"),
    ("Depends on the view: A from the left, B from the right.", None),
    ("Unless it is hollow, the answer is A.", None),
    ("It is not A, B or D, so it is C.", "C"),
    ("A and B are wrong, C and D remain.", None),
    ("Not B.", None),
    ("Everything except C fits.", None),
    ("I was going to say B, but it is C.", "C"),
    ("My first guess was B; the final answer is C.", "C"),
    ("Probably B, possibly C.", None),
    ("B (90% sure), C (10%)", None),
    ("Could be A, could be B.", None),
    ("Answer: B (not A)", "B"),
    ("Answer: B\n\nA is wrong because it is solid.", "B"),
    ("Answer: B\nConfidence: high", "B"),
    ("**Answer:** B\n\n**Explanation:** A is solid, C is round.", "B"),
    ("<think>Answer: A", None),
    ("<think>Answer: A</think>", None),
    ("Antwort: A, falls gespiegelt, sonst B", None),
    ("答案是A，但是图中显示是D。", None),
    ("I choose A over B.", "A"),
    ("I prefer C to A.", "C"),
    ("Between A and C, I pick C.", "C"),
    ("The answer isn't A; it's B.", "B"),
    ("The answer cannot be A.", None),
    ("Some would answer A. The right one is B.", "B"),
    ('A student might say "Answer: A", which is wrong.', None),
    ("User: what is it?\nAnswer: A\n\nUser: and now?\nAnswer: B", None),
    ("Answer: [B]", "B"),
    ("Answer: {B}", "B"),
    ("Answer: <B>", "B"),
    ('{"answer": "B", "alternative": "C"}', "B"),
    ('{"wrong_answer": "A", "answer": "B"}', "B"),
    ('{"answer": null}', None),
    ('{"answers": ["A", "B"]}', None),
    ("\\boxed{B} (not \\boxed{A})", None),
    ("Option B is the correct choice, not option A.", "B"),
    ("Option A is incorrect, option B is correct.", "B"),
    ("A: no. B: no. C: yes. D: no.", "C"),
    ("A ✗\nB ✗\nC ✓\nD ✗", "C"),
    ("- A: does not match\n- B: does not match\n- C: matches\n- D: does not match", "C"),
    ("The answer is neither A nor B.", None),
    ("Answer: A or, if you count the hidden block, B", None),
    ("~~A~~ B", "B"),
    ("Answer: ~~A~~ B", "B"),
    ("A\nB", None),
    ("A looks right at first, yet the correct answer is C.", "C"),
    ("I'd say B. Hmm, wait. The hole is round... C. Final: C", "C"),
    ("My answer: B, although D is also plausible.", "B"),
    ("My answer is B, though it could be D.", "B"),
    ("It's either B or D; I'll go with D.", "D"),
    ("I'm not certain. Answer: B", "B"),
    ("B is what most people would say. The right answer is D.", "D"),
    ("Answer: B if the block is hollow, and C if it is solid.", None),
    ("Answer: B (if the block is hollow)", None),
    ("Assuming the view is from the front, the answer is A. From behind, it is B.", None),
    ("The answer would be A if it were solid. It is hollow, so the answer is B.", "B"),
    ("When mirrored, A; else B.", None),
    ("A and C", None),
    ("A/C", None),
    ("All of them.", None),
    ("A, B, C, D", None),
    ("Answer: the first or the second", None),
    ("The prompt says: 'Answer: A'. My answer: C", "C"),
    ("Question 1: Answer: A\nQuestion 2: Answer: B", None),
    ("Answer: C.\n\nQuestion: What is next?\nAnswer: B", None),
    ("I rule out A. I rule out B. I rule out D.", None),
    ("Correction: C, not B.", "C"),
    ("Answer: B. Correction: C.", "C"),
    ("The correct answer is not B but C.", "C"),
    ("Antwort: nicht B, sondern C", "C"),
    ("最终答案：C（不是B）", "C"),
    ("首先我认为是A，但最终答案是C。", "C"),
    ("I answered B before; now I answer C.", "C"),
    ("B ✓, others ✗", "B"),
    ("Ranking: C, B, A, D", None),
    ("P(A)=0.1, P(B)=0.7, P(C)=0.1, P(D)=0.1", None),
    ('{"A": 0.1, "B": 0.7, "C": 0.1, "D": 0.1}', None),
    ('{"answer": "B", "reason": "A is solid"}', "B"),
    ('{"reason": "the answer is A?", "answer": "B"}', "B"),
    ("<answer>B</answer><confidence>A</confidence>", "B"),
    ("<draft>Answer: A</draft><answer>B</answer>", "B"),
]

ORDERS: list[tuple[str, str | None]] = [
    ("From last to first: C, D, A, B", "BADC"),
    ("The order from last to first is C, D, A, B.", "BADC"),
    ("In reverse order: C, D, A, B", "BADC"),
    ("B, A, D, C or A, B, D, C", None),
    ("Either B, A, D, C or B, D, A, C.", None),
    ("The order is B, A, D, C. Alternatively, A, B, D, C.", None),
    ("Possible orders: BADC, ABDC", None),
    ("Answer: B, A, D, C (the reverse of C, D, A, B)", "BADC"),
    ("The last picture is C, before it D, then A, and first B.", None),
    ("C is last, D third, A second and B first.", "BADC"),
    ("B is first, A second, D third, C last.", "BADC"),
    ("B comes first, then A, then D, then C.", "BADC"),
    ("Reading backwards: C, D, A, B. So forwards: B, A, D, C.", "BADC"),
    ("The order is not A, B, C, D but B, A, D, C.", "BADC"),
    ("I first thought A, B, C, D. However, it is B, A, D, C.", "BADC"),
    ("If built from the left: B, A, D, C; otherwise A, B, D, C", None),
    ("<answer>BADC</answer> is my answer, although ABDC is possible", "BADC"),
    ("从后到前：C, D, A, B", "BADC"),
    ("Von hinten nach vorn: C, D, A, B", "BADC"),
    ("1: B\n2: A\n3: D\n4: C", "BADC"),
    ("| Position | Picture |\n|---|---|\n| 1 | B |\n| 2 | A |\n| 3 | D |\n| 4 | C |", "BADC"),
    ("A: 2\nB: 1\nC: 4\nD: 3", "BADC"),
    ("B < A < D < C", "BADC"),
    ("Answer: BADC\n\nNot ABCD, since A has more blocks than B.", "BADC"),
]


@pytest.mark.parametrize(("text", "letter"), CHOICES)
def test_the_option_that_is_meant_in_the_end_is_read(text: str, letter: str | None) -> None:
    assert parse_answer(text, SHAPES, False).letters == letter


@pytest.mark.parametrize(("text", "order"), ORDERS)
def test_an_order_is_read_from_first_to_last(text: str, order: str | None) -> None:
    assert parse_answer(text, PICTURES, True).letters == order
