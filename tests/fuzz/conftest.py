"""One worker and two prepared folders for all fuzzing, and a summary of what was tried."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.fuzz.bench import Bench
from tests.fuzz.sizes import FAULTS, INPUTS, SEED
from tests.fuzz.worker import Worker
from tests.vqa_set import questions, vqa_suite, write_questions
from tests.workspace import SCENES, Workspace

_tallies: dict[str, Counter[str]] = {}
_SCENES = SCENES[:2]


@pytest.fixture(scope="session")
def tallies() -> dict[str, Counter[str]]:
    """Counts of what was tried, by kind and end; printed in the end."""
    return _tallies


@pytest.fixture(scope="session")
def worker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Worker]:
    """The folder in which all commands of the session run."""
    with Worker(tmp_path_factory.mktemp("worker")) as made:
        yield made


@pytest.fixture(scope="session")
def sound(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """A folder with a sound suite, models, scenes, questions, and files of the user's own."""
    made = Workspace(tmp_path_factory.mktemp("sound"), pictures_dir)
    made.write_scenes(*_SCENES)
    made.write_suite(models=["random"])
    write_questions(made.root / "questions", questions(_SCENES, 1, ("SH", "OR")))
    made.write_yaml(
        "questions.yaml",
        {"name": "asked", "dataset": {"path": "./data"}, **vqa_suite(), "models": ["random"]},
    )
    made.write_yaml("models.yaml", {"old": {"replay": "replies"}, "far": "openai/gpt-4o"})
    (made.root / "thesis").mkdir()
    (made.root / "thesis" / "ch1.tex").write_text("precious", encoding="utf-8")
    return made


@pytest.fixture(scope="session")
def ended(sound: Workspace, worker: Worker, tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """The same with a finished run of each track: `out`, `steps` and `asked`."""
    import shutil

    root = tmp_path_factory.mktemp("ended") / "w"
    shutil.copytree(sound.root, root, symlinks=True)
    made = Workspace(root, sound.cache / "pictures")
    steps = ["--set", "tracks=[step_planning]", "--set", "steps.physics=off"]
    for args in (
        ["suite.yaml", "--out", "out", "--models", "random,oracle"],
        ["suite.yaml", "--out", "steps", "--models", "oracle", *steps],
        ["questions.yaml", "--out", "asked"],
    ):
        told = worker.phyblock(["run", *args, "--no-report"], made.root, made.env)
        assert (told.code, told.err) == (0, "")
    for name in ("report/ch1/thesis.tex", "figures/mine.svg", "tables/mine.csv", "notes.md"):
        path = made.root / "out" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("precious", encoding="utf-8")
    return made


@pytest.fixture(scope="session")
def plain_bench(
    sound: Workspace, worker: Worker, pictures_dir: Path, tmp_path_factory: pytest.TempPathFactory
) -> Bench:
    """Tries cases beside a sound suite."""
    root = tmp_path_factory.mktemp("plain")
    return Bench(worker, sound.root, pictures_dir, root)


@pytest.fixture(scope="session")
def runs_bench(
    ended: Workspace, worker: Worker, pictures_dir: Path, tmp_path_factory: pytest.TempPathFactory
) -> Bench:
    """Tries cases beside finished runs."""
    root = tmp_path_factory.mktemp("runs")
    return Bench(worker, ended.root, pictures_dir, root)


def pytest_report_header() -> str:
    """The seed, so that what fails can be had again."""
    return f"fuzzing: seed {SEED}, {INPUTS} inputs, {FAULTS} faults"


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print what was tried, and how it ended."""
    if not _tallies:
        return
    terminalreporter.section(f"fuzzing with seed {SEED}")
    for name, tally in sorted(_tallies.items()):
        told = ", ".join(f"{key}: {count:,}" for key, count in sorted(tally.items()))
        terminalreporter.line(f"{name:<12} {sum(tally.values()):>6,}  ({told})")
