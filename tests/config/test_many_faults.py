"""Files with thousands of faults, over-long names and numbers: each is told, none takes long."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.config.models import load_models
from phyblock.config.suite import load_suite, resolve_models
from phyblock.config.yaml import looks_secret
from phyblock.errors import SpecError
from tests.fuzz.strategies import MODELS_FILES, SUITES
from tests.fuzz.strategies import OVERRIDES as OVERRIDE_TEXTS

SOUND = "name: s\nmodels: [oracle]\n"


def suite(folder: Path, text: str, *overrides: str) -> list[str]:
    """The lines that tell of problems."""
    (folder / "data" / "phyblock-400").mkdir(parents=True, exist_ok=True)
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        load_suite(path, overrides, data_dir=folder / "data")
    return [str(problem) for problem in caught.value.problems]


def models(folder: Path, text: str) -> list[str]:
    path = folder / "m.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SpecError) as caught:
        load_models(path)
    return [str(problem) for problem in caught.value.problems]


def test_every_unknown_key_is_told(tmp_path: Path) -> None:
    told = suite(tmp_path, SOUND + "".join(f"sede{i}: 1\n" for i in range(3_000)))
    assert len(told) == 3_000
    assert "did you mean seeds?" in told[0]


def test_every_wrong_item_is_told(tmp_path: Path) -> None:
    told = suite(tmp_path, SOUND + "seeds: [" + "x, " * 4_000 + "]\n")
    assert len(told) == 4_000


def test_every_bad_model_is_told(tmp_path: Path) -> None:
    assert len(models(tmp_path, "".join(f"m{i}: {{idd: 1}}\n" for i in range(1_500)))) == 1_500
    assert len(models(tmp_path, "".join(f"m{i}: x\n" for i in range(3_000)))) == 3_000


def test_every_unknown_model_is_told(tmp_path: Path) -> None:
    (tmp_path / "data" / "phyblock-400").mkdir(parents=True)
    path = tmp_path / "s.yaml"
    path.write_text("name: s\nmodels: [" + ", ".join(f"m{i}" for i in range(3_000)) + "]\n")
    loaded = load_suite(path, data_dir=tmp_path / "data")
    with pytest.raises(SpecError) as caught:
        resolve_models(loaded, {})
    assert len(caught.value.problems) == 3_000


def test_names_without_end_are_not_shown_whole(tmp_path: Path) -> None:
    (told,) = suite(tmp_path, SOUND + "? " + "k" * 90_000 + "\n: 1\n")
    assert len(told) < 1_000
    (told,) = suite(tmp_path, SOUND, "seeds=" + "x" * 90_000)
    assert len(told) < 1_000


def test_escape_codes_do_not_reach_the_terminal(tmp_path: Path) -> None:
    (told,) = suite(tmp_path, SOUND + '"\\e[2J\\u202e": 1\n')
    assert "\x1b" not in told
    assert "\u202e" not in told


PATHS = {
    "long": ("./" + "x" * 5_000, "longer than a path can be"),
    "deep": ("./" + "x/" * 5_000, "longer than a path can be"),
    "nul": ('"./a\\0b"', "holds a NUL character"),
}


@pytest.mark.parametrize(("path", "said"), PATHS.values(), ids=PATHS)
def test_what_cannot_be_a_path(tmp_path: Path, path: str, said: str) -> None:
    (told,) = suite(tmp_path, f"{SOUND}dataset: {{path: {path}}}\n")
    assert said in told
    (told,) = suite(
        tmp_path, f"{SOUND}prompt: {path.rstrip(chr(34))}.j2{chr(34) * ('0' in path)}\n"
    )
    assert said in told


def test_a_folder_whose_name_is_not_utf8(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / os.fsdecode(b"\xff")
    folder.mkdir()
    monkeypatch.setenv("THERE", str(folder))
    (told,) = suite(tmp_path, SOUND + "dataset: {path: $THERE}\n")
    assert "not UTF-8" in told


OVERRIDES = {
    "hex": ("seeds=[0x" + "f" * 90_000 + "]", "too long a number"),
    "deep value": ("seeds=" + "[" * 90_000, "nested too deeply"),
    "deep key": ("a." * 40_000 + "a=1", "not of the form key=value"),
    "aliases": ("seeds=[&a 1" + ", *a" * 30_000 + "]", "more than 20,000 values"),
}


@pytest.mark.parametrize(("override", "said"), OVERRIDES.values(), ids=OVERRIDES)
def test_an_override_within_bounds(tmp_path: Path, override: str, said: str) -> None:
    told = suite(tmp_path, SOUND, override)
    assert said in told[0]
    assert len(told[0]) < 1_000


def test_overrides_are_counted(tmp_path: Path) -> None:
    (told,) = suite(tmp_path, SOUND, *["seeds=[1]"] * 201)
    assert "given too often" in told


NUMBERS = {
    "rpm": "9" * 25,
    "max_tokens": "9" * 290,
    "temperature": "0x" + "f" * 240,
    "size_b": "1e308",
    "timeout_s": "1e308",
    "extra_body": "{top_k: 0x" + "f" * 6_000 + "}",
    "price": "{input: 1e300, output: 1}",
}


@pytest.mark.parametrize("field", NUMBERS)
def test_a_number_outside_all_use_is_one_problem(tmp_path: Path, field: str) -> None:
    (told,) = models(tmp_path, f"m: {{id: openai/x, {field}: {NUMBERS[field]}}}\n")
    assert f"m.{field}" in told
    assert len(told) < 1_000


@pytest.mark.parametrize(
    "text", ["-eyJ" * 50_000, "http://" + ":" * 200_000, "bearer " * 30_000, "hf" * 90_000]
)
def test_a_search_for_keys_takes_linear_time(text: str) -> None:
    assert not looks_secret(text)


def test_an_override_that_is_not_utf8(tmp_path: Path) -> None:
    (told,) = suite(tmp_path, SOUND, os.fsdecode(b"\xff=1"))
    assert "is not UTF-8" in told


@settings(deadline=None, max_examples=40)
@given(data=SUITES, override=st.none() | OVERRIDE_TEXTS)
def test_any_suite_is_read_or_refused(
    data: bytes, override: str | None, tmp_path_factory: pytest.TempPathFactory
) -> None:
    folder = tmp_path_factory.getbasetemp()
    (folder / "data" / "phyblock-400").mkdir(parents=True, exist_ok=True)
    (folder / "law.yaml").write_bytes(data)
    with contextlib.suppress(SpecError):
        overrides = () if override is None else (override,)
        loaded = load_suite(folder / "law.yaml", overrides, data_dir=folder / "data")
        assert json.dumps(loaded.identity(), allow_nan=False)


@settings(deadline=None, max_examples=40)
@given(data=MODELS_FILES)
def test_any_models_file_is_read_or_refused(
    data: bytes, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "law-models.yaml"
    path.write_bytes(data)
    with contextlib.suppress(SpecError):
        for spec in load_models(path).values():
            assert json.dumps(spec.model_dump(mode="json"), allow_nan=False)
