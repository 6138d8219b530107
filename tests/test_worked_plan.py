"""The worked plan of docs/scoring.md."""

from __future__ import annotations

from pathlib import Path

from benchmarks.evidence.worked_plan import REPLY, tables

PAGE = Path(__file__).parents[1] / "docs" / "scoring.md"


def test_the_worked_plan_stands_in_the_docs_as_it_is_scored() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert REPLY in page
    for table in tables():
        assert table.strip() in page
