from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from phyblock.domain import SUBTASKS
from phyblock.report import Run, to_markdown
from phyblock.report.questions import CELLS, questions_frame
from phyblock.report.track_intervals import step_intervals, track_intervals_view, vqa_intervals
from tests.report.factory import LEVELS, manifest, record, run_of, score


def facts() -> dict[str, Any]:
    made = manifest(models=["beta", "alpha"], seeds=[0])
    made["suite"]["tracks"] = ["vqa", "step_planning"]
    return made


def asked(model: str, scene: str, subtask: str, number: int, right: bool) -> dict[str, Any]:
    return record(model, scene) | {
        "sample": f"vqa/{model}/{subtask}-{number}/s0",
        "track": "vqa",
        "question": {"id": f"{subtask}-{number}", "subtask": subtask, "rotation": 0},
        "answer": {"right": "A", "given": "A" if right else None, "correct": right},
    }


@pytest.fixture
def run() -> Run:
    rng = np.random.default_rng(0)
    records = [
        asked(model, scene, subtask, number, bool(rng.random() < chance))
        for model, chance in (("alpha", 0.8), ("beta", 0.4))
        for subtask in SUBTASKS
        for number, scene in enumerate([*LEVELS, *LEVELS])
    ]
    for model, tp in (("alpha", 3), ("beta", 1)):
        for scene in LEVELS:
            scores = [score(tp, 1, 4 - tp, criterion=name) for name in ("placed", "attempted")]
            sample = f"step_planning/{model}/{scene}/s0"
            more = {"sample": sample, "track": "step_planning"}
            records.append(record(model, scene, 0, scores) | more)
    return run_of(records, facts())


def test_values_are_those_of_table_2_and_lie_in_their_intervals(run: Run) -> None:
    found = vqa_intervals(run).set_index(["model", "cell"])
    wanted = questions_frame(run).set_index(["model", "cell"])["accuracy"]
    assert list(found.index) == [(model, cell) for model in ("beta", "alpha") for cell in CELLS]
    assert found["value"].tolist() == pytest.approx((100 * wanted.loc[found.index]).tolist())
    assert (found["lo"] <= found["value"]).all()
    assert (found["value"] <= found["hi"]).all()
    overall = found.xs("overall", level="cell")
    assert overall["n"].tolist() == [160, 160]
    assert overall["n_clusters"].tolist() == [5, 5]
    narrow = overall["hi"] - overall["lo"]
    assert (narrow < found.xs("SH", level="cell")["se"] * 8).all()


def test_step_planning_has_f1_by_way_of_counting(run: Run) -> None:
    found = step_intervals(run).set_index(["model", "cell"])
    assert found.loc[("alpha", "placed"), "value"] == pytest.approx(75)
    assert found.loc[("beta", "attempted"), ["lo", "hi"]].tolist() == pytest.approx([100 / 3] * 2)


def test_views_say_averages_with_intervals(run: Run) -> None:
    text = to_markdown(track_intervals_view(vqa_intervals(run), run))
    assert "Object property %" in text
    assert "Overall 95 % CI" in text
    assert "Placed %" in to_markdown(track_intervals_view(step_intervals(run), run))


def test_nothing_asked_is_an_empty_table() -> None:
    empty = run_of([], facts())
    assert vqa_intervals(empty).empty
    assert step_intervals(empty).empty
