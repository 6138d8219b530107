from __future__ import annotations

from pathlib import Path

import pytest

import phyblock
from phyblock.domain import SUBTASKS
from phyblock.errors import SpecError
from phyblock.report import to_markdown
from tests.report.factory import LEVELS, manifest, record, score, write_run


@pytest.fixture
def run(tmp_path: Path) -> phyblock.Run:
    records = [
        record(model, scene, seed, [score(tp, 1, 4 - tp), score(tp, 0, 1, setting="B")])
        for model, tp in (("alpha", 3), ("beta", 1))
        for scene in LEVELS
        for seed in (0, 1)
    ]
    facts = manifest(models=["alpha", "beta", "<b>gamma</b>"])
    return phyblock.load_run(write_run(tmp_path / "run", records, facts))


def test_tables_are_frames_by_name(run: phyblock.Run) -> None:
    assert {"assembly", "table1", "intervals", "coverage"} <= set(run.tables)
    table = run.tables["table1"].set_index("model")
    assert table.loc["alpha", "overall_f1"] == pytest.approx(75)
    assert len(run.tables) == len(list(run.tables))
    view = run.tables.view("table1")
    assert view is not None
    assert "| alpha" in to_markdown(view)
    assert run.tables.view("assembly") is None
    with pytest.raises(KeyError, match=r"table9; there are: .*table1"):
        run.tables["table9"]


def test_the_summary_has_a_row_a_model_with_its_interval(run: phyblock.Run) -> None:
    summary = run.summary()
    assert summary.index.tolist() == ["alpha", "beta", "<b>gamma</b>"]
    assert summary.loc["alpha", ["expected", "ok"]].tolist() == [10, 10]
    row = summary.loc["beta"]
    assert row["f1_lo"] <= row["f1"] <= row["f1_hi"]
    assert summary.loc[["<b>gamma</b>"], "f1"].isna().all()


def test_models_and_runs_are_compared(run: phyblock.Run) -> None:
    verdict = "too few base scenes to tell"
    assert run.compare().table["verdict"].tolist()[0] == verdict
    same = run.compare(run, ["alpha", "alpha"])
    assert set(same.table["difference"].dropna()) == {0}
    with pytest.raises(SpecError, match="no such model"):
        run.compare(models=["delta", "alpha"])


def test_a_notebook_shows_escaped_names_and_aligned_numbers(run: phyblock.Run) -> None:
    html = run._repr_html_()
    assert "<b>gamma</b>" not in html
    assert "&lt;b&gt;gamma&lt;/b&gt;" in html
    assert "75.0 [" in html
    assert html.count("<tr>") == 4


def test_the_summary_has_intervals_of_questions_and_episodes_too(tmp_path: Path) -> None:
    records = []
    for n, scene in enumerate(LEVELS):
        for subtask in SUBTASKS:
            name = f"{subtask}-{scene}"
            question = {"id": name, "subtask": subtask, "rotation": 0}
            answer = {"right": "A", "given": "AB"[n % 2], "correct": n % 2 == 0}
            about = {"sample": f"vqa/alpha/{name}/s0", "track": "vqa", "key": name}
            records.append(record(scene=scene) | about | {"question": question, "answer": answer})
        scores = [score(n, 0, 4 - n, criterion=name) for name in ("placed", "attempted")]
        about = {"sample": f"step_planning/alpha/{scene}/s0", "track": "step_planning"}
        records.append(record(scene=scene, scores=scores) | about)
    facts = manifest(models=["alpha", "beta"], seeds=[0], settings=["A"])
    facts["suite"]["tracks"] = ["vqa", "step_planning"]
    run = phyblock.load_run(write_run(tmp_path / "run", records, facts))
    summary = run.summary()
    alpha = summary.loc["alpha"]
    assert alpha["vqa"] == pytest.approx(60)
    assert alpha["vqa_lo"] < alpha["vqa"] < alpha["vqa_hi"]
    assert alpha["steps_f1_lo"] < alpha["steps_f1"] < alpha["steps_f1_hi"]
    assert summary.loc["beta"].drop(["expected", "ok"]).isna().all()
    assert "60.0 [" in run._repr_html_()
