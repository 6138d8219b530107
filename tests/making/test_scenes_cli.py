"""`phyblock scenes generate|verify|audit|show|render` as a person calls them."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from PIL import Image

from phyblock.cli.main import phyblock
from phyblock.errors import DataError, StoreError
from phyblock.files import LIST
from tests.workspace import SCENES, tower

ALONE = ("--jobs", 1)


def scenes(*args: object) -> Result:
    return CliRunner(env={"COLUMNS": "160"}).invoke(
        phyblock, ["scenes", *map(str, args)], standalone_mode=False, catch_exceptions=False
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three scenes that were made."""
    out = tmp_path_factory.mktemp("made") / "few"
    done = scenes("generate", "--count", 3, "--levels", 2, "--seed", 9, *ALONE, "--out", out)
    assert "3 scenes, all checks passed" in done.stdout
    with pytest.raises(StoreError, match="give another --out"):
        scenes("generate", "--out", out)
    return out


def test_what_is_made_is_verified_and_a_changed_scene_is_named(
    folder: Path, tmp_path: Path
) -> None:
    assert "few: all checks passed" in scenes("verify", *ALONE, folder).stdout
    lines = (folder / "scenes.jsonl").read_text(encoding="utf-8").splitlines()
    spoiled = json.loads(lines[0])
    spoiled["blocks"][-1]["position"][2] += 0.01
    (tmp_path / "scenes.jsonl").write_text(json.dumps(spoiled) + "\n", encoding="utf-8")
    (tmp_path / "SHA256SUMS").write_text(f"{'0' * 64}  scenes.jsonl\n", encoding="utf-8")
    done = scenes("verify", *ALONE, tmp_path)
    assert done.return_value == 1
    assert "scenes.jsonl: differs from its checksum" in done.output
    assert f"failed: {spoiled['id']}" in done.output
    assert "floats 10.00 mm above its support" in done.output


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--levels", "5"), "give levels like 1,2,3,4"),
        (("--levels", "1,1"), "give levels like 1,2,3,4"),
        (("--count", "0"), "0 is not in the range"),
        (("--palette", "wood"), "'wood' is not one of"),
    ],
)
def test_bad_options_are_refused(words: tuple[str, ...], said: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = CliRunner().invoke(phyblock, ["scenes", "generate", "--out", str(out), *words])
    assert (done.exit_code, out.exists()) == (2, False)
    assert said in done.output


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """The five towers of a workspace, and one whose middle block is lifted and misdeclared."""
    spoiled = tower("t6", [3], ("red", "blue", "green"))
    spoiled["blocks"][2]["position"][2] += 0.02
    spoiled["blocks"][1] |= {"depend": [0], "layer": 1}
    spoiled["blocks"][2] |= {"depend": [1], "layer": 2}
    folder = tmp_path / "data"
    folder.mkdir()
    text = "".join(json.dumps(scene) + "\n" for scene in (*SCENES, spoiled))
    (folder / "scenes.jsonl").write_text(text, encoding="utf-8")
    return folder


def test_an_audit_lists_findings(data: Path, tmp_path: Path) -> None:
    table = tmp_path / "found.csv"
    told = scenes("audit", data, *ALONE, "--csv", table).stdout
    assert "6 scenes read; 5 with no finding" in told
    assert "5 stand when finished, 5 at every step as well" in told
    assert "block 3 floats 20.00 mm above its support" in told
    assert "3 green cube" in told
    rows = list(csv.DictReader(io.StringIO(table.read_text(encoding="utf-8"))))
    assert {row["check"] for row in rows if row["scene"] == "t6"} >= {"floating", "unstable"}
    with (data / "scenes.jsonl").open("a", encoding="utf-8") as file:
        file.write("{}\n")
    with pytest.raises(DataError, match=r"scenes\.jsonl:7"):
        scenes("audit", data, *ALONE)
    with pytest.raises(StoreError, match=r"scenes\.jsonl: cannot be written"):
        scenes("audit", data, "--csv", data / "scenes.jsonl" / "x")


def test_show_prints_the_facts(data: Path) -> None:
    told = scenes("show", data, "t3").stdout
    assert "scene t3 · level 3 · 3 blocks · 3 layers" in told
    assert "0 0 75" in told
    with pytest.raises(DataError, match="no such scene"):
        scenes("show", data, "t9")


def test_render_names_views_backgrounds_and_kinds(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    scenes("render", data, "t1", "--out", out, "--composite", "--gif")
    stem = "t1-oblique-checkerboard"
    tails = (".png", "-composite.png", ".gif")
    assert {path.name for path in out.iterdir()} == {LIST, *(stem + tail for tail in tails)}
    for path in out.glob("t1*"):
        with Image.open(path) as image:
            assert image.format == path.suffix[1:].upper()
    scenes("render", data, "t1", "--out", tmp_path / "all", "--view", "all")
    assert len(list((tmp_path / "all").glob("*.png"))) == 4
