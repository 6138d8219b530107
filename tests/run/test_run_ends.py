"""A run that ends before its time, by a mistake of ours or by impatience: all answers are kept."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import pytest
from aiohttp import web

from phyblock.config.models import load_models
from phyblock.config.suite import load_suite
from phyblock.records.files import STOPPED
from phyblock.records.line import Line
from phyblock.records.record import Record
from phyblock.run.events import RunEvent, SampleDone, Stopping
from phyblock.run.plan import make_plan
from phyblock.run.runner import Session
from phyblock.run.store import AppendFile
from phyblock.tracks.full_planning import FullPlanning
from tests.servers.chassis import Faults, Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

AT_ONCE = 4


class FirstAtOnce(OpenAIChat):
    """Answers the first request when all are there, and the others when that is long done."""

    async def handle(self, request: web.Request) -> web.StreamResponse:
        is_first = self.most_at_once == 0
        self.faults = Faults(latency_s=0.0 if is_first else 1.0)
        if is_first:
            self.most_at_once = 1
            while self.at_once < AT_ONCE - 1:
                await asyncio.sleep(0.01)
            # The others have read by then how long they are to wait.
            await asyncio.sleep(0.2)
            self.faults = Faults()
        return await super().handle(request)


def session(workspace: Workspace, watch: Callable[[RunEvent], None], model: str) -> Session:
    workspace.write_suite(models=[model], seeds=[0, 1, 2, 3], limits={"max_concurrency": AT_ONCE})
    known = load_models(workspace.root / "models.yaml") if model == "alpha" else {}
    plan = make_plan(load_suite(workspace.root / "suite.yaml", data_dir=workspace.root), known)
    return Session(plan, workspace.out, watch, use_cache=False)


def nobody(_: RunEvent) -> None:
    return


@pytest.mark.parametrize("place", ["judge", "watch"])
def test_a_mistake_of_ours_loses_no_call_under_way(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, place: str
) -> None:
    judge = FullPlanning.judge
    judged: list[object] = []

    def judges_badly(self: FullPlanning, item: Any, text: str | None) -> Any:
        judged.append(item)
        if len(judged) == 1:
            # Why the run stopped cannot be noted then, which hides nothing.
            (workspace.out / STOPPED).mkdir()
            raise ZeroDivisionError("in judge")
        return judge(self, item, text)

    def watches_badly(event: RunEvent) -> None:
        if isinstance(event, SampleDone | Stopping):
            raise ZeroDivisionError("in watch")

    async def run() -> None:
        watch = watches_badly if place == "watch" else nobody
        if place == "judge":
            monkeypatch.setattr(FullPlanning, "judge", judges_badly)
        await session(workspace, watch, "alpha").run()

    with Running(FirstAtOnce()) as running:
        workspace.write_models(running.url, "alpha")
        with pytest.raises(ZeroDivisionError, match=f"in {place}"):
            asyncio.run(run())
        assert running.server.ended == {"ok": AT_ONCE}
    assert len(workspace.records()) == AT_ONCE - (place == "judge")


def test_an_impatient_cancellation_keeps_all_that_was_answered(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun, may_end = threading.Event(), threading.Event()
    append, put = AppendFile.append, AppendFile.put
    answered: list[str] = []

    async def notes(self: AppendFile, record: Line) -> None:
        assert isinstance(record, Record)
        answered.append(record.sample)
        await put(self, record)

    def appends_slowly(self: AppendFile, lines: Iterable[Mapping[str, Any]]) -> None:
        lines = list(lines)
        if "run" in lines[0]:
            begun.set()
            assert may_end.wait(20)
        append(self, lines)

    async def run() -> None:
        opened = session(workspace, nobody, "random")
        running = asyncio.create_task(opened.run())
        await asyncio.to_thread(begun.wait, 20)
        opened.interrupt()
        for _ in range(3):
            running.cancel()
            for _ in range(10):
                await asyncio.sleep(0)
        may_end.set()
        with pytest.raises(asyncio.CancelledError):
            await running
        assert opened.result.stop is not None
        assert opened.result.stop.cause == "interrupted"

    monkeypatch.setattr(AppendFile, "append", appends_slowly)
    monkeypatch.setattr(AppendFile, "put", notes)
    asyncio.run(run())
    assert len(answered) > 1
    assert sorted(record["sample"] for record in workspace.records()) == sorted(answered)
