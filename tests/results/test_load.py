from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from random import Random

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import StoreError
from phyblock.results.load import load_run
from phyblock.sim.engine import ENGINES
from tests.web.factory import (
    laws,
    manifest,
    record,
    record_lists,
    run_of,
    score,
    write_run,
)


def test_records_have_one_row_a_sample_and_scores_one_a_score(tmp_path: Path) -> None:
    records = [
        record("beta", "000", 0, [score(2, 1, 2), score(3, 0, 1, criterion="selection")]),
        record("alpha", "001", 0, [score(4, 0, 0)], prompt_tokens=7, cost_usd=0.25),
        record("alpha", "002", 0, outcome="api_error"),
    ]
    run = load_run(write_run(tmp_path / "run", records, manifest()))
    assert run.records["sample"].tolist() == [
        "full_planning/alpha/001/s0",
        "full_planning/alpha/002/s0",
        "full_planning/beta/000/s0",
    ]
    first = run.records.iloc[0]
    assert first["levels"] == (2,)
    assert first["prompt_tokens"] == 7
    assert first["cost_usd"] == 0.25
    failed = run.records.iloc[1]
    assert (failed["error_kind"], failed["error_status"]) == ("retryable", 429)
    assert pd.isna(failed["attempts"])
    steps = run.counts["full_planning", "steps"]
    ways = [steps.ways[n] for n in steps.way]
    assert list(zip(steps.row, ways, steps.numbers[:, 0], strict=True)) == [
        (0, ("A", "optimal", "aov"), 4),
        (2, ("A", "optimal", "aov"), 2),
        (2, ("A", "", "selection"), 3),
    ]
    assert run.path == tmp_path / "run"
    assert run.manifest.scenes == 5


@laws
@given(record_lists(), st.randoms())
def test_the_order_of_records_changes_nothing(
    records: list[dict[str, object]], random: Random
) -> None:
    shuffled = records.copy()
    random.shuffle(shuffled)
    left, right = (run_of(one, manifest()) for one in (records, shuffled))
    pd.testing.assert_frame_equal(left.records, right.records)
    pd.testing.assert_frame_equal(left.estimates, right.estimates)


@laws
@given(record_lists())
def test_columns_and_types_do_not_depend_on_the_records(records: list[dict[str, object]]) -> None:
    some, none = (run_of(one, manifest()) for one in (records, []))
    assert some.records.dtypes.to_dict() == none.records.dtypes.to_dict()


@laws
@given(st.data())
def test_a_cut_last_line_is_passed_over_and_counted(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    folder = write_run(tmp_path_factory.mktemp("runs") / "run", [record()], manifest())
    line = json.dumps(record("beta"))
    kept = data.draw(st.integers(1, len(line) - 1))
    with (folder / "records.jsonl").open("a", encoding="utf-8") as file:
        file.write(line[:kept])
    run = load_run(folder)
    assert run.records["model"].tolist() == ["alpha"]
    assert run.is_cut


@pytest.mark.parametrize(
    ("line", "at", "field"),
    [
        ('{"sample": "x', ":14", ""),
        ("\0\0\0", "", ""),
        (json.dumps(record()) + "\r", "", ""),
        ("[1, 2]", "", ""),
        ("{}", "", "track"),
        (json.dumps(record() | {"seed": "first"}), "", "seed"),
        (json.dumps(record() | {"scores": [{"criterion": "aov"}]}), "", "scores[0].setting"),
        (json.dumps(record() | {"scores": [7]}), "", "scores[0]"),
        (json.dumps(record() | {"reply": "text"}), "", "reply"),
        (json.dumps(record() | {"levels": 2}), "", "levels"),
    ],
)
def test_a_corrupt_line_is_named(tmp_path: Path, line: str, at: str, field: str) -> None:
    folder = write_run(tmp_path / "run", [], manifest())
    good = json.dumps(record())
    (folder / "records.jsonl").write_text(f"{good}\n{line}\n{good}\n", encoding="utf-8")
    with pytest.raises(StoreError) as caught:
        load_run(folder)
    problem = caught.value.problems[0]
    assert problem.where == f"{folder / 'records.jsonl'}:2{at}"
    assert problem.message.startswith("is not a record")
    assert problem.field == field
    assert problem.hint


def test_reading_runs_needs_no_simulator_and_no_network() -> None:
    heavy = {"litellm", "rich", "matplotlib", "aiohttp"}
    heavy |= set(ENGINES)
    code = (
        "import sys, phyblock.results.load, phyblock.results.tables\n"
        f"heavy = {heavy} & set(sys.modules)\n"
        "sys.exit(repr(heavy) if heavy else 0)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
