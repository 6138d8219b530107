"""A track that is added from outside: from YAML to the report, led by either of its measures."""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import pytest

from phyblock import registry
from phyblock.cli.main import phyblock
from phyblock.data import AssemblyTask
from phyblock.errors import SpecError
from phyblock.records.record import Record
from phyblock.results.compare import comparable, compare_models
from phyblock.results.estimates import main_column
from phyblock.results.load import Run, load_run
from phyblock.scoring.counts import mean_of, ratio_of
from phyblock.tracks import Judgement, SceneTrack
from phyblock.tracks.measures import LayoutColumn, Measure, SampleCounts, TrackReport
from phyblock.web.board import SiteRun, Sources, all_values, board_of, entries_of, values_of
from tests.servers.chassis import Running, Seen
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace


def count(item: AssemblyTask, record: Record) -> tuple[float, float, float]:
    off = abs((record.parse["number"] or 0) - len(item.scene))
    return off, off == 0, 1


COUNTS = SampleCounts("blocks", ("off", "exact", "n"), sample=count)
ERROR = Measure(
    "error", "Error", COUNTS, lambda sums: mean_of(sums[..., [0, 2]]),
    "blocks too many or too few", unit="blocks", better="lower", most=math.inf,
)  # fmt: skip
EXACT = Measure("exact", "Exact", COUNTS, lambda s: ratio_of(s[..., 1:]), "right counts")


class Counting(SceneTrack):
    """Asks how many blocks a goal has."""

    name = "counting"
    title = "Counting"
    template = Path(__file__).with_name("counting.j2")
    baselines: ClassVar = {
        "oracle": lambda task, _: str(len(task.scene)),
        "random": lambda _, rng: str(np.random.Generator.integers(rng, 5, 9)),
    }
    counted = (COUNTS,)

    @classmethod
    def report(cls) -> TrackReport:
        return TrackReport((ERROR, EXACT), short="count_error")

    def judge(self, item: AssemblyTask, text: str | None) -> Judgement:
        del item
        found = re.findall(r"\d+", text or "")
        number = int(found[-1]) if found else None
        parse = {"rule": "number" if found else None, "number": number}
        return Judgement(bool(found), {"parse": parse})


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
    registry.register_track(Counting)
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


def led_by(leading: Measure, *measures: Measure) -> type[Counting]:
    """The track with these measures, the leading one behind what stands first."""
    columns = tuple(LayoutColumn({m.name: m.heading}, main=m is leading) for m in measures)
    report = replace(Counting.report(), measures=measures, headline=columns)
    return type("Led", (Counting,), {"report": classmethod(lambda _: report)})


@pytest.fixture
def run(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Iterator[Run]:
    registry.register_track(Counting)
    monkeypatch.chdir(workspace.root)
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))
    monkeypatch.setattr(sys, "argv", ["phyblock"])
    workspace.write_suite(tracks=["counting"], models=["oracle", "random"])
    words = ["run", "suite.yaml", "--out", "out", "--no-report"]
    assert not phyblock.main(words, standalone_mode=False)
    yield load_run(workspace.out)
    registry.unregister_track(Counting.name)


def show(kind: type[Counting]) -> None:
    registry.unregister_track(Counting.name)
    registry.register_track(kind)


def test_the_leading_measure_leads_everywhere(run: Run) -> None:
    for kind, leading in ((Counting, ERROR), (led_by(EXACT, ERROR, EXACT), EXACT)):
        show(kind)
        assert comparable(run, "counting").measure == leading
        assert compare_models(run).name == leading.heading
        one = (SiteRun("run", run, Sources()),)
        (track,) = board_of(one, entries_of(one), all_values(one))["tracks"]
        assert track["main"] == main_column(run, "counting").heading
        worth = values_of(run, "counting").samples["oracle"].values()
        assert set(worth) == {leading.best}


@pytest.mark.parametrize(
    ("better", "most", "best"),
    [
        *(("higher", 8, 8), ("higher", math.inf, math.nan), ("higher", None, math.nan)),
        *(("lower", 8, 0), ("lower", math.inf, 0), ("lower", None, math.nan)),
    ],
)
def test_a_sample_is_solved_where_it_has_the_best_value_that_there_is(
    run: Run, better: Any, most: float | None, best: float
) -> None:
    """The oracle has it everywhere, guesses nowhere: they are off by one block or more."""
    far = {"higher": lambda sums: 8 - ERROR.value(sums), "lower": ERROR.value}
    measure = replace(ERROR, value=far[better], better=better, most=most)
    show(led_by(measure, measure))
    assert measure.best == pytest.approx(best, nan_ok=True)
    has_best = not math.isnan(best)
    flipped = compare_models(run).flipped
    assert set(flipped["right"]) == ({"oracle"} if has_best else set())
    sites = [SiteRun("run", run, Sources())]
    board = board_of(sites, entries_of(sites), all_values(sites))
    assert json.loads(json.dumps(board, allow_nan=False))["tracks"][0]["best"] == (
        best if has_best else None
    )
    solved = {row["name"]: row["facts"]["counting"]["solved"] for row in board["rows"]}
    asked = run.design.samples("counting")
    assert solved == (
        {"oracle": asked, "random": 0} if has_best else {"oracle": None, "random": None}
    )


@pytest.mark.usefixtures("run")
def test_what_a_track_has_not_is_refused() -> None:
    asked = ["run", "suite.yaml", "--set", "answer_format=json_schema", "--out", "json"]
    with pytest.raises(SpecError, match="cannot be asked for as JSON"):
        phyblock.main(asked, standalone_mode=False)
    with pytest.raises(SpecError, match="is a person, who cannot answer in counting"):
        phyblock.main(["play", "suite.yaml", "--name", "ada"], standalone_mode=False)
