"""`phyblock episode`: an episode of a run, as text and as pictures."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from phyblock.data import read_builtin
from phyblock.records.files import read_records
from phyblock.tracks.step_planning import EpisodeRecord
from phyblock.tracks.step_planning_results import OUTCOME_NAMES, episode_film, episode_table
from tests.workspace import Workspace

SEESAW = {
    "id": "seesaw",
    "levels": [2],
    "parents": ["seesaw"],
    "blocks": [
        *(
            {"order": n, "type": "cube", "color": color, "layer": 1, "depend": [0],
             "position": [x, 0, 0.025], "euler": [0, 0, 0]}
            for n, color, x in ((1, "red", 0), (2, "blue", 0.11))
        ),
        {"order": 3, "type": "cuboid3", "color": "yellow", "layer": 2, "depend": [1],
         "position": [0.055, 0, 0.0625], "euler": [0, 0, 0]},
    ],
    "candidates": [
        {"type": t, "color": c, "euler": [0, 0, 0], "required": 1}
        for t, c in (("cube", "red"), ("cube", "blue"), ("cuboid3", "yellow"))
    ],
}  # fmt: skip


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory, pictures_dir: Path) -> Workspace:
    """A run of oracle and repeat; in some of eight seeds the oracle lets the bar fall."""
    workspace = Workspace(tmp_path_factory.mktemp("played"), pictures_dir)
    workspace.write_scenes(SEESAW)
    workspace.write_suite(
        tracks=["step_planning"],
        models=["oracle", "repeat"],
        seeds=list(range(8)),
        steps={"physics": "strict"},
    )
    assert workspace.run("--no-cache").code == 0
    return workspace


def test_an_episode_is_told_and_shown(played: Workspace) -> None:
    endings = {r["seed"]: r["ending"] for r in played.records() if r["model"] == "oracle"}
    assert set(endings.values()) == {"completed", "collapsed"}
    fallen = next(seed for seed, ending in endings.items() if ending == "collapsed")
    gif, sheet = played.root / "a" / "out.gif", played.root / "out.png"
    sample = f"oracle/seesaw/s{fallen}"
    done = played.phyblock(
        "episode", "out", sample, "--gif", gif, "--sheet", sheet, "--size", "128"
    )
    assert (done.code, done.err) == (0, "")
    assert "Collapsed" in done.out
    assert "2  Move(3)    Placed" in done.out
    with Image.open(gif) as frames:
        assert frames.n_frames == 4
        frames.seek(2)
        before = frames.convert("RGB").crop((262, 17, 390, 145)).tobytes()
        frames.seek(3)
        assert frames.convert("RGB").crop((262, 17, 390, 145)).tobytes() != before
    with Image.open(sheet) as picture:
        assert picture.format == "PNG"


def test_frames_say_what_became_of_steps_as_tables_do(played: Workspace) -> None:
    (task,) = read_builtin(played.root / "data").tasks
    for record in read_records(played.root / "out"):
        assert isinstance(record, EpisodeRecord)
        _, *frames, last = episode_film(record, task)
        outcomes = [row[2] for row in episode_table(record).rows]
        assert all(
            frame.caption.endswith(f": {said}")
            for frame, said in zip(frames, outcomes, strict=True)
            if said != "Done"
        )
        assert set(outcomes) <= set(OUTCOME_NAMES.values())
        turns = tuple(turn.model_copy(update={"outcome": "empty"}) for turn in record.turns)
        unread = record.model_copy(update={"turns": turns})
        assert {row[2] for row in episode_table(unread).rows} == {"Empty"}
        assert last.caption.startswith(f"{record.progress[-1]} of 3 blocks placed; ended: ")


@pytest.mark.parametrize(
    ("sample", "message"),
    [("no-such", "holds no such episode"), ("oracle", "holds 8 such episodes")],
)
def test_which_episode_is_meant_must_be_clear(played: Workspace, sample: str, message: str) -> None:
    done = played.phyblock("episode", "out", sample)
    assert (done.code, len(done.errors)) == (2, 1)
    assert message in done.errors[0]
    allowed = done.errors[0].partition("allowed")[2]
    assert "step_planning/" in allowed
    assert f"and {11 if sample == 'no-such' else 3} more" in allowed


def test_a_run_without_episodes_says_so(played: Workspace) -> None:
    words = ("--set", "tracks=[full_planning]", "--models", "oracle", "--out", "plans")
    assert played.phyblock("run", "suite.yaml", *words, "--no-report").code == 0
    done = played.phyblock("episode", "plans", "oracle")
    assert (done.code, len(done.errors)) == (2, 1)
    assert "holds no episodes of step planning" in done.errors[0]


def test_a_data_set_that_was_moved_can_be_named(played: Workspace) -> None:
    moved = (played.root / "data").rename(played.root / "elsewhere")
    wanted = ("episode", "out", "repeat/seesaw/s0", "--gif", "x.gif")
    done = played.phyblock(*wanted)
    assert (done.code, "--data" in done.err) == (2, True)
    assert played.phyblock(*wanted, "--data", "elsewhere").code == 0
    assert (played.root / "x.gif").stat().st_size > 1000
    moved.rename(played.root / "data")
