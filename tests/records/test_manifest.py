"""`run.yaml` is read within bounds, and said to be wrong in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.config.yaml import shown
from phyblock.errors import StoreError
from phyblock.records.manifest import MANIFEST, read_manifest
from tests.records.damage import YAML_TEXTS


@pytest.mark.parametrize("name", YAML_TEXTS)
@pytest.mark.parametrize("field", ["mine", "limit", "scenes", "suite", "scenes_by_level"])
def test_what_no_run_writes_is_refused_in_words(tmp_path: Path, name: str, field: str) -> None:
    (tmp_path / MANIFEST).write_text(f"identity: x\n{field}: {YAML_TEXTS[name]}\n")
    with pytest.raises(StoreError, match=r"run\.yaml"):
        read_manifest(tmp_path)


def test_half_a_character_is_refused(tmp_path: Path) -> None:
    (tmp_path / MANIFEST).write_text('identity: x\nsuite: {name: "x\\ud800"}\n')
    with pytest.raises(StoreError, match=r"run\.yaml:2:15: suite.name: (.|\n)*half of a char"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    "value",
    [10**6000, {object(): 1}, {(1, 2): 3}, b"x", "\ud800", {"a": {1, 2}}, "x" * 10**6],
    ids=lambda value: type(value).__name__,
)
def test_any_value_can_be_shown(value: object) -> None:
    text = shown(value)
    assert len(text) <= 80
    text.encode()
