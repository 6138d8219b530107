"""Replies of every form: a table of what they say, laws of every reader, and counts of readings of
the official recordings.
"""

import json
import time
from collections import Counter, defaultdict
from pathlib import Path

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st

from phyblock.domain.scene import PoseStep
from phyblock.parsing.answer import choice_form, parse_answer, parse_move
from phyblock.parsing.plan import MOST_POSE_STEPS, parse_plan, parse_poses, pose_form
from tests.shipped import reply_texts
from tests.workspace import csv_rows, plan_text

N = 16
OPTIONS = ("a red cube", "a blue cube", "an arch", "a cylinder")
LENGTHS = ("5 cm", "7.5 cm", "10 cm", "15 cm")
READERS = {
    "plan": lambda text: parse_plan(text, N),
    "official": lambda text: parse_plan(text, N, "official"),
    "move": parse_move,
    "choice": lambda text: parse_answer(text, OPTIONS, is_ordering=False),
    "number": lambda text: parse_answer(text, LENGTHS, is_ordering=False),
    "order": lambda text: parse_answer(text, OPTIONS, is_ordering=True),
    "poses": lambda text: parse_poses(text, N),
}
SAID = {
    "plan": lambda plan: f"{' '.join(map(str, plan.plan.steps))}{' cut' * plan.truncated}",
    "move": lambda read: f"{'done' if read.is_done else read.move} {read.rule}",
    "poses": lambda plan: "; ".join(
        "{} at {:g}, {:g}, {:g}".format(step.candidate, *step.center_cm) for step in plan.steps
    ),
}
HERE = Path(__file__).parent
TABLE = yaml.safe_load((HERE / "replies.yaml").read_text(encoding="utf-8"))
AROUND = TABLE.pop("around a plan")
ROWS = [
    (reader, said, text)
    for reader, rows in TABLE.items()
    for said, texts in rows.items()
    for text in texts
]


@pytest.mark.parametrize(("reader", "said", "text"), ROWS)
def test_a_reply_is_read_as_it_says_or_has_a_named_problem(reader, said, text):
    parsed = READERS[reader](text)
    told = SAID.get(reader, lambda answer: f"{answer.letters} {answer.rule}")
    assert (parsed.problem or told(parsed)) == said


PLAN = (7, 7, 12, 3, 5, 9, 14, 2, 1)
TEXT = plan_text(*PLAN)


@pytest.mark.parametrize("text", AROUND)
def test_what_stands_around_a_plan_changes_nothing(text):
    for whole in (f"{TEXT}\n\n{text}", f"{text}\n\n{TEXT}", f"{text}\n\n{TEXT}\n\n{text}"):
        assert parse_plan(whole, N).plan.steps == PLAN


def test_the_official_rule_reads_every_mention_and_nothing_else():
    text = f"I take block with index 4, not block 5.\n{TEXT}\nblock with index 99"
    parsed = parse_plan(text, N, "official")
    assert (parsed.plan.steps, parsed.dropped) == ((4, *PLAN), (99,))
    assert parsed.rule == "block_with_index"


plans = st.lists(st.integers(1, N), min_size=1, max_size=30)
prose = st.lists(
    st.text(
        st.characters(codec="utf-8", exclude_characters='0123456789{}[]`"<>~'), max_size=60
    ).filter(lambda line: not any(c.isdigit() for c in line)),
    max_size=4,
).map("\n".join)


@given(plans, prose, prose)
def test_text_without_numbers_around_the_asked_form_never_changes_it(steps, before, behind):
    assert parse_plan(f"{before}\n\n{plan_text(*steps)}\n\n{behind}", N).plan.steps == tuple(steps)


dresses = st.sampled_from(
    ["{}", "**{}**", "- {}", "> {}", "* *{}*", "`{}`", "| {} |", '"{}",', "   {}  ", "{}.", "# {}"]
)


@given(plans, dresses, st.sampled_from(("\n", "\n\n", "  \n", "\r\n")), st.booleans())
def test_decoration_and_fences_change_nothing(steps, dress, between, is_fenced):
    lines = between.join(dress.format(line) for line in plan_text(*steps).split("\n"))
    text = f"```json\n{{\n{lines}\n}}\n```" if is_fenced else lines
    assert parse_plan(text, N).plan.steps == tuple(steps)


@given(plans, st.permutations(range(1, N + 1)))
def test_numbering_candidates_otherwise_numbers_the_plan_otherwise(steps, order):
    for write in (plan_text, lambda *plan: json.dumps({"reasoning": "", "plan": plan})):
        moved = [order[step - 1] for step in steps]
        assert parse_plan(write(*moved), N).plan.steps == tuple(moved)


@given(st.integers(1, 16), st.text(st.sampled_from("abc ,.\n"), max_size=80), st.booleans())
def test_what_stands_before_the_asked_form_of_a_move_changes_nothing(number, text, is_json):
    asked = f"Next plan: Move({number})"
    if is_json:
        asked = json.dumps({"reasoning": text, "operation": f"Move({number})"})
    assert parse_move(f"{text}\n{asked}").move == number


forms = st.sampled_from(("Answer: {}", "**Answer: {}**", "\\boxed{{{}}}"))


@given(st.text(st.sampled_from("xyz ,.\n"), max_size=80), st.sampled_from("ABCD"), forms)
def test_text_before_the_asked_line_changes_nothing(text, letter, form):
    whole = f"{text}\n{form.format(letter)}"
    assert parse_answer(whole, OPTIONS, is_ordering=False).letters == letter


@given(st.permutations("ABCD"))
def test_the_json_form_is_read_as_it_is_written(order):
    for value, is_ordering in ((order, True), (order[0], False)):
        form = choice_form(OPTIONS, is_ordering)
        text = json.dumps({"reasoning": "It is {A}.", form.key: value})
        assert json.loads(text)["answer"] == value
        assert parse_answer(text, OPTIONS, is_ordering).letters == "".join(value)


lengths = st.integers(-100_000, 100_000).map(lambda n: n / 100)
steps = st.builds(PoseStep, st.integers(1, 16), st.tuples(lengths, lengths, lengths))


@given(st.lists(steps, min_size=1, max_size=MOST_POSE_STEPS), st.booleans())
@example([PoseStep(3, (1, 1, 1))] * (MOST_POSE_STEPS + 1), False)
def test_every_plan_of_the_asked_forms_is_read_as_it_is_written(plan, is_json):
    """Unless it has too many steps."""
    lines = [f"Step{i}: block {one.candidate} at {one.center_cm}" for i, one in enumerate(plan, 1)]
    items = [
        {"block": one.candidate, **dict(zip("xyz", one.center_cm, strict=True))} for one in plan
    ]
    text = json.dumps({"reasoning": "", pose_form(16).key: items}) if is_json else "\n".join(lines)
    parsed = parse_poses(text, N)
    whole = len(plan) <= MOST_POSE_STEPS
    assert parsed.problem == (None if whole else "too_many_steps")
    assert parsed.steps == (tuple(plan) if whole else ())


_PIECES = (
    "Step1: Move block with index 7  \n|Step|step 12 & |Steps 1, 2 and 3|block |# Layer 1:\n|"
    "index |1. |- |* |> |**|_|`|~~|```json\n|```|\n|  \n|\t|\u00a0|\u200b|\u00e9|7 |1, |and |"
    '-> |(|)|[|]|{|}|"|\\"|\\n|{"plan": [|{"answer": |{"operation": "|\\boxed{|<answer>|'
    "<think>|</think>|plan |order: |Answer: |answer is |option A |A, B |C is right|not |"
    "Next plan: |Move(|Move block |done |move |at (1, 2, 3) |x = 1.5 |a red cube |mm |e|.|,|:|="
)
PIECES = (*_PIECES.split("|"), "twice", "x2", "|", "| 1 | 2 ", " " * 50, "7" * 40, "a" * 40)
SIZE = 50_000
MOST_RATIO = 3.0  # 2 is linear, 4 quadratic.
SMALL_S = 0.05  # Times below this say nothing.


def check(read, piece):
    """Fail where 50 KB take much more than twice the time of 25 KB, each time."""
    whole = (piece * (SIZE // len(piece) + 1))[:SIZE]
    for _ in range(6):
        start = time.process_time()
        read(whole)
        middle = time.process_time()
        read(whole[: SIZE // 2])
        took, half = middle - start, time.process_time() - middle
        if took < max(SMALL_S, MOST_RATIO * half):
            return
    pytest.fail(f"{len(whole)} characters take {took:.3f} s")


each_reader = pytest.mark.parametrize("name", [name for name in READERS if name != "number"])


@each_reader
def test_a_text_of_one_piece_is_read_in_linear_time(name):
    for piece in PIECES:
        check(READERS[name], piece)


@each_reader
@settings(max_examples=10)
@given(st.lists(st.sampled_from(PIECES), min_size=2, max_size=8).map("".join))
@example("Step1: Move block with index 16  \n")
def test_a_text_of_many_pieces_is_read_in_linear_time(name, piece):
    check(READERS[name], piece)


@each_reader
@given(st.text())
@example(f"Step1: block {'9' * 5000}")
def test_any_text_is_read_or_a_named_problem(name, text):
    parsed = READERS[name](text)
    assert (parsed.rule is None) == (parsed.problem is not None)
    if name == "move":
        assert (parsed.rule is None) == (parsed.move is None and not parsed.is_done)
    elif name in ("choice", "order"):
        assert (parsed.rule is None) == (parsed.letters is None)
        assert set(parsed.letters or "") <= set("ABCD")


def test_every_recorded_reply_is_read_as_counted(official_checkout):
    found = defaultdict(Counter)
    for (model, _), text in reply_texts(official_checkout).items():
        parsed = parse_plan(text, N)
        found[model] += Counter({
            "replies": 1, parsed.rule or "unread": 1, "truncated": parsed.truncated,
            "blocks": len(parsed.plan.steps), "dropped": len(parsed.dropped),
            "as_official": parsed.plan == parse_plan(text, N, "official").plan,
        })  # fmt: skip
    known = {row.pop("model"): row for row in csv_rows(HERE / "recordings.csv")}
    for model, counts in found.items():
        assert {name: str(counts[name]) for name in known[model]} == known[model], model
    assert found
