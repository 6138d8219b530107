"""Operations of step planning: a table of replies with what they say, and laws."""

from __future__ import annotations

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.parsing.move import parse_move

REPLIES: list[tuple[str, str]] = [
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
def test_an_operation_is_read_as_it_is_said(text: str, said: str) -> None:
    parsed = parse_move(text)
    read = "done" if parsed.is_done else parsed.move
    assert (parsed.problem or f"{read} {parsed.rule}") == said


@given(st.integers(1, 16), st.text(st.sampled_from("abc ,.\n"), max_size=80), st.booleans())
def test_what_stands_before_the_asked_form_changes_nothing(
    number: int, text: str, is_json: bool
) -> None:
    asked = (
        json.dumps({"reasoning": text, "operation": f"Move({number})"})
        if is_json
        else f"Next plan: Move({number})"
    )
    assert parse_move(f"{text}\n{asked}").move == number
