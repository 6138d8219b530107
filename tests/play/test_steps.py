"""Episodes at the desk: a sitting that is closed in the middle goes on at its next step."""

from __future__ import annotations

import asyncio
import json
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from phyblock.config.suite import load_suite
from phyblock.run.execute import RunResult
from phyblock.tracks.baselines import picks_of
from phyblock.web.session import Person, PlaySession, plan_session
from tests.workspace import SCENES, Workspace

RED, BLUE = 0, 2
"""Places among the choices of the cubes that the goal is made of."""


@pytest.fixture
def suite(tmp_path: Path, pictures_dir: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    workspace = Workspace(tmp_path, pictures_dir)
    workspace.write_scenes(SCENES[0])
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    yield workspace.write_suite(tracks=["step_planning"], steps={"physics": "off"})
    shutil.rmtree(tmp_path / "out", ignore_errors=True)


def played(suite: Path, picks: Sequence[int]) -> tuple[RunResult, list[dict[str, Any]]]:
    """Sit down, pick these one after another, and close the sitting; what was shown."""
    person = Person("ada", None, "May we?")
    plan = plan_session(load_suite(suite, data_dir=suite.parent), person, None)
    session = PlaySession(plan.samples_per_model)
    shown: list[dict[str, Any]] = []

    async def sat() -> RunResult:
        left = list(picks)
        run = asyncio.create_task(session.run(plan, person, suite.parent / "out", lambda: None))
        while not run.done():
            await asyncio.sleep(0.01)
            told = session.state(-1)
            if told["phase"] == "consent":
                session.agree()
            elif told["phase"] == "question" and left:
                shown.append(told["question"])
                session.answer(told["change"], picks_of([left.pop(0)]))
            elif told["phase"] == "question":
                session.close()
        return await run

    return asyncio.run(sat()), shown


def test_an_episode_goes_on_where_the_sitting_was_closed(suite: Path) -> None:
    result, shown = played(suite, [BLUE, RED])
    assert (result.settled, result.left) == (0, 1)
    assert [text(one) for one in shown] == [1, 2]
    result, shown = played(suite, [BLUE])
    assert (result.settled, result.left) == (1, 0)
    assert [text(one) for one in shown] == [3]
    lines = (suite.parent / "out" / "records.jsonl").read_text(encoding="utf-8").splitlines()
    (record,) = map(json.loads, lines)
    assert record["outcomes"] == ["dependency_not_met", "placed", "placed"]
    assert record["ending"] == "completed"
    assert [turn["reply"]["text"] for turn in record["turns"]] == [
        "Next plan: Move(3)",
        "Next plan: Move(1)",
        "Next plan: Move(3)",
    ]


def text(question: dict[str, Any]) -> int:
    """The number of the step that a question's own text tells."""
    told = json.dumps(question["messages"])
    return next(n for n in range(1, 9) if f"This is step {n} of" in told)
