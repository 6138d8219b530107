from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import stats

from phyblock.domain import SUBTASKS
from phyblock.report import Run, to_markdown
from phyblock.tracks.step_planning_results import step_intervals, step_intervals_view
from phyblock.tracks.vqa_results import CELLS, questions_frame, vqa_intervals, vqa_intervals_view
from tests.report.factory import LEVELS, manifest, record, run_of, score


def facts() -> dict[str, Any]:
    made = manifest(models=["beta", "alpha"], seeds=[0])
    made["suite"]["tracks"] = ["vqa", "step_planning"]
    return made


def asked(
    model: str,
    scene: str,
    subtask: str,
    number: int,
    right: bool,
    *,
    rotation: int = 0,
    outcome: str = "ok",
) -> dict[str, Any]:
    return record(model, scene, outcome=outcome) | {
        "sample": f"vqa/{model}/{subtask}-{number}-r{rotation}/s0",
        "track": "vqa",
        "question": {"id": f"{subtask}-{number}", "subtask": subtask, "rotation": rotation},
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
    # Five base scenes agree on a third: Wilson's interval of five samples.
    ends = found.loc[("beta", "attempted"), ["lo", "hi"]].to_numpy(float) / 100
    squared = stats.t.ppf(0.975, 4) ** 2 * ends * (1 - ends) / 5
    assert (1 / 3 - ends) ** 2 == pytest.approx(squared)
    assert ends[0] < 1 / 3 < ends[1]


def test_views_say_averages_with_intervals(run: Run) -> None:
    text = to_markdown(vqa_intervals_view(vqa_intervals(run), run))
    assert "Object property %" in text
    assert "Overall 95 % CI" in text
    assert "Placed %" in to_markdown(step_intervals_view(step_intervals(run), run))


def test_nothing_asked_is_an_empty_table() -> None:
    empty = run_of([], facts())
    assert vqa_intervals(empty).empty
    assert step_intervals(empty).empty


def test_a_question_goes_with_its_rotations_and_is_right_if_all_are() -> None:
    made = facts()
    made["suite"]["vqa"] = {"circular": True}
    records = [
        asked("alpha", scene, "SH", number, number != 1 or turn != 2, rotation=turn)
        for number, scene in enumerate(LEVELS)
        for turn in range(4)
    ]
    # Left out with all of its rotations, three of which were right.
    records[-1] = asked("alpha", "004", "SH", 4, False, rotation=3, outcome="api_error")
    run = run_of(records, made)
    cell = vqa_intervals(run).set_index("cell").loc["SH"]
    wanted = questions_frame(run).set_index(["model", "cell"])["accuracy"]
    assert cell["value"] == pytest.approx(75) == 100 * wanted["alpha", "SH"]
    assert (cell["n"], cell["n_scenes"], cell["n_clusters"]) == (4, 4, 4)


def test_a_cell_of_one_base_scene_has_no_interval_and_neither_has_a_mean_with_it() -> None:
    records = [
        asked("alpha", scene, subtask, number, number % 2 == 0)
        for subtask in SUBTASKS
        for number, scene in enumerate(["000"] if subtask == "SH" else LEVELS)
    ]
    found = vqa_intervals(run_of(records, facts())).set_index("cell")
    assert found["value"].notna().all()
    assert found.loc["SH", ["n_scenes", "n_clusters"]].tolist() == [1, 1]
    assert found.loc["overall", ["n", "n_scenes", "n_clusters"]].tolist() == [76, 5, 5]
    without = found.index[found["lo"].isna()].tolist()
    assert without == ["SH", "object_property", "overall"]


@pytest.mark.parametrize("missing", ["count", "skip"])
def test_where_a_model_said_nothing_nothing_was_measured(missing: str) -> None:
    made = facts()
    made["suite"]["scoring"]["missing"] = missing
    records = [
        asked(
            "alpha", scene, subtask, number, False, outcome="ok" if subtask == "SH" else "missing"
        )
        for subtask in ("SH", "CO")
        for number, scene in enumerate(LEVELS)
    ]
    found = vqa_intervals(run_of(records, made)).set_index("cell")
    assert found.loc["SH", "value"] == 0
    assert np.isnan(found.loc["CO", "value"])
