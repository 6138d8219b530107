"""Runs about the scenes that tell the models of an earlier run apart best."""

from __future__ import annotations

import csv
import io
import shutil
from pathlib import Path

import numpy as np
import pytest
import yaml

from tests.vqa_set import write_questions
from tests.workspace import Workspace

MODELS = ["oracle", "random", "all-candidates", "first-pose", "oracle-no-orientation"]
FEW = ("--limit", "3", "--informative", "out", "--out", "few")


@pytest.fixture(scope="module")
def chosen_from(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    root = tmp_path_factory.mktemp("informative")
    made = Workspace(root, root / "kept")
    made.write_scenes()
    made.write_suite(models=MODELS, seeds=[0, 1], settings=["A"], levels=[2, 3, 4])
    done = made.run()
    assert done.code == 0, done.err
    return made


def test_what_scenes_are_worth_chooses_those_of_a_later_run(chosen_from: Workspace) -> None:
    made = chosen_from
    rows = list(csv.DictReader(io.StringIO(made.tables()["scenes.csv"].decode())))
    by_hand = _by_hand(made)
    for row in rows:
        found = float(row["discrimination"] or "nan")
        assert found == pytest.approx(by_hand[row["scene"]], abs=1e-5, nan_ok=True)
    done = made.phyblock("run", "suite.yaml", "--no-report", *FEW)
    assert done.code == 0, done.err
    assert "Kendall's tau" in done.out
    few = made.root / "few"
    manifest = yaml.safe_load((few / "run.yaml").read_text())
    chosen = manifest["chosen"]
    asked = {record["scene"] for record in made.records(few)}
    assert asked == set(chosen["scenes"])
    assert chosen["models"] == MODELS
    assert chosen["of"] == 5
    levels = {row["scene"]: int(row["level"]) for row in rows}
    assert sorted(levels[scene] for scene in asked) == [2, 3, 4]
    best = {
        level: max((value, scene) for scene, value in by_hand.items() if levels[scene] == level)
        for level in (2, 3, 4)
    }
    assert asked == {scene for _, scene in best.values()}
    # The run goes on and is scored again without the one that chose.
    again = made.phyblock("run", "suite.yaml", "--no-report", *FEW)
    assert (again.code, len(made.records(few))) == (0, 3 * 2 * len(MODELS))
    alone = made.root / "alone"
    shutil.copytree(few, alone)
    shutil.move(made.out, made.root / "moved")
    try:
        scored = made.phyblock("score", alone, "--matcher", "paper")
    finally:
        shutil.move(made.root / "moved", made.out)
    assert scored.code == 0, scored.err


def _by_hand(made: Workspace) -> dict[str, float]:
    sums: dict[tuple[str, str], np.ndarray] = {}
    for record in made.records():
        (one,) = (
            s
            for s in record["scores"]
            if (s["setting"], s["matcher"], s["criterion"]) == ("A", "optimal", "aov")
        )
        key = record["model"], record["scene"]
        sums.setdefault(key, np.zeros(3))[:] += [one["tp"], one["fp"], one["fn"]]
    scenes = sorted({scene for _, scene in sums})
    f1 = np.array(
        [
            [2 * tp / (2 * tp + fp + fn) for tp, fp, fn in (sums[m, s] for s in scenes)]
            for m in MODELS
        ]
    )
    return {
        scene: float(np.corrcoef(f1[:, i], np.delete(f1, i, axis=1).mean(axis=1))[0, 1])
        for i, scene in enumerate(scenes)
    }


@pytest.mark.parametrize(
    ("args", "said"),
    [
        (("--informative", "out"), "--limit N"),
        (("--informative", "out", "--limit", "5"), "more than 5, the limit"),
        (("--informative", "data", "--limit", "2"), "holds no run.yaml"),
        (("--informative", "other", "--limit", "2"), "asked about other data"),
        (("--informative", "weak", "--limit", "2"), "at least 4"),
    ],
)
def test_what_no_scenes_can_be_chosen_from_is_refused(
    chosen_from: Workspace, args: tuple[str, ...], said: str
) -> None:
    made = chosen_from
    _changed(made.out, made.root / "other", version=7)
    _changed(made.out, made.root / "weak", models=3)
    before = sorted(made.root.iterdir())
    done = made.phyblock("run", "suite.yaml", "--out", "new", *args)
    assert done.code == 2
    assert said in done.err
    assert sorted(made.root.iterdir()) == before


def _changed(run: Path, copy: Path, version: int | None = None, models: int | None = None) -> None:
    """A copy of a run that says another version of its data, or has fewer models."""
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(run, copy)
    manifest = yaml.safe_load((run / "run.yaml").read_text())
    if version is not None:
        manifest["dataset"]["version"] = version
    (copy / "run.yaml").write_text(yaml.safe_dump(manifest))
    if models is not None:
        lines = (run / "records.jsonl").read_text().splitlines(keepends=True)
        kept = [one for one in lines if any(f'"model":"{m}"' in one for m in MODELS[:models])]
        assert 0 < len(kept) < len(lines)
        (copy / "records.jsonl").write_text("".join(kept))


def test_questions_are_not_chosen_by_scenes(chosen_from: Workspace) -> None:
    made = chosen_from
    write_questions(made.root / "questions")
    suite = yaml.safe_load((made.root / "suite.yaml").read_text())
    both = {"tracks": ["full_planning", "vqa"], "vqa": {"path": "./questions"}}
    made.write_yaml("both.yaml", {**suite, **both, "models": ["random"]})
    done = made.phyblock("run", "both.yaml", *FEW, "--dry-run")
    assert done.code == 2
    assert "found: vqa" in done.err
