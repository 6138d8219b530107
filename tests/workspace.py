"""A working folder for tests of whole runs: tiny scenes, a suite, models, the real command; small
question sets of every subtask, whose right answers are drawn.
"""

from __future__ import annotations

import asyncio
import csv
import functools
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
import pytest
import yaml
from click.testing import CliRunner, Result

from phyblock.domain.question import CATEGORIES, LETTERS, SUBTASKS
from phyblock.errors import PhyblockError, Problem
from tests.fork_server import ONE_THREAD, Done, Forked, run_forked

if TYPE_CHECKING:
    from phyblock.run.plan import RunPlan

Raw = dict[str, Any]
S = TypeVar("S")
T = TypeVar("T")

SHARED = ("pictures", "goal-blind")
"""Folders of the cache: rendered pictures, and what floors reach."""
COMMAND = (sys.executable, "-m", "phyblock")
PRICE = {"input": 10.0, "output": 100.0}
CALL_USD = 1000 * PRICE["input"] / 1e6 + 40 * PRICE["output"] / 1e6
"""The server counts 1,000 tokens in and 40 out for every call."""
TWICE = {"max_attempts": 2, "retry_for_s": 0.0}
"""Limits of a run that gives up soon, however little time it took."""
KEY_VARIABLE = "PHYBLOCK_TEST_KEY"
"""The variable that holds the key of every model here."""
KEY = "sk-not-a-real-key-1234"
_COLORS = ("red", "yellow", "blue", "green", "orange")


def call(*words: object) -> int:
    """Give a command in this process; return its exit code."""
    from phyblock.cli.main import phyblock

    return phyblock.main([str(word) for word in words], standalone_mode=False) or 0


def in_a_loop(work: Callable[..., Coroutine[Any, Any, T]]) -> Callable[..., T]:
    """Make an asynchronous test an ordinary one."""

    @functools.wraps(work)
    def run(*args: Any, **options: Any) -> T:
        return asyncio.run(work(*args, **options))

    return run


def invoked(*words: object, **env: str) -> Result:
    """Give a command in this process; its output, and what it raises."""
    from phyblock.cli.main import phyblock

    runner = CliRunner(env={"COLUMNS": "160", **env})
    return runner.invoke(
        phyblock, [*map(str, words)], standalone_mode=False, catch_exceptions=False
    )


def problem_of(error: type[PhyblockError], work: Callable[..., object], *args: object) -> Problem:
    """Return the one problem that a call is refused for."""
    with pytest.raises(error) as caught:
        work(*args)
    (problem,) = caught.value.problems
    return problem


def until(is_so: Callable[[], object], timeout_s: float = 30.0) -> None:
    """Wait for what a process or a thread of its own is about to do."""
    end = time.monotonic() + timeout_s
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.005)


def plan_text(*numbers: int) -> str:
    """A plan in the form that is asked for."""
    return "\n".join(f"Step{i}: Move block with index {n}" for i, n in enumerate(numbers, 1))


def write_lines(path: Path, rows: Iterable[object]) -> Path:
    """Write a row of JSON a line."""
    path.write_text("".join(json.dumps(row) + "\n" for row in rows), encoding="utf-8")
    return path


def read_lines(path: Path) -> list[Raw]:
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def csv_rows(path: Path, **options: Any) -> list[dict[str, str]]:
    """The rows of a CSV file by the names of its columns."""
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, **options))


def files_below(folder: Path) -> dict[str, bytes]:
    """Every file and link by relative path; a link is told by where it leads."""
    return {
        str(path.relative_to(folder)): b"-> " + bytes(path.readlink())
        if path.is_symlink()
        else path.read_bytes()
        for path in folder.rglob("*")
        if path.is_symlink() or path.is_file()
    }


def tower(scene_id: str, levels: list[int], colors: tuple[str, ...]) -> Raw:
    """Cubes of the given colors, each on the one before, and sixteen candidates that all differ."""
    blocks = []
    for i, color in enumerate(colors, 1):
        cube = {"order": i, "type": "cube", "color": color, "euler": [0, 0, 0]}
        place = {"layer": i, "depend": [i - 1], "position": [0, 0, (i - 0.5) * 0.05]}
        blocks.append(cube | place)
    looks = [(kind, color, 0) for kind in ("cube", "cylinder") for color in _COLORS]
    turned = (("cuboid2", "green"), ("arch", "red"), ("triangle", "orange"))
    looks += [(*kind, turn) for kind in turned for turn in (0, 90)]
    offered = [{"type": t, "color": c, "euler": [0, 0, turn]} for t, c, turn in looks]
    needed = [
        {**one, "required": colors.count(one["color"]) if one["type"] == "cube" else 0}
        for one in offered
    ]
    named = {"id": scene_id, "levels": levels, "parents": [scene_id]}
    return {**named, "blocks": blocks, "candidates": needed}


SCENES: tuple[Raw, ...] = (
    tower("t1", [1, 2], ("red", "blue")),
    tower("t2", [1, 2], ("green", "green")),
    tower("t3", [3], ("yellow", "red", "blue")),
    tower("t4", [3], ("orange", "green", "orange")),
    tower("t5", [4], ("blue", "blue", "red", "yellow")),
)


def _whole(done: Done) -> Done:
    assert (done.code, done.err) == (0, ""), done.out + done.err
    return done


class Workspace:
    """A folder with `data/`, `suite.yaml` and `models.yaml`, and a reply cache of its own, in which
    the folders `SHARED` are shared between workspaces: to fill them takes a while.
    """

    def __init__(self, root: Path, pictures: Path) -> None:
        self.root = root
        self.cache = root / "cache"
        is_new = not self.cache.exists()
        self.cache.mkdir(parents=True, exist_ok=True)
        for folder in map(pictures.with_name, SHARED):
            folder.mkdir(parents=True, exist_ok=True)
            if is_new:
                (self.cache / folder.name).symlink_to(folder)
        self.out = root / "out"
        self.env = {
            "PATH": os.environ["PATH"],
            "HOME": str(root),
            # Wherever phyblock is installed from.
            "PYTHONPATH": str(Path(__file__).parents[1]),
            "PHYBLOCK_CACHE": str(self.cache),
            "LITELLM_LOCAL_MODEL_COST_MAP": "True",
            **ONE_THREAD,
        }

    def write_scenes(self, *scenes: Raw) -> Path:
        """`data/scenes.jsonl`."""
        folder = self.root / "data"
        folder.mkdir(exist_ok=True)
        return write_lines(folder / "scenes.jsonl", scenes or SCENES).parent

    def write_suite(self, *, name: str = "trial", **fields: Any) -> Path:
        """`suite.yaml` with small pictures and no baselines; `fields` replace whole sections."""
        suite = {"name": name, "dataset": {"format": "builtin", "path": "./data"}}
        suite |= {"images": {"size_px": 128}, "models": ["random", "oracle"], "baselines": []}
        return self.write_yaml("suite.yaml", suite | fields)

    def write_models(self, url: str, *names: str, **fields: Any) -> Path:
        """`models.yaml`: each name is a model of the local server at `url`."""
        return self.write_served(dict.fromkeys(names, url), **fields)

    def write_served(self, urls: Mapping[str, str], **fields: Any) -> Path:
        """`models.yaml`: each is a model of a local server."""
        entries = {
            name: {"id": f"hosted_vllm/{name}", "api_base": f"{url}/v1", **fields}
            for name, url in urls.items()
        }
        return self.write_yaml("models.yaml", entries)

    def write_yaml(self, name: str, content: object) -> Path:
        path = self.root / name
        path.write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        return path

    def phyblock(
        self,
        *args: str | Path,
        env: Mapping[str, str] | None = None,
        bytes_left: int | None = None,
        fresh: bool = False,
    ) -> Done:
        """Run the command to its end, in a process that is forked from one that has imported
        everything, or a `fresh` one: with a hash seed and interpreter's settings of its own.
        """
        words, settings = [*map(str, args)], {**self.env, **(env or {})}
        if not fresh:
            return run_forked(words, self.root, settings, bytes_left)
        options: dict[str, Any] = {"capture_output": True, "text": True, "timeout": 300}
        options |= {"cwd": self.root, "env": settings, "stdin": subprocess.DEVNULL}
        done = subprocess.run([*COMMAND, *words], **options)
        return Done(done.returncode, done.stdout, done.stderr)

    def run(self, *args: str | Path, page: bool = False, **options: Any) -> Done:
        """`phyblock run suite.yaml --out out`, with figures and page where a test is about them."""
        less = () if page else ("--no-report",)
        return self.phyblock("run", "suite.yaml", "--out", self.out, *less, *args, **options)

    def completed(self, *args: str | Path, **options: Any) -> Done:
        """Run, without an error."""
        return _whole(self.run(*args, **options))

    def refused(self, *args: str | Path) -> str:
        """Run with what is not accepted; what is said."""
        done = self.run(*args)
        assert done.code == 2, done.out + done.err
        return done.err

    def does(self, *args: str | Path, **options: Any) -> Done:
        """Call the command line, without an error."""
        return _whole(self.phyblock(*args, **options))

    @contextmanager
    def served(
        self, server: S, *names: str, entry: Mapping[str, Any] | None = None, **suite: Any
    ) -> Iterator[S]:
        """A server of models of these names, or `alpha`, with an entry, and a suite for them."""
        from tests.servers.chassis import Running

        names = names or ("alpha",)
        with Running(server) as running:
            self.write_models(running.url, *names, **(entry or {}))
            self.write_suite(**{"models": list(names), **suite})
            yield server

    def copied(self, root: Path) -> Workspace:
        """A copy of all of it in another folder; pictures stay shared."""
        shutil.copytree(self.root, root, symlinks=True)
        return Workspace(root, self.cache / "pictures")

    def plan(self, models: str | None = "models.yaml") -> RunPlan:
        """The plan of the suite, with the models of a file or none."""
        from phyblock.config.models import load_models
        from phyblock.config.suite import load_suite
        from phyblock.run.plan import make_plan

        known = {} if models is None else load_models(self.root / models)
        return make_plan(load_suite(self.root / "suite.yaml"), known)

    def start(self, *args: str | Path) -> Forked:
        """Start `run` and return at once; the process leads a group of its own."""
        words = ["run", "suite.yaml", "--out", self.out, "--no-report", *args]
        return Forked([*map(str, words)], self.root, self.env)

    def records(self, folder: Path | None = None) -> list[Raw]:
        """The lines of a run's records, as they stand; the file is made with the first one."""
        path = (folder or self.out) / "records.jsonl"
        if not path.exists():
            assert (path.parent / "run.yaml").exists(), "nothing has run"
            return []
        return read_lines(path)

    def tables(self, folder: Path | None = None) -> dict[str, bytes]:
        """The table files of a run by name."""
        return {p.name: p.read_bytes() for p in sorted((folder or self.out).glob("tables/*"))}

    def rows(self, table: str) -> list[Raw]:
        """The rows of a table, as its CSV file has them."""
        return csv_rows(self.out / "tables" / f"{table}.csv")

    def files(self) -> dict[str, bytes]:
        """Every file below the folder but pictures, by relative path."""
        found = files_below(self.root).items()
        return {name: data for name, data in found if "pictures" not in name.split("/")}


def question(subtask: str, scene: Raw, number: int, rng: np.random.Generator) -> Raw:
    """A question of a subtask about a scene; the right letter is drawn."""
    letters = [str(letter) for letter in rng.permutation(list(LETTERS))]
    made: Raw = {
        "id": f"{subtask.lower()}-{number:03d}",
        "subtask": subtask,
        "category": next(name for name, codes in CATEGORIES.items() if subtask in codes),
        "scene_id": scene["id"],
        "wording": f"{subtask.lower()}-1",
        "question": f"A question of kind {subtask}, number {number}, about the red cube?",
        "options": [str(word) for word in rng.permutation(["cube", "arch", "cylinder", "cuboid"])],
        "answer": letters[0],
        "pictures": [{"label": "scene", "view": [45, 22]}],
        "evidence": {"slots": {}},
    }
    if subtask in ("VP", "CF", "PD", "OR"):
        made["options"] = [f"<img{i}>" for i in range(1, 5)]
        made["pictures"] += [
            {"label": letter, "view": [45 + 35 * place, 25 + number], "framed": True}
            for place, letter in enumerate(LETTERS)
        ]
    if subtask == "OR":
        made["answer"] = "".join(letters)
        made["pictures"] = made["pictures"][1:]
    if subtask == "AD":
        made["options"] = [f"place {letter}" for letter in LETTERS]
        marks = [
            {"letter": letter, "position": [0.04 * (place - 1.5), 0.08, 0.0]}
            for place, letter in enumerate(LETTERS)
        ]
        made["pictures"][0]["marks"] = marks
        orders = [block["order"] for block in scene["blocks"]]
        made["pictures"].append({"label": "block", "view": [45, 22], "without": orders[1:]})
    return made


def questions(
    scenes: Sequence[Raw] = SCENES, per_subtask: int = 4, subtasks: Sequence[str] = SUBTASKS
) -> list[Raw]:
    """Questions of every subtask, about the scenes in turn."""
    rng = np.random.default_rng(7)
    return [
        question(subtask, scenes[number % len(scenes)], number, rng)
        for subtask in subtasks
        for number in range(per_subtask)
    ]


def write_questions(folder: Path, made: Sequence[Raw] | None = None) -> Path:
    """`questions.jsonl` in a folder."""
    folder.mkdir(exist_ok=True)
    return write_lines(folder / "questions.jsonl", questions() if made is None else made).parent


def vqa_suite(**fields: Any) -> Raw:
    """Fields of a suite that asks the questions in `questions`; `fields` go into its section."""
    return {"tracks": ["vqa"], "vqa": {"path": "./questions", **fields}}
