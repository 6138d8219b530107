from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from phyblock.cli.main import phyblock
from phyblock.errors import InputError

ALONE = ("--jobs", "1")


def call(*words: str, raises: bool = False) -> Result:
    return CliRunner().invoke(phyblock, ["scenes", *words], catch_exceptions=not raises)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("made") / "few"
    result = call(
        "generate", "--count", "3", "--levels", "2", "--seed", "9", *ALONE, "--out", str(out)
    )
    assert result.exit_code == 0, result.output
    assert "3 scenes, all checks passed" in result.output
    return out


def test_what_is_made_is_verified(folder: Path) -> None:
    result = call("verify", *ALONE, str(folder))
    assert result.exit_code == 0, result.output
    assert "all checks passed" in result.output


def test_a_changed_scene_fails_with_its_name(folder: Path, tmp_path: Path) -> None:
    lines = (folder / "scenes.jsonl").read_text(encoding="utf-8").splitlines()
    (tmp_path / "scenes.jsonl").write_text(f"{lines[0]}\n", encoding="utf-8")
    (tmp_path / "SHA256SUMS").write_text(f"{'0' * 64}  scenes.jsonl\n", encoding="utf-8")
    result = call("verify", *ALONE, str(tmp_path))
    assert result.exit_code == 1
    assert "scenes.jsonl: differs from its checksum" in result.output


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--levels", "5"), "give levels like 1,2,3,4"),
        (("--levels", "1,1"), "give levels like 1,2,3,4"),
        (("--count", "0"), "0 is not in the range"),
        (("--palette", "wood"), "'wood' is not one of"),
        (("--jobs", "0"), "0 is not in the range"),
    ],
)
def test_bad_options_are_refused(words: tuple[str, ...], said: str, tmp_path: Path) -> None:
    result = call("generate", "--out", str(tmp_path / "out"), *words)
    assert result.exit_code == 2
    assert said in result.output
    assert not (tmp_path / "out").exists()


def test_a_bundled_set_is_verified_by_its_name() -> None:
    result = call("verify", "phyblock-400", "--limit", "1", *ALONE)
    assert result.exit_code == 0, result.output
    assert "phyblock-400: all checks passed" in result.output


@pytest.mark.parametrize("address", ["nowhere", "127.0.0.1:1", "127.0.0.1:99999", "host.invalid:1"])
def test_a_cluster_that_does_not_answer_is_refused_at_once(address: str, tmp_path: Path) -> None:
    pytest.importorskip("ray")
    with pytest.raises(InputError, match=f"no such cluster\n.*{address}"):
        call("generate", "--out", str(tmp_path / "out"), "--ray", address, raises=True)
    assert not (tmp_path / "out").exists()
