"""The verbs of `phyblock scenes` and `phyblock questions` as a person calls them."""

import re
import shutil
from functools import partial

import click
import pytest
from click.testing import CliRunner
from PIL import Image

from phyblock.cli.main import phyblock
from phyblock.errors import DataError, InputError, StoreError
from phyblock.files import LIST
from phyblock.sim.engine import other_engine
from phyblock.workers import open_workers
from tests.shipped import DATA
from tests.workspace import SCENES, files_below, invoked, read_lines, tower, write_lines

ALONE = ("--jobs", 1)
FEW = ("generate", "--count", 3, "--levels", 2, "--seed", 3)
QUESTION_LINES = "questions.jsonl"


scenes, vqa = partial(invoked, "scenes"), partial(invoked, "questions")


def is_said(done, code, *parts):
    """Hold a command to its exit code and to texts of its output."""
    assert (done.return_value or 0) == code
    assert all(part in done.output for part in parts), done.output


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three scenes that were made."""
    out = tmp_path_factory.mktemp("made") / "few"
    is_said(scenes(*FEW, *ALONE, "--out", out), 0, "3 scenes, all checks passed")
    with pytest.raises(StoreError, match="give another --out"):
        scenes("generate", "--out", out)
    return out


def test_what_is_made_is_verified_and_a_changed_scene_is_named(folder, tmp_path):
    is_said(scenes("verify", *ALONE, folder), 0, "few: all checks passed")
    spoiled = read_lines(folder / "scenes.jsonl")[0]
    spoiled["blocks"][-1]["position"][2] += 0.01
    write_lines(tmp_path / "scenes.jsonl", [spoiled])
    sums = "".join(f"{'0' * 64}  {name}\n" for name in ("scenes.jsonl", "README.md"))
    (tmp_path / "SHA256SUMS").write_text(sums, encoding="utf-8")
    said = ("scenes.jsonl: differs from its checksum", "README.md: is missing")
    said += (f"failed: {spoiled['id']}", "floats 10.00 mm above its support")
    is_said(scenes("verify", *ALONE, tmp_path), 1, *said)


def test_processes_and_shards_make_the_same_files(folder, tmp_path):
    for number in (2, 1, 3):
        shard = ("--shard", f"{number}/3", *ALONE, "--out", tmp_path / "few")
        done = scenes(*FEW, *shard)
        assert ("is done; the first writes" in done.stdout) == (number != 1)
    scenes(*FEW, "--jobs", 2, "--out", tmp_path / "two" / "few")
    with pytest.raises(StoreError, match="is about other work"):
        scenes("generate", "--count", 4, *shard)
    words = ("render", folder, "--out")
    scenes(*words, tmp_path / "drawn", *ALONE)
    scenes(*words, tmp_path / "shards", "--shard", "2/2", *ALONE)
    scenes(*words, tmp_path / "shards", "--shard", "1/2", "--jobs", 2)
    for one, other in ((folder, "few"), (folder, "two/few"), (tmp_path / "drawn", "shards")):
        assert files_below(one).items() <= files_below(tmp_path / other).items()


def test_a_set_holds_nothing_of_those_that_it_excludes(folder, tmp_path):
    said = scenes(*FEW, *ALONE, "--exclude", folder, "--out", tmp_path / "other").stdout
    rejected = int(said.splitlines()[-1].split()[0])
    assert rejected >= 3
    assert f"({rejected} drafts were rejected)" in (tmp_path / "other" / "README.md").read_text()
    for name in (folder, "phyblock-400"):
        compared = scenes("compare", tmp_path / "other", name).stdout
        assert compared == "of 3 scenes: 0 equal, 0 equal but for colors\n"
    lines = (folder / "scenes.jsonl").read_text(encoding="utf-8")
    swapped = {"red": "blue", "blue": "green", "green": "yellow", "yellow": "red"}
    lines = re.sub("|".join(swapped), lambda found: swapped[found[0]], lines)
    (tmp_path / "scenes.jsonl").write_text(lines, encoding="utf-8")
    for name, said in ((folder, "3 equal, 0 equal"), (tmp_path, "0 equal, 3 equal but for colors")):
        assert f"of 3 scenes: {said}" in scenes("compare", folder, name).stdout


def test_a_season_is_made_again_from_what_was_revealed_and_from_nothing_else(tmp_path):
    begin = ("commit", "--public", "round 7 of a beacon", "--out")
    scenes(*begin, tmp_path, "--", "--count", 1, "--levels", 3)
    commitment, secret = tmp_path / "commitment.json", tmp_path / "secret.txt"
    assert secret.read_text().strip() not in commitment.read_text()
    words = ("reveal", commitment, secret, "--public")
    made = []
    for name, public in (("one", "beacon 7"), ("two", "beacon 7"), ("other", "beacon 8")):
        *command, _ = scenes(*words, public).stdout.split()[2:]
        scenes(*command, tmp_path / name, *ALONE)
        made.append((tmp_path / name / "scenes.jsonl").read_bytes())
    assert made[0] == made[1] != made[2]
    assert secret.stat().st_mode & 0o077 == 0
    for bad, message in (
        (("--levels", 7), "give all"),
        (("--seed", 5), "no --seed"),
        (("--out", "foo"), "no --out"),
        (("--exclude", tmp_path / "one"), "can change before the season"),
    ):
        with pytest.raises(click.UsageError, match=message):
            scenes(*begin, tmp_path / "bad", "--", *bad)
    text = commitment.read_text()
    for path, forged, error, message in (
        (commitment, text.replace("--count 1", "--count 1 ; echo"), click.UsageError, "extra argu"),
        (commitment, text.replace('code_sha256": "', 'code_sha256": "x'), DataError, "code_sha256"),
        (secret, "guessed", DataError, "secret_sha256"),
    ):
        commitment.write_text(text)
        path.write_text(forged)
        with pytest.raises(error, match=message):
            scenes(*words, "beacon 7")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("scenes", "--levels", "5"), "give all, or some of 1,2,3,4,5+"),
        (("scenes", "--levels", "1,1"), "give all, or some of 1,2,3,4"),
        (("scenes", "--count", "0"), "0 is not in the range"),
        (("scenes", "--palette", "wood"), "'wood' is not one of"),
        (("scenes", "--shard", "5/4"), "is not a shard: 3/64 is the third of 64"),
        (("questions", "--shard", "0/4"), "is not a shard"),
        *((("questions", "--subtasks", bad), "some of SH,CO,SI") for bad in ("XX", "CO,CO", "")),
    ],
)
def test_bad_options_are_refused(words, said, tmp_path):
    out = tmp_path / "out"
    args = [words[0], "generate", "--out", str(out), *words[1:]]
    done = CliRunner(env={"COLUMNS": "160"}).invoke(phyblock, args)
    assert (done.exit_code, out.exists()) == (2, False)
    assert said in done.output


def test_what_was_made_elsewhere_is_verified_too(workspace, official_checkout, tmp_path):
    """Of one tower the middle block is lifted and misdeclared."""
    spoiled = tower("t6", [3], ("red", "blue", "green"))
    spoiled["blocks"][2]["position"][2] += 0.02
    spoiled["blocks"][1] |= {"depend": [0], "layer": 1}
    spoiled["blocks"][2] |= {"depend": [1], "layer": 2}
    data = workspace.write_scenes(*SCENES, spoiled)
    done = scenes("verify", data, *ALONE)
    is_said(done, 1, "block 3 floats 20.00 mm above its support")
    assert re.search(r"floating +5 +6\n", done.stdout)
    workspace.write_scenes(*SCENES, spoiled, {})
    with pytest.raises(DataError, match=r"scenes\.jsonl:7"):
        scenes("verify", data, *ALONE)
    for path in official_checkout.glob("data/SCENEs_400_*_Jsons/00[01]*.json"):
        copy = tmp_path / "some" / path.relative_to(official_checkout)
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, copy)
    done = scenes("verify", tmp_path / "some", *ALONE)
    assert re.search(r"candidates +2 +2\n", done.stdout)
    assert "checksums" not in done.stdout


def test_a_scene_is_shown_with_its_facts_and_drawn_in_pictures_named_by_what_they_show(
    workspace, tmp_path
):
    data, out = workspace.root / "data", tmp_path / "pictures"
    facts = ("scene t3 · level 3 · 3 blocks · 3 layers", "0 0 75")
    is_said(scenes("show", data, "t3"), 0, *facts)
    with pytest.raises(DataError, match="is not in the data set"):
        scenes("show", data, "t9")
    scenes("render", data, "t1", *ALONE, "--out", out, "--composite", "--gif")
    stem = "t1-oblique-checkerboard"
    tails = (".png", "-composite.png", ".gif")
    assert {path.name for path in out.iterdir()} == {LIST, *(stem + tail for tail in tails)}
    for path in out.glob("t1*"):
        with Image.open(path) as image:
            assert image.format == path.suffix[1:].upper()
    scenes("render", data, "t1", *ALONE, "--out", tmp_path / "all", "--view", "all")
    assert len(list((tmp_path / "all").glob("*.png"))) == 4


@pytest.fixture(scope="module")
def asked(tmp_path_factory):
    """Eight questions about twelve scenes of the built-in set, which stand beside them."""
    folder = tmp_path_factory.mktemp("vqa")
    write_lines(folder / "scenes.jsonl", read_lines(DATA / "phyblock-400" / "scenes.jsonl")[5::33])
    small = ("--subtasks", "CO,OC", "--per-subtask", 4, *ALONE)
    told = vqa("generate", "--data", folder, "--out", folder / "q", *small)
    assert "8 questions in 2 subtasks, " in told.stdout
    assert ("made with" in told.stderr) == bool(other_engine())
    return folder


def test_answers_are_derived_again_and_a_corrupted_one_is_named(asked, tmp_path):
    is_said(vqa("verify", asked / "q", "--data", asked, *ALONE), 0, "all checks passed")
    found = read_lines(asked / "q" / QUESTION_LINES)
    right = found[2]["answer"]
    found[2]["answer"] = "ABCD"["BCDA".index(right)]
    write_lines(tmp_path / QUESTION_LINES, found)
    for name in ("CARD.md", "SHA256SUMS"):
        (tmp_path / name).write_bytes((asked / "q" / name).read_bytes())
    said = f"failed: co-003: the answer is {right}, not {found[2]['answer']}"
    done = vqa("verify", tmp_path, "--data", asked, *ALONE)
    is_said(done, 1, said, "differs from its checksum")


def test_a_question_is_shown_with_its_pictures(asked, tmp_path):
    first = read_lines(asked / "q" / QUESTION_LINES)[0]
    where = ("--questions", asked / "q", "--data", asked)
    done = vqa("show", "co-001", *where, "--out", tmp_path / "co.png")
    is_said(done, 0, first["question"], f"answer: {first['answer']}")
    with Image.open(tmp_path / "co.png") as image:
        assert image.size == (512, 512)
    with pytest.raises(DataError, match="did you mean co-001"):
        vqa("show", "co-0001", *where)


def test_one_command_makes_questions_pictures_and_card(asked, tmp_path):
    words = ("generate", "--data", asked, "--subtasks", "CO,VP", "--per-subtask", 1, "--pictures")
    out = tmp_path / "q"
    vqa(*words, "--shard", "1/1", *ALONE, "--out", out)
    card = (out / "CARD.md").read_text(encoding="utf-8")
    assert f"generate --data {asked}" in card
    assert f"scenes of `{asked.name}`" in card
    assert [q["id"] for q in read_lines(out / QUESTION_LINES)] == ["co-001", "vp-001"]
    drawn = ["co-001-scene.png", *(f"vp-001-{name}.png" for name in (*"ABCD", "scene"))]
    assert sorted(path.name for path in (out / "pictures").glob("*.png")) == drawn
    (out / "pictures" / drawn[0]).write_bytes(b"")
    done = vqa("verify", out, "--data", asked, *ALONE)
    is_said(done, 1)
    assert re.search(r"checksums +8 +9", done.stdout)


def test_an_audit_says_what_it_finds(asked, tmp_path):
    found = read_lines(asked / "q" / QUESTION_LINES)
    again = {**found[0], "id": "co-009"}
    write_lines(tmp_path / QUESTION_LINES, [*found, again])
    pytest.importorskip("sklearn")
    said = ("co-009: asks what an earlier question asks", "9 questions, ")
    is_said(vqa("audit", tmp_path, "--data", asked), 0, *said)


def test_no_ray_and_no_cluster_are_told():
    with pytest.raises(InputError, match="--ray"), open_workers(2, "127.0.0.1:1"):
        pass
