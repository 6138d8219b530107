"""Laws of the rasterizer: sizes, hiding, planes, light, threads."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from phyblock.domain import euler_deg_to_quat_xyzw
from phyblock.sim.camera import FULL_WINDOW, Camera, frame, view_axes
from phyblock.sim.engine import Pose
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.raster import Light, Prop, Raster, draw

SIZE_PX = 120
COLORS = ((240, 40, 40), (40, 200, 60), (60, 80, 240))
EVEN = Light(np.array([0.0, 0.0, 1.0]), 1.0, 0.0)
CUBE = solid_mesh("cube")
HALF_DIAGONAL_M = 0.0434
APART = ((0.0, 0.0, 0.025), (0.0, 0.3, 0.025), (0.1, 0.15, 0.3))


def cubes(*places_m: tuple[float, float, float]) -> list[Prop]:
    upright = euler_deg_to_quat_xyzw((0.0, 0.0, 0.0))
    return [
        Prop(CUBE, color, Pose(np.array(place), upright))
        for place, color in zip(places_m, COLORS, strict=False)
    ]


def camera_on(props: list[Prop], azimuth_deg: float = 20.0, elevation_deg: float = 25.0) -> Camera:
    corners = [CUBE.vertices_m + prop.pose.position_m for prop in props]
    return frame(
        np.vstack(corners), view_axes(azimuth_deg, elevation_deg), FULL_WINDOW.scaled(0.8), 0.5
    )


def depth_m(camera: Camera, prop: Prop) -> float:
    return float((prop.pose.position_m - camera.eye_m) @ camera.axes[2])


def at_center(raster: Raster, camera: Camera, prop: Prop) -> tuple[int, list[int]]:
    """What shows where the middle of a prop is: the place in the list, and the color."""
    column, row = camera.to_pixels(prop.pose.position_m[None], SIZE_PX)[0].astype(int).tolist()
    return int(raster.prop[row, column]), raster.rgb[row, column].tolist()


def places(raster: Raster) -> set[int]:
    return set(np.unique(raster.prop).tolist())


def test_a_picture_has_the_size_asked_for_and_numbers_what_it_shows() -> None:
    props = cubes(*APART)
    raster = draw(props, camera_on(props), EVEN, SIZE_PX)
    assert (raster.rgb.shape, raster.rgb.dtype) == ((SIZE_PX, SIZE_PX, 3), np.uint8)
    for numbers in (raster.prop, raster.face):
        assert numbers.shape == (SIZE_PX, SIZE_PX)
        assert np.issubdtype(numbers.dtype, np.integer)
    assert (raster.shaded.shape, raster.shaded.dtype) == ((SIZE_PX, SIZE_PX), np.bool_)
    assert places(raster) == {-1, 0, 1, 2}


def test_a_picture_of_nothing_shows_nothing() -> None:
    camera = camera_on(cubes(*APART))
    assert places(draw([], camera, EVEN, SIZE_PX)) == {-1}


@given(st.floats(-180, 180), st.floats(5, 60), st.sampled_from([30.0, 45.0]))
@settings(max_examples=15)
def test_what_nothing_hides_shows_in_its_color_where_the_camera_says(
    azimuth_deg: float, elevation_deg: float, field_of_view_deg: float
) -> None:
    for place, prop in enumerate(cubes(*APART)):
        camera = camera_on(cubes(*APART), azimuth_deg, elevation_deg)
        camera = replace(camera, field_of_view_deg=field_of_view_deg)
        raster = draw([prop], camera, EVEN, SIZE_PX)
        shown, color = at_center(raster, camera, prop)
        assert shown == 0
        assert_allclose(color, COLORS[place], atol=2)
        pixels = camera.to_pixels(CUBE.vertices_m + prop.pose.position_m, SIZE_PX)
        rows, columns = np.nonzero(raster.prop == 0)
        found = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        assert_allclose(found, [*pixels.min(axis=0), *pixels.max(axis=0)], atol=2.0)


def test_the_nearer_hides_the_farther_in_whichever_order_they_come() -> None:
    camera = camera_on(cubes(*APART))
    forward = camera.axes[2]
    near, far = APART[0], tuple((np.array(APART[0]) + 0.2 * forward).tolist())
    camera = camera_on(cubes(near, far))
    for props, first in ((cubes(near, far), 0), (cubes(far, near), 1)):
        raster = draw(props, camera, EVEN, SIZE_PX)
        assert at_center(raster, camera, props[first])[0] == first


def test_the_order_of_props_changes_their_numbers_alone() -> None:
    props = cubes(*APART)
    camera = camera_on(props)
    one = draw(props, camera, EVEN, SIZE_PX)
    other = draw(props[::-1], camera, EVEN, SIZE_PX)
    shown = one.prop >= 0
    assert (one.prop[shown] == 2 - other.prop[shown]).all()
    assert (shown == (other.prop >= 0)).all()
    assert (one.rgb[shown] == other.rgb[shown]).all()


def test_nothing_shows_before_the_near_plane_or_behind_the_far_one() -> None:
    props = sorted(cubes(*APART[:2]), key=lambda prop: depth_m(camera_on(cubes(*APART)), prop))
    camera = camera_on(props, azimuth_deg=60.0)
    near, far = sorted(depth_m(camera, prop) for prop in props)
    first, second = sorted(range(2), key=lambda place: depth_m(camera, props[place]))
    middle_m = (near + far) / 2
    assert min(far - middle_m, middle_m - near) > HALF_DIAGONAL_M
    seen = draw(props, replace(camera, near_m=middle_m), EVEN, SIZE_PX)
    assert places(seen) == {-1, second}
    seen = draw(props, replace(camera, far_m=middle_m), EVEN, SIZE_PX)
    assert places(seen) == {-1, first}


def test_a_picture_does_not_depend_on_those_before_it() -> None:
    props = cubes(*APART)
    camera = camera_on(props)
    one = draw(props, camera, EVEN, SIZE_PX)
    draw(props[:1], camera_on(props[:1], 90.0), EVEN, SIZE_PX // 2)
    again = draw(props, camera, EVEN, SIZE_PX)
    assert again.rgb.tobytes() == one.rgb.tobytes()
    assert again.prop.tobytes() == one.prop.tobytes()


def test_threads_do_not_disturb_one_another() -> None:
    props = cubes(*APART)
    cameras = [camera_on(props, azimuth_deg) for azimuth_deg in range(0, 360, 45)]
    alone = [draw(props, camera, EVEN, SIZE_PX).rgb.tobytes() for camera in cameras]
    with ThreadPoolExecutor(4) as pool:
        drawn = pool.map(lambda camera: draw(props, camera, EVEN, SIZE_PX), cameras)
        assert [raster.rgb.tobytes() for raster in drawn] == alone


def test_a_face_is_as_bright_as_the_light_says() -> None:
    """The upper face of a cube, seen from above."""
    (prop,) = cubes(APART[0])
    camera = camera_on([prop], elevation_deg=90.0)
    for direction in ((0.0, 0.6, 0.8), (0.0, 0.0, 1.0), (0.0, 0.8, -0.6)):
        raster = draw([prop], camera, Light(np.array(direction), 0.4, 0.5), SIZE_PX)
        bright = np.array(COLORS[0]) * (0.4 + 0.5 * max(0.0, direction[2]))
        assert_allclose(at_center(raster, camera, prop)[1], bright, atol=2)
