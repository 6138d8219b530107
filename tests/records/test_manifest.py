"""`run.yaml` is read within bounds, and said to be wrong in words."""

from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.errors import StoreError
from phyblock.records.line import shown
from phyblock.records.manifest import MANIFEST, read_manifest
from tests.records.damage import YAML_TEXTS


@pytest.mark.parametrize("name", YAML_TEXTS)
@pytest.mark.parametrize("field", ["mine", "limit", "scenes", "suite", "scenes_by_level"])
def test_what_no_run_writes_is_refused_in_words(tmp_path: Path, name: str, field: str) -> None:
    (tmp_path / MANIFEST).write_text(f"identity: x\n{field}: {YAML_TEXTS[name]}\n")
    with pytest.raises(StoreError, match=r"run\.yaml"):
        read_manifest(tmp_path)


HALF = '"x\\ud800"'


@pytest.mark.parametrize("suite", [f"{{name: {HALF}}}", f"{{levels: [{{{HALF}: 1}}]}}"])
def test_a_suite_holds_no_half_of_a_character(tmp_path: Path, suite: str) -> None:
    (tmp_path / MANIFEST).write_text(f"identity: x\nsuite: {suite}\n")
    with pytest.raises(StoreError, match=r"run\.yaml: suite: (.|\n)*half of a char"):
        read_manifest(tmp_path)


def test_a_folder_of_any_bytes_is_kept_and_names_can_be_shown(tmp_path: Path) -> None:
    data = f"{{name: {HALF}, sha256: x, root: {HALF}}}"
    (tmp_path / MANIFEST).write_text(f"identity: x\ndataset: {data}\nmodels: [{{name: {HALF}}}]\n")
    manifest = read_manifest(tmp_path)
    assert manifest.dataset is not None
    assert manifest.dataset.root == "x\ud800"
    assert [manifest.dataset.name, manifest.models[0].name] == ["x?", "x?"]


@pytest.mark.parametrize(
    "value",
    [10**6000, {object(): 1}, {(1, 2): 3}, b"x", "\ud800", {"a": {1, 2}}, "x" * 10**6],
    ids=lambda value: type(value).__name__,
)
def test_any_value_can_be_shown(value: object) -> None:
    text = shown(value)
    assert len(text) <= 60
    text.encode()
