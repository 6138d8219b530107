from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import StoreError
from phyblock.folders import LIST, OutFolder

NAMES = ("a.csv", "b.md", "tables/c.csv", "tables/deep/d.csv", "figures/e.svg")
some = st.sets(st.sampled_from(NAMES))


def contents(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != LIST)
    return {str(path.relative_to(folder)): path.read_text() for path in files}


def put(folder: Path, names: set[str]) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("theirs")


@given(theirs=some, first=some, later=some)
def test_what_we_never_wrote_is_never_written_over(
    tmp_path_factory: pytest.TempPathFactory, theirs: set[str], first: set[str], later: set[str]
) -> None:
    folder = tmp_path_factory.mktemp("out")
    put(folder, theirs)
    for round_, names in enumerate((first, later, first)):
        before = contents(folder)
        texts = dict.fromkeys(sorted(names), f"ours {round_}")
        if names & theirs:
            with pytest.raises(StoreError) as caught:
                OutFolder(folder).write(texts)
            assert len(caught.value.problems) == len(names & theirs)
            assert contents(folder) == before
        else:
            OutFolder(folder).write(texts)
            assert contents(folder) == before | texts


def test_links_are_neither_followed_nor_replaced(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "file").write_text("theirs")
    out = tmp_path / "out"
    OutFolder(out).write({"c.csv": "ours"})
    (out / "c.csv").unlink()
    (out / "c.csv").symlink_to(tmp_path / "elsewhere" / "file")
    (out / "tables").symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    with pytest.raises(StoreError) as caught:
        OutFolder(out).write({"tables/file": "ours", "tables/deep/x": "ours", "c.csv": "ours"})
    assert [problem.where for problem in caught.value.problems] == [
        str(out / "tables"),
        str(out / "c.csv"),
    ]
    assert contents(tmp_path / "elsewhere") == {"file": "theirs"}


def test_a_list_that_is_a_link_is_not_written_through(tmp_path: Path) -> None:
    theirs = tmp_path / "theirs"
    theirs.write_text("theirs")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / LIST).symlink_to(theirs)
    with pytest.raises(StoreError, match="it is a link"):
        OutFolder(tmp_path / "out").write({"a": "ours"})
    assert theirs.read_text() == "theirs"


def test_files_and_folders_in_the_way_are_named(tmp_path: Path) -> None:
    (tmp_path / "tables").write_text("theirs")
    (tmp_path / "a.csv").mkdir()
    with pytest.raises(StoreError) as caught:
        OutFolder(tmp_path).check(["tables/b.csv", "a.csv"])
    told = {problem.where: problem.message for problem in caught.value.problems}
    assert told == {
        str(tmp_path / "tables"): "cannot be written in: it is no folder",
        str(tmp_path / "a.csv"): "cannot be written: it is no file",
    }
    assert not (tmp_path / LIST).exists()


def test_a_closed_folder_is_not_said_to_be_in_the_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The one who runs the tests may be root, whom no folder is closed to."""
    monkeypatch.setattr("os.access", lambda *_: False)
    with pytest.raises(StoreError) as caught:
        OutFolder(tmp_path).check(["a.csv"])
    (problem,) = caught.value.problems
    assert problem.message == "cannot be written in: permission denied"
    assert "choose another folder" in problem.hint


@pytest.mark.parametrize("name", ["../mine", "a/../../mine", "/mine"])
def test_no_name_leads_out_of_the_folder(tmp_path: Path, name: str) -> None:
    with pytest.raises(StoreError, match="leads out of the folder"):
        OutFolder(tmp_path / "out").write({name: "ours"})
    assert list(tmp_path.iterdir()) == []


def test_what_was_written_before_there_was_a_list_is_ours(tmp_path: Path) -> None:
    put(tmp_path, {"a.csv", "b.md", "mine.md"})
    out = OutFolder(tmp_path, earlier=lambda: ["a.csv", "b.md"])
    out.write({"a.csv": "ours"})
    OutFolder(tmp_path, earlier=lambda: ["mine.md"]).write({"b.md": "ours"})
    with pytest.raises(StoreError, match="phyblock did not make"):
        OutFolder(tmp_path, earlier=lambda: ["mine.md"]).write({"mine.md": "ours"})
    assert contents(tmp_path) == {"a.csv": "ours", "b.md": "ours", "mine.md": "theirs"}


def test_a_list_that_was_cut_short_is_no_failure(tmp_path: Path) -> None:
    OutFolder(tmp_path).write({"a.csv": "1", "b.md": "1"})
    listed = (tmp_path / LIST).read_bytes()
    os.truncate(tmp_path / LIST, len(listed) - 3)
    with pytest.raises(StoreError, match=r"b\.md"):
        OutFolder(tmp_path).write({"b.md": "2", "c": "2"})
    OutFolder(tmp_path).write({"a.csv": "2", "c": "2"})
    OutFolder(tmp_path).write({"c": "3"})
    assert contents(tmp_path) == {"a.csv": "2", "b.md": "1", "c": "3"}


def test_only_what_is_ours_is_removed_and_folders_that_are_empty_then(tmp_path: Path) -> None:
    out = OutFolder(tmp_path / "out")
    out.write({"a/b/one": "ours", "a/two": "ours", "c/three": "ours", "d/four": "ours"})
    (out.path / "c" / "theirs").write_text("mine")
    (out.path / "d" / "four").unlink()
    (out.path / "d").rmdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "four").write_text("mine")
    (out.path / "d").symlink_to(tmp_path / "elsewhere")
    assert out.names("a/") == ["a/b/one", "a/two"]
    out.remove(["a/b/one", "a/two", "c/three", "c/theirs", "d/four", "gone"])
    left = {path.relative_to(out.path).as_posix() for path in out.path.rglob("*")}
    assert left == {LIST, "c", "c/theirs", "d"}
    assert (tmp_path / "elsewhere" / "four").read_text() == "mine"


def make(out: OutFolder, name: str, failure: Exception | None = None) -> None:
    with out.making() as folder:
        (folder / "b").write_text("ours")
        (folder / name).write_text("ours")
        if failure is not None:
            raise failure


def test_files_that_are_made_together_come_together_or_not_at_all(tmp_path: Path) -> None:
    out = OutFolder(tmp_path / "out")
    with out.making("deep/") as folder:
        (folder / "x").mkdir()
        (folder / "x" / "y").write_text("ours")
    assert contents(out.path) == {"deep/x/y": "ours"}
    put(out.path, {"mine"})
    with pytest.raises(ValueError, match="stop"):
        make(out, "a", ValueError("stop"))
    with pytest.raises(StoreError, match="mine"):
        make(out, "mine")
    assert contents(out.path) == {"deep/x/y": "ours", "mine": "theirs"}
    assert sorted(path.name for path in out.path.iterdir()) == [LIST, "deep", "mine"]
