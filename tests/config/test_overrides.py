"""--set: what it may say, and how its errors point at it."""

from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.config.suite import Suite, load_suite
from phyblock.errors import Problem, SpecError

SUITE = "name: s\nmodels: [oracle]\nimages: {size_px: 256}\n"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "suites").mkdir()
    (tmp_path / "suites" / "s.yaml").write_text(SUITE, encoding="utf-8")
    (tmp_path / "data" / "phyblock-400").mkdir(parents=True)
    (tmp_path / "official").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def load(folder: Path, *overrides: str) -> Suite:
    return load_suite(folder / "suites" / "s.yaml", overrides, data_dir=folder / "data")


def problems_of(folder: Path, *overrides: str) -> list[Problem]:
    with pytest.raises(SpecError) as caught:
        load(folder, *overrides)
    return list(caught.value.problems)


def test_values_are_yaml(folder: Path) -> None:
    suite = load(
        folder,
        "levels=[1, 2]",
        "seeds=[3]",
        "limits.max_cost_usd=1e-3",
        "sampling.temperature=null",
        "scoring={level1: aov}",
        "description='say: no'",
    )
    assert suite.levels == (1, 2)
    assert suite.seeds == (3,)
    assert suite.limits.max_cost_usd == 1e-3
    assert suite.sampling.temperature is None
    assert suite.scoring.level1 == "aov"
    assert suite.description == "say: no"


def test_the_rest_of_a_section_stays(folder: Path) -> None:
    images = load(folder, "images.background=white").images
    assert (images.size_px, images.background) == (256, "white")


def test_the_last_of_two_wins(folder: Path) -> None:
    assert load(folder, "seeds=[1]", "seeds=[2]").seeds == (2,)
    changed = load(folder, "images.size_px=128", "images={layout: separate}").images
    assert (changed.size_px, changed.layout) == (512, "separate")


@pytest.mark.parametrize(
    ("text", "field", "message", "hint"),
    [
        ("dataset.pth=x", "dataset.pth", "is not a known key", "did you mean path?"),
        ("datset.path=x", "datset", "is not a known key", "did you mean dataset?"),
        ("size_px=256", "size_px", "is not a known key", "it belongs at images.size_px"),
        ("images.size_px=big", "images.size_px", "has the wrong type", ""),
        ("images.size_px='256'", "images.size_px", "has the wrong type", "take the quotes off"),
        ("levels=[1, 9]", "levels[1]", "is not one of the choices", ""),
        ("levels=2", "levels", "has the wrong type", "write a list: [2]"),
        ("parser=oficial", "parser", "is not one of the choices", "did you mean official?"),
        ("models=recorded", "models", "recorded replies come", "set dataset.format to official"),
        ("dataset.format=official", "dataset.path", "needs the folder", "--set dataset.path"),
        ("seeds=[1, 1]", "seeds[1]", "stands twice in this list", "keep one of them"),
        ("dataset.path=./none", "dataset.path", "no such folder", ""),
        ("prompt=none.j2", "prompt", "no such file", ""),
        ("limits={max_atempts: 1}", "limits.max_atempts", "is not a known key", "max_attempts"),
    ],
)
def test_an_error_points_at_the_override(
    folder: Path, text: str, field: str, message: str, hint: str
) -> None:
    (problem,) = problems_of(folder, text)
    assert problem.where == f"--set {text}"
    assert problem.field == field
    assert message in problem.message
    assert hint in problem.hint


@pytest.mark.parametrize("text", ["levels", "=1", "images.=1", ".x=1", ""])
def test_what_is_no_override(folder: Path, text: str) -> None:
    (problem,) = problems_of(folder, text)
    assert problem.message == "is not of the form key=value"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("levels=[1", "is not YAML"),
        ("images={size_px: 1, size_px: 2}", "is written twice"),
        ("parser=!x y", "has a tag that is not allowed"),
    ],
)
def test_a_value_that_is_not_yaml(folder: Path, text: str, message: str) -> None:
    found = problems_of(folder, text)
    assert found[0].where == f"--set {text}"
    assert message in found[0].message


def test_a_key_below_something_that_is_no_section(folder: Path) -> None:
    (problem,) = problems_of(folder, "models.x=1")
    assert problem.message == "cannot be set: models is not a mapping"
    assert problem.hint == "set the whole value"


def test_all_overrides_are_judged(folder: Path) -> None:
    found = problems_of(folder, "a=1", "b=2", "c", "levels=[0]")
    assert {problem.where for problem in found} == {
        "--set a=1",
        "--set b=2",
        "--set c",
        "--set levels=[0]",
    }


def test_an_override_mends_the_file(folder: Path) -> None:
    path = folder / "suites" / "s.yaml"
    path.write_text(SUITE + "levels: [9]\n", encoding="utf-8")
    assert load(folder, "levels=[1]").levels == (1,)


def test_a_secret_is_not_repeated(folder: Path) -> None:
    found = problems_of(folder, "description=sk-abcdefgh12345678")
    assert "abcdefgh" not in "\n".join(map(str, found))


def test_paths_on_the_command_line_start_at_the_working_directory(folder: Path) -> None:
    loaded = load(folder, "dataset={format: official}", "dataset.path=official")
    assert loaded.files.dataset == folder / "official"
    whole = load(folder, "dataset={format: official, path: ./official}")
    assert whole.files.dataset == folder / "official"


def test_paths_in_a_file_start_at_the_file(folder: Path) -> None:
    path = folder / "suites" / "s.yaml"
    (folder / "suites" / "p.j2").write_text("", encoding="utf-8")
    text = "dataset: {format: official, path: ../official}\nprompt: p.j2\n"
    path.write_text(SUITE + text, encoding="utf-8")
    loaded = load(folder)
    assert loaded.files.dataset == folder / "official"
    assert loaded.files.templates["full_planning"] == folder / "suites" / "p.j2"
    assert loaded.where("dataset", "path") == f"{path}:4:35"


def test_variables_and_home_are_expanded(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PHYBLOCK_TEST_ROOT", str(folder))
    monkeypatch.setenv("HOME", str(folder))
    for text in ("$PHYBLOCK_TEST_ROOT/official", "${PHYBLOCK_TEST_ROOT}/official", "~/official"):
        loaded = load(folder, "dataset.format=official", f"dataset.path={text}")
        assert loaded.files.dataset == folder / "official"


def test_a_bare_name_is_a_bundled_data_set(folder: Path) -> None:
    assert load(folder).files.dataset == folder / "data" / "phyblock-400"
    named = load(folder, "dataset.path=phyblock-400")
    assert named.files.dataset == folder / "data" / "phyblock-400"


def test_a_prompt_that_is_a_word_has_no_path(folder: Path) -> None:
    assert load(folder).files.templates == {}


def test_a_section_left_empty_in_the_file_can_be_filled(folder: Path) -> None:
    path = folder / "suites" / "s.yaml"
    path.write_text(SUITE + "limits:\n", encoding="utf-8")
    assert load(folder, "limits.max_attempts=2").limits.max_attempts == 2
