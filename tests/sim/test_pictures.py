"""Pictures: cameras that cut nothing off, blocks that stand out, the same bytes for one recipe."""

import io
import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from PIL import Image, ImageSequence

from phyblock.domain.blocks import BLOCK_TYPES, KIT_PALETTE
from phyblock.domain.question import Mark, QuestionPicture
from phyblock.domain.scene import Candidate, CandidateSet, Scene
from phyblock.errors import DataError
from phyblock.making.scenes.production import make_candidates
from phyblock.making.scenes.sketch import POSES
from phyblock.sim import pictures
from phyblock.sim import question_pictures as asked
from phyblock.sim.backgrounds import GROUNDS
from phyblock.sim.engine import Pose, quat_xyzw_to_euler_deg
from phyblock.sim.question_pictures import question_key, question_png, seen
from phyblock.sim.raster import Window, frame, view_axes
from phyblock.types import BACKGROUNDS
from tests.shipped import TASKS
from tests.sim.structures import block, clouds, tower

SCENE = TASKS[0].scene
STYLE, SMALL = pictures.PictureStyle(), pictures.PictureStyle(size_px=128)
MARGIN, LEAST_CONTRAST = 0.16, 3.0
EVERY_LOOK = [
    Candidate(kind, color, euler) for kind, color in KIT_PALETTE for euler in POSES[kind].values()
]
VIEW = (45.0, 22.0)
TOWER = (*tower(2), block(3, "cube", (0.1, 0.0, 0.025)))
PLAIN = QuestionPicture("scene", TOWER, VIEW)
MARKED = replace(PLAIN, marks=(Mark("A", (0.0, 0.0, 0.1)), Mark("B", (0.1, 0.0, 0.05))))
angles = st.floats(-180, 180)
elevations = st.floats(1, 90)
coordinates = st.floats(-1, 1)
windows = st.builds(
    Window, st.floats(-1, -0.2), st.floats(0.1, 1), st.floats(-1, -0.3), st.floats(0.2, 1)
)
slowly = [
    pytest.param(name, marks=pytest.mark.slow if GROUNDS[name].texture else ())
    for name in BACKGROUNDS
]


def pixels(png):
    with Image.open(io.BytesIO(png)) as image:
        return np.asarray(image.convert("RGB")).astype(np.int64)


@given(angles, elevations)
def test_axes_are_a_right_handed_frame(azimuth_deg, elevation_deg):
    right, up, forward = axes = view_axes(azimuth_deg, elevation_deg)
    assert_allclose(axes @ axes.T, np.eye(3), atol=1e-11)
    assert_allclose(np.cross(right, up), -forward, atol=1e-11)
    assert up[2] >= -1e-12
    assert right[2] == 0


@given(
    st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=20),
    angles,
    elevations,
    windows,
    st.floats(0.1, 2.1),
)
def test_framing_keeps_every_point_in_the_window_and_comes_as_close_as_it_may(
    cloud, azimuth, elevation, window, near_m
):
    where = np.array(cloud)
    camera = frame(where, view_axes(azimuth, elevation), window, near_m)
    across, up = camera.project(where).T
    assert window.left - 1e-9 <= across.min() <= across.max() <= window.right + 1e-9
    assert window.bottom - 1e-9 <= up.min() <= up.max() <= window.top + 1e-9
    depths = (where - camera.eye_m) @ camera.axes[2]
    assert depths.min() >= near_m - 1e-9
    assert camera.near_m < depths.min() <= depths.max() < camera.far_m
    spans = np.ptp([across, up], axis=1) / [window.right - window.left, window.top - window.bottom]
    is_close = depths.min() == pytest.approx(near_m, abs=1e-6)
    assert spans.max() == pytest.approx(1.0, abs=1e-6) or is_close


@pytest.mark.parametrize("every", [16, pytest.param(1, marks=pytest.mark.slow)])
def test_blocks_of_wide_goals_are_large(every):
    for task in TASKS[::every]:
        style = pictures.goal_style(task.scene, STYLE)
        camera = pictures.goal_camera(task.scene, style)
        places = np.array([one.position_m for one in task.scene.blocks])
        farthest_m = ((places - camera.eye_m) @ camera.axes[2]).max()
        assert 0.05 / camera.width_m(farthest_m) * style.size_px >= 0.08 * STYLE.size_px


@given(st.lists(st.sampled_from(EVERY_LOOK), min_size=1, max_size=16), st.floats(1, 89))
@settings(max_examples=30)
def test_all_candidates_of_a_grid_have_one_scale_and_the_largest_fills_its_cell(looks, elevation):
    style = replace(STYLE, elevation_deg=elevation)
    blocks = [pictures.on_the_floor(*look.look[:2], look.euler_deg) for look in looks]
    distance_m = pictures.common_distance_m(blocks, style)
    fullest = []
    for one in blocks:
        camera = pictures.candidate_camera(one, style, distance_m)
        depths = (pictures.drawn_m(one) - camera.eye_m) @ camera.axes[2]
        assert (depths.min() + depths.max()) / 2 == pytest.approx(distance_m)
        shown = camera.project(pictures.drawn_m(one))
        assert np.abs(shown).max() < 0.87
        fullest.append(max(np.ptp(shown, axis=0) / [1.72, 1.40]))
    assert max(fullest) == pytest.approx(1.0, abs=1e-6)


def test_every_look_has_a_picture_of_its_own_that_fills_its_cell_above_the_number():
    found = {}
    for candidate in EVERY_LOOK:
        one = pictures.on_the_floor(*candidate.kind, candidate.euler_deg)
        camera = pictures.candidate_camera(one, STYLE)
        rows, columns = np.nonzero(pictures.shoot([one], camera, 128).block >= 0)
        assert 0.04 * 128 < rows.min() <= rows.max() < 128 * (1 - pictures.LABEL_STRIP)
        assert 0.04 * 128 < columns.min() <= columns.max() < 0.96 * 128
        share = max(np.ptp(rows) / (1 - pictures.LABEL_STRIP), np.ptp(columns)) / 128
        assert 0.6 < share < 0.95
        image = pictures.picture([one], camera, "white", 64)
        found.setdefault(candidate.look, np.asarray(image).astype(np.int64))
    for one_look, other in itertools.combinations(found.values(), 2):
        assert (np.abs(one_look - other).max(axis=-1) > 45).mean() > 0.01


def luminance(rgb):
    """Relative luminance of colors (..., 3), 0..255, as WCAG 2.2 defines it."""
    share = rgb / 255
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return linear @ np.array([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("background", slowly)
@pytest.mark.parametrize("color", pictures.COLOR_RGB)
def test_every_face_stands_out_from_the_floor(background, color):
    """By a contrast of 3:1, its own or that of the line round it, along nine tenths of its edge.

    The floor is taken nine pixels to the side, where it may be in shadow.
    """
    one, size_px = pictures.on_the_floor("cube", color, (0.0, 0.0, 0.0)), 256
    camera = pictures.camera_for([one], STYLE, "cube")
    picture = pictures.picture([one], camera, background, size_px)
    light = luminance(np.asarray(picture, dtype=np.float64))
    inside = np.pad(pictures.segments([one], camera, size_px) >= 0, 4)
    rows, columns = np.nonzero(inside & ~np.roll(inside, 1, 1) | inside & ~np.roll(inside, -1, 1))
    clear = []
    for row, column in zip(rows - 4, columns - 4, strict=True):
        way = -1 if inside[row + 4, column + 5] else 1
        line, ground = light[row, column - 3 : column + 4], light[row, column + 9 * way]
        high, low = np.maximum(line, ground), np.minimum(line, ground)
        clear.append(((high + 0.05) / (low + 0.05)).max() >= LEAST_CONTRAST)
    assert np.mean(clear) >= 0.9


def test_keys_differ_exactly_where_pixels_may():
    scene, other = (task.scene for task in TASKS[:2])
    first = replace(scene.blocks[0], euler_deg=(0.0, 0.0, 90.0))
    turned = replace(scene, blocks=(first, *scene.blocks[1:]))
    kit = CandidateSet(tuple(Candidate(name, "red", (0.0, 0.0, 90.0)) for name in BLOCK_TYPES))
    looks = ({"size_px": 256}, {"background": "white"}, {"azimuth_deg": 10}, {"elevation_deg": 10})
    recipes = [
        PLAIN,
        MARKED,
        replace(PLAIN, view_deg=(50.0, 22.0)),
        replace(PLAIN, blocks=TOWER[:2]),
        replace(PLAIN, framed=TOWER[:1]),
        replace(PLAIN, blocks=(*TOWER[:2], replace(TOWER[2], color="blue"))),
        *(replace(PLAIN, background=name) for name in BACKGROUNDS if name != STYLE.background),
    ]
    keys = [
        *(pictures.goal_key(one, SMALL) for one in (scene, other, turned)),
        *(pictures.goal_key(scene, replace(SMALL, **change)) for change in looks),
        *(pictures.candidates_key(make_candidates(one), SMALL) for one in (scene, other)),
        *(pictures.ruled_key(one, SMALL) for one in (scene, other)),
        *(pictures.kit_key(one, SMALL) for one in (kit, CandidateSet(kit.candidates[:-1]))),
        *(question_key(one, STYLE) for one in recipes),
        question_key(PLAIN, replace(STYLE, size_px=256)),
    ]
    assert len({*keys}) == len(keys)
    assert {len(key) for key in keys} == {64}
    assert pictures.goal_key(replace(scene, id="another", levels=(4,)), SMALL) == keys[0]
    high, low = (QuestionPicture("block", (one,), VIEW) for one in (TOWER[1], TOWER[0]))
    for one, same, style in (
        (PLAIN, replace(PLAIN, label="A"), STYLE),
        (PLAIN, PLAIN, replace(STYLE, azimuth_deg=200.0)),
        (high, low, STYLE),
    ):
        assert question_key(one, STYLE) == question_key(same, style)


@given(angles, st.floats(-85, 85), angles)
def test_any_orientation_comes_back_from_its_quaternion(x, y, z):
    pose = Pose.goal(replace(TOWER[0], euler_deg=(x, y, z)))
    back = replace(TOWER[0], euler_deg=quat_xyzw_to_euler_deg(pose.quat_xyzw))
    assert Pose.goal(back).angle_deg(pose) < 0.01


@given(clouds(), st.integers(1, 6), angles, elevations)
@settings(max_examples=30)
def test_no_picture_is_cut_off_or_open_whatever_it_frames(blocks, framed, azimuth, elevation):
    """Not even where blocks lie behind the place from which those in the frame are seen best."""
    style = pictures.PictureStyle(azimuth_deg=azimuth, elevation_deg=elevation)
    corners = np.vstack([pictures.drawn_m(one) for one in blocks])
    camera = pictures.goal_camera(Scene("s", (3,), tuple(blocks), ("s",)), style)
    assert np.abs(camera.project(corners)).max() <= 1 - MARGIN + 1e-9
    recipe = QuestionPicture("s", tuple(blocks), (azimuth, elevation))
    assert asked.is_inside(recipe)
    recipe = replace(recipe, framed=tuple(blocks[:framed]))
    camera = asked.question_camera(recipe, STYLE)
    drawn = np.vstack([pictures.drawn_m(one) for one in asked.drawn_blocks(recipe)])
    depths = (drawn - camera.eye_m) @ camera.axes[2]
    assert 0 < camera.near_m < depths.min() <= depths.max() < camera.far_m


def test_marks_show_on_the_blocks_that_they_are_on():
    marked, plain = (pixels(question_png(one, STYLE)) for one in (MARKED, PLAIN))
    assert 1000 < (np.abs(marked - plain).max(axis=2) > 60).sum() < 12000
    for one in TOWER:
        mark = asked.block_mark(PLAIN, seen(PLAIN), one.order, "A")
        assert asked.seen_order(PLAIN, seen(PLAIN), mark.position_m) == one.order


def test_a_state_is_seen_as_the_goal_is_and_changes_where_a_block_comes():
    built = (SCENE.blocks[:count] for count in range(len(SCENE) + 1))
    states = [question_png(asked.state_picture(SCENE, one, SMALL), SMALL) for one in built]
    assert states[-1] == pictures.goal_png(SCENE, SMALL)
    for before, after in itertools.pairwise(map(pixels, states)):
        assert 0 < (before != after).any(axis=2).mean() < 0.5


@settings(max_examples=40)
@given(
    st.lists(st.tuples(*[st.floats(-0.4, 0.4)] * 2, st.floats(0.025, 0.3)), min_size=1, max_size=4),
    st.floats(0, 360),
    st.floats(5, 90),
)
def test_all_that_is_ruled_and_written_is_in_the_picture(places, azimuth_deg, elevation_deg):
    blocks = [block(n, "cube", place) for n, place in enumerate(places, 1)]
    style = replace(SMALL, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    field = pictures._field(blocks, style)
    camera = pictures._ruled_camera(blocks, field, style)
    beyond = [(*field.x, field.beyond(0, 5)), (*field.y, field.beyond(1, 5)), (0.0,)]
    ends = np.array([*itertools.product(*beyond)])
    assert np.abs(camera.project(ends / 100)).max() <= 1
    points = np.vstack([pictures.drawn_m(one) for one in blocks]) * 100
    for axis, (low, high) in enumerate((field.x, field.y)):
        assert low % 5 == high % 5 == 0
        assert low <= points[:, axis].min() - 3 + 1e-6
        assert points[:, axis].max() + 3 - 1e-6 <= high
    # The numbers are on the sides from which it is seen.
    near = np.array(field.near) - np.mean([field.x, field.y], axis=1)
    assert near @ -camera.axes[2, :2] >= -1e-6


def test_an_animation_ends_in_the_goal_and_blocks_are_placed_in_order():
    with Image.open(io.BytesIO(pictures.assembly_gif(SCENE, SMALL))) as image:
        assert (image.n_frames, image.info["loop"]) == (len(SCENE), 0)
        *_, last = (np.asarray(one.convert("RGB")) for one in ImageSequence.Iterator(image))
    assert np.abs(last - pixels(pictures.goal_png(SCENE, SMALL))).mean() < 3
    with pytest.raises(DataError, match="backward"):
        pictures.assembly_gif(replace(SCENE, id="backward", blocks=SCENE.blocks[::-1]), SMALL)
