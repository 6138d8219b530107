"""`phyblock vqa audit` as a person calls it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from PIL import Image

from phyblock.cli.main import phyblock
from phyblock.domain import LETTERS
from tests.vqa_set import questions, write_questions
from tests.workspace import Workspace


def audit(*args: object) -> Any:
    """The command as it ends."""
    return CliRunner(env={"COLUMNS": "160"}).invoke(
        phyblock, ["vqa", "audit", *map(str, args)], standalone_mode=False, catch_exceptions=False
    )


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("audited")
    return Workspace(root, root / "pictures").write_scenes()


def test_attacks_by_pictures_and_texts_stand_beside_their_aims(
    scenes: Path, tmp_path: Path
) -> None:
    asked = questions(per_subtask=20, subtasks=("SH", "AD"))
    for one in asked[:20]:
        one["answer"] = LETTERS[one["options"].index("cube")]
    mine = write_questions(tmp_path / "mine", asked)
    other = write_questions(tmp_path / "other", asked[:15])
    table = tmp_path / "figures.json"
    told = audit(mine, "--data", scenes, "--unseen", other, "--json", table, "-j", 1)
    assert "40 questions" in told.stdout
    found = json.loads(table.read_text(encoding="utf-8"))
    assert [one["subtask"] for one in found["subtasks"]] == ["SH", "AD"]
    rows = {(row["attack"], row["subtask"]): row for row in found["attacks"]}
    for name in ("text, unseen set", "text, within the set"):
        row = rows[name, "SH"]
        assert (row["most"]["value"], row["least"]["value"], row["verdict"]) == (1, 0, "missed")
        assert (row["aim"], row["aim_inverted"]) == (0.30, 0.33)
    assert ("text, unseen set", "AD") not in rows
    central = rows["central", "AD"]
    assert (central["n"], central["chance"], central["aim"]) == (20, 0.25, 0.35)
    assert central["most"]["low"] <= central["most"]["value"] <= central["most"]["high"]
    assert found["faults"] == {}
    for (name, subtask), row in rows.items():
        assert name.split()[0] in told.stdout
        assert row["verdict"] in ("met", "over, in noise", "missed")
        if row["verdict"] == "missed":
            assert f"{subtask or 'all'}: {name}" in told.stdout


def test_pictures_and_classifiers_can_be_left_out(scenes: Path, tmp_path: Path) -> None:
    folder = write_questions(tmp_path / "few", questions(per_subtask=2, subtasks=("SH", "VP")))
    told = audit(folder, "--data", scenes, "--no-pictures", "--no-text-probe", "-j", 1)
    assert "attack" not in told.stdout
    assert "4 questions" in told.stdout


def test_blind_pictures_hold_whole_questions_and_the_answers_stand_apart(
    scenes: Path, tmp_path: Path
) -> None:
    asked = questions(per_subtask=4, subtasks=("SH", "VP", "OR", "AD"))
    folder = write_questions(tmp_path / "few", asked)
    out = tmp_path / "blind"
    quick = ("--no-pictures", "--no-text-probe", "--size", 128, "-j", 1)
    audit(folder, "--data", scenes, *quick, "--blind", out, "--per-subtask", 2)
    rows = (out / "answers.csv").read_text(encoding="utf-8").splitlines()
    answers = dict(row.split(",") for row in rows[1:])
    right = {one["id"]: one["answer"] for one in asked}
    assert len(answers) == 8
    assert answers == {name: right[name] for name in answers}
    sizes = {}
    for name in answers:
        with Image.open(out / f"{name}.png") as picture:
            sizes[name[:2]] = picture.size
    # A viewpoint's options stand below its scene, an ordering has no scene.
    assert sizes["vp"][1] >= sizes["or"][1] + 128
    changed = [{**one, "answer": "ABCD" if one["subtask"] == "OR" else "A"} for one in asked]
    write_questions(folder, changed)
    before = {name: (out / f"{name}.png").read_bytes() for name in answers}
    audit(folder, "--data", scenes, *quick, "--blind", out, "--per-subtask", 2)
    assert {name: (out / f"{name}.png").read_bytes() for name in answers} == before


def test_a_set_is_no_other_set_than_itself(scenes: Path, tmp_path: Path) -> None:
    folder = write_questions(tmp_path / "few", questions(per_subtask=1, subtasks=("SH",)))
    with pytest.raises(click.BadParameter, match="is the set itself"):
        audit(folder, "--data", scenes, "--unseen", folder)
