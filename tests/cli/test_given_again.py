"""A finished run given again: nothing is made anew that did not change, and all that did."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import yaml
from click.testing import CliRunner, Result

from phyblock import registry
from phyblock.cli.main import phyblock
from phyblock.files import LIST
from phyblock.report import inputs
from phyblock.report.html import PageWritten
from phyblock.report.made import MADE, names_to_write, note_made, still_made
from phyblock.report.summary import Summary
from phyblock.run import code
from phyblock.tracks.kind import kind_of
from tests.workspace import Workspace

TABLES = ("assembly", "table1")


def files(folder: Path) -> dict[str, tuple[bytes, int, int]]:
    """Content, inode and time of every file but of those that any command touches."""
    return {
        path.relative_to(folder).as_posix(): (path.read_bytes(), stat.st_ino, stat.st_mtime_ns)
        for path in folder.rglob("*")
        if path.is_file() and path.name not in (LIST, ".lock")
        for stat in [path.stat()]
    }


def contents(folder: Path) -> dict[str, bytes]:
    return {name: content for name, (content, *_) in files(folder).items()}


class Finished:
    """A finished run with its tables, figures and page, and the words that made it."""

    def __init__(self, workspace: Workspace) -> None:
        self.out = workspace.out
        self.words = ["run", str(workspace.root / "suite.yaml"), "--out", str(workspace.out)]

    def run(self) -> Result:
        done = CliRunner().invoke(phyblock, self.words)
        assert done.exit_code == 0, done.output
        return done


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Finished]:
    root = tmp_path_factory.mktemp("given-again")
    with pytest.MonkeyPatch.context() as patch:
        workspace = Workspace(root, root / "pictures")
        for name, value in workspace.env.items():
            patch.setenv(name, value)
        workspace.write_scenes()
        workspace.write_suite(models=["oracle"], tables=list(TABLES))
        run = Finished(workspace)
        run.run()
        yield run


def test_a_finished_run_given_again_writes_nothing_and_says_the_same(finished: Finished) -> None:
    before, first = files(finished.out), finished.run()
    assert files(finished.out) == before
    assert {"report.html", "tables/table1.csv", "figures/scenes.svg", MADE} <= set(before)
    said = CliRunner().invoke(phyblock, ["report", str(finished.out)])
    assert first.output.startswith(said.output.splitlines()[0])
    assert first.output.splitlines()[-1] == said.output.splitlines()[-1]
    # The verb makes all anew: the same bytes, as other files.
    after = files(finished.out)
    assert contents(finished.out) == {name: content for name, (content, *_) in before.items()}
    assert after["report.html"][1:] != before["report.html"][1:]


def test_nothing_that_draws_or_counts_is_imported_for_it(finished: Finished) -> None:
    code = (
        "import sys; from phyblock.cli.main import phyblock\n"
        "phyblock(sys.argv[1:], standalone_mode=False)\n"
        "sys.exit(' '.join({'pandas', 'scipy', 'matplotlib', 'litellm'} & set(sys.modules)))"
    )
    words = [sys.executable, "-c", code, *finished.words]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""
    assert "All 5 samples are done" in done.stdout


def swap(path: Path, old: bytes, new: bytes) -> None:
    content = path.read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new))


def as_link(path: Path) -> None:
    path.rename(path.with_name("elsewhere"))
    path.symlink_to("elsewhere")


def relabel(run: Path) -> None:
    path = run / "run.yaml"
    fields = yaml.safe_load(path.read_text(encoding="utf-8"))
    fields["models"][0]["published"] = "GPT-4o"
    path.write_text(yaml.safe_dump(fields, sort_keys=False), encoding="utf-8")


def repeat_a_line(run: Path) -> None:
    lines = (run / "records.jsonl").read_bytes().splitlines(keepends=True)
    (run / "records.jsonl").write_bytes(b"".join([*lines, lines[0]]))


CHANGES: dict[str, Callable[[Path], object]] = {
    "table-removed": lambda run: (run / "tables/table1.md").unlink(),
    "table-changed": lambda run: swap(run / "tables/table1.csv", b"0", b"1"),
    "table-a-link": lambda run: as_link(run / "tables/table1.csv"),
    "figure-removed": lambda run: (run / "figures/scenes.svg").unlink(),
    "page-changed": lambda run: swap(run / "report.html", b"oracle", b"orakel"),
    "script-changed": lambda run: swap(next(run.glob("report/*/index.js")), b"oracle", b"orakel"),
    "record-added": repeat_a_line,
    "records-removed": lambda run: (run / "records.jsonl").unlink(),
    "manifest-changed": relabel,
    "prompt-added": lambda run: (run / "prompts.jsonl").write_text("\n"),
    "note-removed": lambda run: (run / MADE).unlink(),
    "note-broken": lambda run: (run / MADE).write_text("{"),
    "note-a-link": lambda run: as_link(run / MADE),
    "note-of-another-format": lambda run: swap(run / MADE, b'"format":2', b'"format":0'),
    "data-changed": lambda run: os.utime(run.parents[1] / "data" / "scenes.jsonl", (0, 0)),
}


@pytest.fixture
def copied(finished: Finished, tmp_path: Path) -> Iterator[Path]:
    """The run, in a folder of its own; times of the data are put back at the end."""
    data = finished.out.parent / "data" / "scenes.jsonl"
    times = data.stat()
    run = finished.out.parent / tmp_path.name / finished.out.name
    shutil.copytree(finished.out, run)
    yield run
    os.utime(data, ns=(times.st_atime_ns, times.st_mtime_ns))


def is_current(run: Path, *, page: bool = True, tables: tuple[str, ...] = TABLES) -> bool:
    return still_made(run, inputs.inputs_digest(run, tables), page=page) is not None


@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
def test_after_any_change_it_is_not_current(copied: Path, change: Callable[[Path], object]) -> None:
    assert is_current(copied)
    assert is_current(copied, page=False)
    change(copied)
    assert not is_current(copied)


def test_other_tables_code_or_settings_are_other_inputs(
    copied: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not is_current(copied, tables=("table1",))
    assert not is_current(copied.rename(copied.with_name("of-another-name")))
    copied.with_name("of-another-name").rename(copied)
    with monkeypatch.context() as patch:
        patch.setenv("PHYBLOCK_PHYSICS", "mujoco")
        assert not is_current(copied)
    with monkeypatch.context() as patch:
        patch.setattr(code, "version", lambda _: "99")
        assert not is_current(copied)
    with monkeypatch.context() as patch:
        patch.setattr(code, "_MOST_FILES", 3)
        assert not is_current(copied)
    assert is_current(copied)
    name = kind_of("full_planning").report().measures[0]
    registry.add_measure("full_planning", name)
    try:
        assert not is_current(copied)
    finally:
        registry.remove_measure("full_planning", name.name)
    assert is_current(copied)


def test_all_that_was_changed_is_made_again_as_it_was(finished: Finished) -> None:
    before = contents(finished.out)
    for change in ("table-changed", "figure-removed", "page-changed", "script-changed"):
        CHANGES[change](finished.out)
    finished.run()
    assert contents(finished.out) == before
    assert is_current(finished.out)


def test_a_page_that_lacks_what_may_come_is_not_noted(copied: Path) -> None:
    (copied / MADE).unlink()
    digest = inputs.inputs_digest(copied, TABLES)
    page = PageWritten(copied / "report.html", (copied / "report.html",), (), is_whole=False)
    note_made(copied, digest, Summary(), (), page)
    assert not (copied / MADE).exists()
    picture = copied / "sent.png"
    picture.touch()
    whole = PageWritten(page.path, page.files, (picture,), is_whole=True)
    note_made(copied, digest, Summary(), (), whole)
    assert is_current(copied)
    picture.unlink()
    assert not is_current(copied)


def test_tables_alone_do_not_stand_for_a_page(copied: Path) -> None:
    (copied / MADE).unlink()
    digest = inputs.inputs_digest(copied, TABLES)
    note_made(copied, digest, Summary(), (copied / "tables/table1.csv",), None)
    assert is_current(copied, page=False)
    assert not is_current(copied)


def test_names_in_the_way_are_the_same_with_a_note_and_without(copied: Path) -> None:
    known = [list(names_to_write(copied, page=page)) for page in (False, True)]
    (copied / MADE).unlink()
    assert known == [list(names_to_write(copied, page=page)) for page in (False, True)]
