"""The rasterizer against rays: what shows where, how bright it is, and what lies in shadow."""

import ast
import hashlib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import phyblock.sim
from phyblock.domain.blocks import BLOCK_TYPES, quat_xyzw_to_matrix
from phyblock.sim.engine import Pose
from phyblock.sim.geometry import drawn_mesh
from phyblock.sim.pictures import COLOR_RGB, light_direction
from phyblock.sim.raster import HALF_TANGENT, Camera, Light, Prop, Window, draw, frame, view_axes
from tests.sim.structures import block, clouds

SIZE_PX = 160
RAYS = 40
COLORS = tuple(COLOR_RGB)
DIGEST = "077f19edea00090368f8a9efc8a70dd88b668db1ee19f511f0d31b1d2652a7d5"
EXACT = ("dot", "cross", "turned", "unit", "rounded")
PRODUCTS = ("dot", "einsum", "inner", "linalg", "matmul", "tensordot", "vdot")
views = st.tuples(st.floats(-180, 180), st.floats(3, 90))


heaps = clouds(reach_m=0.1, least=3)
"""Blocks in one another's way."""


def props_of(blocks):
    return [
        Prop(drawn_mesh(one.type), COLOR_RGB[COLORS[place % len(COLORS)]], Pose.goal(one))
        for place, one in enumerate(blocks)
    ]


def triangles_m(prop):
    rotation = quat_xyzw_to_matrix(prop.pose.quat_xyzw)
    return prop.mesh.corners_m @ rotation.T + prop.pose.position_m


def seen(blocks, view):
    """Return blocks as props, and a camera on them."""
    props = props_of(blocks)
    corners = np.vstack([triangles_m(prop).reshape(-1, 3) for prop in props])
    return props, frame(corners, view_axes(*view), Window(-0.85, 0.85, -0.85, 0.85), 0.3)


def light_of(camera):
    return Light(light_direction(camera), 0.5, 0.5)


def drawn(props, camera):
    return draw(props, camera, light_of(camera), SIZE_PX)


def hits(starts, ways, corners):
    """Return the distance along each ray (n, 3) to a triangle, inf for none, and the normal."""
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    crossed = np.cross(ways[:, None], two)
    scale = np.where(np.abs(s := (one * crossed).sum(-1)) > 1e-14, s, np.inf)
    offset = starts[:, None] - corners[:, 0]
    u = (offset * crossed).sum(-1) / scale
    turned = np.cross(offset, one)
    v = (ways[:, None] * turned).sum(-1) / scale
    away = (two * turned).sum(-1) / scale
    met = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (away > 1e-7), away, np.inf)
    nearest = met.argmin(axis=1)
    normals = np.cross(one, two)[nearest]
    return met.min(axis=1), normals / np.linalg.norm(normals, axis=1, keepdims=True)


def rays(camera, pixels):
    """Directions of unit depth through the centers of pixels (n, 2), row and column."""
    across = ((pixels[:, 1] + 0.5) / SIZE_PX * 2 - 1) * HALF_TANGENT
    up = (1 - (pixels[:, 0] + 0.5) / SIZE_PX * 2) * HALF_TANGENT
    return np.stack([across, up, np.ones(len(pixels))], axis=1) @ camera.axes


def some_pixels(seed, n=RAYS):
    return np.random.default_rng(seed).integers(0, SIZE_PX, (n, 2))


def met_by(props, starts, ways):
    """Return distances along rays to props, (k, n), inf for none, and normals, (k, n, 3)."""
    found = [hits(starts, ways, triangles_m(prop)) for prop in props]
    return np.stack([away for away, _ in found]), np.stack([normals for _, normals in found])


def is_hidden(props, points, way):
    """True if anything stands in the way from points (n, 3)."""
    away, _ = met_by(props, points, np.broadcast_to(way, points.shape))
    return np.isfinite(away).any(axis=0)


@given(clouds() | heaps, views, st.integers(0, 2**31))
@settings(max_examples=40)
def test_each_pixel_shows_what_the_ray_through_its_center_meets(blocks, view, seed):
    (props, camera), pixels = seen(blocks, view), some_pixels(seed)
    away, _ = met_by(props, np.broadcast_to(camera.eye_m, (RAYS, 3)), rays(camera, pixels))
    shown = drawn(props, camera).prop[pixels[:, 0], pixels[:, 1]]
    # Where faces of two blocks lie in one plane, either may show; no prop is infinitely far.
    away = np.vstack([away, np.full(RAYS, np.inf)])
    off = away[shown, np.arange(RAYS)] - np.minimum(away.min(axis=0), 1e9)
    wrong = np.where(shown < 0, np.isfinite(away).any(axis=0), off > 1e-6)
    # A ray that grazes an edge may be taken to meet either side of it.
    assert wrong.sum() <= 1


@given(heaps, views, st.integers(0, 2**31))
@settings(max_examples=25)
def test_a_pixel_is_as_bright_as_its_face_and_what_stands_before_the_light_say(blocks, view, seed):
    """Points near the edge of a shadow are left out; round faces bend between their facets."""
    props, camera = seen(blocks, view)
    light, pixels, raster = light_of(camera), some_pixels(seed, 5 * RAYS), drawn(props, camera)
    shown = raster.prop[pixels[:, 0], pixels[:, 1]]
    pixels, shown = pixels[shown >= 0], shown[shown >= 0]
    ways = rays(camera, pixels)
    away, normals = met_by(props, np.broadcast_to(camera.eye_m, ways.shape), ways)
    away, normals = away[shown, np.arange(len(shown))], normals[shown, np.arange(len(shown))]
    points = camera.eye_m + np.where(np.isfinite(away), away, 0.0)[:, None] * ways
    steps = 0.006 * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    hidden = np.stack([is_hidden(props, points + step, light.direction) for step in steps])
    clear = np.isfinite(away) & (hidden.all(axis=0) | ~hidden.any(axis=0))
    facing = np.maximum(normals @ light.direction, 0) * ~hidden[0]
    colors = np.array([prop.rgb for prop in props])[shown]
    found = raster.rgb[pixels[:, 0], pixels[:, 1]]
    bright = light.ambient + light.diffuse * facing
    off = np.abs(found - colors * bright[:, None]).max(axis=1, initial=0)
    assert (off[clear] > 8).sum() <= 1


@given(clouds(), views, st.integers(0, 2**31))
@settings(max_examples=30)
def test_the_ground_is_in_shadow_where_something_stands_before_the_light(blocks, view, seed):
    (props, camera), pixels = seen(blocks, view), some_pixels(seed)
    ways = rays(camera, pixels)
    below = ways[:, 2] < -1e-6
    pixels, ways = pixels[below], ways[below]
    ground = camera.eye_m + ways * (camera.eye_m[2] / -ways[:, 2:])
    shaded = is_hidden(props, ground, light_of(camera).direction)
    assert (drawn(props, camera).shaded[pixels[:, 0], pixels[:, 1]] != shaded).sum() <= 1


@given(clouds(), views, st.randoms(use_true_random=False))
@settings(max_examples=20)
def test_the_order_of_blocks_changes_their_numbers_alone(blocks, view, random):
    props, camera = seen(blocks, view)
    order = list(range(len(props)))
    random.shuffle(order)
    one, other = drawn(props, camera), drawn([props[place] for place in order], camera)
    assert one.rgb.tobytes() == other.rgb.tobytes()
    assert one.shaded.tobytes() == other.shaded.tobytes()
    assert (np.append(order, -1)[other.prop] == one.prop).all()


def test_nothing_shows_before_the_near_plane_or_behind_the_far_one_in_any_thread():
    apart = [block(n, "cube", (0.0, 0.3 * n, 0.025)) for n in range(2)]
    props, camera = seen(apart, (60.0, 25.0))
    depths = [(prop.pose.position_m - camera.eye_m) @ camera.axes[2] for prop in props]
    middle_m, near = float(np.mean(depths)), int(np.argmin(depths))
    for planes, shown in (({"near_m": middle_m}, 1 - near), ({"far_m": middle_m}, near)):
        cut = replace(camera, **planes)
        alone = drawn(props, cut)
        assert set(np.unique(alone.prop).tolist()) == {-1, shown}
        with ThreadPoolExecutor(4) as pool:
            found = pool.map(lambda one: drawn(props, one).rgb.tobytes(), [camera, cut] * 4)
        assert list(found)[1::2] == [alone.rgb.tobytes()] * 4


def test_what_reaches_behind_the_camera_is_drawn_as_far_as_it_is_before_it():
    """A long block beside the eye: only what is in front of it can show."""
    camera = Camera(np.array([-0.05, 0.0, 0.03]), view_axes(180.0, 1.0), 1e-3, 10.0)
    shown = drawn(props_of([block(1, "cuboid3", (0.0, 0.0, 0.0))]), camera).prop >= 0
    assert shown[-1].any()
    assert not shown[: SIZE_PX // 2].any()


def test_the_bytes_of_a_picture_are_the_same_on_every_machine():
    """`RASTER_VERSION` is raised where these change on purpose, or cached pictures are mixed."""
    blocks = [
        block(n, kind, (0.09 * n, 0.07 * (n % 3), 0.1), (20.0 * n, 10.0, 35.0 * n))
        for n, kind in enumerate(BLOCK_TYPES)
    ]
    raster = drawn(*seen(blocks, (45.0, 22.0)))
    parts = (raster.rgb, raster.prop.astype("<i8"), raster.face.astype("<i8"), raster.shaded)
    assert hashlib.sha256(b"".join(part.tobytes() for part in parts)).hexdigest() == DIGEST


def test_no_matrix_product_decides_a_pixel():
    """A BLAS adds up in another order on another machine."""
    sim = Path(phyblock.sim.__file__).parent
    for name in ("raster", "backgrounds", "pictures", "geometry"):
        parts = [ast.parse((sim / f"{name}.py").read_text(encoding="utf-8"))]
        if name == "geometry":
            parts = [one for one in parts[0].body if getattr(one, "name", "") in EXACT]
            assert len(parts) == len(EXACT)
        for node in (node for part in parts for node in ast.walk(part)):
            assert not isinstance(node, ast.MatMult), name
            if isinstance(node, ast.Attribute):
                assert ast.unparse(node) not in {f"np.{one}" for one in PRODUCTS}, name
