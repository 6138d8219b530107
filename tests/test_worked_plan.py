"""What commands under benchmarks/evidence print stands in the docs: the worked plan, the table."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from benchmarks.evidence import __main__ as evidence
from benchmarks.evidence.worked_plan import REPLY, tables

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "scoring.md"


def test_the_worked_plan_stands_in_the_docs_as_it_is_scored() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert REPLY in page
    for table in tables():
        assert table.strip() in page


def test_the_numbers_that_commands_print_stand_in_the_docs() -> None:
    assert evidence.table().strip() in (DOCS / "statistics.md").read_text(encoding="utf-8")
    for number in evidence.NUMBERS:
        module = number.command.split()[0]
        assert module == "phyblock" or find_spec(module) is not None, number.what
