from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import phyblock
from phyblock.errors import SpecError, StoreError
from phyblock.report.export.flat import export_frame
from phyblock.report.export.write import FORMATS, export_run
from phyblock.tables.load import load_run
from tests.report.factory import LEVELS, manifest, record, score, write_run

HF = "the package datasets is not installed"
INSPECT = "the package inspect_ai is not installed"


def asked(model: str, seed: int, right: bool, key: str = "sh-1") -> dict[str, Any]:
    question = {"id": "sh-1", "subtask": "SH", "category": "object_property"}
    return record(model, "000", seed) | {
        "sample": f"vqa/{model}/{key}/s{seed}",
        "track": "vqa",
        "key": key,
        "question": question | {"rotation": int(key[-1]) if "-r" in key else 0},
        "parse": {"rule": "letter", "letters": "A" if right else "B"},
        "answer": {"right": "A", "given": "A" if right else "B", "correct": right},
    }


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    facts = manifest()
    facts["suite"]["tracks"] = ["full_planning", "vqa"]
    records: list[dict[str, Any]] = []
    for place, scene in enumerate(LEVELS):
        for seed in (0, 1):
            scores = [score(place, 1, 1), score(place, 0, 1, setting="B")]
            records.append(record("alpha", scene, seed, scores, prompt_tokens=100))
    records[0]["prompt"] = {"template": "x", "version": "1", "images": [], "messages": "d1"}
    records[1] = record("alpha", "000", 1, [score(0, 0, 4)], outcome="missing")
    records += [asked("alpha", 0, True), asked("alpha", 1, False)]
    records.append(record("beta", "000", 0, outcome="api_error"))
    made = write_run(tmp_path / "run", records, facts)
    prompt = {"role": "user", "parts": ["Look at", {"image": "goal"}]}
    line = json.dumps({"sha256": "d1", "messages": [prompt]})
    (made / "prompts.jsonl").write_text(line + "\n", encoding="utf-8")
    return made


def test_rows_hold_what_was_asked_answered_and_counted(folder: Path) -> None:
    frame = export_frame(load_run(folder)).set_index("sample")
    assert len(frame) == 13
    row = frame.loc["full_planning/alpha/002/s0"]
    assert (row["tp_a"], row["fp_a"], row["fn_a"], row["tp_b"]) == (2, 1, 1, 2)
    assert (row["reply"], row["plan"], row["prompt_tokens"]) == (
        "Move block with index 1",
        [1],
        100,
    )
    assert frame.loc["full_planning/alpha/000/s0", "prompt"] == "Look at\n[picture: goal]"
    assert pd.isna(frame.loc["full_planning/alpha/000/s1", "reply"])
    assert frame.loc["vqa/alpha/sh-1/s1", ["question_subtask", "answer_given"]].tolist() == [
        "SH",
        "B",
    ]
    assert frame.loc["full_planning/beta/000/s0", "error"] == "busy"


def test_csv_and_parquet_come_back_as_the_same_rows(folder: Path) -> None:
    run = load_run(folder)
    (csv,), (parquet,) = export_run(run, "csv"), export_run(run, "parquet")
    assert csv == folder / "export" / "csv" / "records.csv"
    from_csv, from_parquet = pd.read_csv(csv), pd.read_parquet(parquet)
    assert from_csv["sample"].tolist() == from_parquet["sample"].tolist()
    assert from_csv["tp_a"].fillna(-1).tolist() == from_parquet["tp_a"].fillna(-1).tolist()
    assert json.loads(from_csv["levels"][0]) == list(from_parquet["levels"][0]) == [1, 2]


def test_a_hugging_face_dataset_has_the_right_rows(folder: Path, tmp_path: Path) -> None:
    datasets = pytest.importorskip("datasets", reason=HF)
    frame = export_frame(load_run(folder))
    parquet, saved = export_run(load_run(folder), "hf", tmp_path / "out")
    from_disk = datasets.load_from_disk(str(saved))
    loaded = datasets.load_dataset(
        "parquet", data_files=str(parquet), cache_dir=str(tmp_path / "cache"), split="train"
    )
    for rows in (from_disk, loaded):
        assert rows.column_names == list(frame.columns)
        assert rows["sample"][:] == frame["sample"].tolist()
        assert rows["levels"][0] == [1, 2]
        assert rows["tp_a"][2:4] == [1, 1]
        assert rows["tp_a"][-3:] == [None, None, None]
        assert rows["answer_correct"][-2:] == [True, False]


def test_an_inspect_log_opens_with_the_right_scores(folder: Path, tmp_path: Path) -> None:
    log = pytest.importorskip("inspect_ai.log", reason=INSPECT)
    files = export_run(load_run(folder), "inspect", tmp_path / "out")
    names = ["full_planning_alpha.eval", "full_planning_beta.eval", "vqa_alpha.eval"]
    assert [file.name for file in files] == names
    planning, failed, vqa = (log.read_eval_log(str(file)) for file in files)
    assert (planning.status, planning.eval.task, planning.eval.model) == (
        "success",
        "phyblock/full_planning",
        "alpha",
    )
    assert planning.eval.config.epochs == 2
    samples = {(sample.id, sample.epoch): sample for sample in planning.samples}
    assert samples["002", 2].scores["A-optimal-aov"].value == {
        "tp": 2,
        "fp": 1,
        "fn": 1,
        "f1": pytest.approx(4 / 6),
    }
    assert samples["000", 1].input == "Look at\n[picture: goal]"
    assert samples["002", 1].output.completion == "Move block with index 1"
    assert samples["002", 1].output.usage.input_tokens == 100
    assembly = phyblock.load_run(folder).tables["assembly"]
    cell = assembly[(assembly["model"] == "alpha") & (assembly["level"] == "overall")].iloc[0]
    (metrics,) = (s.metrics for s in planning.results.scores if s.name == "A-optimal-aov")
    assert metrics["f1"].value == pytest.approx(cell["f1"])
    assert metrics["recall"].value == pytest.approx(cell["recall"])
    assert failed.samples[0].error.message == "busy"
    assert [sample.scores["answer"].value for sample in vqa.samples] == ["C", "I"]
    assert vqa.results.scores[0].metrics["accuracy"].value == 0.5
    assert vqa.samples[0].target == "A"
    listed = log.list_eval_logs(str(tmp_path / "out"))
    assert len(listed) == 3


def test_rotations_of_a_question_are_samples_of_their_own_in_an_inspect_log(tmp_path: Path) -> None:
    log = pytest.importorskip("inspect_ai.log", reason=INSPECT)
    records = [asked("alpha", 0, True, key=f"sh-1-r{rotation}") for rotation in range(4)]
    facts = manifest(models=["alpha"], seeds=[0])
    facts["suite"]["tracks"] = ["vqa"]
    run = load_run(write_run(tmp_path / "run", records, facts))
    (file,) = export_run(run, "inspect", tmp_path / "out")
    samples = log.read_eval_log(str(file)).samples
    assert [sample.id for sample in samples] == [f"sh-1-r{rotation}" for rotation in range(4)]


@pytest.mark.parametrize(
    ("form", "package", "extra"),
    [
        ("hf", "datasets", "hf"),
        ("parquet", "pyarrow", "hf"),
        ("inspect", "inspect_ai.log", "inspect"),
    ],
)
def test_a_missing_package_is_named_with_what_to_install(
    folder: Path, monkeypatch: pytest.MonkeyPatch, form: str, package: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    name = package.partition(".")[0]
    with pytest.raises(SpecError, match=rf"(?s)needs the package {name}\b.*phyblock\[{extra}\]"):
        export_run(load_run(folder), form)


@pytest.mark.parametrize("form", FORMATS)
def test_a_folder_that_cannot_be_written_is_said_so(folder: Path, form: str) -> None:
    (folder / "export").write_text("in the way")
    with pytest.raises(StoreError, match="cannot be written"):
        export_run(load_run(folder), form)
