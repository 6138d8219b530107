"""Runs as a leaderboard: what stands in one table, what is refused, what is written where."""

from __future__ import annotations

import json
import shutil
import zlib
from base64 import b64decode
from collections.abc import Collection, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from phyblock.bundle import bundle_run
from phyblock.errors import SpecError, StoreError
from phyblock.records.files import known_records
from phyblock.records.record import Record
from phyblock.results.estimates import track_measures
from phyblock.tracks.base import kind_of
from phyblock.web import leaderboard
from phyblock.web.leaderboard import (
    SiteRun,
    all_values,
    board_of,
    check_runs_alike,
    entries_of,
    open_runs,
    values_of,
    write_site,
)
from phyblock.web.pack import Sources
from phyblock.web.report import rank_texts
from tests.report.factory import manifest, record, run_of, score
from tests.workspace import Workspace


def tree(folder: Path) -> dict[str, bytes]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}


def data_of(made: Workspace) -> list[Path]:
    return [made.root / "data", made.root / "questions"]


def test_runs_and_bundles_become_one_folder_the_same_every_time(
    made: Workspace, tmp_path: Path
) -> None:
    paths = [made.root / "first", made.root / "later.zip"]
    found = write_site(paths, tmp_path / "a", data_of(made))
    assert (found.models, found.samples) == (4, 58)
    assert not found.lacking
    write_site(paths, tmp_path / "b", data_of(made))
    assert tree(tmp_path / "a") == tree(tmp_path / "b")
    assert str(made.root).encode() not in b"".join(tree(tmp_path / "a").values())


def test_the_board_says_what_tables_and_comparisons_say(made: Workspace) -> None:
    with ExitStack() as kept:
        runs = open_runs([made.root / "first"], (), kept)
        entries = entries_of(runs)
        board = board_of(runs, entries, all_values(runs))
    rows = {row["name"]: row for row in board["rows"]}
    assert rows["oracle"]["values"]["full_planning/A/Overall F1"][0] == 100.0
    facts = rows["oracle"]["facts"]["full_planning"]
    assert (facts["expected"], facts["done"], facts["solved"]) == (5, 5, 5)
    assert not any(row["ranks"] for row in board["rows"])
    settings = {column["setting"] for column in board["columns"] if column["track"] == "vqa"}
    assert settings == {""}


SCENES = [str(number) for number in range(12)]


def planned(
    seed: int = 0, rules: Sequence[str] = (), left_out: Collection[str] = (), **right: int
) -> SiteRun:
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
    return SiteRun("run", run_of(records, facts), False, Sources())


def ranks_of(*runs: SiteRun) -> dict[str, Any]:
    board = board_of(runs, entries_of(runs), all_values(runs))
    return {row["name"]: row["ranks"].get("full_planning") for row in board["rows"]}


def test_models_without_a_common_sample_are_not_told_apart() -> None:
    ranks = ranks_of(planned(a=4), planned(b=1), planned(9, c=0))
    assert ranks == {"a": [1, 2], "b": [2, 3], "c": [1, 3]}


def test_models_alone_have_ranks_the_same_on_the_site_and_in_the_report() -> None:
    run = planned(rules=["rule"], rule=4, a=3, b=1)
    ranks = ranks_of(run)
    assert ranks == {"rule": None, "a": [1, 1], "b": [2, 2]}
    said = {name: str(found[0]) for name, found in ranks.items() if found}
    assert rank_texts(run.run, "full_planning") == said


def test_a_model_of_which_samples_were_left_out_has_no_rank() -> None:
    run = planned(left_out=SCENES[1:], cherry=4, a=3, b=1)
    assert ranks_of(run) == {"cherry": None, "a": [1, 1], "b": [2, 2]}
    board = board_of([run], entries_of([run]), all_values([run]))
    lacking = {row["name"]: row["lacking"].get("full_planning") for row in board["rows"]}
    assert lacking == {"cherry": f"1 of {len(SCENES)} answered", "a": None, "b": None}


def test_days_are_those_on_which_a_reply_was_asked_for_and_else_not_known() -> None:
    sent, cached = {"attempts": 1}, {"attempts": 0, "cached": True}
    how = {
        "called": (sent, sent),
        "partly": (sent, cached),
        "cached": (cached, cached),
        "recorded": ({"attempts": 0}, {"attempts": 0}),
    }
    records = [
        {
            **record(model, f"00{n}", 0, [score(1, 1, 1)], **reply),
            "time": f"2026-11-2{n}T23:59:59+00:00",
        }
        for model, each in how.items()
        for n, reply in enumerate(each)
    ]
    run = run_of(records, manifest(models=how, seeds=[0]))
    facts = values_of(run, "full_planning").facts
    assert {model: (fact["asked"], fact["cached"]) for model, fact in facts.items()} == {
        "called": (("2026-11-20", "2026-11-21"), 0),
        "partly": (("2026-11-20", "2026-11-20"), 1),
        "cached": (None, 2),
        "recorded": (None, 0),
    }


def test_a_sample_without_a_value_has_none() -> None:
    nothing = [score(0, 0, 0, setting=setting) for setting in "AB"]
    records = [record("a", "000", 0, nothing), record("a", "001", 0, [score(1, 1, 1)])]
    run = run_of(records, manifest(models=["a"], seeds=[0]))
    assert values_of(run, "full_planning").samples == {"a": {("001", "001", 0, ""): 50.0}}


def chunks(folder: Path, kind: str) -> list[Any]:
    """What stands in the chunks of a kind, as the page unpacks it."""
    texts = [path.read_text() for path in sorted(folder.glob(f"data/*/{kind}-*.js"))]
    packed = [text.split("'")[5] for text in texts]
    return [entry for one in packed for entry in json.loads(zlib.decompress(b64decode(one)))]


def test_replays_have_all_that_tracks_add_to_records(made: Workspace, tmp_path: Path) -> None:
    write_site([made.root / "first"], tmp_path / "site", data_of(made))
    found = set().union(*(entry.keys() for entry in chunks(tmp_path / "site", "replays")))
    added: set[str] = set()
    for line in (made.root / "first" / "records.jsonl").read_text(encoding="utf-8").splitlines():
        fields = known_records().validate_json(line)
        own = type(fields).model_fields.keys() - Record.model_fields.keys()
        added |= {name for name in own if getattr(fields, name) is not None}
    assert added <= found
    assert {"pose", "progress"} <= added
    assert not {"prompt", "time", "counts"} & found


def site_run(where: str, **facts: Any) -> SiteRun:
    return SiteRun(where, run_of([], manifest(**facts)), False, Sources())


def in_track(track: str, **more: Any) -> dict[str, Any]:
    """Facts of a run of one track alone, with its identity."""
    facts = manifest()
    suite = {**facts["suite"], "tracks": [track]}
    data = {"name": "d", "sha256": "0" * 64, "version": 2}
    return {
        "suite": suite,
        "dataset": data,
        "tracks": {track: {"prompt": {"name": "p", "version": "a" * 64}}},
        "created": "2026-11-22T10:00:00+00:00",
        **more,
    }


def test_a_model_asked_different_things_is_one_row_and_the_same_things_two() -> None:
    plan, vqa = (site_run(track, **in_track(track)) for track in ("full_planning", "vqa"))
    one = entries_of([plan, vqa])
    assert [entry.name for entry in one] == ["alpha", "beta"]
    assert one[0].runs == {"full_planning": 0, "vqa": 1}
    later = site_run("later", **in_track("full_planning", created="2026-11-23", identity="1" * 64))
    two = entries_of([plan, later])
    assert [entry.name for entry in two][::2] == ["alpha (2026-11-22)", "alpha (2026-11-23)"]
    same_day = site_run("x", **in_track("full_planning", identity="1" * 64))
    names = [entry.name for entry in entries_of([plan, same_day])]
    assert names[0] == "alpha (2026-11-22, run 00000000)"
    assert len(set(names)) == len(names)


def shown(images: dict[str, Any], digest: str) -> dict[str, Any]:
    facts = in_track("full_planning")
    tracks = {"full_planning": {**facts["tracks"]["full_planning"], "pictures": digest}}
    return {"suite": {**facts["suite"], "images": images}, "tracks": tracks}


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (shown({"background": "lawn"}, "b"), "images.background"),
        (shown({"size_px": 512, "view": "top"}, "b"), "images.view"),
        ({"dataset": {"name": "d", "sha256": "0" * 64, "version": 3}}, "dataset.version"),
        ({"dataset": {"name": "e", "sha256": "0" * 64, "version": 2}}, "dataset.name"),
        ({"dataset": {"name": "d", "sha256": "1" * 64, "version": 2}}, "dataset.sha256"),
        (
            {"tracks": {"full_planning": {"prompt": {"name": "p", "version": "b" * 64}}}},
            "tracks.full_planning.prompt",
        ),
        (
            {"suite": {**manifest(level1="membership")["suite"], "tracks": ["full_planning"]}},
            "scoring.level1",
        ),
    ],
)
def test_runs_that_differ_in_what_decides_are_refused_with_what_differs(
    change: dict[str, Any], field: str
) -> None:
    first = site_run("one", **in_track("full_planning", **shown({}, "a")))
    other = site_run("two", **in_track("full_planning", **change))
    with pytest.raises(SpecError) as caught:
        check_runs_alike([first, other])
    (problem,) = caught.value.problems
    assert (problem.where, problem.field) == ("two", field)
    assert "cannot stand in one table with one" in problem.message
    assert ("--limit" in problem.hint) == (field == "dataset.sha256")


def carried_out(version: int) -> dict[str, Any]:
    facts = in_track("pose_planning")
    own = facts["tracks"]["pose_planning"]
    return {**facts, "tracks": {"pose_planning": {**own, "carrying": version}}}


@pytest.mark.parametrize(("before", "after"), [(2, 1), (1, 2)])
def test_plans_that_were_carried_out_otherwise_do_not_stand_in_one_table(
    before: int, after: int
) -> None:
    first, other = (site_run(f"{n}", **carried_out(n)) for n in (before, after))
    with pytest.raises(SpecError) as caught:
        check_runs_alike([first, other])
    (problem,) = caught.value.problems
    assert problem.field == "tracks.pose_planning.carrying"
    assert (problem.found, problem.allowed) == (str(after), str(before))
    assert "run the older one again" in problem.hint
    measures = {measure.name: measure for measure in track_measures("pose_planning")}
    check = kind_of("pose_planning").report().check_alike
    assert check is not None
    check(other.run, first.run, [], measures["f1_c"])
    with pytest.raises(SpecError, match="carried plans out otherwise"):
        check(other.run, first.run, [], measures["final_iou"])
    check_runs_alike([first, site_run("same", **carried_out(before))])
    check_runs_alike([site_run("old", **carried_out(None)), site_run("1", **carried_out(1))])


def test_a_recording_that_was_asked_elsewhere_stands_beside_any_prompt() -> None:
    first = site_run("one", **in_track("full_planning"))
    larger = site_run("two", **in_track("full_planning", **shown({"size_px": 512}, "b")))
    check_runs_alike([site_run("one", **in_track("full_planning", **shown({}, "a"))), larger])
    asked = {"full_planning": {"prompt": None, "pictures": None}}
    check_runs_alike([first, site_run("two", **in_track("full_planning", tracks=asked))])


def test_a_folder_of_somebody_else_is_refused_and_left_as_it_is(
    made: Workspace, tmp_path: Path
) -> None:
    theirs = tmp_path / "thesis"
    (theirs / "data").mkdir(parents=True)
    (theirs / "data" / "a.js").write_text("mine")
    with pytest.raises(StoreError, match="is not empty and holds no site"):
        write_site([made.root / "first"], theirs)
    assert tree(theirs) == {"data/a.js": b"mine"}
    run = made.root / "first"
    before = tree(run)
    with pytest.raises(StoreError, match="holds no site"):
        write_site([made.root / "first"], run)
    assert tree(run) == before


def test_a_build_that_was_stopped_never_looks_whole_and_what_is_not_ours_stays(
    made: Workspace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "site"
    write_site([made.root / "later"], out, title="One")
    (out / "CNAME").write_text("example.org")
    before = tree(out)

    def stopped(*_: object, **__: object) -> str:
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(leaderboard, "fill", stopped)
        for place in (tmp_path / "new", out):
            with pytest.raises(KeyboardInterrupt):
                write_site([made.root / "later"], place, title="Two")
    assert not (tmp_path / "new" / "index.html").exists()
    left = tree(out)
    kept = [name for name in before if name != ".generated"]
    assert {name: left[name] for name in kept} == {name: before[name] for name in kept}
    write_site([made.root / "later"], tmp_path / "new", title="Two")
    write_site([made.root / "later"], out, title="Two")
    assert (out / "CNAME").read_text() == "example.org"
    assert tree(out).keys() - {"CNAME"} == tree(tmp_path / "new").keys()
    assert "<title>Two" in (out / "index.html").read_text(encoding="utf-8")


def test_a_bundle_that_does_not_verify_is_refused_by_the_command(
    made: Workspace, tmp_path: Path
) -> None:
    copy = tmp_path / "run"
    shutil.copytree(made.root / "later", copy)
    lines = (copy / "records.jsonl").read_text(encoding="utf-8").splitlines()
    first = json.loads(lines[0])
    first["scores"][0]["tp"] += 1
    text = "\n".join([json.dumps(first), *lines[1:]]) + "\n"
    (copy / "records.jsonl").write_text(text, encoding="utf-8")
    with pytest.raises(StoreError, match="records: does not verify"):
        bundle_run(copy, tmp_path / "b.zip")
    whole = (made.root / "later.zip").read_bytes()
    (made.root / "cut.zip").write_bytes(whole[:-100])
    done = made.phyblock("site", "first", "cut.zip", "--out", "refused")
    assert done.code == 2
    assert "cut.zip" in done.err
    assert not (made.root / "refused").exists()


def test_a_run_given_twice_is_refused(made: Workspace, tmp_path: Path) -> None:
    paths = [made.root / "later", made.root / "later.zip"]
    with pytest.raises(SpecError, match="is the same run as"):
        write_site(paths, tmp_path / "s", data_of(made))
