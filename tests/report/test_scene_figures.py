"""Figures that show scenes: what they show is what the records say."""

from __future__ import annotations

import functools
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import phyblock
from phyblock.data import AssemblyTask, Dataset
from phyblock.domain import Plan
from phyblock.errors import SpecError
from phyblock.report.figures import Wanted, write_paper_figures
from phyblock.report.figures.perturbations import perturbation_strip
from phyblock.scoring.plan import AssemblyScorer
from phyblock.tables.drawing import COLUMN_IN, Look
from phyblock.tables.load import Run
from phyblock.tracks.full_planning import PlanRecord
from phyblock.tracks.full_planning_results import PLAN_VIEW
from phyblock.tracks.kind import kind_of
from phyblock.tracks.plans import score_fields
from tests.report.factory import laws, manifest, record, run_of

N_SCENES = 12


@functools.cache
def scenes() -> list[phyblock.SceneTask]:
    return list(phyblock.load_suite("quick", f"limit={N_SCENES}").scenes.values())


@laws
@given(
    st.integers(0, N_SCENES - 1), st.lists(st.integers(1, 16), max_size=12), st.sampled_from("AB")
)
def test_the_film_of_a_plan_ends_with_the_blocks_that_its_score_counts(
    place: int, steps: list[int], setting: str
) -> None:
    task = scenes()[place]
    scorer = AssemblyScorer(task.scene, task.candidates, (setting,))
    scores = scorer.score(Plan(tuple(steps)), ("optimal", "paper"), "selection")
    fields = record(scene=task.key) | {
        "n_blocks": len(task.scene.blocks),
        "scores": [score_fields(score) for score in scores],
        "parse": {"parser": "steps", "rule": "step_list", "plan": steps},
    }
    made = PlanRecord.model_validate(fields)
    first, *frames, last = PLAN_VIEW.frames(made, task)
    assert first.blocks == ()
    assert [frame.candidate for frame in frames] == steps
    tp = scores[0].counts.tp
    assert len(last.blocks) == len(set(last.blocks)) == tp
    assert (last.tone == "good") == (tp == len(task.scene.blocks))
    known = set(task.scene.blocks)
    standing = 0
    for frame in frames:
        assert (frame.tone == "good") == (len(frame.blocks) == standing + 1)
        standing = len(frame.blocks)
        assert set(frame.blocks) <= known
    assert len(PLAN_VIEW.table(made).rows) == len(steps)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suite", "overrides", "models", "names"),
    [
        ("sensitivity", (), ["random"], ["inference", "perturbations"]),
        ("vqa", ("vqa.per_subtask=1",), ["random"], ["subtask-cards"]),
        ("steps", (), ["random"], ["inference-steps"]),
        ("pose", (), ["stack"], ["inference-poses"]),
    ],
)
def test_every_figure_of_scenes_is_drawn_alike_twice(
    suite: str, overrides: tuple[str, ...], models: list[str], names: list[str], tmp_path: Path
) -> None:
    loaded = phyblock.load_suite(suite, *overrides)
    run = phyblock.run_suite(loaded, models=models, limit=4, out=tmp_path / "run")
    for look in (Look(), Look(COLUMN_IN, "serif", titled=False)):
        files = write_paper_figures(run, Wanted(names), look).files
        assert {path.stem for path in files} == set(names)
        first = {path: path.read_bytes() for path in files}
        write_paper_figures(run, Wanted(names), look)
        assert {path: path.read_bytes() for path in files} == first
    if "vqa" not in suite:
        with pytest.raises(SpecError, match="no such scene"):
            write_paper_figures(run, Wanted(names, "nowhere"), Look())


@pytest.mark.parametrize(
    "draw", [perturbation_strip, kind_of("full_planning").report().figures["inference"].draw]
)
def test_of_a_scene_that_a_run_has_not_errors_name_those_it_has(
    draw: Callable[[Run, Dataset, str], object],
) -> None:
    tasks = tuple(
        AssemblyTask(replace(scenes()[0].scene, id=str(n)), scenes()[0].candidates)
        for n in range(7)
    )
    dataset = Dataset("scenes", Path(), tasks)
    for count, allowed in {0: "none", 2: "0, 1", 7: "0, 1, 2, 3, 4, ..."}.items():
        run = run_of([record(scene=task.scene.id) for task in tasks[:count]], manifest())
        with pytest.raises(SpecError, match=f"(?s)no such scene.*allowed: {re.escape(allowed)}$"):
            draw(run, dataset, "nope")
    assert draw(run_of([], manifest()), dataset, "") is None
