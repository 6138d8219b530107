"""Two prepared folders for all fuzzing, and a summary of what was tried."""

from collections import Counter
from collections.abc import Callable

import pytest

from tests.fuzz.strategies import FAULTS, INPUTS, SEED
from tests.workspace import SCENES, Workspace, questions, vqa_suite, write_questions

_tallies: dict[str, Counter[str]] = {}
_SCENES = SCENES[:2]


@pytest.fixture(scope="session")
def tallies() -> dict[str, Counter[str]]:
    """Counts of what was tried, by kind and end; printed in the end."""
    return _tallies


@pytest.fixture(scope="session")
def sound(new_workspace: Callable[..., Workspace]) -> Workspace:
    """A folder with a sound suite, models, scenes, questions, and files of the user's own."""
    made = new_workspace(*_SCENES)
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
def ended(sound: Workspace, tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """The same with a finished run of each track: `out`, `steps` and `asked`."""
    made = sound.copied(tmp_path_factory.mktemp("ended") / "w")
    steps = ("--set", "tracks=[step_planning]", "--set", "steps.physics=off")
    for words in (
        ("suite.yaml", "--out", "out", "--models", "random,oracle"),
        ("suite.yaml", "--out", "steps", "--models", "oracle", *steps),
        ("questions.yaml", "--out", "asked"),
    ):
        made.does("run", *words, "--no-report")
    for name in ("report/ch1/thesis.tex", "figures/mine.svg", "tables/mine.csv", "notes.md"):
        path = made.root / "out" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("precious", encoding="utf-8")
    return made


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
