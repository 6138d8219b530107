"""Places at a server are used while records are on their way to disk."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterable, Mapping
from typing import Any

import pytest

from phyblock.run.appending import AppendFile
from phyblock.run.events import RunEvent
from phyblock.run.plan import make_plan
from phyblock.run.session import Session
from phyblock.specs import load_models, load_suite
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

AT_ONCE = 4


@pytest.mark.parametrize("use_cache", [True, False])
def test_others_are_asked_while_records_wait_for_the_disk(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, use_cache: bool
) -> None:
    """Where replies are in the cache by then: a kill must not lose more than are asked at once."""
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    disk_is_free = threading.Event()
    append = AppendFile.append

    def appends_when_free(self: AppendFile, lines: Iterable[Mapping[str, Any]]) -> None:
        lines = list(lines)
        if "run" in lines[0]:
            assert disk_is_free.wait(20)
        append(self, lines)

    async def run(server: OpenAIChat) -> int:
        suite = load_suite(workspace.root / "suite.yaml", data_dir=workspace.root)
        plan = make_plan(suite, load_models(workspace.root / "models.yaml"))
        async with Session(plan, workspace.out, nobody, use_cache=use_cache) as opened:
            running = asyncio.create_task(opened.run())
            try:
                asked, until_s = -1, time.monotonic() + 20
                while server.requests != asked or asked < AT_ONCE:
                    assert time.monotonic() < until_s
                    asked = server.requests
                    await asyncio.sleep(0.2)
            finally:
                disk_is_free.set()
            await running
        return asked

    monkeypatch.setattr(AppendFile, "append", appends_when_free)
    with Running(OpenAIChat()) as running:
        workspace.write_models(running.url, "alpha")
        workspace.write_suite(
            models=["alpha"], seeds=[0, 1, 2, 3], limits={"max_concurrency": AT_ONCE}
        )
        asked = asyncio.run(run(running.server))
        assert asked == (AT_ONCE + AT_ONCE // 2 if use_cache else AT_ONCE)
        assert running.server.most_at_once <= AT_ONCE
    assert len(workspace.records()) == running.server.requests == 20


def nobody(_: RunEvent) -> None:
    return
