from __future__ import annotations

import numpy as np
import pytest

from phyblock.sim.backgrounds import GROUNDS, PERIOD_M, TEXTURED, floor, sample, surface_map
from phyblock.sim.camera import frame, view_axes
from phyblock.types import BACKGROUNDS, Background

FINE_M = 0.0001


def points(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points off the texels' borders, in a square of one period."""
    steps = (np.arange(count) + 0.31) / count * PERIOD_M
    x_m, y_m = np.meshgrid(steps, steps)
    return x_m.astype(np.float32), y_m.astype(np.float32)


def footprint(x_m: np.ndarray, width_m: float) -> np.ndarray:
    return np.full(x_m.shape, width_m, dtype=np.float32)


def test_every_background_is_a_row() -> None:
    assert tuple(sorted(GROUNDS)) == tuple(sorted(BACKGROUNDS))


@pytest.mark.parametrize("surface", TEXTURED)
def test_a_surface_is_seamless(surface: Background) -> None:
    """A step across the seam is no larger than steps elsewhere."""
    texture = surface_map(surface)[0].astype(np.int16)
    for axis in (0, 1):
        steps = np.abs(np.diff(texture, axis=axis)).mean(axis=(1 - axis, 2))
        seam = np.abs(texture.take(0, axis) - texture.take(-1, axis)).mean()
        assert seam <= steps.max() + 1e-3


@pytest.mark.parametrize("surface", TEXTURED)
def test_a_surface_repeats_and_keeps_its_colors_in_range(surface: Background) -> None:
    x_m, y_m = points(24)
    here = sample(surface, x_m, y_m, footprint(x_m, FINE_M))
    there = sample(surface, x_m + PERIOD_M, y_m - 3 * PERIOD_M, footprint(x_m, FINE_M))
    assert np.abs(here - there).max() < 0.1 * np.ptp(here)
    assert 0 <= here.min() <= here.max() <= 255


@pytest.mark.parametrize("surface", TEXTURED)
def test_far_ground_shows_the_mean_color(surface: Background) -> None:
    x_m, y_m = points(24)
    near = sample(surface, x_m, y_m, footprint(x_m, FINE_M))
    far = sample(surface, x_m, y_m, footprint(x_m, 2 * PERIOD_M))
    assert near.std(axis=(0, 1)).min() > 2
    assert np.ptp(far, axis=(0, 1)).max() < 0.01
    mean = surface_map(surface)[0].mean(axis=(0, 1), dtype=np.float64)
    assert np.abs(far - mean).max() < 0.51


@pytest.mark.parametrize("surface", TEXTURED)
def test_the_sky_is_no_different_from_far_ground(surface: Background) -> None:
    """From just above the ground the upper half looks over the horizon."""
    camera = frame(np.array([[0.0, 0.0, 0.05]]), view_axes(20.0, 1.0), min_distance_m=0.5)
    colors = floor(surface, camera, 64)
    assert np.isfinite(colors).all()
    assert np.abs(colors[0] - surface_map(surface)[-1][0, 0]).max() < 1e-3
    assert np.abs(colors[0] - colors[20]).max() < 40
