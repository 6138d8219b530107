"""The data of pages: what is packed comes back, headlines are those of tables, runs agree."""

import base64
import json
import math
import re
import zlib
from bisect import bisect_right

import pytest
from hypothesis import given
from hypothesis import strategies as st

from phyblock.errors import DataError, SpecError
from phyblock.files import OutFolder
from phyblock.records.files import read_records
from phyblock.records.record import Record
from phyblock.results.estimates import Headline
from phyblock.results.load import load_run
from phyblock.results.tables import write_tables
from phyblock.scoring.plan import Counts
from phyblock.web.board import SiteRun, Sources, board_of, entries_of
from phyblock.web.pack import Pack, pack_samples
from phyblock.web.pages import check_runs, write_report, write_site
from tests.web.factory import JSON, laws, manifest, record, record_lists, run_of, score, write_run
from tests.workspace import files_below, problem_of

SCENES = [str(number) for number in range(12)]


def unpacked(script):
    """The data of a script: JSON, deflated, in base 64."""
    text = script.read_text(encoding="ascii")
    (packed,) = re.findall(r"^phyblockTake\('[^']*','[^']*','([A-Za-z0-9+/=]*)'\)\n$", text)
    return json.loads(zlib.decompress(base64.b64decode(packed)))


def entries_in(folder, starts):
    return [entry for n in range(len(starts)) for entry in unpacked(folder / f"records-{n}.js")]


class Report:
    """A page's reading of a folder of scripts."""

    def __init__(self, run, data=None, made=None):
        path = write_report(made or write_tables(run), data)
        self.page = path.read_text(encoding="utf-8")
        self.folder = run / self.page.partition('data-folder="')[2].partition('"')[0]
        self.index = unpacked(self.folder / "samples.js")

    def entry(self, kind, number):
        starts = self.index["starts"][kind]
        chunk = bisect_right(starts, number) - 1
        return unpacked(self.folder / f"{kind}-{chunk}.js")[number - starts[chunk]]


@laws
@given(st.lists(JSON, max_size=6))
def test_what_is_packed_comes_back(tmp_path_factory, entries):
    folder = tmp_path_factory.mktemp("pack")
    made = Pack(folder, "records", "build")
    assert [made.add(entry) for entry in entries] == list(range(len(entries)))
    made.close()
    assert entries_in(folder, made.starts) == entries


@laws
@given(record_lists(), st.randoms(use_true_random=False))
def test_the_newest_record_of_every_sample_is_there_once(tmp_path_factory, records, random):
    folder = tmp_path_factory.mktemp("run")
    some = [one for one in records if random.random() < 0.5]
    stale = [one | {"outcome": "missing", "reply": None} for one in some]
    write_run(folder, [*stale, *records], manifest())
    run = [SiteRun("run", load_run(folder), Sources())]
    index = pack_samples(folder, "build", run, entries_of(run), failures=6)
    entries = entries_in(folder, index["starts"]["records"])
    by_name = {one["sample"]: one for one in records}
    rows = index["rows"]
    assert len(entries) == len(rows["item"]) == len(by_name)
    for row, entry in enumerate(entries):
        model, key = ("alpha", "beta")[rows["entry"][row]], index["items"]["key"][rows["item"][row]]
        one = by_name.pop(f"full_planning/{model}/{key}/s{rows['seed'][row]}")
        told = one["reply"]
        assert entry.get("reply", {}).get("text") == (told and told["text"])
        assert index["outcomes"][rows["outcome"][row]] == one["outcome"]
        score = next(score for score in one["scores"] if score["matcher"] == "optimal")
        f1 = Counts(score["tp"], score["fp"], score["fn"]).f1
        # Of models that say nothing at all in a level, no sample has a value.
        assert rows["score"][row] in (f1 if f1 is None else round(100 * f1, 1), None)


def test_every_text_of_the_page_is_escaped_and_only_our_script_may_run(tmp_path):
    hostile = "<script>alert(1)</script><img src=x onerror=alert(2)>\"'&"
    facts = manifest(models=[hostile], suite={"models": ["alpha"], "description": hostile})
    folder = write_run(tmp_path / "run", [record(hostile, scores=[score(1, 0, 1)])], facts)
    page = Report(folder).page
    assert "<img src=x" not in page
    assert page.count("<script>") == 1 == page.count("<script type=")
    policy = page.partition('Content-Security-Policy" content="')[2].partition('"')[0]
    assert policy.startswith("default-src 'none'; script-src 'sha256-".replace("'", "&#39;"))
    assert not re.search("unsafe|http|//cdn|@import", policy)
    assert not re.search(r"https?://(?!www\.w3\.org/2000/svg)|@import", page)


def test_scenes_are_drawn_from_where_they_are_and_from_no_other_data(workspace, tmp_path):
    workspace.write_suite(models=["oracle"])
    workspace.completed()
    out, data = workspace.out, workspace.root / "data"
    made = write_tables(out)
    report = Report(out, made=made)
    scene = report.entry("scenes", report.index["scenes"].index("t5"))
    placed = [(block["candidate"], block["depend"]) for block in scene["blocks"]]
    assert placed == [(3, []), (3, [0]), (1, [1]), (2, [2])]
    assert report.index["lacking"] == ""
    moved = data.rename(tmp_path / "elsewhere")
    report = Report(out, made=made)
    assert report.index["starts"]["scenes"] == []
    assert "the data set of the run is not there" in report.index["lacking"]
    assert report.entry("records", 0)["reply"]["text"]
    assert Report(out, moved, made).index["starts"]["scenes"] == [0]
    path = moved.rename(data) / "scenes.jsonl"
    path.write_text(path.read_text().replace('"levels": [3]', '"levels": [4]', 1))
    with pytest.raises(DataError, match="is not the data set that the run was made on"):
        Report(out, data, made)
    assert "or it was changed since" in Report(out, made=made).index["lacking"]


def test_boards_say_what_tables_say(made):
    one = (SiteRun("run", load_run(made.out), Sources()),)
    board = board_of(one, entries_of(one))
    tracks = {track["name"]: track for track in board["tracks"]}
    assert tracks["step_planning"]["main"] == "F1 of attempts"
    for column in board["columns"]:
        if column["setting"] not in ("", "A"):
            continue
        values = Headline(one[0].run, column["track"]).values
        for row in board["rows"]:
            value = values.get((row["name"], column["heading"]))
            shown = row["values"].get(column["id"])
            if value is None or math.isnan(value.value):
                assert shown is None
            else:
                wanted = (value.value, value.lo, value.hi)
                assert shown == [None if math.isnan(n) else round(n, 4) for n in wanted]


def test_runs_and_bundles_become_one_folder_the_same_every_time(made, tmp_path):
    paths = [made.root / "first", made.root / "later.zip"]
    data = [made.root / "data", made.root / "questions"]
    for name in "ab":
        found = write_site(paths, tmp_path / name, data)
        assert (found.models, found.samples, found.lacking) == (4, 104, "")
    assert files_below(tmp_path / "a") == files_below(tmp_path / "b")
    assert str(made.root).encode() not in b"".join(files_below(tmp_path / "a").values())
    with pytest.raises(SpecError, match="is the same run as"):
        write_site([made.root / "later", *paths[1:]], tmp_path / "s", data)
    replays = [e for path in (tmp_path / "a").glob("data/*/records-*.js") for e in unpacked(path)]
    shown, added = set().union(*replays), set()
    for fields in read_records(made.root / "first"):
        own = type(fields).model_fields.keys() - Record.model_fields.keys()
        added |= {name for name in own if getattr(fields, name) is not None}
    assert {"pose", "ending"} <= added <= shown
    assert not {"prompt", "time", "counts"} & shown


def planned(seed=0, rules=(), left_out=(), **right):
    """A run of models by how many of four steps of every scene they have right; `rules` are
    baselines among them, and of scenes `left_out` the first has no record.
    """
    records = [
        record(model, scene, seed, [score(n, 4 - n, 4 - n, setting=setting) for setting in "AB"])
        for place, (model, n) in enumerate(right.items())
        for scene in SCENES
        if place or scene not in left_out
    ]
    facts = manifest(models=right, seeds=[seed], items={"full_planning": len(SCENES)})
    for model in facts["models"]:
        model["kind"] = "baseline" if model["name"] in rules else "litellm"
    return SiteRun("run", run_of(records, facts), Sources())


def test_only_whole_models_have_ranks():
    def board(*runs):
        return board_of(runs, entries_of(runs))["rows"]

    def ranks_of(*runs):
        return {row["name"]: row["ranks"].get("full_planning") for row in board(*runs)}

    # Models without a common sample are not told apart.
    ranks = ranks_of(planned(a=4), planned(b=1), planned(9, c=0))
    assert ranks == {"a": [1, 2], "b": [2, 3], "c": [1, 3]}
    run = planned(rules=["rule"], rule=4, a=3, b=1)
    assert ranks_of(run) == {"rule": None, "a": [1, 1], "b": [2, 2]}
    assert ranks_of(planned(rules=["rule"], rule=4, a=3)) == {"rule": None, "a": [1, 1]}
    run = planned(left_out=SCENES[1:], cherry=4, a=3, b=1)
    assert ranks_of(run) == {"cherry": None, "a": [1, 1], "b": [2, 2]}
    lacking = [row["lacking"].get("full_planning", "") for row in board(run)]
    assert f"1 of {len(SCENES)} answered" in lacking


def site_run(where, track="full_planning", suite=None, **more):
    """A run of one track alone, with its identity."""
    tracks = {track: {"prompt": {"name": "p", "version": "a" * 64}}}
    facts = {"tracks": tracks, "created": "2026-11-22T10:00:00+00:00", **of_data(), **more}
    made = manifest(suite={"tracks": [track], **(suite or {})}, **facts)
    return SiteRun(where, run_of([], made), Sources())


def test_a_model_asked_different_things_is_one_row_and_the_same_things_two():
    plan, vqa = (site_run(track, track) for track in ("full_planning", "vqa"))
    one = entries_of([plan, vqa])
    assert [entry.name for entry in one] == ["alpha", "beta"]
    assert one[0].runs == {"full_planning": 0, "vqa": 1}
    for hour, digit in ((20, "0"), (10, "1")):
        later = site_run("x", created=f"2026-11-22T{hour}:00:00+00:00", identity=digit * 64)
        names = [entry.name for entry in entries_of([plan, later])]
        assert names[0] == "alpha (2026-11-22 10:00:00, run 00000000)"
        assert names[2] == f"alpha (2026-11-22 {hour}:00:00, run {digit * 8})"
        assert len(set(names)) == len(names)


def test_a_baseline_is_one_row_of_all_runs_where_its_result_is_the_same():
    first = planned(rules=["rule"], rule=2, a=1)
    for right, models in ((2, ["rule", "a", "b"]), (1, ["rule", "a", "rule", "b"])):
        runs = [first, planned(rules=["rule"], rule=right, b=3)]
        rows = board_of(runs, entries_of(runs))["rows"]
        assert [row["model"] for row in rows] == models
        assert len({row["name"] for row in rows} & {"rule"}) == (len(models) == 3)


def shown(images, digest):
    identity = {"prompt": {"name": "p", "version": "a" * 64}, "pictures": digest}
    return {"suite": {"images": images}, "tracks": {"full_planning": identity}}


def of_data(name="d", sha256="0"):
    return {"dataset": {"name": name, "sha256": sha256 * 64, "version": 2}}


def of_track(**identity):
    return {"tracks": {"full_planning": identity}}


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (shown({"background": "lawn"}, "b"), "images.background"),
        (of_data(name="e"), "dataset.name"),
        (of_data(sha256="1"), "dataset.sha256"),
        (of_track(prompt={"name": "p", "version": "b" * 64}), "tracks.full_planning.prompt"),
        ({"level1": "membership"}, "scoring.level1"),
        (of_track(execution=2), "tracks.full_planning.execution"),
    ],
)
def test_runs_that_differ_in_what_decides_are_refused_with_what_differs(change, field):
    first = site_run("one", **shown({}, "a"))
    first.run.manifest.tracks["full_planning"]["execution"] = 1
    other = site_run("two", **change)
    problem = problem_of(SpecError, check_runs, [first, other])
    assert (problem.where, problem.field) == ("two", field)


def test_runs_of_different_limits_are_told_so():
    limits = {"a": 4, "b": None}
    runs = [site_run(name, limit=n, **of_data(sha256=name)) for name, n in limits.items()]
    with pytest.raises(SpecError, match=r"their limits \(--limit\) are none and 4"):
        check_runs(runs)
    assert [one["limit"] for one in board_of(runs, entries_of(runs))["runs"]] == [4, None]


def test_a_recording_and_a_larger_picture_stand_beside_any_other():
    larger, recorded = shown({"size_px": 512}, "b"), of_track(prompt=None, pictures=None)
    for one, other in ((shown({}, "a"), larger), ({}, recorded)):
        check_runs([site_run("one", **one), site_run("two", **other)])


def test_a_build_that_was_stopped_never_looks_whole_and_what_is_not_ours_stays(
    made, tmp_path, monkeypatch
):
    later, out, new = [made.root / "later"], tmp_path / "site", tmp_path / "new"
    write_site(later, out, title="One")
    (out / "CNAME").write_text("example.org")
    before = files_below(out)

    def stopped(*_, **__):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(OutFolder, "write", stopped)
        for place in (new, out):
            with pytest.raises(KeyboardInterrupt):
                write_site(later, place, title="Two")
    assert not (new / "index.html").exists()
    left = files_below(out)
    assert all(left[name] == before[name] for name in before if name != ".generated")
    for place in (new, out):
        write_site(later, place, title="Two")
    assert files_below(out).keys() == {*files_below(new), "CNAME"}
    assert "<title>Two" in (out / "index.html").read_text(encoding="utf-8")
