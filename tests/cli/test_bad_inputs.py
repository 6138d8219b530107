"""Bad input gives exit code 2 and one clear message a problem, and nothing on disk is lost."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from phyblock.cli.main import show_problems
from phyblock.errors import InputError, Problem
from tests.cli.bad_inputs import BAD, Bad
from tests.cli.breakage import FAKE_KEY
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace, tower


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """A workspace with a finished run in `out`, replies in the cache, and a server that is gone."""
    made = Workspace(tmp_path_factory.mktemp("finished"), pictures_dir)
    made.write_scenes()
    made.write_suite(models=["random", "alpha"])
    (made.root / "low").mkdir()
    (made.write_scenes(tower("t1", [1, 2], ("red",))) / "scenes.jsonl").rename(
        made.root / "low" / "scenes.jsonl"
    )
    made.write_scenes()
    with Running(OpenAIChat()) as server:
        made.write_models(server.url, "alpha")
        done = made.run()
    assert done.code == 0, done.err
    return made


@pytest.fixture
def copy(finished: Workspace, tmp_path: Path) -> Workspace:
    root = tmp_path / "copy"
    shutil.copytree(finished.root, root, symlinks=True)
    # The manifest names the data by its absolute path.
    manifest = root / "out" / "run.yaml"
    text = manifest.read_text(encoding="utf-8").replace(str(finished.root), str(root))
    manifest.write_text(text, encoding="utf-8")
    return Workspace(root, finished.cache / "pictures")


@pytest.mark.parametrize("bad", BAD, ids=[bad.name for bad in BAD])
def test_bad_input(copy: Workspace, bad: Bad) -> None:
    args = bad.prepare(copy)
    before = copy.files()
    done = copy.phyblock(*args, env=dict(bad.env), bytes_left=bad.bytes_left)

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


def test_many_problems_are_cut_and_counted(capsys: pytest.CaptureFixture[str]) -> None:
    show_problems(InputError([Problem("s.yaml", f"is wrong {n}") for n in range(60)]))
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 26
    assert lines[-1] == "... and 35 more problems"
