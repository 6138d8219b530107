"""`phyblock scenes audit|show|render|stats` as a person calls them."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from click.testing import CliRunner
from PIL import Image

from phyblock.cli.main import phyblock
from phyblock.errors import DataError, StoreError
from phyblock.files import LIST
from tests.workspace import SCENES, tower


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The five towers of a workspace, and one whose middle block is lifted and misdeclared."""
    spoiled = tower("t6", [3], ("red", "blue", "green"))
    spoiled["blocks"][2]["position"][2] += 0.02
    spoiled["blocks"][1] |= {"depend": [0], "layer": 1}
    spoiled["blocks"][2]["depend"] = [1]
    spoiled["blocks"][2]["layer"] = 2
    folder = tmp_path / "data"
    folder.mkdir()
    text = "".join(json.dumps(scene) + "\n" for scene in (*SCENES, spoiled))
    (folder / "scenes.jsonl").write_text(text, encoding="utf-8")
    return folder


def scenes(*args: object, columns: int = 160) -> str:
    """What the command prints."""
    done = CliRunner(env={"COLUMNS": str(columns)}).invoke(
        phyblock, ["scenes", *map(str, args)], standalone_mode=False, catch_exceptions=False
    )
    return done.stdout


def test_an_audit_lists_findings(data: Path, tmp_path: Path) -> None:
    table = tmp_path / "found.csv"
    told = scenes("audit", data, "--jobs", 1, "--csv", table)
    assert "6 scenes read; 5 with no finding" in told
    assert "5 stand when finished, 5 at every step as well" in told
    assert "block 3 floats 20.00 mm above its support" in told
    assert "3 green cube" in told
    rows = list(csv.DictReader(io.StringIO(table.read_text(encoding="utf-8"))))
    assert {row["check"] for row in rows if row["scene"] == "t6"} >= {"floating", "unstable"}


def test_an_audit_says_what_cannot_be_read(data: Path) -> None:
    with (data / "scenes.jsonl").open("a", encoding="utf-8") as file:
        file.write("{}\n")
    with pytest.raises(DataError, match=r"scenes\.jsonl:7"):
        scenes("audit", data, "--jobs", 1)


def test_an_audit_refuses_to_write_over_before_it_works(data: Path) -> None:
    with pytest.raises(StoreError, match=r"scenes\.jsonl: cannot be written"):
        scenes("audit", data, "--csv", data / "scenes.jsonl" / "x")


def test_show_prints_the_facts(data: Path) -> None:
    told = scenes("show", data, "t3")
    assert "scene t3 · level 3 · 3 blocks · 3 layers" in told
    assert "0 0 75" in told
    with pytest.raises(DataError, match="no such scene"):
        scenes("show", data, "t9")


def test_render_names_views_backgrounds_and_kinds(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    scenes("render", data, "t1", "--out", out, "--size", 128, "--composite", "--gif")
    stem = "t1-oblique-checkerboard"
    tails = (".png", "-composite.png", ".gif")
    assert {path.name for path in out.iterdir()} == {LIST, *(stem + tail for tail in tails)}
    for path in out.glob("t1*"):
        with Image.open(path) as image:
            assert image.format == path.suffix[1:].upper()
    scenes("render", data, "--out", tmp_path / "all", "--size", 128, "--view", "all")
    assert len(list((tmp_path / "all").glob("*.png"))) == 6 * 4
