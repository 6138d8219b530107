"""Output of commands: what is the user's is never written over, removed or reached by a link."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from phyblock.cli.main import phyblock
from phyblock.errors import StoreError
from phyblock.files import LIST
from phyblock.results.tables import write_tables
from phyblock.web.report import write_report
from tests.web.factory import LEVELS, manifest, record, score, write_run
from tests.workspace import COMMAND, Workspace

Prepare = Callable[[Path], None]


def call(*words: str | Path, home: Path | None = None) -> str:
    env = {"HOME": str(home)} if home else {}
    done = CliRunner().invoke(
        phyblock, [str(word) for word in words], standalone_mode=False, env=env
    )
    if done.exception is not None:
        raise done.exception
    return done.output


def files(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): b"-> " + bytes(path.readlink())
        if path.is_symlink()
        else path.read_bytes()
        for path in folder.rglob("*")
        if path.is_symlink() or path.is_file()
    }


def put(path: Path, text: str = "mine") -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def link(path: Path) -> None:
    """A link at `path` to a folder of the user's beside the out folder."""
    put(path.parent.parent / "elsewhere" / "ch1" / "thesis.tex")
    path.symlink_to(path.parent.parent / "elsewhere", target_is_directory=True)


@pytest.fixture
def suite(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    workspace.write_suite(models=["oracle"])
    for name, value in workspace.env.items():
        monkeypatch.setenv(name, value)
    return workspace


@pytest.fixture
def finished(tmp_path: Path) -> Path:
    """A run folder with records, begun by this version."""
    records = [record(scene=scene, scores=[score(1, 1, 1)]) for scene in LEVELS]
    folder = write_run(tmp_path / "run", records, manifest(models=["alpha"], seeds=[0]))
    put(folder / LIST, "# ours\n")
    return folder


@pytest.mark.parametrize("options", [(), ("--dry-run",)])
@pytest.mark.parametrize(
    "name", ["report/ch1/thesis.tex", "report.html", "tables/table1.md", "notes.txt"]
)
def test_a_run_begins_in_no_folder_of_another(
    suite: Workspace, name: str, options: tuple[str, ...]
) -> None:
    put(suite.out / name)
    before = files(suite.root)
    with pytest.raises(StoreError, match="is not empty and holds no run"):
        call("run", suite.root / "suite.yaml", "--out", suite.out, *options)
    assert files(suite.root) == before


@pytest.mark.parametrize(
    "words",
    [
        ("run", "quick", "--out", ""),
        ("run", ""),
        ("run", "quick", "--models-file", ""),
        ("report", ""),
        ("score", "run", "--out", ""),
        ("export", "run", "--to", "csv", "--out", ""),
        ("scenes", "render", "phyblock-400", "--out", ""),
        ("show", "run", "sample", "--gif", ""),
        ("init", ""),
    ],
)
def test_an_empty_path_is_a_slip_and_not_this_folder(words: tuple[str, ...]) -> None:
    with pytest.raises(click.UsageError, match="empty"):
        call(*words)


def test_a_tilde_is_the_home_folder(suite: Workspace, monkeypatch: pytest.MonkeyPatch) -> None:
    home = suite.root / "home"
    monkeypatch.chdir(suite.root)
    call("init", "~/bench", home=home)
    call("run", suite.root / "suite.yaml", "--out", "~/run", "--no-report", home=home)
    assert (home / "bench" / "models.yaml").is_file()
    assert "Assembly planning" in call("report", "~/run", "--print", home=home)
    assert not (suite.root / "~").exists()


IN_THE_WAY: dict[str, tuple[Prepare, str]] = {
    "report": (lambda run: put(run / "report"), "report: cannot be written in: it is no folder"),
    "linked-report": (lambda run: link(run / "report"), "report: .*it is a link"),
    "linked-tables": (lambda run: link(run / "tables"), "tables: .*it is a link"),
    "page": (lambda run: put(run / "report.html"), r"report\.html: .*phyblock did not make"),
    "table": (lambda run: put(run / "tables" / "table1.md"), "table1.md: .*did not make"),
}


@pytest.mark.parametrize("name", IN_THE_WAY)
def test_what_is_in_the_way_is_named_and_stays(finished: Path, name: str) -> None:
    prepare, said = IN_THE_WAY[name]
    prepare(finished)
    before = files(finished.parent)
    with pytest.raises(StoreError, match=said):
        call("report", finished)
    after = files(finished.parent)
    assert {path: after[path] for path in before if not path.endswith(LIST)} == {
        path: before[path] for path in before if not path.endswith(LIST)
    }
    assert not (finished / "report").is_dir() or (finished / "report").is_symlink()


def test_a_run_goes_on_only_where_its_report_can_be_written(suite: Workspace) -> None:
    words = ("run", suite.root / "suite.yaml", "--out", suite.out)
    call(*words, "--no-report")
    put(suite.out / "tables" / "mine.md")
    before = files(suite.root)
    for prepare, said in IN_THE_WAY.values():
        if "tables" not in said and "table1" not in said:
            prepare(suite.out)
            with pytest.raises(StoreError, match=said):
                call(*words)
            for path in (suite.out / "report", suite.out / "report.html"):
                path.unlink(missing_ok=True)
    left = files(suite.root)
    assert {path: left[path] for path in before} == before
    call(*words, "--no-report")
    assert (suite.out / "tables" / "mine.md").read_text() == "mine"


def test_a_run_writes_through_no_link(suite: Workspace) -> None:
    put(suite.root / "theirs")
    words = ("run", suite.root / "suite.yaml", "--out", suite.out)
    call(*words, "--no-report")
    (suite.out / "calls.jsonl").symlink_to(suite.root / "theirs")
    with pytest.raises(StoreError, match=r"calls\.jsonl: is a link"):
        call(*words)
    assert (suite.root / "theirs").read_text() == "mine"


def test_reports_that_are_written_at_once_all_come_to_their_end(finished: Path) -> None:
    def write(_: int) -> Path:
        return write_report(write_tables(finished))

    with ThreadPoolExecutor(4) as pool:
        pages = list(pool.map(write, range(5)))
    assert set(pages) == {finished / "report.html"}
    (build,) = (path for path in (finished / "report").iterdir())
    assert {path.name for path in build.iterdir()} >= {"samples.js", "records-0.js"}
    assert f"report/{build.name}" in pages[0].read_text(encoding="utf-8")


def test_scores_go_to_no_folder_of_another(suite: Workspace) -> None:
    call("run", suite.root / "suite.yaml", "--out", suite.out, "--no-report")
    put(suite.root / "theirs" / "notes.txt")
    with pytest.raises(StoreError, match="is not empty and holds no run"):
        call("score", suite.out, "--out", suite.root / "theirs")
    link(suite.out / "scores")
    before = files(suite.root)
    with pytest.raises(StoreError, match=r"scores: .*it is a link"):
        call("score", suite.out, "--parser", "official")
    assert files(suite.root) == before


WRITING: dict[str, tuple[tuple[str, ...], str, str]] = {
    "export": (("export", "{run}", "--to", "csv"), "records.csv", "phyblock did not make"),
    "compare": (("compare", "{run}"), "flipped.csv", "phyblock did not make"),
    "figures": (("figures", "{run}", "--only", "errors"), "errors.pdf", "phyblock did not make"),
    "scenes": (("scenes", "generate", "--jobs", "1"), "SHA256SUMS", "already there"),
    "questions": (("questions", "generate", "--jobs", "1"), "SHA256SUMS", "already there"),
    "render": (
        ("scenes", "render", "phyblock-400", "l1-001-animal"),
        "l1-001-animal-oblique-checkerboard.png",
        "phyblock did not make",
    ),
}


@pytest.mark.parametrize("verb", WRITING)
def test_a_verb_writes_over_its_own_files_and_no_others(tmp_path: Path, verb: str) -> None:
    records = [
        record(model, scene, scores=[score(1, 1, 1)])
        for model in ("alpha", "beta")
        for scene in LEVELS
    ]
    run = write_run(tmp_path / "run", records, manifest(seeds=[0]))
    words, name, said = WRITING[verb]
    called = [word.format(run=run) for word in words]
    if "generate" not in words:
        for _ in range(2):
            call(*called, "--out", tmp_path / "ours")
    put(tmp_path / "theirs" / name)
    with pytest.raises(StoreError, match=f"{re.escape(name)}: .*{said}"):
        call(*called, "--out", tmp_path / "theirs")
    assert (tmp_path / "theirs" / name).read_text() == "mine"
    assert set(files(tmp_path / "theirs")) <= {name, LIST}


def test_init_writes_through_no_link(tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "models.yaml").symlink_to(tmp_path / "elsewhere.yaml")
    with pytest.raises(StoreError, match=r"models\.yaml: is already there"):
        call("init", tmp_path / "new")
    assert not (tmp_path / "elsewhere.yaml").exists()


def refused(workspace: Workspace, output: int, *words: str | bytes) -> tuple[int, str]:
    done = subprocess.run(
        [*COMMAND, *words],
        cwd=workspace.root,
        env=workspace.env | {"PYTHONIOENCODING": "ascii"},
        stdout=output,
        stderr=subprocess.PIPE,
        text=True,
    )
    return done.returncode, done.stderr


def test_output_that_nobody_takes_is_no_traceback(suite: Workspace) -> None:
    with open("/dev/full", "wb") as full:
        code, said = refused(suite, full.fileno(), "models")
    assert (code, said) == (2, "error: output: cannot be used: No space left on device\n")
    reader, writer = os.pipe()
    os.close(reader)
    assert refused(suite, writer, "models") == (1, "")
    os.close(writer)


def test_a_name_that_no_terminal_can_print_is_no_traceback(suite: Workspace) -> None:
    code, said = refused(suite, subprocess.DEVNULL, "report", b"r\xffn")
    assert code == 2
    assert "n: holds no run.yaml" in said
    assert "Traceback" not in said


def test_a_data_set_in_a_folder_that_is_not_utf_8_is_refused(suite: Workspace) -> None:
    place = Path(os.fsdecode(bytes(suite.root) + b"/r\xffn"))
    place.mkdir()
    for name in ("data", "suite.yaml"):
        (suite.root / name).rename(place / name)
    code, said = refused(suite, subprocess.DEVNULL, "run", place / "suite.yaml")
    assert code == 2
    assert "Traceback" not in said
