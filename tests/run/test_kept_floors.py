"""What floors reach is worked out once, and again whenever anything that decides it changes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from phyblock import registry
from phyblock.config.suite import load_suite
from phyblock.records import Manifest
from phyblock.resources import bundled
from phyblock.run import code, floors
from phyblock.run.floors import FloorValues
from phyblock.run.plan import RunPlan, make_plan
from phyblock.tracks.estimates import track_measures
from tests.workspace import SCENES, Workspace

Plans = Callable[..., RunPlan]
Begin = Callable[..., FloorValues]
DATA, PROMPTS = bundled("benchmarks", "data"), bundled("prompts")
SHUFFLED = {"candidates": {"order": "shuffled"}}


@pytest.fixture
def anew(monkeypatch: pytest.MonkeyPatch) -> list[FloorValues]:
    """Values that were worked out, in order."""
    values: list[FloorValues] = []
    work_out = floors.floor_values

    def counted(*given: Any) -> FloorValues:
        values.append(work_out(*given))
        return values[-1]

    monkeypatch.setattr(floors, "floor_values", counted)
    return values


class LaterManifest(Manifest):
    """What a run is to a version that says more of it."""

    asked: str = ""


@pytest.fixture
def planned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Plans:
    """The plan of a new run of a suite."""
    workspace = Workspace(tmp_path, tmp_path / "pictures")
    monkeypatch.setenv("PHYBLOCK_CACHE", str(workspace.cache))

    def made(*scenes: dict[str, Any], limit: int | None = None, **suite: Any) -> RunPlan:
        workspace.write_scenes(*scenes)
        loaded = load_suite(workspace.write_suite(**suite), data_dir=DATA, prompt_dirs=[PROMPTS])
        return make_plan(loaded, {}, limit=limit)

    return made


@pytest.fixture
def begin(planned: Plans) -> Begin:
    """The floors in the manifest of a new run of a suite."""
    return lambda *scenes, **suite: planned(*scenes, **suite).begun().floors


def kept_files(folder: Path) -> list[Path]:
    files = [*(folder / "cache" / "goal-blind").glob("*.json")]
    assert files
    return files


def test_the_same_is_worked_out_once(begin: Begin, anew: list[FloorValues], tmp_path: Path) -> None:
    first = begin()
    assert first["full_planning"]["goal-blind"]
    same: list[dict[str, Any]] = [
        {},
        {"name": "other", "models": ["oracle"], "seeds": [3, 4, 5]},
        {"tables": ["table1"], "limits": {"max_concurrency": 3}},
    ]
    assert [begin(**suite) for suite in same] == [first] * 3
    assert anew == [first]
    for count, suite in enumerate(same[1:], 2):
        for file in kept_files(tmp_path):
            file.unlink()
        assert begin(**suite) == first
        assert len(anew) == count


def test_whatever_decides_the_values_is_in_the_key(
    begin: Begin, anew: list[FloorValues], monkeypatch: pytest.MonkeyPatch
) -> None:
    changes: list[Callable[[], object]] = [
        lambda: begin(limit=3),
        # The fourth scene is not asked about, but learned from.
        lambda: begin(*SCENES[:3], {**SCENES[3], "parents": ["t1"]}, *SCENES[4:], limit=3),
        lambda: begin(settings=["B"]),
        lambda: begin(scoring={"matchers": ["paper"]}),
        lambda: begin(**SHUFFLED, seeds=[0]),
        lambda: begin(**SHUFFLED, seeds=[0, 1]),
        lambda: begin(levels=[3, 4]),
        lambda: begin(vary={"candidate_order": ["file", "shuffled"]}),
    ]
    for count, change in enumerate(changes, 1):
        change()
        assert len(anew) == count
    monkeypatch.setattr(code, "version", lambda _: "99")
    changes[0]()
    assert len(anew) == len(changes) + 1


def test_what_a_later_version_says_of_a_run_decides_unless_it_is_named(
    planned: Plans, anew: list[FloorValues]
) -> None:
    floors = planned().floors
    assert isinstance(floors, partial)
    manifest, *others = floors.args
    for asked in ("plainly", "politely", "plainly"):
        later = LaterManifest.model_validate({**manifest.model_dump(), "asked": asked})
        floors.func(later, *others)
    assert len(anew) == 2


def test_a_file_that_holds_no_values_costs_only_the_time(
    begin: Begin, anew: list[FloorValues], tmp_path: Path
) -> None:
    first = begin()
    files = kept_files(tmp_path)
    for content in (b"{", b'{"full_planning": 1}', b"\xff"):
        for file in files:
            file.write_bytes(content)
        assert begin() == first
    assert anew == [first] * 4


def test_the_best_value_counts_whichever_way_is_better(
    begin: Begin, request: pytest.FixtureRequest
) -> None:
    """The least that is missed of F1 is what is left of the most that is reached."""
    f1 = next(measure for measure in track_measures("full_planning") if measure.name == "f1")
    missed = replace(f1, name="missed", value=lambda sums: 1 - f1.value(sums), better="lower")
    registry.add_measure("full_planning", missed)
    request.addfinalizer(lambda: registry.remove_measure("full_planning", "missed"))
    lines = (DATA / "phyblock-400" / "scenes.jsonl").read_text("utf-8").splitlines()[::12]
    values = begin(*map(json.loads, lines))["full_planning"]["goal-blind"]
    reached = {key.partition("/")[2]: value for key, value in values.items() if key[:3] == "f1/"}
    assert reached
    for key, value in reached.items():
        assert values[f"missed/{key}"] == pytest.approx(1 - value)
