"""Measures and tracks that are added in one place; names and counts that clash are refused."""

import math
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from phyblock import registry
from phyblock.errors import SpecError
from phyblock.results.compare import comparable, compare
from phyblock.results.estimates import Headline
from phyblock.results.load import load_run, track_measures
from phyblock.scoring.plan import mean_of, ratio_of
from phyblock.tracks.base import Judgement, SceneTrack
from phyblock.tracks.full_planning import FullPlanning
from phyblock.tracks.measures import LayoutColumn, Measure, SampleCounts, TrackReport
from phyblock.web.board import SiteRun, Sources, board_of, entries_of, values_of
from tests.workspace import call


@pytest.mark.parametrize(
    "more", [{}, {"name": "steps"}, {"name": "mine"}, {"name": "mine", "section": "vqa"}]
)
def test_a_name_that_is_taken_is_refused(more):
    kind = type("Taken", (FullPlanning,), more)
    with pytest.raises(ValueError, match="has this name"):
        registry.register_track(kind)
    assert kind not in registry.known_tracks().values()


def count_blocks(item, record):
    off = abs((record.parse["number"] or 0) - len(item.scene))
    return off, off == 0, 1


COUNTS = SampleCounts("blocks", ("off", "exact", "n"), sample=count_blocks)
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

    @classmethod
    def report(cls):
        return TrackReport((ERROR, EXACT), short="count_error")

    def judge(self, item, text):
        del item
        number = int(text) if text else None
        return Judgement(bool(text), {"parse": {"rule": text and "number", "number": number}})


@pytest.fixture
def run(inside):
    registry.register_track(Counting)
    inside.write_suite(tracks=["counting"], models=["oracle", "random"])
    assert not call("run", "suite.yaml", "--out", "out", "--no-report")
    yield load_run(inside.out)
    registry._registered.pop(Counting.name)


def test_the_leading_measure_leads_everywhere(run, monkeypatch):
    columns = tuple(LayoutColumn({m.name: m.heading}, main=m is EXACT) for m in (ERROR, EXACT))
    report = replace(Counting.report(), headline=columns)
    for leading in (ERROR, EXACT):
        if leading is EXACT:
            monkeypatch.setattr(Counting, "report", lambda: report)
        assert comparable(run, "counting").measure == leading
        assert compare(run).name == leading.heading
        one = (SiteRun("run", run, Sources()),)
        (track,) = board_of(one, entries_of(one))["tracks"]
        assert track["main"] == Headline(run, "counting").main.heading
        assert {*values_of(run, "counting").samples["oracle"].values()} == {leading.best}


@pytest.mark.usefixtures("run")
def test_what_a_track_has_not_is_refused():
    with pytest.raises(SpecError, match="cannot be asked for as JSON"):
        call("run", "suite.yaml", "--set", "answer_format=json_schema", "--out", "json")
    with pytest.raises(SpecError, match="is a person, who cannot answer in counting"):
        call("play", "suite.yaml", "--name", "ada")


@pytest.mark.parametrize(
    "other", [EXACT, replace(EXACT, name="other", counted=replace(COUNTS, columns=("a", "b")))]
)
def test_two_measures_or_counts_of_one_name_are_refused(other, monkeypatch):
    monkeypatch.setattr(registry, "_measures", {})
    for measure in (EXACT, other):
        registry.add_measure("full_planning", measure)
    with pytest.raises(ValueError, match="are called"):
        track_measures("full_planning")
