"""Scan conversion: triangles on a square screen to the pixels whose centers they cover.

All triangles at once: each row of pixels that a triangle crosses is a span, each span a run of
pixels. The crossing of an edge with a row is worked out from the edge's ends alone, in one order,
so two triangles that share an edge cover every pixel along it once. The nearest triangle of each
pixel is kept by its nearness, a number that is linear over the screen (the inverse of depth for a
camera; the height towards a light from far away).
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["AT_ONCE", "NOTHING", "Nearest", "Spans", "covered", "nearest", "spans"]

NOTHING = -1
"""What is nearest where there is no triangle."""
AT_ONCE = 1 << 16
"""Pixels that are worked on together: what they take of memory is used again and again."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Spans(NamedTuple):
    """Runs of pixels: whose they are, their row, the first column and the one after the last."""

    triangle: Ints
    row: Ints
    left: Ints
    right: Ints


def spans(corners_px: Floats, size_px: int) -> Spans:
    """The spans of triangles with corners (n, 3, 2), column and row, on a screen `size_px` wide.

    A pixel belongs to a triangle that holds its center, half a pixel from its edges.
    """
    order = np.argsort(corners_px[..., 1], axis=1, kind="stable")
    x, y = np.moveaxis(np.take_along_axis(corners_px, order[..., None], axis=1), -1, 0)
    first, end = (_from_center(y[:, i], size_px) for i in (0, 2))
    heights = np.maximum(end - first, 0)
    triangle = np.repeat(np.arange(len(x)), heights)
    row = np.arange(len(triangle)) - np.repeat(np.cumsum(heights) - heights - first, heights)
    x, y, center = x[triangle], y[triangle], row + 0.5
    long = _crossing(x, y, center, 0, 2)
    short = np.where(center < y[:, 1], _crossing(x, y, center, 0, 1), _crossing(x, y, center, 1, 2))
    left = _from_center(np.minimum(long, short), size_px)
    right = _from_center(np.maximum(long, short), size_px)
    some = right > left
    return Spans(triangle[some], row[some], left[some], right[some])


class Nearest(NamedTuple):
    """What a screen shows, both of shape (size, size).

    `triangle` is the number of the nearest triangle, `NOTHING` where there is none; `nearness` its
    nearness there.
    """

    triangle: NDArray[np.int32]
    nearness: Floats


def nearest(covering: Spans, planes: Floats, size_px: int, least: float, most: float) -> Nearest:
    """The nearest triangle of each pixel.

    `planes` (n, 3) give the nearness of each triangle as a * column + b * row + c; what lies
    outside `least`..`most` is left out. Of two that are equally near the later counts.
    """
    best = np.full(size_px * size_px, least)
    shown = np.full(size_px * size_px, NOTHING, dtype=np.int32)
    for part in _parts(covering):
        lengths = part.right - part.left
        a, b, c = planes.T[:, part.triangle]
        start = np.cumsum(lengths) - lengths
        column = np.arange(int(lengths.sum())) - np.repeat(start - part.left, lengths)
        pixel = column + np.repeat(part.row * size_px, lengths)
        nearness = np.repeat(a, lengths) * column
        nearness += np.repeat(b * part.row + c, lengths)
        if nearness.max(initial=-np.inf) > most:
            nearness[nearness > most] = -np.inf
        np.maximum.at(best, pixel, nearness)
        seen = nearness == best[pixel]
        shown[pixel[seen]] = np.repeat(part.triangle, lengths)[seen]
    return Nearest(shown.reshape(size_px, size_px), best.reshape(size_px, size_px))


def covered(covering: Spans, size_px: int) -> NDArray[np.bool_]:
    """Which pixels any span covers, shape (size, size)."""
    inside = np.zeros((size_px, size_px), dtype=np.bool_)
    if len(covering.row):
        first, end = int(covering.row.min()), int(covering.row.max()) + 1
        n, start = (end - first) * (size_px + 1), (covering.row - first) * (size_px + 1)
        depth = np.bincount(start + covering.left, minlength=n)
        depth -= np.bincount(start + covering.right, minlength=n)
        # A row's spans end within it, so that one sum runs through all rows.
        np.cumsum(depth, out=depth)
        inside[first:end] = depth.reshape(-1, size_px + 1)[:, :-1] > 0
    return inside


def _crossing(x: Floats, y: Floats, center: Floats, start: int, end: int) -> Floats:
    """Where the edge between two corners crosses a row's center line; anything for a level edge."""
    rise = y[:, end] - y[:, start]
    slope = (x[:, end] - x[:, start]) / np.where(rise > 0, rise, 1.0)
    crossing: Floats = x[:, start] + (center - y[:, start]) * slope
    return crossing


def _from_center(place: Floats, size_px: int) -> Ints:
    """The first pixel whose center is not before a place, within the screen."""
    return np.ceil(np.clip(place, 0.0, size_px) - 0.5).astype(np.int64)


def _parts(covering: Spans) -> Iterator[Spans]:
    """The spans in groups of about so many pixels as are worked on together."""
    ends = np.cumsum(covering.right - covering.left)
    cuts = np.flatnonzero(np.diff(ends // AT_ONCE)) + 1
    for group in np.split(np.arange(len(ends)), cuts):
        yield Spans(*(column[group] for column in covering))
