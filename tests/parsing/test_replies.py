"""Replies of every form but plans: tables with what they say, and laws of every reader."""

import json
import time

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from phyblock.domain.scene import PoseStep
from phyblock.parsing.answer import choice_form, parse_answer
from phyblock.parsing.move import parse_move
from phyblock.parsing.plan import parse_plan
from phyblock.parsing.poses import MOST_POSE_STEPS, parse_poses, pose_form

REPLIES = [
    ("Move(3)", "3 line"),
    ("Next plan: Move(3)", "3 line"),
    ("**Next plan:** Move( 3 ).", "3 line"),
    ("The base is there.\n\nNext plan: Move(3)", "3 line"),
    ("Next plan: Move(7)\nNo, 7 is turned.\nNext plan: Move(3)", "3 line"),
    ("Next plan: Move(3)\n\nIt rests on block 7.", "3 line"),
    ("```\nNext plan: Move(3)\n```", "3 line"),
    ("<think>Next plan: Move(7)</think>Next plan: Move(3)", "3 line"),
    ("\\boxed{Move(3)}", "3 line"),
    ("Move block with index 3", "3 line"),
    ("next plan = move[3]", "3 line"),
    ("Next plan: Move(-3)", "-3 line"),
    ("Next plan: Move 3", "3 line"),
    ("Next plan: 3", "3 line"),
    ("3", "3 line"),
    ("Move(3)\nMove(3)", "3 line"),
    ("Everything stands. Done.", "done line"),
    ("Next plan: Done", "done line"),
    ("Done()", "done line"),
    ("My next plan is Move(3), since its support is there.", "3 label"),
    ("I will place the arch now: Move(3) on the left.", "3 mention"),
    ("The last step worked.\nNow Move(3) fits.\nThat is all.", "3 mention"),
    ('{"reasoning": "Move(7) fails", "operation": "Move(3)"}', "3 json"),
    ('I see.\n```json\n{"operation": "Done"}\n```', "done json"),
    ('{"operation": "Move(7)"}\n{"operation": "Move(3)"}', "3 json"),
    ('{"operation": 3}', "3 json"),
    ("", "empty"),
    ("<think>Move(3)", "thoughts_only"),
    ("I am done thinking about the red block.", "no_move"),
    ("Place the red cube.", "no_move"),
    ("Move(N)", "no_move"),
    ("Move(3.5)", "no_move"),
    ("Next plan: Move(3) or Move(7)", "several_moves"),
    ("Next plan: Move(3), then Move(7)", "several_moves"),
    ("Move(3)\nMove(7)", "several_moves"),
    ("Move(3)\nDone", "several_moves"),
    ("Move(3) would fall, Move(7) would not.", "several_moves"),
]


@pytest.mark.parametrize(("text", "said"), REPLIES)
def test_an_operation_is_read_as_it_is_said(text, said):
    parsed = parse_move(text)
    read = "done" if parsed.is_done else parsed.move
    assert (parsed.problem or f"{read} {parsed.rule}") == said


@given(st.integers(1, 16), st.text(st.sampled_from("abc ,.\n"), max_size=80), st.booleans())
def test_what_stands_before_the_asked_form_changes_nothing(number, text, is_json):
    asked = (
        json.dumps({"reasoning": text, "operation": f"Move({number})"})
        if is_json
        else f"Next plan: Move({number})"
    )
    assert parse_move(f"{text}\n{asked}").move == number


TEXTS = ("a red cube", "a blue cube", "an arch", "a cylinder")
LENGTHS = ("5 cm", "7.5 cm", "10 cm", "15 cm")

READ = [
    ("Answer: C", "C", "answer_line"),
    ("The span is bridged by one block.\n\n**Answer:** (C)", "C", "answer_line"),
    ("Answer: c", "C", "answer_line"),
    ("Answer:\nC", "C", "answer_line"),
    ("The correct answer is option C, because it is round.", "C", "answer_line"),
    ("Answer: C) an arch", "C", "answer_line"),
    ("Answer: an arch", "C", "answer_line"),
    ("Answer: A\nWait, it is hollow.\nAnswer: C", "C", "answer_line"),
    ("\\boxed{C}", "C", "answer_line"),
    ("It is hollow. $\\boxed{\\text{C}}$", "C", "answer_line"),
    ("<answer>C</answer>", "C", "answer_line"),
    ("<think>Answer: A</think>Answer: C", "C", "answer_line"),
    ('{"reasoning": "hollow", "answer": "C"}', "C", "json"),
    ('Draft {"answer": "A"}, then:\n```json\n{"answer": "C"}\n```', "C", "json"),
    ("I choose C. A and B are solid.", "C", "stated"),
    ("A looks right at first, but it is solid. Therefore C.", "C", "stated"),
    ("B is wrong. C is the correct one.", "C", "stated"),
    ("C", "C", "line"),
    ("**C.** It is the only one with a hole.", "C", "line"),
    ("It has a hole.\n(C)", "C", "line"),
    ("An arch.", "C", "line"),
    ("Only option C has a hole in it.", "C", "only_named"),
    ("What the picture shows on the left is an arch.", "C", "only_named"),
    ("", None, None),
    ("I cannot tell from this picture.", None, None),
    ("Answer: none of them", None, None),
    ("Answer: A or B", None, None),
    ("Answer: X", None, None),
    ("Answer: E", None, None),
    ("A. a red cube\nB. a blue cube\nC. an arch\nD. a cylinder", None, None),
    ("It may be option A, it may be option B.", None, None),
]


@pytest.mark.parametrize(("text", "letter", "rule"), READ)
def test_a_choice_is_read_as_it_is_stated(text, letter, rule):
    parsed = parse_answer(text, TEXTS, is_ordering=False)
    assert (parsed.letters, parsed.rule) == (letter, rule)
    assert (parsed.problem is None) == (letter is not None)


@pytest.mark.parametrize(
    ("text", "letter"),
    [
        *(("Answer: 10 cm", "C"), ("Answer: 10", "C"), ("Answer: B (7.5 cm)", "B"), ("5 cm", "A")),
        *(("Answer: 75", None), ("It is 5 cm or 10 cm long.", None)),
    ],
)
def test_options_that_are_numbers_are_read_by_number(text, letter):
    assert parse_answer(text, LENGTHS, is_ordering=False).letters == letter


@pytest.mark.parametrize(
    ("text", "letters"),
    [
        ("Answer: C, A, D, B", "CADB"),
        ("First C, later D.\n**Answer: C → A → D → B**", "CADB"),
        ("CADB", "CADB"),
        ("The order is C > A > D > B.", "CADB"),
        ("1. C\n2. A\n3. D\n4. B", "CADB"),
        ("First I thought A, B, C, D, but it must be C, A, D, B.", "CADB"),
        ('{"reasoning": "", "answer": ["C", "A", "D", "B"]}', "CADB"),
        ('{"answer": "C, A, D, B"}', "CADB"),
        ("\\boxed{C, A, D, B}", "CADB"),
        ("picture C, then picture A, then picture D, then picture B", "CADB"),
        ("Answer: W, X, Y, Z", None),
        ("C, A, D", None),
        ("C, A, C, B", None),
        ("I cannot tell.", None),
    ],
)
def test_an_order_is_the_last_that_names_every_letter(text, letters):
    assert parse_answer(text, TEXTS, is_ordering=True).letters == letters


harmless = st.text(st.sampled_from("xyz ,.\n"), max_size=80)


@given(
    harmless,
    st.sampled_from("ABCD"),
    st.sampled_from(("Answer: {}", "**Answer: {}**", "\\boxed{{{}}}")),
)
def test_text_before_the_asked_line_changes_nothing(text, letter, form):
    whole = f"{text}\n{form.format(letter)}"
    assert parse_answer(whole, TEXTS, is_ordering=False).letters == letter


@given(st.permutations("ABCD"))
def test_the_json_form_is_read_as_it_is_written(order):
    for value, is_ordering in ((order, True), (order[0], False)):
        form = choice_form(TEXTS, is_ordering)
        text = json.dumps({"reasoning": "It is {A}.", form.key: value})
        assert json.loads(text)["answer"] == value
        assert parse_answer(text, TEXTS, is_ordering).letters == "".join(value)


TWO = "Step1: block 3 at (5, 10, 2.5)\nStep2: block 5 at (0, -5, 7.5)"
STEPS = [(3, (5.0, 10.0, 2.5)), (5, (0.0, -5.0, 7.5))]
IN_JSON = json.dumps(
    {"plan": [{"block": n, "x": x, "y": y, "z": z} for n, (x, y, z) in STEPS], "reasoning": "{"}
)

PLANS_READ = [
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


@pytest.mark.parametrize("text", PLANS_READ)
def test_a_plan_is_read_in_whatever_decoration(text):
    parsed = parse_poses(text, 16)
    assert parsed.problem is None
    assert [(step.candidate, pytest.approx(step.center_cm)) for step in parsed.steps] == STEPS


def one(rest):
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
def test_a_step_that_cannot_be_read_is_the_problem_of_the_plan(text, problem):
    parsed = parse_poses(text, 16)
    assert (parsed.steps, parsed.rule, parsed.problem) == ((), None, problem)


lengths = st.integers(-100_000, 100_000).map(lambda n: n / 100)
steps = st.builds(PoseStep, st.integers(1, 16), st.tuples(lengths, lengths, lengths))


@given(st.lists(steps, min_size=1, max_size=MOST_POSE_STEPS), st.booleans())
def test_every_plan_of_the_asked_forms_is_read_as_it_is_written(plan, is_json):
    lines = [f"Step{i}: block {one.candidate} at {one.center_cm}" for i, one in enumerate(plan, 1)]
    items = [
        {"block": one.candidate, **dict(zip("xyz", one.center_cm, strict=True))} for one in plan
    ]
    text = json.dumps({"reasoning": "", pose_form(16).key: items}) if is_json else "\n".join(lines)
    assert parse_poses(text, 16).steps == tuple(plan)


LINEAR_TEXTS = ("a red cube", "a blue cube", "an arch", "a cylinder")
READERS = {
    "plan": lambda text: parse_plan(text, 16),
    "official": lambda text: parse_plan(text, 16, "official"),
    "move": parse_move,
    "choice": lambda text: parse_answer(text, LINEAR_TEXTS, is_ordering=False),
    "order": lambda text: parse_answer(text, LINEAR_TEXTS, is_ordering=True),
    "poses": lambda text: parse_poses(text, 16),
}
_PIECES = (
    "Step1: Move block with index 7  \n|Step|step 12 & |Steps 1, 2 and 3|block |# Layer 1:\n|"
    "index |1. |- |* |> |**|_|`|~~|```json\n|```|\n|  \n|\t|\u00a0|\u200b|\u00e9|7 |1, |and |"
    '-> |(|)|[|]|{|}|"|\\"|\\n|{"plan": [|{"answer": |{"operation": "|\\boxed{|<answer>|'
    "<think>|</think>|plan |order: |Answer: |answer is |option A |A, B |C is right|not |"
    "Next plan: |Move(|Move block |done |move |at (1, 2, 3) |x = 1.5 |a red cube |mm |e|.|,|:|="
)
PIECES = (*_PIECES.split("|"), "twice", "x2", "|", "| 1 | 2 ", " " * 50, "7" * 40, "a" * 40)
SIZE = 100_000
MOST_RATIO = 3.0  # 2 is linear, 4 quadratic.
SMALL_S = 0.05  # Times below this say nothing.


def seconds(read, text):
    """Return the CPU time of reading a text."""
    start = time.process_time()
    read(text)
    return time.process_time() - start


def check(read, piece):
    """Fail where 100 KB take much more than twice the time of 50 KB, each time."""
    whole = (piece * (SIZE // len(piece) + 1))[:SIZE]
    for _ in range(6):
        took = seconds(read, whole)
        if took < SMALL_S or took < MOST_RATIO * seconds(read, whole[: SIZE // 2]):
            return
    pytest.fail(f"{len(whole)} characters take {took:.3f} s")


@pytest.mark.parametrize("name", READERS)
def test_a_text_of_one_piece_is_read_in_linear_time(name):
    for piece in PIECES:
        check(READERS[name], piece)


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=10)
@given(st.lists(st.sampled_from(PIECES), min_size=2, max_size=8).map("".join))
@example("Step1: Move block with index 16  \n")
def test_a_text_of_many_pieces_is_read_in_linear_time(name, piece):
    check(READERS[name], piece)


@pytest.mark.parametrize("name", READERS)
@given(st.text())
def test_any_text_is_read_or_a_named_problem(name, text):
    parsed = READERS[name](text)
    assert (parsed.rule is None) == (parsed.problem is not None)
    if name == "move":
        assert (parsed.rule is None) == (parsed.move is None and not parsed.is_done)
    elif name in ("choice", "order"):
        assert (parsed.rule is None) == (parsed.letters is None)
        assert set(parsed.letters or "") <= set("ABCD")
