"""Results on different versions of a data set are never mixed."""

from __future__ import annotations

from pathlib import Path

import pytest

from phyblock.data import VERSION_FILE, read_version
from phyblock.errors import DataError, SpecError
from phyblock.records.manifest import read_manifest
from phyblock.results.compare import check_alike, compare_runs
from phyblock.results.estimates import main_measure
from phyblock.results.load import load_run
from tests.web.factory import manifest, run_of
from tests.workspace import Workspace


@pytest.mark.parametrize("text", ["", "0", "two", "-1", "1.5", "1" * 7, "²"])
def test_what_is_no_version_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / VERSION_FILE).write_text(text, encoding="utf-8")
    with pytest.raises(DataError, match=r"VERSION: holds no version\n.*\n.*whole number from 1"):
        read_version(tmp_path)


def test_runs_on_two_versions_are_not_mixed(tmp_path: Path) -> None:
    work = Workspace(tmp_path, tmp_path / "pictures")
    folder = work.write_scenes()
    work.write_suite(levels=[1])
    assert work.run().code == 0
    assert work.run().code == 0
    (folder / VERSION_FILE).write_text("2\n", encoding="utf-8")
    refused = work.run()
    assert refused.code != 0
    assert "out: holds another run" in refused.err
    assert "dataset.version (1, now 2)" in refused.err
    newer = tmp_path / "newer"
    assert work.phyblock("run", "suite.yaml", "--out", newer, "--no-report").code == 0
    versions = [read_manifest(path).dataset for path in (work.out, newer)]
    assert [data.version for data in versions if data is not None] == [1, 2]
    with pytest.raises(SpecError, match=r"dataset\.version: cannot be compared"):
        compare_runs(load_run(work.out), load_run(newer), ["oracle"])


def test_answers_to_two_versions_of_questions_are_not_mixed() -> None:
    runs = [run_of([], manifest(tracks={"vqa": {"questions": digest}})) for digest in "ab"]
    with pytest.raises(SpecError, match=r"tracks.vqa.questions: cannot be .*\n.*found: b"):
        check_alike(runs[1], runs[0], [], "vqa", main_measure(runs[0], "vqa"))
