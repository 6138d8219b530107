"""Episodes as pictures."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image

from phyblock.data import read_builtin
from phyblock.sim.film import FilmStep, episode_gif, episode_images
from phyblock.sim.pictures import PictureStyle, goal_png

TASK = read_builtin(Path(__file__).parents[2] / "benchmarks" / "data" / "phyblock-400").tasks[0]
STYLE = PictureStyle(128)
STEPS = (
    FilmStep("begun", "plain", None, ()),
    FilmStep("1. Move(2): placed", "good", 2, TASK.scene.blocks[:1]),
    FilmStep("2. Move(7): overflow", "bad", 7, TASK.scene.blocks[:1]),
    FilmStep("3. Move(40): invalid", "bad", 40, TASK.scene.blocks[:1]),
    FilmStep("completed", "good", None, TASK.scene.blocks),
)


def frames() -> list[np.ndarray]:
    found = episode_images(TASK.scene, TASK.candidates, STEPS, STYLE)
    return [np.asarray(image) for image in found]


def test_each_frame_shows_goal_candidates_and_world() -> None:
    found = frames()
    assert len({frame.shape for frame in found}) == 1
    goal = np.asarray(Image.open(io.BytesIO(goal_png(TASK.scene, STYLE))))
    for frame in found:
        assert np.array_equal(frame[-128:, :128], goal)
    assert np.array_equal(found[-1][-128:, -128:], goal)
    assert not np.array_equal(found[0][-128:, -128:], goal)


def test_a_wrong_move_marks_its_candidate_and_changes_no_world() -> None:
    _, placed, wrong, invalid, _ = frames()
    assert np.array_equal(placed[-128:, -128:], wrong[-128:, -128:])
    middle = [frame[-128:, 131:259] for frame in (placed, wrong, invalid)]
    changed = np.argwhere((middle[1] != middle[2]).any(axis=2))
    # Candidate 7 of the grid of 4 by 4: second row, third column.
    assert changed.min(axis=0).tolist() == [32, 64]
    assert changed.max(axis=0).tolist() == [63, 95]
    assert not np.array_equal(middle[0], middle[2])


def test_a_gif_holds_every_frame() -> None:
    images = episode_images(TASK.scene, TASK.candidates, STEPS, STYLE)
    with Image.open(io.BytesIO(episode_gif(images))) as gif:
        assert gif.n_frames == len(STEPS)
        assert gif.size == images[0].size
