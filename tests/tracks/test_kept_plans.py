"""Goal-blind plans that were learned are kept, by all that decides them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner

from phyblock.cli.cache import command
from phyblock.domain import CandidateSet, Plan, Scene
from phyblock.tracks.goal_blind import kept_plans as module
from phyblock.tracks.goal_blind.kept_plans import kept_plans
from phyblock.tracks.goal_blind.learning import goal_blind_plans
from tests.tracks.test_goal_blind import KIT, scene

SETS = {name: CandidateSet(KIT[at : at + 6]) for at, name in enumerate(("s0", "s1", "s2"))}
SCENES = [scene(name, SETS[name].candidates[:2]) for name in SETS]


@pytest.fixture
def learned(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[str]:
    """The settings under which plans were learned anew; the cache is a folder of the test's own."""
    calls: list[str] = []

    def counted(
        scenes: list[Scene], candidates: dict[str, CandidateSet], setting: str
    ) -> dict[str, Plan]:
        calls.append(setting)
        return goal_blind_plans(scenes, candidates, setting)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "goal_blind_plans", counted)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(tmp_path / "cache"))
    return calls


def files(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / "cache").rglob("*.json"))


def test_what_was_learned_is_not_learned_again(learned: list[str]) -> None:
    plans = goal_blind_plans(SCENES, SETS, "A")
    assert [kept_plans(SCENES, SETS, "A") for _ in range(3)] == [plans] * 3
    assert learned == ["A"]


def test_whatever_decides_the_plans_is_in_the_key(
    learned: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    kept_plans(SCENES, SETS, "A")
    kept_plans(SCENES, SETS, "B")
    fewer = CandidateSet(SETS["s0"].candidates[:5])
    kept_plans(SCENES, {**SETS, "s0": fewer}, "A")
    turned = replace(SCENES[0], parents=("s1",))
    kept_plans([turned, *SCENES[1:]], SETS, "A")
    with monkeypatch.context() as patch:
        code = tmp_path / "code"
        for name in module._DECIDE:
            (code / name).mkdir(parents=True)
            (code / name / "code.py").write_text("", encoding="utf-8")
        patch.setattr(module, "_PACKAGE", code)
        kept_plans(SCENES, SETS, "A")
        (code / module._DECIDE[-1] / "goal_blind.py").write_text("changed", encoding="utf-8")
        kept_plans(SCENES, SETS, "A")
    kept_plans(SCENES, SETS, "A")
    assert learned == ["A", "B", "A", "A", "A", "A"]


@pytest.mark.parametrize("gone", range(len(module._DECIDE)))
def test_without_its_code_nothing_is_kept(
    learned: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, gone: int
) -> None:
    """As in an archive, or where bytecode alone is there: an edit of it would not be seen."""
    for at, name in enumerate(module._DECIDE):
        (tmp_path / "code" / name).mkdir(parents=True)
        if at != gone:
            (tmp_path / "code" / name / "code.py").write_text("", encoding="utf-8")
    monkeypatch.setattr(module, "_PACKAGE", tmp_path / "code")
    assert kept_plans(SCENES, SETS, "A") == kept_plans(SCENES, SETS, "A")
    assert learned == ["A", "A"]
    assert files(tmp_path) == []


def test_what_was_learned_is_told_and_removed_by_the_user(
    learned: list[str], tmp_path: Path
) -> None:
    kept_plans(SCENES, SETS, "A")
    kept_plans(SCENES, SETS, "B")
    (folder,) = {path.parent for path in files(tmp_path)}
    mine = folder / "mine.json"
    mine.write_text("{}", encoding="utf-8")
    told = CliRunner().invoke(command, ["stats"])
    assert "2 files of floors' plans and values" in told.output
    assert CliRunner().invoke(command, ["clear", "--learned", "--model", "m"]).exit_code == 2
    assert "Deleted 2 files" in CliRunner().invoke(command, ["clear", "--learned"]).output
    assert files(tmp_path) == [mine]
    assert "floors'" not in CliRunner().invoke(command, ["stats"]).output
    kept_plans(SCENES, SETS, "A")
    assert learned == ["A", "B", "A"]


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{",
        "[]",
        '{"s0": [1], "s1": [1]}',
        '{"s0": [1], "s1": [1], "s2": [7]}',
        '{"s0": [1], "s1": [1], "s2": [0]}',
        '{"s0": [1], "s1": [1], "s2": [true]}',
        '{"s0": [1], "s1": [1], "s2": 1}',
    ],
)
def test_a_file_that_is_not_whole_is_written_anew(
    learned: list[str], tmp_path: Path, content: str
) -> None:
    plans = kept_plans(SCENES, SETS, "A")
    (path,) = files(tmp_path)
    path.write_text(content, encoding="utf-8")
    assert kept_plans(SCENES, SETS, "A") == kept_plans(SCENES, SETS, "A") == plans
    assert learned == ["A", "A"]


def test_a_cache_that_cannot_be_written_costs_only_time(learned: list[str], tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("no folder", encoding="utf-8")
    assert kept_plans(SCENES, SETS, "A") == kept_plans(SCENES, SETS, "A")
    assert learned == ["A", "A"]
