from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from phyblock.cli.main import phyblock


def call(*words: str) -> Result:
    return CliRunner().invoke(phyblock, ["scenes", *words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("made") / "few"
    result = call("generate", "--count", "3", "--levels", "2", "--seed", "9", "--out", str(out))
    assert result.exit_code == 0, result.output
    assert "3 scenes, all checks passed" in result.output
    return out


def test_what_is_made_is_verified(folder: Path) -> None:
    result = call("verify", str(folder))
    assert result.exit_code == 0, result.output
    assert "all checks passed" in result.output


def test_the_card_names_the_command_that_made_it(folder: Path) -> None:
    text = (folder / "README.md").read_text(encoding="utf-8")
    assert "scenes generate --count 3 --seed 9 --levels 2 --palette kit --out few" in text


def test_a_changed_scene_fails_with_its_name(folder: Path, tmp_path: Path) -> None:
    lines = (folder / "scenes.jsonl").read_text(encoding="utf-8").splitlines()
    (tmp_path / "scenes.jsonl").write_text(f"{lines[0]}\n", encoding="utf-8")
    (tmp_path / "SHA256SUMS").write_text(f"{'0' * 64}  scenes.jsonl\n", encoding="utf-8")
    result = call("verify", str(tmp_path))
    assert result.exit_code == 1
    assert "scenes.jsonl: differs from its checksum" in result.output


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
    result = call("generate", "--out", str(tmp_path / "out"), *words)
    assert result.exit_code == 2
    assert said in result.output
    assert not (tmp_path / "out").exists()
