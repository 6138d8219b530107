from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from phyblock.data import read_official
from phyblock.domain import Scene
from phyblock.sim.camera import VIEWS, Window, frame, view_axes
from phyblock.sim.pictures import PictureStyle, drawn, goal_camera, shoot
from tests.designs.scenes import designed_scene
from tests.sim.structures import clouds, scene_of

azimuths = st.floats(-360, 360, allow_nan=False)
elevations = st.floats(1, 90, allow_nan=False)
coordinates = st.floats(-1, 1, allow_nan=False)
points = st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=1, max_size=20)
windows = st.builds(
    Window, st.floats(-1, -0.2), st.floats(0.1, 1), st.floats(-1, -0.3), st.floats(0.2, 1)
)
MARGIN = 0.16


def projected(scene: Scene, style: PictureStyle) -> np.ndarray:
    corners = np.vstack([block.vertices_m for block in drawn(scene.blocks)])
    return goal_camera(scene, style).project(corners)


@given(azimuths, elevations)
def test_axes_are_a_right_handed_frame(azimuth_deg: float, elevation_deg: float) -> None:
    """But for their rounding to 12 decimals."""
    right, up, forward = view_axes(azimuth_deg, elevation_deg)
    assert_allclose(
        np.stack([right, up, forward]) @ np.stack([right, up, forward]).T, np.eye(3), atol=1e-11
    )
    assert_allclose(np.cross(right, up), -forward, atol=1e-11)
    assert up[2] >= -1e-12
    assert right[2] == 0


@given(points, azimuths, elevations, windows, st.floats(0, 2))
def test_framing_keeps_every_point_in_the_window(cloud, azimuth, elevation, window, near_m) -> None:
    where = np.array(cloud)
    camera = frame(where, view_axes(azimuth, elevation), window, near_m + 0.1)
    across, up = camera.project(where).T
    assert window.left - 1e-9 <= across.min() <= across.max() <= window.right + 1e-9
    assert window.bottom - 1e-9 <= up.min() <= up.max() <= window.top + 1e-9
    depths = (where - camera.eye_m) @ camera.axes[2]
    assert depths.min() >= near_m + 0.1 - 1e-9
    assert camera.near_m < depths.min() <= depths.max() < camera.far_m


@given(points, azimuths, elevations, windows)
def test_framing_comes_as_close_as_it_may(cloud, azimuth, elevation, window) -> None:
    where = np.array(cloud)
    camera = frame(where, view_axes(azimuth, elevation), window, 0.1)
    seen = camera.project(where)
    spans = np.ptp(seen, axis=0) / [window.right - window.left, window.top - window.bottom]
    nearest = ((where - camera.eye_m) @ camera.axes[2]).min()
    assert spans.max() == pytest.approx(1.0, abs=1e-6) or nearest == pytest.approx(0.1, abs=1e-6)


@given(clouds(), azimuths, elevations)
def test_a_goal_picture_never_cuts_a_block_off(blocks, azimuth_deg, elevation_deg) -> None:
    style = PictureStyle(azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)
    assert np.abs(projected(scene_of(blocks), style)).max() <= 1 - MARGIN + 1e-9


@pytest.mark.parametrize("view", sorted(VIEWS))
def test_no_official_scene_is_cut_off(view: str, official_checkout: Path) -> None:
    style = PictureStyle.from_view(view)
    for task in read_official(official_checkout).tasks:
        assert np.abs(projected(task.scene, style)).max() <= 1 - MARGIN + 1e-9, task.scene.id


@pytest.mark.parametrize("view", sorted(VIEWS))
def test_the_renderer_draws_where_the_camera_says(view: str) -> None:
    scene = designed_scene("l2-rocket")
    camera, size_px = goal_camera(scene, PictureStyle.from_view(view)), 512
    blocks = drawn(scene.blocks)
    shot = shoot(blocks, camera, size_px)
    rows, columns = np.nonzero(shot.block >= 0)
    pixels = np.vstack([camera.to_pixels(block.vertices_m, size_px) for block in blocks])
    seen = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
    assert_allclose(seen, [*pixels.min(axis=0), *pixels.max(axis=0)], atol=3.0)
