"""Questions and episodes compared, as plans are in test_report_compare."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from phyblock.domain import SUBTASKS
from phyblock.errors import SpecError
from phyblock.report import Run
from phyblock.report.compare import compare_models, compare_runs
from phyblock.report.compare_view import compare_view, flipped_lines
from phyblock.tracks.step_planning_results import step_intervals
from phyblock.tracks.vqa_results import questions_frame
from tests.report.factory import LEVELS, manifest, record, run_of, score

SCENES = tuple(f"{n:03}" for n in range(30))


def facts(*tracks: str, models: tuple[str, ...] = ("alpha", "beta"), **vqa: Any) -> dict[str, Any]:
    made = manifest(models=models, seeds=[0], settings=["A"], matchers=["optimal"])
    made["suite"] |= {"tracks": list(tracks), "vqa": vqa}
    return made


def asked(model: str, scene: str, subtask: str, right: bool, outcome: str = "ok") -> dict[str, Any]:
    name = f"{subtask.lower()}-{scene}"
    return record(model, scene, outcome=outcome) | {
        "sample": f"vqa/{model}/{name}/s0",
        "track": "vqa",
        "question": {"id": name, "subtask": subtask, "rotation": 0},
        "answer": {"right": "A", "given": "A" if right else "B", "correct": right},
    }


def episode(model: str, scene: str, tp: int) -> dict[str, Any]:
    scores = [
        score(tp, fp, 4 - tp, criterion=name) for name, fp in (("placed", 0), ("attempted", 4))
    ]
    more = {"sample": f"step_planning/{model}/{scene}/s0", "track": "step_planning"}
    return record(model, scene, scores=scores) | more


def answers(subtasks: tuple[str, ...] = SUBTASKS) -> list[dict[str, Any]]:
    """Alpha is right in nine of ten, beta in five of ten, in an order of its own by subtask."""
    return [
        asked(model, scene, subtask, (7 * n + place) % 10 < tenths)
        for model, tenths in (("alpha", 9), ("beta", 5))
        for place, subtask in enumerate(subtasks)
        for n, scene in enumerate(SCENES[: 10 + place])
    ]


def test_accuracies_are_those_of_table_2_and_a_clear_difference_is_told() -> None:
    run = run_of(answers(), facts("vqa"))
    found = compare_models(run)
    table = found.table.set_index("part")
    accuracy = 100 * questions_frame(run).set_index(["model", "cell"])["accuracy"]
    for part in ("object_property", "dynamic_reasoning", "overall"):
        row = table.loc[part]
        assert row["value_a"] == pytest.approx(accuracy["alpha", part])
        assert row["value_b"] == pytest.approx(accuracy["beta", part])
        assert row["lo"] < row["difference"] < row["hi"]
    overall = table.loc["overall"]
    assert overall["verdict"] == "alpha is better"
    n = sum(10 + place for place in range(16))
    assert (overall["n_samples"], overall["n_scenes"], overall["n_clusters"]) == (n, 25, 25)
    assert overall["better"] + overall["worse"] + overall["same"] == n
    assert len(found.flipped) == overall["better"] + overall["worse"]
    view = compare_view(found)
    assert [row[2] for row in view.rows][::4] == ["Object property", "Overall"]
    assert view.columns[3].group == "Accuracy (%)"


def test_only_questions_that_both_answered_count_and_means_are_of_what_was_asked() -> None:
    records = [asked("alpha", "000", "SH", True), asked("alpha", "001", "SH", False)]
    records += [asked("alpha", "002", "OR", True), asked("alpha", "003", "CO", True)]
    records += [asked("beta", "000", "SH", False), asked("beta", "001", "SH", False)]
    records += [asked("beta", "002", "OR", True), asked("beta", "003", "CO", True, "missing")]
    records += [asked("alpha", "000", "TC", True), asked("beta", "000", "TC", True, "missing")]
    found = compare_models(run_of(records, facts("vqa")))
    overall = found.table.set_index("part").loc["overall"]
    assert (overall["value_a"], overall["value_b"], overall["n_samples"]) == (75, 50, 3)
    assert flipped_lines(found) == ("alpha is right where beta is not, 1: sh-000",)
    empty = found.table.set_index("part").loc["scene_understanding"]
    assert empty["verdict"] == "nothing to compare"


def test_episodes_are_compared_by_f1_of_attempts_and_of_blocks_placed() -> None:
    records = [episode("alpha", scene, 3) for scene in LEVELS]
    records += [episode("beta", scene, n % 2 + 1) for n, scene in enumerate(LEVELS)]
    run = run_of(records, facts("step_planning"))
    table = compare_models(run).table.set_index("part")
    values = step_intervals(run).set_index(["model", "cell"])["value"]
    assert table.index.tolist() == ["placed", "attempted"]
    for part in table.index:
        assert table.loc[part, "value_a"] == pytest.approx(values["alpha", part])
        assert table.loc[part, "value_b"] == pytest.approx(values["beta", part])
    three = run_of(records, facts("step_planning", models=("alpha", "beta", "gamma")))
    assert set(compare_models(three).table["part"]) == {"attempted"}


def test_the_track_is_the_first_that_runs_share_or_the_one_named() -> None:
    records = [record(model, "001", scores=[score(1, 1, 1)]) for model in ("alpha", "beta")]
    mixed = run_of(records + answers(("SH",)), facts("full_planning", "vqa"))
    assert compare_models(mixed).name == "F1"
    assert compare_models(mixed, track="vqa").name == "Accuracy"
    alone = run_of(answers(("SH",)), facts("vqa"))
    assert compare_runs(mixed, alone, ["alpha", "beta"]).name == "Accuracy"


def test_runs_of_other_questions_or_of_other_ways_to_count_are_refused() -> None:
    def run(path: str, **more: Any) -> Run:
        made = facts("vqa", circular=more.get("circular", False))
        made["tracks"] = {"vqa": {"questions": more.get("questions", "d1")}}
        read = run_of(answers(("SH",)), made)
        return Run(Path(path), read.manifest, read.design, read.records, read.scores)

    assert len(compare_runs(run("one"), run("two")).table) == 2
    with pytest.raises(SpecError, match=r"two: vqa.circular: counts right answers in another"):
        compare_runs(run("one"), run("two", circular=True))
    with pytest.raises(SpecError, match="questions of another set than one"):
        compare_runs(run("one"), run("two", questions="d2"))
