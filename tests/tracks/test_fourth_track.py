"""A track is added in one place: here, "how many blocks has the goal?", from YAML to the report."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import pytest

from phyblock import registry
from phyblock.cli.main import phyblock
from phyblock.data import AssemblyTask
from phyblock.models.request import Message, Request
from phyblock.scoring.counts import mean_of, ratio_of
from phyblock.tracks import Opening, TrackKind
from phyblock.tracks.base import assembly_pictures
from phyblock.tracks.items import select_tasks
from phyblock.tracks.measures import Measure, SampleCounts, TrackReport
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

QUESTION = "How many blocks has the goal? Answer with one number."


@dataclass(frozen=True)
class CountSubject:
    right: int


@dataclass(frozen=True)
class Said:
    number: int | None

    @property
    def is_read(self) -> bool:
        return self.number is not None

    def fields(self) -> dict[str, Any]:
        return {"parse": {"rule": "number" if self.is_read else None, "number": self.number}}


class Counting:
    name = "counting"
    template = "counting"

    def __init__(self, opening: Opening) -> None:
        suite = opening.suite
        self.items = select_tasks(opening.dataset.tasks, suite.levels, opening.limit)
        self._pictures = assembly_pictures(suite)

    def about(self, _: AssemblyTask) -> dict[str, Any]:
        return {}

    def identity(self) -> dict[str, Any]:
        return {"prompt": {"name": self.template, "version": QUESTION}}

    async def request(
        self, item: AssemblyTask, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        pictures = await self._pictures.of(item) if with_messages else ()
        return self._request(item, seed, params, pictures)

    def outlines(self, item: AssemblyTask) -> Iterator[tuple[Request, bool]]:
        pictures, are_real = self._pictures.outline(item)
        yield self._request(item, 0, {}, pictures), are_real

    def _request(self, item: Any, seed: int, params: Any, pictures: Any) -> Request:
        messages = (Message("user", (*pictures, QUESTION)),)
        return Request(item.key, seed, messages, params, QUESTION, CountSubject(len(item.scene)))

    def judge(self, _: AssemblyTask, text: str | None) -> Said:
        found = re.findall(r"\d+", text or "")
        return Said(int(found[-1]) if found else None)

    def close(self) -> None:
        self._pictures.close()


def count(item: AssemblyTask, said: Said) -> tuple[float, float, float]:
    off = abs((said.number or 0) - len(item.scene))
    return off, off == 0, 1


COUNTS = SampleCounts("blocks", ("off", "exact", "n"), sample=count)
ERROR = Measure(
    "error", "Error", COUNTS, lambda sums: mean_of(sums[..., [0, 2]]),
    "blocks too many or too few", unit="blocks", better="lower", most=math.inf,
)  # fmt: skip
EXACT = Measure("exact", "Exact", COUNTS, lambda s: ratio_of(s[..., 1:]), "right counts")
TRACK = TrackKind(
    name="counting", title="Counting", item="scene", about="how many blocks a goal has",
    open=Counting, report=lambda: TrackReport((ERROR, EXACT), short="count_error"),
    subject=CountSubject, counted=(COUNTS,),
    baselines={"oracle": lambda subject, _: str(subject.right), "random": lambda _, rng:
               str(np.random.Generator.integers(rng, 5, 9))},
)  # fmt: skip


class Counter(OpenAIChat):
    def reply(self, seen: Seen, ending: str) -> dict[str, Any]:
        body = super().reply(seen, ending)
        body["choices"][0]["message"]["content"] = "There are 3 blocks."
        return body


def test_a_track_runs_from_yaml_to_the_report(
    workspace: Workspace,
    monkeypatch: pytest.MonkeyPatch,
    request: pytest.FixtureRequest,
    capsys: pytest.CaptureFixture[str],
) -> None:
    registry.register_track(TRACK)
    request.addfinalizer(lambda: registry.unregister_track("counting"))
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    monkeypatch.setattr(sys, "argv", ["phyblock"])
    workspace.write_suite(tracks=["counting"], models=["counter", "oracle", "random"])
    run = ["run", "suite.yaml", "--out", "out"]
    with Running(Counter()) as running:
        workspace.write_models(running.url, "counter")
        assert not phyblock.main(run, standalone_mode=False)
        whole = workspace.records()
        text = (workspace.out / "records.jsonl").read_text()
        (workspace.out / "records.jsonl").write_text(text[: len(text) // 2])
        assert not phyblock.main(run, standalone_mode=False)
        assert running.server.requests == 5
    assert "Counting, suite trial" in capsys.readouterr().out
    assert sorted(r["sample"] for r in workspace.records()) == sorted(r["sample"] for r in whole)
    estimates = pd.read_csv(workspace.out / "tables" / "estimates.csv")
    error = estimates[estimates["measure"] == "error"].set_index("model")
    assert error.loc[["counter", "oracle"], "value"].tolist() == [0.6, 0]
    assert error.loc["counter", "lo"] < 0.6 < error.loc["counter", "hi"]
    for file in ("tables/counting.md", "tables/counting.tex"):
        assert (workspace.out / file).exists(), file
    assert "Counting" in (workspace.out / "report.html").read_text("utf-8")
    for more in ("compare --out out", "compare --measure exact", "export --to csv"):
        verb, *options = more.split()
        assert not phyblock.main([verb, "out", *options], standalone_mode=False)
    assert pd.read_csv(workspace.out / "comparison.csv")["verdict"].notna().all()
    assert len(pd.read_csv(workspace.out / "export" / "csv" / "records.csv")) == len(whole) == 15
