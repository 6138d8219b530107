"""A reply cache that takes no more: what was paid for is recorded, and the run ends with it."""

from __future__ import annotations

import sqlite3

import pytest

from phyblock.models import ReplyCache
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

SAMPLES = 20


@pytest.mark.parametrize("room", [3, SAMPLES - 1])
def test_every_reply_is_recorded_before_the_run_ends_with_the_error(
    workspace: Workspace, room: int
) -> None:
    path = workspace.cache / "replies.sqlite"
    ReplyCache(path).close()
    db = sqlite3.connect(path)
    db.execute(
        f"CREATE TRIGGER full BEFORE INSERT ON replies WHEN (SELECT count(*) FROM replies) >= "
        f"{room} BEGIN SELECT RAISE(ABORT, 'the disk is full'); END"
    )
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha")
        workspace.write_suite(models=["alpha"], seeds=[0, 1, 2, 3], limits={"max_concurrency": 1})
        done = workspace.run()
        assert done.code == 2
        (message,) = done.errors
        assert "the disk is full" in message
        assert str(path) in message
        assert running.server.ended == {"ok": room + 1}
        assert [record["outcome"] for record in workspace.records()] == ["ok"] * (room + 1)

        db.execute("DROP TRIGGER full")
        db.close()
        again = workspace.run()
        assert (again.code, again.err) == (0, "")
        assert running.server.requests == SAMPLES
