"""Verbs as they are called: help, `models`, `show`, and those that read a finished run."""

import re
import subprocess
import sys
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from phyblock.cli.main import phyblock
from phyblock.config.models import ModelConfig
from phyblock.data.scenes import read_builtin
from phyblock.models import litellm_client
from phyblock.models.cache import ReplyCache
from phyblock.models.litellm_client import known_providers
from phyblock.records.files import read_records
from phyblock.records.record import Reply
from phyblock.sim.engine import ENGINES
from tests.servers.openai_chat import OpenAIChat
from tests.tracks.conftest import raw_of, seesaw
from tests.web.factory import LEVELS, manifest, record, score, write_run
from tests.workspace import questions, vqa_suite, write_questions

VERBS = tuple(phyblock.list_commands(None))
CALLS = re.compile(rf"\bphyblock ((?:{'|'.join(VERBS)})\b[^\n`;|&>\"#]*)")
LIBRARIES = tuple(ENGINES)
HEAVY = ("litellm", *LIBRARIES, "pandas", "aiohttp", "matplotlib", "phyblock.making")
COMMANDS = """
from phyblock.cli.main import main
for words in sys.argv[1:]:
    sys.argv = ["phyblock", *words.split()]
    try:
        main()
    except SystemExit as ending:
        assert not ending.code
"""
PACKAGES = '\nsys.stderr.write(" ".join({name.split(".")[0] for name in sys.modules}))'


def ran(code, *words):
    """Return what code prints, and the packages that it imports."""
    command = [sys.executable, "-c", f"import sys\n{code}{PACKAGES}", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return done.stdout, set(done.stderr.split())


@pytest.mark.parametrize(
    ("modules", "heavy"),
    [
        ("phyblock", ("numpy", "pandas", "litellm", "aiohttp", "pydantic", "yaml", "click")),
        ("phyblock.results.load, phyblock.results.tables", ("litellm", "rich", "matplotlib")),
    ],
)
def test_importing_what_a_program_needs_imports_nothing_heavy(modules, heavy):
    _, imported = ran(f"import {modules}")
    assert not imported & {*heavy, *LIBRARIES, "aiohttp"}


def test_help_and_version_import_nothing_heavy():
    told, imported = ran(COMMANDS, "--help")
    assert all(f"\n  {verb} " in told for verb in VERBS)
    assert not imported & {*HEAVY, "numpy", "pydantic", "rich", "yaml"}
    verbs = ("run", "report", "score", "validate", "models", "cache", "init")
    told, imported = ran(COMMANDS, "--version", *(f"{verb} --help" for verb in verbs))
    assert told.count("Usage: phyblock ") == len(verbs)
    assert not imported & set(HEAVY)


def test_every_option_that_messages_and_docs_name_is_there():
    root = Path(__file__).parents[2]
    written = [*root.glob("phyblock*/**/*.py"), root / "README.md", *root.glob("docs/**/*.md")]
    named = set()
    for path in written:
        for call in CALLS.findall(path.read_text(encoding="utf-8")):
            before, *options = re.split(r"(?<!\S)(?=--)", call)
            words = before.split()
            named |= {(*words[:2], re.split(r"[^a-z0-9-]", option)[0]) for option in options}
    assert {verb for verb, *_ in named} >= {"run", "scenes", "compare"}
    context = click.Context(phyblock)
    for verb, *words in sorted(named):
        # Of a verb, or of its own verb that the next word names.
        command = phyblock.get_command(context, verb)
        inner = command.get_command(context, words[0]) if isinstance(command, click.Group) else None
        params = [param for one in (command, inner) if one for param in one.params]
        assert words[-1] in {"--help"}.union(*(param.opts for param in params)), (verb, *words)


@pytest.mark.parametrize(
    "model", ["hosted_vllm/x", "openai/new", "gemini/gemini-2.5-pro", "anthropic/claude-unheard-of"]
)
def test_a_model_at_hand_needs_no_litellm(model, monkeypatch):
    monkeypatch.setattr(litellm_client, "_litellm", lambda: pytest.fail("it was imported"))
    assert model.partition("/")[0] in known_providers(ModelConfig(name="m", id=model))


def test_an_episode_is_told_by_the_outcome_of_each_step_and_its_end(workspace):
    """In some of eight seeds the oracle lets the bar fall."""
    workspace.write_scenes(raw_of(seesaw()))
    suite = {"models": ["oracle", "repeat"], "seeds": [*range(8)], "steps": {"physics": "strict"}}
    workspace.write_suite(tracks=["step_planning"], **suite)
    workspace.completed("--no-cache")
    endings = {r["seed"]: r["ending"] for r in workspace.records() if r["model"] == "oracle"}
    assert set(endings.values()) == {"completed", "collapsed"}
    fallen = next(seed for seed, ending in endings.items() if ending == "collapsed")
    assert "Collapsed" in workspace.does("show", "out", f"oracle/seesaw/s{fallen}").out
    (task,) = read_builtin(workspace.root / "data").tasks
    for episode in read_records(workspace.out):
        course, built = episode.course(""), episode.built(task)
        whys = [None if one in ("placed", "done") else one for one in episode.outcomes]
        assert ([why for _, why in course.steps], course.ending) == (whys, episode.ending)
        assert len(built) == 3 - course.missing == episode.outcomes.count("placed")
        assert set(built) <= set(task.scene.blocks)


def test_plans_and_answers_are_shown_with_reply_steps_and_verdict(workspace):
    write_questions(workspace.root / "questions", questions(per_subtask=2, subtasks=("SH", "CO")))
    tracks = ["full_planning", "vqa"]
    with workspace.served(OpenAIChat(), **{**vqa_suite(), "tracks": tracks}):
        workspace.completed("--limit", "2")
    for shown in workspace.records():
        done = workspace.does("show", "out", shown["sample"], env={"COLUMNS": "80"})
        assert max(map(len, done.out.splitlines())) <= 80
        assert shown["reply"]["text"].splitlines()[0] in done.out
        if shown["track"] == "vqa":
            verdict = "right" if shown["answer"]["correct"] else "wrong: the answer is "
            assert f"\n{verdict}" in done.out
        else:
            steps = re.findall(r"^\d+\. block (\d+): ", done.out, re.MULTILINE)
            assert steps == [str(candidate) for candidate in shown["parse"]["plan"]]


@pytest.fixture
def folder(tmp_path):
    records = [
        record(model, scene, seed, [score(tp, 4 - tp, 4 - tp), score(tp, 0, 1, setting="B")])
        for model, tp in (("alpha", 4), ("beta", 1))
        for scene in LEVELS
        for seed in (0, 1)
    ]
    facts = manifest(models=[("alpha", "GPT-4.1"), "beta"])
    return write_run(tmp_path / "run", records, facts)


def printed(*words, typed=""):
    words = [str(word) for word in words]
    return CliRunner().invoke(phyblock, words, typed, catch_exceptions=False).output


def test_tables_print_all_or_one_in_any_form(folder):
    words = ("report", folder, "--print")
    assert printed(*words, "--only", "errors") in printed(*words)
    assert r"\begin{tabular}" in printed(*words, "--only", "cost", "--format", "tex")
    assert not (folder / "tables").exists()


def test_the_cache_is_listed_and_the_replies_of_one_model_are_deleted(tmp_path, monkeypatch):
    monkeypatch.setenv("PHYBLOCK_CACHE", str(tmp_path))
    with ReplyCache(tmp_path / "replies.sqlite") as cache:
        for key, model in enumerate(("openai/a", "openai/a", "openai/b")):
            cache.put(str(key), model, Reply(text="Step1"))

    def listed():
        return dict(re.findall(r"^(openai/.) +(\d+)", printed("cache"), re.MULTILINE))

    clear = ("cache", "--clear", "openai/a")
    assert "Delete 2 replies of openai/a?" in printed(*clear)
    assert listed() == {"openai/a": "2", "openai/b": "1"}
    assert "openai/a " not in printed(*clear, typed="y\n")
    assert listed() == {"openai/b": "1"}


def test_figures_exports_and_comparisons_are_written_where_they_say(folder):
    made = [str(folder / "paper" / f"errors.{kind}") for kind in ("pdf", "svg", "png", "txt")]
    assert printed("figures", folder, "--only", "errors").split() == made
    exported = printed("export", folder, "--to", "csv").strip()
    assert exported == str(folder / "export" / "csv" / "records.csv")
    compared = printed("compare", folder, "--models", "alpha,beta", "--out", folder / "x")
    # Five base scenes are too few for five comparisons.
    assert "cannot tell" in compared
    assert (folder / "x" / "comparison.tex").exists()
