"""`phyblock questions generate|verify|show` as a person calls them."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from PIL import Image

from phyblock.cli.main import phyblock
from phyblock.errors import DataError
from phyblock.resources import bundled
from phyblock.sim.engine import other_engine

QUESTION_LINES = "questions.jsonl"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight questions about twelve scenes of the built-in set, which stand beside them."""
    folder = tmp_path_factory.mktemp("vqa")
    lines = bundled("benchmarks", "data", "phyblock-400", "scenes.jsonl").read_text("utf-8")
    some = "".join(f"{line}\n" for line in lines.splitlines()[5::33])
    (folder / "scenes.jsonl").write_text(some, encoding="utf-8")
    told = vqa("generate", "--data", folder, "--out", folder / "q", *SMALL)
    assert "8 questions in 2 subtasks" in told.stdout
    assert ("made with" in told.stderr) == bool(other_engine())
    return folder


SMALL = ("--subtasks", "CO,OC", "--per-subtask", 4, "--jobs", 1)


def vqa(*args: object) -> Any:
    """The command as it ends."""
    return CliRunner(env={"COLUMNS": "160"}).invoke(
        phyblock, ["questions", *map(str, args)], standalone_mode=False, catch_exceptions=False
    )


def questions_of(folder: Path) -> list[dict[str, Any]]:
    text = (folder / QUESTION_LINES).read_text(encoding="utf-8")
    return [json.loads(line) for line in text.splitlines()]


def test_questions_are_written_with_card_and_checksums(folder: Path) -> None:
    assert sorted(path.name for path in (folder / "q").iterdir()) == [
        "CARD.md",
        "SHA256SUMS",
        "VERSION",
        QUESTION_LINES,
    ]
    found = questions_of(folder / "q")
    assert [one["id"] for one in found] == [
        f"{s}-00{i}" for s in ("co", "oc") for i in (1, 2, 3, 4)
    ]
    card = (folder / "q" / "CARD.md").read_text(encoding="utf-8")
    assert f"generate --data {folder}" in card
    assert f"scenes of `{folder.name}`" in card


@pytest.mark.parametrize("names", ["XX", "CO,CO", ""])
def test_subtasks_that_are_not_there_are_told(tmp_path: Path, names: str) -> None:
    with pytest.raises(click.BadParameter, match="SH,CO,SI"):
        vqa("generate", "--out", tmp_path, "--subtasks", names)


def test_all_answers_are_derived_again(folder: Path) -> None:
    done = vqa("verify", folder / "q", "--data", folder, "--jobs", 1)
    assert "all checks passed" in done.stdout


def test_a_corrupted_answer_is_named_and_so_is_the_checksum(folder: Path, tmp_path: Path) -> None:
    found = questions_of(folder / "q")
    right = found[2]["answer"]
    found[2]["answer"] = "ABCD"["BCDA".index(right)]
    text = "".join(json.dumps(one) + "\n" for one in found)
    (tmp_path / QUESTION_LINES).write_text(text, encoding="utf-8")
    for name in ("CARD.md", "SHA256SUMS"):
        (tmp_path / name).write_bytes((folder / "q" / name).read_bytes())
    done = vqa("verify", tmp_path, "--data", folder, "--jobs", 1)
    assert done.return_value == 1
    assert f"failed: co-003: the answer is {right}, not {found[2]['answer']}" in done.output
    assert "differs from its checksum" in done.output


def test_a_question_is_shown_with_its_pictures(folder: Path, tmp_path: Path) -> None:
    first = questions_of(folder / "q")[0]
    where = ("--questions", folder / "q", "--data", folder)
    done = vqa("show", "co-001", *where, "--out", tmp_path / "co.png")
    assert first["question"] in done.stdout
    assert f"answer: {first['answer']}" in done.stdout
    with Image.open(io.BytesIO((tmp_path / "co.png").read_bytes())) as image:
        assert image.size == (512, 512)
    with pytest.raises(DataError, match="did you mean co-001"):
        vqa("show", "co-0001", *where)


def test_an_audit_says_what_it_finds(folder: Path, tmp_path: Path) -> None:
    found = questions_of(folder / "q")
    again = {**found[0], "id": "co-009"}
    text = "".join(json.dumps(one) + "\n" for one in [*found, again])
    (tmp_path / QUESTION_LINES).write_text(text, encoding="utf-8")
    pytest.importorskip("sklearn")
    done = vqa("audit", tmp_path, "--data", folder)
    assert "co-009: asks what an earlier question asks" in done.stdout
    assert "9 questions, " in done.stdout
