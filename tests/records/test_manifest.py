"""`run.yaml` is read within bounds; only a run's own records are counted, and go on in it."""

import pytest

from phyblock.errors import StoreError
from phyblock.records.files import MANIFEST, Manifest, Validation, known_records, read_manifest
from phyblock.records.record import Call
from phyblock.results.load import load_run
from phyblock.run.rescore import rescore
from tests.data.broken import YAML_TEXTS, plan_record
from tests.workspace import call, problem_of

IDENTITY = "5eed" * 16


@pytest.mark.parametrize("name", YAML_TEXTS)
@pytest.mark.parametrize("field", ["mine", "scenes_by_level"])
def test_what_no_run_writes_is_refused_in_words(tmp_path, name, field):
    (tmp_path / MANIFEST).write_text(f"identity: x\n{field}: {YAML_TEXTS[name]}\n")
    with pytest.raises(StoreError, match=r"run\.yaml"):
        read_manifest(tmp_path)


FACTS = Manifest.model_validate({"identity": IDENTITY})
"""The manifest of the run that `plan_record` is of."""


def renamed(**changes):
    record = plan_record() | changes
    return record | {"sample": "{track}/{model}/{key}/s{seed}".format(**record)}


@pytest.mark.parametrize(
    ("record", "field"),
    [
        (plan_record(), None),
        (plan_record() | {"run": IDENTITY[:16]}, None),
        (plan_record() | {"run": "0" * 16}, "run"),
        (renamed(model="oracle"), "sample"),
        (renamed(seed=2), "sample"),
        (renamed(key="another"), "sample"),
        (renamed(track="pose_planning") | {"track": "full_planning"}, "sample"),
        (plan_record() | {"seed": 1}, "sample"),
        (plan_record() | {"model": "oracle"}, "sample"),
    ],
)
def test_a_foreign_record_or_call_is_known_by_what_differs(record, field):
    validation = Validation(FACTS, {plan_record()["sample"]})
    problem = validation.problem("records.jsonl:7", known_records().validate_python(record))
    assert (problem and problem.field) == field
    assert problem is None or (problem.where == "records.jsonl:7" and problem.hint)
    for run, wanted in ((FACTS.run, None), ("0" * 16, "run")):
        call = Call(call=0, model="m", sample="s", key="k", run=run)
        problem = validation.problem("calls.jsonl:1", call)
        assert (problem and problem.field) == wanted


@pytest.fixture(scope="module")
def runs(new_workspace):
    """Two runs that differ in the background of their pictures alone: `out` and `other`."""
    made = new_workspace()
    for name, background in (("other", "white"), ("out", "checkerboard")):
        made.out = made.root / name
        made.write_suite(models=["random"], images={"size_px": 128, "background": background})
        made.completed()
    return made


def goes_on(folder):
    return call("run", folder.parent / "suite.yaml", "--out", folder, "--no-report")


@pytest.mark.parametrize("reader", [load_run, rescore, goes_on])
def test_records_that_were_copied_in_are_not_counted(runs, tmp_path, reader):
    folder = runs.copied(tmp_path / "w").root / "out"
    reader(folder)
    path = folder / "records.jsonl"
    with path.open("ab") as file:
        file.write((runs.root / "other" / "records.jsonl").read_bytes())
    before = path.read_bytes()
    problem = problem_of(StoreError, reader, folder)
    assert (problem.where, problem.field) == (f"{path}:6", "run")
    assert path.read_bytes() == before
