from __future__ import annotations

import json
import subprocess
import sys
from random import Random

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.results.load import load_run
from phyblock.sim.engine import ENGINES
from tests.web.factory import (
    laws,
    manifest,
    record,
    record_lists,
    run_of,
    write_run,
)


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
