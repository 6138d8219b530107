"""Table 2 out of records: macro means, circular scoring, seeds, missing replies, letters."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.domain import CATEGORIES, LETTERS, SUBTASKS
from phyblock.report import Run, published_table, to_latex, to_markdown
from phyblock.report.write import make_tables
from phyblock.tracks.vqa_results import (
    CELLS,
    letters_frame,
    letters_view,
    published_cells,
    questions_frame,
    table2_frame,
    table2_view,
)
from tests.report.factory import laws, manifest, record, run_of


def answered(
    subtask: str,
    number: int,
    given: str | None,
    *,
    model: str = "alpha",
    seed: int = 0,
    right: str = "A",
    rotation: int = 0,
    outcome: str = "",
) -> dict[str, Any]:
    name = f"{subtask.lower()}-{number:03d}"
    kind = outcome or ("ok" if given else "parse_failure")
    made = record(model, "000", seed, (), kind)
    sample = f"vqa/{model}/{name}-r{rotation}/s{seed}"
    about = {"id": name, "subtask": subtask, "category": "", "rotation": rotation}
    told = {"right": right, "given": given, "correct": given == right}
    return {**made, "track": "vqa", "sample": sample, "question": about, "answer": told}


def facts(seeds: Iterable[int] = (0,), missing: str = "count", **shown: Any) -> dict[str, Any]:
    models = [("alpha", "GPT-4o"), "beta"]
    made = manifest(models=models, seeds=seeds, missing=missing)
    made["suite"] |= {"tracks": ["vqa"], "vqa": shown}
    made["tracks"] = {"vqa": {"by_subtask": dict.fromkeys(SUBTASKS, 4)}}
    return made


def complete(right: dict[str, int], **more: Any) -> list[dict[str, Any]]:
    """Four answers of every subtask, so many of them right."""
    return [
        answered(subtask, number, "A" if number < right.get(subtask, 0) else "B", **more)
        for subtask in SUBTASKS
        for number in range(4)
    ]


def cell(run: Run, name: str, column: str = "accuracy", model: str = "alpha") -> Any:
    frame = questions_frame(run).set_index(["model", "cell"])
    return frame.at[(model, name), column]


@given(st.fixed_dictionaries({subtask: st.integers(0, 4) for subtask in SUBTASKS}))
@laws
def test_averages_are_unweighted_means_of_their_parts(right: dict[str, int]) -> None:
    run = run_of(complete(right), facts())
    table = table2_frame(run).iloc[0]
    for subtask, count in right.items():
        assert table[subtask] == pytest.approx(25 * count)
    for category, subtasks in CATEGORIES.items():
        assert table[category] == pytest.approx(np.mean([25 * right[name] for name in subtasks]))
    assert table["overall"] == pytest.approx(table[list(CATEGORIES)].astype(float).mean())


def test_a_mean_of_which_a_part_was_not_asked_has_no_value() -> None:
    records = [
        one for one in complete(dict.fromkeys(SUBTASKS, 4)) if one["question"]["subtask"] != "SI"
    ]
    run = run_of(records, facts())
    assert cell(run, "CO") == 1.0
    for name in ("SI", "object_property", "overall"):
        assert np.isnan(cell(run, name))
    assert cell(run, "dynamic_reasoning") == 1.0
    assert cell(run, "SI", "n") == 0


def test_seeds_give_mean_and_standard_deviation() -> None:
    records = complete({"SH": 4}, seed=0) + complete({"SH": 2}, seed=1)
    run = run_of(records, facts(seeds=(0, 1)))
    assert cell(run, "SH") == 0.75
    assert cell(run, "SH", "accuracy_mean") == 0.75
    assert cell(run, "SH", "accuracy_sd") == pytest.approx(np.std([1, 0.5], ddof=1))
    assert cell(run, "SH", "expected") == 8
    view = table2_view(table2_frame(run), run)
    assert view.rows[0][1] == "75.0"
    assert any("2 seeds" in note for note in view.notes)


@pytest.mark.parametrize(("missing", "n", "accuracy"), [("count", 4, 0.5), ("skip", 3, 2 / 3)])
def test_missing_replies_count_as_wrong_or_are_left_out(
    missing: str, n: int, accuracy: float
) -> None:
    records = [answered("SH", number, "A" if number < 2 else "B") for number in range(3)]
    records.append(answered("SH", 3, None, outcome="api_error"))
    run = run_of(records, facts(missing=missing))
    assert (cell(run, "SH", "n"), cell(run, "SH")) == (n, pytest.approx(accuracy))
    assert cell(run, "SH", "api_error") == 1


def test_a_model_that_never_answered_has_no_value() -> None:
    records = [answered("SH", number, None, outcome="api_error") for number in range(4)]
    run = run_of(records, facts())
    assert np.isnan(cell(run, "SH"))
    assert (cell(run, "SH", "n"), cell(run, "SH", "api_error")) == (4, 4)


def test_refusals_and_what_cannot_be_read_are_wrong_answers() -> None:
    records = [answered("SH", 0, "A"), answered("SH", 1, None)]
    records += [answered("SH", n, None, outcome=o) for n, o in ((2, "refusal"), (3, "truncated"))]
    run = run_of(records, facts())
    assert cell(run, "SH") == 0.25
    for outcome in ("parse_failure", "refusal", "truncated"):
        assert cell(run, "SH", outcome) == 1
    notes = table2_view(table2_frame(run), run).notes
    assert "No answer could be read, which counts as wrong: alpha 1 of 4." in notes


def test_circular_needs_every_rotation_of_a_seed() -> None:
    def rotations(number: int, seed: int, wrong: int | None) -> list[dict[str, Any]]:
        return [
            answered("SH", number, "B" if by == wrong else LETTERS[by], right=LETTERS[by],
                     rotation=by, seed=seed)
            for by in range(4)
        ]  # fmt: skip

    records = (
        rotations(0, 0, None) + rotations(1, 0, 2) + rotations(0, 1, 0) + rotations(1, 1, None)
    )
    run = run_of(records, facts(seeds=(0, 1), circular=True))
    assert cell(run, "SH") == 0.5
    assert cell(run, "SH", "each_rotation") == 14 / 16
    assert cell(run, "SH", "chance") == pytest.approx(0.25**4)
    lacking = run_of(records[1:], facts(seeds=(0, 1), circular=True))
    assert cell(lacking, "SH") == 0.25
    assert "[circular]" in make_tables(run, ["table2"])[1]["table2"].caption


def test_the_published_row_stands_under_its_model() -> None:
    run = run_of(complete({}) + complete({}, model="beta"), facts())
    table = table2_frame(run)
    assert table["source"].tolist() == ["run", "published", "run"]
    printed = published_table(2)
    rows = printed[printed["model"] == "GPT-4o"]
    assert sorted(published_cells("GPT-4o").values()) == sorted(rows["value"])
    assert set(published_cells("GPT-4o")) == set(CELLS)
    assert published_cells("LLaVa-OneVision-7B") == {}
    view = table2_view(table, run)
    assert [row[0] for row in view.rows] == ["alpha", "  as published (GPT-4o)", "beta"]
    assert view.rows[1][1] == "82.0"


def test_letters_are_those_of_questions_with_one_answer() -> None:
    records = [
        answered("SH", 0, "A"), answered("SH", 1, "B"), answered("CO", 0, None),
        answered("OR", 0, "ABCD", right="ABCD"),
    ]  # fmt: skip
    run = run_of(records, facts())
    row = letters_frame(run).iloc[0]
    assert (row["n"], row["unread"]) == (3, 1)
    assert row["right_a"] == 100
    assert row["given_a"] == row["given_b"] == pytest.approx(100 / 3)
    assert letters_view(letters_frame(run), run).rows[1][1:3] == ("0", "0")


@pytest.mark.parametrize(
    ("shown", "words"),
    [
        ({"blind": True}, "blind"),
        ({"wrong_image": True}, "pictures of another scene"),
        ({"options_as": "letters"}, "options on one sheet"),
    ],
)
def test_how_questions_were_shown_is_in_the_captions(shown: dict[str, Any], words: str) -> None:
    run = run_of(complete({}), facts(**shown))
    _, views = make_tables(run, ["table2"])
    for view in (views["table2"], views["letters"]):
        assert words in view.caption
        assert words in to_markdown(view)
        assert words in to_latex(view, "x")


def test_a_run_without_records_has_rows_and_no_values() -> None:
    run = run_of([], facts())
    frame = questions_frame(run)
    assert len(frame) == 2 * len(CELLS)
    assert frame["accuracy"].isna().all()
    assert isinstance(table2_frame(run), pd.DataFrame)
    assert letters_frame(run)["n"].tolist() == [0, 0]
