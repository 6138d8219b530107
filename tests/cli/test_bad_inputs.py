"""Bad input gives exit code 2 and one clear message a problem, and nothing on disk is lost."""

import os
import re
import sqlite3
from collections.abc import Callable, Mapping
from contextlib import closing
from functools import partial
from typing import NamedTuple

import pytest

from phyblock.cli.main import show_problems
from phyblock.errors import InputError, Problem
from tests.data.broken import sound_scene, write_checkout
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace, tower, write_lines

RUN = ["run", "suite.yaml", "--out", "out"]
FRESH = ["run", "suite.yaml", "--out", "fresh"]
FAKE_KEY = "sk-" + "x1" * 12


def after(change, *args):
    """Something is changed, if anything, and then this command is given."""

    def prepare(workspace):
        if change:
            change(workspace)
        return list(args)

    return prepare


command = partial(after, None)
options = partial(command, *RUN)
"""A sound suite, and these options."""


def file(name, content, *args):
    """A file holds this, whatever it was; content may be a function of the text before."""

    def change(workspace):
        path = workspace.root / name
        path.parent.mkdir(exist_ok=True)
        text = content(path.read_text(encoding="utf-8")) if callable(content) else content
        path.write_bytes(text if isinstance(text, bytes) else text.encode())

    return after(change, *args)


def suite_line(line):
    """The suite is sound but for one more line."""
    sound = ("name: trial", "models: [random]", "dataset: {path: ./data}")
    kept = [other for other in sound if other.split(":")[0] != line.split(":")[0]]
    return file("suite.yaml", "\n".join([*kept, line, ""]), *RUN)


file_in_the_way = partial(file, "taken", "mine")
"""A file stands where the command line names a folder."""


def models_text(text, *args):
    return file("models.yaml", text, *FRESH, *args)


def prompt(text):
    return file("mine.j2", text, *FRESH, "--models", "alpha", "--set", "prompt=mine.j2")


def pipe(name, *args):
    """A pipe without a writer stands where a file belongs."""

    def change(workspace):
        (workspace.root / name).unlink(missing_ok=True)
        os.mkfifo(workspace.root / name)

    return after(change, *args)


def checkout(workspace, *args):
    """A checkout of the official layout without pictures."""
    write_checkout(workspace.root / "official", {**sound_scene(), "id": "000"})
    official = {"format": "official", "path": "official"}
    workspace.write_suite(dataset=official, images={"source": "dataset"}, models=["alpha"])
    return [*FRESH, *args]


def broken_record(change, *args):
    """The second of the finished run's records is changed."""

    def changed(text):
        first, second, *others = text.splitlines()
        return "\n".join([first, change(second), *others, ""])

    return file("out/records.jsonl", changed, *(args or RUN))


def foreign_cache(workspace):
    """The reply cache is a database of another schema."""
    path = workspace.cache / "replies.sqlite"
    path.unlink()
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE theirs (x)")
        database.commit()


def many_files(workspace):
    """Three files, each with a problem of its own."""
    workspace.write_yaml("bad-suite.yaml", {"name": "trial", "models": ["nobody"], "dataset": {}})
    (workspace.root / "bad-models.yaml").write_text("mine: nowhere\n", encoding="utf-8")
    return ["validate", "bad-suite.yaml", "bad-models.yaml", "absent.yaml"]


CACHED = (*FRESH, "--models", "alpha")


class Bad(NamedTuple):
    """A bad input: what breaks something and gives the command line; parts that its messages hold;
    how many these are; files that may have appeared or grown; the size that no file may pass.
    """

    name: str
    prepare: Callable[[Workspace], list[str]]
    says: tuple[str, ...]
    messages: int = 1
    env: Mapping[str, str] = {}
    writes: tuple[str, ...] = ()
    bytes_left: int | None = None


BAD = (
    Bad("key", suite_line("sede: [1]"), ("suite.yaml:4:1: sede", "did you mean seeds?", "allowed")),
    Bad("model", suite_line("models: [alpah]"), ("suite.yaml:3:10: models[0]", "mean alpha?")),
    Bad("no-samples", suite_line("dataset: {path: ./low}\nlevels: [4]"), ("no samples", "1, 2")),
    Bad("absent", command("run", "quik"), ("quik: ", "allowed: ", "did you mean quick?")),
    Bad("folder", command("run", "data"), ("data: there is no such suite file",)),
    Bad("set-unquoted", options("--set", "seeds=[0,", "1]"), ("1]", "quote values with spaces")),
    Bad("models-spaced", options("--models", "alpha,", "random"), ("quote values with spaces",)),
    Bad("field", options("--seeds", "0,1"), ("are set with --set 'seeds=[...]'",)),
    Bad("plugin", command("--plugin", "no_such", "models"),
        ("--plugin: cannot be imported: ModuleNotFoundError",)),
    Bad("models", options("--models", "oracel"), ("--models", "found: oracel", "mean oracle?")),
    Bad("no-file", options("--models-file", "gone.yaml"), ("gone.yaml", "no such models file")),
    Bad("limit", options("--limit", "0"), ("--limit", "0 is not in the range")),
    Bad("verb", command("rum"), ("rum", "run")),
    Bad("validate", many_files, (), messages=3),
    # What a server of one's own has is known to nobody, nor what a direct transport asks for.
    Bad("validate-models",
        file("models.yaml", "far: {replay: gone}\nodd: opnai/gpt-4o\n"
             "own: {id: hosted_vllm/x, api_base: 'http://127.0.0.1:9/v1'}\n"
             "straight: {id: My/x, api_base: 'http://127.0.0.1:9/v1', transport: direct}\n",
             "validate", "models.yaml"),
        ("models.yaml:1:15: far.replay: recordings not found",
         "has an unknown provider", "did you mean openai?"), messages=2),
    # A file that is there and cannot be read, for root too.
    Bad("validate-locked", command("validate", "/proc/self/mem"), ("mem: cannot be read: ",)),
    Bad("validate-data", pipe("data/scenes.jsonl", "validate", "data"), ("is not a regular file",)),
    Bad("run-long", command("run", "suite.yaml", "--models-file", "x" * 5_000),
        ("no such models file",)),
    Bad("init", command("init", "."), ("models.yaml", "is already there")),
    Bad("no-png", checkout, ("scene 000: images.source", "has no picture", "render")),
    Bad("varied", models_text("old: {replay: out}\n", "--models", "old",
                              "--set", "vary.repeats=2"), ("cannot be varied",)),
    Bad("no-rule", options("--models", "repeat"), ("repeat", "has no rule for full_planning")),
    Bad("engine", command(*FRESH, "--models", "random", "--set", "tracks=[step_planning]"),
        ("PHYBLOCK_PHYSICS: is not known", "found: bullet", "allowed: "),
        env={"PHYBLOCK_PHYSICS": "bullet"}),
    Bad("drawn-goal", lambda here: checkout(here, "--set", "tracks=[step_planning]"),
        ("step_planning draws its own pictures", "images.source=render")),
    Bad("two-addresses",
        models_text("".join(
            f"{name}: {{id: hosted_vllm/m, api_base: 'http://127.0.0.1:{port}/v1'}}\n"
            for name, port in (("alpha", 9), ("beta", 10))
        ), "--models", "alpha,beta"), ("beta: api_base: is alpha at another address",)),
    Bad("batched-steps",
        models_text("m: {id: openai/gpt-4o, api_base: 'http://127.0.0.1:9/v1', batch: true}\n",
                    "--models", "m", "--set", "tracks=[step_planning]"),
        ("is asked in batches, and step_planning plays episodes of several turns",)),
    Bad("undefined", prompt("{% block user %}\n{{ solution }}\n{% endblock %}"),
        ("mine.j2:2: ", "block user", "solution", "n_candidates"), writes=("fresh",)),
    Bad("other-prompt", prompt("{% block user %}a{% endblock %}{% block turn %}b{% endblock %}"),
        ("mine.j2:1: ", "that nothing uses"), writes=("fresh",)),
    Bad("prompt-pipe", pipe("mine.j2", *FRESH, "--set", "prompt=mine.j2"), ("no such file",)),
    Bad("secret", models_text(f"mine:\n  id: openai/x\n  api_key: {FAKE_KEY}\n"),
        ("models.yaml:3:", "mine.api_key", "api_key_env")),
    Bad("no-key", models_text("alpha: openai/gpt-4o\n"), ("alpha", "OPENAI_API_KEY", "--models")),
    Bad("no-price", command(*FRESH, "--models", "alpha", "--set", "limits.max_cost_usd=1"),
        ("model alpha: price", "max_cost_usd", "models.yaml"), writes=("fresh",)),
    Bad("no-recording", models_text("old: {replay: replies}\n", "--models", "old"),
        ("models.yaml:1:15: old.replay: recordings not found", "replies"), writes=("fresh",)),
    Bad("below-file", file_in_the_way("run", "suite.yaml", "--out", "taken/x"),
        ("taken/x", "cannot be written: Not a directory", "--out")),
    Bad("long-name", command("run", "suite.yaml", "--out", "x" * 300),
        ("cannot be written: File name too long", "--out")),
    Bad("not-utf-8-out", file_in_the_way("run", "suite.yaml", "--out", "taken/\udcff"),
        ("taken/\\udcff: cannot be written", "--out")),
    Bad("manifest", file("out/run.yaml", "identity: [1", *RUN),
        ("out/run.yaml:1:13: is not a run manifest", "from a copy")),
    Bad("record", broken_record(lambda line: line[:40]), ("out/records.jsonl:2:41: ", "hint: ")),
    Bad("record-score", broken_record(lambda line: line.replace("n_blocks", "m"), "score", "out"),
        ("out/records.jsonl:2", "n_blocks")),
    Bad("show-none", command("show", "out", "no-such"), ("no-such", "0 samples fit")),
    Bad("show-several", command("show", "out", "random"), ("5 samples fit", "allowed: ")),
    Bad("export-nothing", command("export", "--to", "csv"), ("Name the folder of a run",)),
    Bad("export-limit", command("export", "out", "--to", "csv", "--limit", "1"), ("--limit is",)),
    Bad("export-form", command("export", "out", "--to", "vlmevalkit"), ("is not one of csv, hf",)),
    Bad("figure", command("figures", "out", "--only", "radar"), ("no such figure",)),
    Bad("width", command("figures", "out", "--width", "20"), ("Invalid value",)),
    Bad("table", command("report", "out", "--only", "table9"), ("no such table",)),
    Bad("compare-track", command("compare", "out", "--track", "vqa"), ("no such track",)),
    Bad("compare-model", command("compare", "out", "--models", "alpha,delta"), ("no such model",)),
    Bad("compare-twice", command("compare", "out", "--models", "alpha,alpha"), ("a model twice",)),
    Bad("compare-empty", command("compare", "out", "--models", "alpha,"), ("empty name",)),
    Bad("compare-none", command("compare", "out", "data"), ("holds no run.yaml",)),
    Bad("clear", command("cache", "--clear", "hosted_vlm/alpha"), ("mean hosted_vllm/alpha",)),
    Bad("no-run", command("report", "data"), ("data: holds no run.yaml",)),
    Bad("nothing", command("report", "no"), ("no: is not there",)),
    Bad("stranger", file_in_the_way("run", "suite.yaml", "--out", ".", "--dry-run"),
        (".: is not empty and holds no run", "found: ", "--out")),
    Bad("orphans", after(lambda made: (made.out / "run.yaml").unlink(), *RUN),
        ("out: is not empty and holds no run", "no run.yaml", "--out")),
    Bad("changed-data",
        file("data/scenes.jsonl", lambda text: text.replace("0.025", "0.026"), "score", "out"),
        ("data: sha256: is not the data set", "found", "allowed")),
    Bad("full-disk", command(*FRESH, "--no-cache", "--models", "random,oracle"),
        ("fresh/records.jsonl", "cannot be written: File too large", "again to continue"),
        writes=("fresh",), bytes_left=6000),
    Bad("full-at-once", command("run", "suite.yaml", "--out", "fresh"),
        ("fresh", "cannot be written"), writes=("fresh",), bytes_left=100),
    Bad("full-tables", command("report", "out"), ("out", "cannot be written"),
        writes=("out/tables",), bytes_left=100),
    Bad("full-records", command("score", "out"), ("out/records.jsonl", "cannot be written"),
        bytes_left=100),
    Bad("full-init", command("init", "new"), ("new", "cannot be written"),
        writes=("new",), bytes_left=100),
    Bad("broken-cache", file("cache/replies.sqlite", b"not a database" * 40, *CACHED),
        ("replies.sqlite", "hint: "), writes=("fresh",)),
    Bad("foreign-cache", after(foreign_cache, "cache"),
        ("replies.sqlite", "another version", "hint: "), writes=("fresh",)),
    Bad("full-cache", command(*FRESH, "--models", "alpha", "--set", "seeds=[1]"),
        ("replies.sqlite", "cannot be used: disk I/O error", "free some space"),
        writes=("fresh", "cache/replies.sqlite-"), bytes_left=6000),
    Bad("no-pictures", file("c2/pictures", "mine", *CACHED),
        ("c2/pictures", "cannot be written", "PHYBLOCK_CACHE"),
        env={"PHYBLOCK_CACHE": "c2"}, writes=("fresh", "c2/goal-blind", "c2/replies.sqlite")),
    Bad("cache-below", file_in_the_way("run", "suite.yaml", "--out", "fresh", "--models", "alpha"),
        ("taken/x", "PHYBLOCK_CACHE"), env={"PHYBLOCK_CACHE": "taken/x"}, writes=("fresh",)),
)  # fmt: skip


@pytest.fixture(scope="module")
def finished(new_workspace):
    """A workspace with a finished run in `out`, replies in the cache, and a server that is gone."""
    made = new_workspace()
    (made.root / "low").mkdir()
    write_lines(made.root / "low" / "scenes.jsonl", [tower("t1", [1, 2], ("red",))])
    with made.served(OpenAIChat(), models=["random", "alpha"]):
        made.completed()
    return made


@pytest.fixture
def copy(finished, tmp_path):
    made = finished.copied(tmp_path / "copy")
    # The manifest names the data by its absolute path.
    manifest = made.out / "run.yaml"
    text = manifest.read_text(encoding="utf-8").replace(str(finished.root), str(made.root))
    manifest.write_text(text, encoding="utf-8")
    return made


@pytest.mark.parametrize("bad", BAD, ids=[bad.name for bad in BAD])
def test_bad_input(copy, bad):
    args = bad.prepare(copy)
    before = copy.files()
    done = copy.phyblock(*args, env=bad.env, bytes_left=bad.bytes_left)

    assert done.code == 2, done.out + done.err
    assert "Traceback" not in done.err
    assert FAKE_KEY not in done.out + done.err
    messages = re.findall(r"^(?:error|Error): ", done.err, re.MULTILINE)
    assert len(messages) == bad.messages, done.err
    for part in bad.says:
        assert part in done.err

    after = copy.files()
    assert {name: after.get(name) for name in before} == before
    assert all(name.startswith(bad.writes or ("/",)) for name in after.keys() - before.keys())


def test_many_problems_are_cut_and_counted(capsys):
    show_problems(InputError([Problem("s.yaml", f"is wrong {n}") for n in range(60)]))
    lines = capsys.readouterr().err.splitlines()
    assert (len(lines), lines[-1]) == (26, "... and 35 more problems")
