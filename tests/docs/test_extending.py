"""Each plugin of docs/extending.md adds its part from outside, in few lines, to table and page."""

from __future__ import annotations

import base64
import csv
import re
import zlib
from pathlib import Path

import pytest

from tests.docs.following import DOCS, follow
from tests.workspace import Workspace

MOST_LINES = 150
SECTIONS = dict(
    re.findall(
        r"^## (.+?)\n(.*?)(?=^## |\Z)",
        (DOCS / "extending.md").read_text(encoding="utf-8"),
        re.MULTILINE | re.DOTALL,
    )
)
SHOWN: dict[str, tuple[str, str, dict[str, float | None], str, str]] = {
    "A block shape": ("towers", "f1", {"oracle": 1.0, "random": None}, "table1.md", "hexagon"),
    "A background": ("grounds", "f1", {"random": None}, "sensitivity.md", "sand"),
    "A question kind": ("ground", "accuracy", {"oracle": 1.0}, "table2.md", "GR"),
    "A measure": (
        "needless",
        "needless",
        {"oracle": 0.0, "all-candidates": None},
        "full_planning_measures.md",
        "Needless steps",
    ),
    "A track": ("counting", "exact", {"oracle": 1.0, "random": None}, "counting.md", "Counting"),
}
"""By section: the folder of its run, a measure with values, a table, and a text of the page."""


@pytest.mark.slow
@pytest.mark.parametrize("section", SECTIONS)
def test_a_plugin_is_in_tables_and_on_the_page(section: str, workspace: Workspace) -> None:
    text = SECTIONS[section]
    assert max(code.count("\n") for code in re.findall(r"```python(.*?)```", text, re.S)) <= (
        MOST_LINES
    )
    follow(text, workspace)
    folder, measure, values, table, word = SHOWN[section]
    run = workspace.root / "reader" / "results" / folder
    with (run / "tables" / "estimates.csv").open(newline="", encoding="utf-8") as file:
        rows = [
            row
            for row in csv.DictReader(file)
            if row["measure"] == measure and row["cell"] == "overall"
        ]
    for model, value in values.items():
        (found, *_) = [row for row in rows if row["model"] == model]
        assert found["lo"] <= found["value"] <= found["hi"]
        assert value is None or float(found["value"]) == value
    shown = (run / "tables" / table).read_text(encoding="utf-8")
    assert all(model in shown for model in values)
    assert word in shown or section in ("A block shape", "A background")
    assert word in page_of(run)


def page_of(run: Path) -> str:
    """Return the report with the data that it loads, unpacked."""
    scripts = "".join(file.read_text(encoding="utf-8") for file in (run / "report").rglob("*.js"))
    packed = re.findall(r"^phyblockTake\('[^']*','[^']*','([^']*)'\)$", scripts, re.M)
    data = [zlib.decompress(base64.b64decode(text)).decode() for text in packed]
    return "".join([(run / "report.html").read_text(encoding="utf-8"), *data])


def test_every_kind_of_addition_has_a_plugin() -> None:
    assert [*SECTIONS] == [*SHOWN]
