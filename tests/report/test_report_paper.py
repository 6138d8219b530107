from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from phyblock.domain import SUBTASKS
from phyblock.report import published_table
from phyblock.tables.load import load_run
from phyblock.tracks.kind import kinds
from tests.report.factory import LEVELS, manifest, record, score, write_run

PAPER_TABLES = dict(
    sorted((n, t) for kind in kinds().values() for n, t in kind.report().paper_tables.items())
)


def asked(model: str, subtask: str, seed: int, right: bool) -> dict[str, Any]:
    return record(model, "000", seed) | {
        "sample": f"vqa/{model}/{subtask}/s{seed}",
        "track": "vqa",
        "key": subtask,
        "question": {"id": subtask, "subtask": subtask, "rotation": 0},
        "answer": {"right": "A", "given": "A" if right else "B", "correct": right},
    }


def episode(model: str, seed: int) -> dict[str, Any]:
    scores = [score(1, 1, 3, criterion=name) for name in ("placed", "attempted")]
    return record(model, "000", seed, scores) | {
        "sample": f"step_planning/{model}/000/s{seed}",
        "track": "step_planning",
        "ending": "done",
        "outcomes": ["placed", "overflow"],
        "progress": [1, 1],
        "max_steps": 8,
    }


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    facts = manifest(models=[("mine", "GPT-4o"), ("seeded", "GPT-4.1"), "other"], seeds=[0, 1])
    facts["suite"]["tracks"] = ["full_planning", "vqa", "step_planning"]
    records = []
    for model in ("mine", "seeded"):
        for seed in (0, 1):
            records += [record(model, s, seed, [score(2 + seed, 1, 1)]) for s in LEVELS]
            records += [asked(model, name, seed, right=True) for name in SUBTASKS]
            records.append(episode(model, seed))
    return write_run(tmp_path / "run", records, facts)


def test_every_table_of_the_paper_has_published_ours_and_difference(folder: Path) -> None:
    run = load_run(folder)
    for number, table in PAPER_TABLES.items():
        frame = table.frame(run)
        assert len(frame), number
        gap = frame["ours"] - frame["published"]
        assert (frame["difference"].isna() == gap.isna()).all()
        assert frame["difference"].dropna().tolist() == pytest.approx(gap.dropna().tolist())
        printed = published_table(number)["value"].tolist()
        assert set(frame["published"].dropna()) <= set(printed)
        assert len(table.view(frame, run).rows) > 0


def test_ours_stands_beside_the_published_number_of_the_same_cell(folder: Path) -> None:
    run = load_run(folder)
    two = PAPER_TABLES[2].frame(run).set_index(["model", "cell"])
    assert two.loc[("mine", "SH"), "ours"] == 100
    printed = published_table(2)
    wanted = printed[(printed["model"] == "GPT-4o") & (printed["subtask"] == "SH")]["value"].item()
    assert two.loc[("mine", "SH"), "published"] == wanted
    three = PAPER_TABLES[3].frame(run).set_index(["model", "cell"])
    assert three.loc[("mine", "placed_recall")].tolist()[1:] == [13.0, 25.0, 12.0]
    five = PAPER_TABLES[5].frame(run).set_index(["model", "level", "metric"])
    f1 = [100 * 2 * tp / (2 * tp + 2) for tp in (2, 3)]
    assert five.loc[("seeded", "2", "f1_mean"), "ours"] == pytest.approx(sum(f1) / 2)
    assert five.loc[("seeded", "2", "f1_mean"), "published"] == 46.26
    assert five.loc[("seeded", "2", "f1_sd"), "ours"] == pytest.approx((f1[1] - f1[0]) / 2**0.5)


def test_a_run_without_published_models_has_nothing_beside_the_paper(tmp_path: Path) -> None:
    run = load_run(write_run(tmp_path / "run", [record("alpha")], manifest()))
    assert [len(table.frame(run)) for table in PAPER_TABLES.values()] == [0, 0, 0, 0]
