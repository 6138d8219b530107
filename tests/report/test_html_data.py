"""The data beside the page: what is packed comes back, whatever it says, sample by sample."""

from __future__ import annotations

import base64
import json
import os
import re
import zlib
from bisect import bisect_right
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import DataError, StoreError
from phyblock.results.design import read_design
from phyblock.results.tables import write_tables
from phyblock.web.pack import Pack, SampleIndex, pack_samples, read_places
from phyblock.web.report import write_report
from tests.report.factory import laws, manifest, record, record_lists, score, write_run
from tests.servers.chassis import Running
from tests.servers.openai_chat import OpenAIChat
from tests.workspace import Workspace

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


def unpacked(script: str) -> Any:
    """The data of a script: JSON, deflated, in base 64."""
    (packed,) = re.findall(r"^phyblockTake\('[^']*','[^']*','([A-Za-z0-9+/=]*)'\)\n$", script)
    return json.loads(zlib.decompress(base64.b64decode(packed)))


def write_page(folder: Path, data: Path | None = None) -> Path:
    """The report without figures, which take seconds."""
    return write_report(write_tables(folder), data, figures=False)


class Report:
    """What a page reads out of a folder of scripts."""

    def __init__(self, run: Path) -> None:
        page = (run / "report.html").read_text(encoding="utf-8")
        self.page = page
        self.folder = run / page.partition('data-folder="')[2].partition('"')[0]
        self.index = self.script("index")

    def script(self, name: str) -> Any:
        return unpacked((self.folder / f"{name}.js").read_text(encoding="ascii"))

    def entry(self, kind: str, number: int) -> Any:
        starts = self.index["starts"][kind]
        chunk = bisect_right(starts, number) - 1
        return self.script(f"{kind}-{chunk}")[number - starts[chunk]]


@laws
@given(st.lists(JSON, max_size=6))
def test_what_is_packed_comes_back(
    tmp_path_factory: pytest.TempPathFactory, entries: list[Any]
) -> None:
    folder = tmp_path_factory.mktemp("pack")
    pack = Pack(folder, "records", "build")
    assert [pack.add(entry) for entry in entries] == list(range(len(entries)))
    pack.close()
    found = [unpacked((folder / f"records-{n}.js").read_text()) for n in range(len(pack.starts))]
    assert [entry for chunk in found for entry in chunk] == entries


def test_chunks_stay_small_and_say_where_they_start(tmp_path: Path) -> None:
    pack = Pack(tmp_path, "records", "build")
    entries = [f"{n}" + "x" * (90_000 + 1000 * n) for n in range(20)]
    for entry in entries:
        pack.add(entry)
    pack.close()
    sizes = [path.stat().st_size for path in tmp_path.iterdir()]
    assert len(sizes) == len(pack.starts) > 5
    assert max(sizes) < 320_000
    assert pack.starts[0] == 0
    for n, start in enumerate(pack.starts):
        assert unpacked((tmp_path / f"records-{n}.js").read_text())[0] == entries[start]


@laws
@given(record_lists(), st.randoms(use_true_random=False))
def test_the_newest_record_of_every_sample_is_there_once(
    tmp_path_factory: pytest.TempPathFactory, records: list[dict[str, Any]], random: Any
) -> None:
    folder = tmp_path_factory.mktemp("run")
    facts = manifest()
    stale = [
        {**one, "outcome": "missing", "reply": None} for one in records if random.random() < 0.5
    ]
    write_run(folder, [*stale, *records], facts)
    design = read_design(facts)
    places = read_places(folder, design)
    index, pack = SampleIndex(design), Pack(folder, "records", "build")
    pack_samples(folder, places, index, pack, {}, {})
    pack.close()
    columns = index.columns({})
    entries = [
        entry
        for n in range(len(pack.starts))
        for entry in unpacked((folder / f"records-{n}.js").read_text())
    ]
    by_name = {one["sample"]: one for one in records}
    rows = columns["rows"]
    assert len(entries) == len(rows["item"]) == len(by_name)
    for row, entry in enumerate(entries):
        model = columns["models"][rows["model"][row]]
        key = columns["items"]["key"][rows["item"][row]]
        one = by_name.pop(f"full_planning/{model}/{key}/s{rows['seed'][row]}")
        assert entry["reply"] == one["reply"]
        assert columns["outcomes"][rows["outcome"][row]] == one["outcome"]
        for setting in "AB":
            found = next(
                s for s in one["scores"] if (s["setting"], s["matcher"]) == (setting, "optimal")
            )
            counts = {name: rows["scores"][setting][name][row] for name in ("tp", "fp", "fn")}
            assert counts == {name: found[name] for name in counts}
            bits = rows["scores"][setting]["wrong"][row]
            wrong = {
                name
                for n, name in enumerate(columns["listings"][0]["AB".index(setting)]["errors"])
                if bits >> n & 1
            }
            assert wrong == {name for name, count in found["errors"].items() if count}
    assert not by_name


def test_every_text_of_the_page_is_escaped(tmp_path: Path) -> None:
    hostile = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'&"
    facts = manifest(models=[hostile])
    facts["suite"] |= {"name": hostile, "description": hostile}
    folder = write_run(tmp_path / "run", [record(hostile, scores=[score(1, 0, 1)])], facts)
    page = write_page(folder).read_text(encoding="utf-8")
    assert not (folder / "figures").exists()
    assert "<script>alert" not in page
    assert "<img src=x" not in page
    assert page.count("<script>") == 1
    assert page.count("&lt;script&gt;alert(1)") > 3


def test_nothing_but_our_own_script_may_run(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [record(scores=[score(1, 0, 1)])], manifest())
    page = write_page(folder).read_text(encoding="utf-8")
    policy = page.partition('Content-Security-Policy" content="')[2].partition('"')[0]
    assert policy.startswith("default-src 'none'; script-src 'sha256-".replace("'", "&#39;"))
    assert "unsafe" not in policy
    assert "http" not in policy
    for outside in ("http://", "https://", "//cdn", "@import"):
        assert outside not in page


def test_a_report_is_replaced_as_a_whole(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [record(scores=[score(1, 0, 1)])], manifest())
    write_page(folder)
    first = Report(folder)
    write_run(folder, [record("beta", scores=[score(0, 1, 2)])], manifest())
    write_page(folder)
    second = Report(folder)
    assert second.folder != first.folder
    assert not first.folder.exists()
    index = second.index
    assert [index["models"][model] for model in index["rows"]["model"]] == ["beta"]


def test_a_run_without_records_has_a_report(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [], manifest())
    write_page(folder)
    index = Report(folder).index
    assert index["rows"]["item"] == []
    assert index["starts"] == {"records": [], "scenes": [], "questions": [], "prompts": []}


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_is_said(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [record(scores=[score(1, 0, 1)])], manifest())
    written = write_tables(folder)
    (folder / "figures").mkdir()
    folder.chmod(0o555)
    try:
        with pytest.raises(StoreError, match="cannot be written"):
            write_report(written, figures=False)
    finally:
        folder.chmod(0o755)


def test_a_file_in_the_place_of_the_folder_is_said(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run", [record(scores=[score(1, 0, 1)])], manifest())
    (folder / "report").write_text("in the way")
    with pytest.raises(StoreError, match="report: cannot be written in: it is no folder"):
        write_page(folder)
    assert not (folder / "report.html").exists()


@pytest.fixture
def run(workspace: Workspace) -> Workspace:
    """A run of the oracle on the five scenes."""
    workspace.write_suite(models=["oracle"])
    done = workspace.run()
    assert done.code == 0, done.err
    return workspace


def test_scenes_are_drawn_from_where_they_are(run: Workspace, tmp_path: Path) -> None:
    write_page(run.out)
    report = Report(run.out)
    scene = report.entry("scenes", report.index["scenes"].index("t5"))
    assert [block["candidate"] for block in scene["blocks"]] == [3, 3, 1, 2]
    assert [block["depend"] for block in scene["blocks"]] == [[], [0], [1], [2]]
    assert report.index["no_scenes"] == ""

    moved = (run.root / "data").rename(tmp_path / "elsewhere")
    write_page(run.out)
    report = Report(run.out)
    assert report.index["starts"]["scenes"] == []
    assert "the data set of the run is not there" in report.index["no_scenes"]
    assert report.entry("records", 0)["reply"]["text"]

    write_page(run.out, moved)
    assert Report(run.out).index["starts"]["scenes"] == [0]


def test_other_data_is_refused(run: Workspace) -> None:
    path = run.root / "data" / "scenes.jsonl"
    path.write_text(path.read_text().replace('"levels": [3]', '"levels": [4]', 1))
    with pytest.raises(DataError, match="is not the data set that the run was made on"):
        write_page(run.out, run.root / "data")
    write_page(run.out)
    assert "or it was changed since" in Report(run.out).index["no_scenes"]


def test_prompts_and_pictures_as_sent_are_there(workspace: Workspace) -> None:
    run = workspace
    run.write_suite(models=["oracle", "alpha"], seeds=[0])
    with Running(OpenAIChat()) as running:
        run.write_models(running.url, "alpha")
        assert run.run().code == 0
    done = run.phyblock("report", run.out)
    assert (done.code, done.err) == (0, "")
    report = Report(run.out)
    facts = yaml.safe_load((run.out / "run.yaml").read_text())
    assert facts["items"]["full_planning"] == 5
    records = [report.entry("records", row) for row in range(10)]
    prompts = [record["prompt"] for record in records]
    # Baselines, whose records stand before those of the model, are sent nothing.
    assert prompts.count(None) == 5
    for prompt in filter(None, prompts):
        sent = report.entry("prompts", prompt["n"])
        assert [message["role"] for message in sent] == ["system", "user"]
        (image,) = prompt["images"]
        data = (run.out / image["file"]).read_bytes()
        assert data.startswith(b"\x89PNG")
