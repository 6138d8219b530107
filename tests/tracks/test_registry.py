"""What is registered twice, and counts that are not those of their measure, are refused."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from phyblock import registry
from phyblock.errors import StoreError
from phyblock.results.estimates import track_estimates, track_measures
from phyblock.results.load import load_run
from phyblock.results.tables import write_tables
from phyblock.scoring.counts import ratio_of
from phyblock.tracks.base import kind_of
from phyblock.tracks.measures import Measure, SampleCounts
from tests.report.factory import manifest, record, write_run

SAMPLED = SampleCounts("sampled", ("part", "whole"), sample=lambda _, __: (1, 2))
HALF = Measure("half", "Half", SAMPLED, ratio_of, "one of two")


@pytest.fixture
def half() -> Iterator[None]:
    registry.add_measure("full_planning", HALF)
    yield
    registry.remove_measure("full_planning", "half")


@pytest.mark.parametrize(
    "more",
    [{}, {"name": "steps"}, {"name": "table1"}, {"name": "mine", "tables": ("errors",)}],
)
def test_a_name_that_is_taken_is_refused(more: dict[str, Any]) -> None:
    kind = replace(kind_of("full_planning"), **{"tables": (), **more})
    with pytest.raises(ValueError, match="has this name"):
        registry.register_track(kind)
    assert kind not in registry.known_tracks().values()


@pytest.mark.usefixtures("half")
@pytest.mark.parametrize(
    "other", [HALF, replace(HALF, name="other", counted=replace(SAMPLED, columns=("a", "b")))]
)
def test_two_measures_or_counts_of_one_name_are_refused(
    other: Measure, request: pytest.FixtureRequest
) -> None:
    registry.add_measure("full_planning", other)
    request.addfinalizer(lambda: registry.add_measure("full_planning", HALF))
    request.addfinalizer(lambda: registry.remove_measure("full_planning", other.name))
    with pytest.raises(ValueError, match="are called"):
        track_measures("full_planning")


@pytest.mark.parametrize("track", sorted(registry.known_tracks()))
def test_a_track_counts_all_that_its_own_measures_need(track: str) -> None:
    """A measure in the report whose counts the kind does not name would never be counted."""
    kind = kind_of(track)
    needed = {one.counted for one in kind.report().measures if one.counted.sample is not None}
    assert needed == set(kind.counted)


@pytest.mark.usefixtures("half")
def test_samples_that_lack_counts_are_not_counted(tmp_path: Path) -> None:
    records = [record(scene="001") | {"counts": {"sampled": [1, 2]}}]
    records += [record(scene="002") | {"counts": {"sampled": []}}, record(scene="003")]
    written = write_tables(write_run(tmp_path / "run", records, manifest()))
    (row,) = written.run.estimates.query("cell == 'overall' and measure == 'half'").to_dict(
        "records"
    )
    assert (row["value"], row["n"]) == (0.5, 1)


@pytest.mark.usefixtures("half")
def test_counts_of_another_measure_name_the_file(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [record() | {"counts": {"sampled": [1]}}], manifest())
    assert json.loads((folder / "records.jsonl").read_text())["counts"] == {"sampled": [1]}
    with pytest.raises(StoreError, match=r"records.jsonl: counts.sampled: was counted in another"):
        track_estimates(load_run(folder), "full_planning")


MADE_ELSEWHERE = {"phyblock/cli/main.py": {"vqa"}}
"""The verb of the package beside this one that makes questions."""
