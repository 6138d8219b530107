"""What a run's end says in the terminal about what its tables hold."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from phyblock.cli.summary import print_summary
from phyblock.report import NO_VALUE, write_tables
from phyblock.report.terminal import terminal_of
from tests.report.factory import manifest, record, score, write_run


def printed(folder: Path, records: list[dict[str, Any]], facts: dict[str, Any]) -> list[str]:
    console = Console(file=io.StringIO(), width=160)
    written = write_tables(write_run(folder, records, facts))
    print_summary(console, terminal_of(written), written.folder)
    assert isinstance(console.file, io.StringIO)
    return [line.strip() for line in console.file.getvalue().splitlines()]


def test_a_model_that_never_answered_has_no_value_and_a_note(tmp_path: Path) -> None:
    records = [
        record(scene=scene, scores=[score(0, 0, 4)], outcome="api_error")
        for scene in ("000", "001", "002", "003", "004")
    ]
    lines = printed(tmp_path / "run", records, manifest(seeds=[0], missing="count"))
    (row, *_) = (line for line in lines if line.startswith("alpha"))
    assert row.split() == ["alpha", *[NO_VALUE] * 16]
    assert "Counted as empty plans: alpha 5 of 5 (API errors)." in lines


def test_the_comparison_has_its_total_and_the_models_it_leaves_out(tmp_path: Path) -> None:
    facts = manifest(models=[("mine", "GPT-4o"), ("unrun", "GPT-o1"), "my-[claude]"], seeds=[0])
    scores = [score(1, 1, 3, matcher="paper")]
    lines = printed(tmp_path / "run", [record("mine", "001", scores=scores)], facts)
    start = lines.index("Beside the paper's Table 1: largest difference in points")
    names = [line.split() for line in lines[start + 1 : start + 3]]
    assert names[0][0] == "mine"
    assert names[0][2:] == ["6", "cells,", "differs"]
    assert names[1] == ["unrun", NO_VALUE, "0", "cells,", "not", "compared"]
    assert lines[start + 3] == f"Largest absolute difference of 6 cells: {names[0][1]}."
    assert lines[start + 4] == "No published row: my-[claude]."


@pytest.mark.parametrize("settings", [["B"], ["B", "A"]])
def test_setting_b_is_never_called_as_published(tmp_path: Path, settings: list[str]) -> None:
    facts = manifest(models=[("mine", "GPT-4o")], settings=settings, matchers=["paper"], seeds=[0])
    scores = [score(4, 0, 0, matcher="paper", setting="B")]
    lines = printed(tmp_path / "run", [record("mine", "001", scores=scores)], facts)
    assert f"mine        {NO_VALUE}  0 cells, not compared" in lines
    said = "The paper's setting, A, was not run." in lines
    assert said == ("A" not in settings)
