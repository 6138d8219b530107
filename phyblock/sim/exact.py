"""Sums of products in a fixed order, for whatever decides a pixel.

Matrix products go to a BLAS, which adds up in another order, and with fused operations, on another
machine; trigonometric functions differ by a unit in the last place from one C library to the next.
Plain numpy arithmetic in 64 bits is the same everywhere, and so are pictures that follow from it
and from a few angles whose sines were rounded.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["cross", "dot", "rounded", "turned", "unit"]

Vectors = NDArray[np.float64]

_DIGITS = 12


def dot(one: Vectors, other: Vectors) -> Vectors:
    """Scalar products along the last axis, which has length 3; the rest broadcasts."""
    terms = [one[..., axis] * other[..., axis] for axis in range(3)]
    product: Vectors = terms[0] + terms[1] + terms[2]
    return product


def cross(one: Vectors, other: Vectors) -> Vectors:
    """Vector products along the last axis, which has length 3; the rest broadcasts."""
    (a, b, c), (d, e, f) = np.moveaxis(one, -1, 0), np.moveaxis(other, -1, 0)
    return np.stack([b * f - c * e, c * d - a * f, a * e - b * d], axis=-1)


def turned(points: Vectors, matrix: Vectors) -> Vectors:
    """The matrix (3, 3) applied to points (..., 3), as `points @ matrix.T` is."""
    return np.stack([dot(points, row) for row in matrix], axis=-1)


def unit(vectors: Vectors) -> Vectors:
    """Vectors (..., 3) scaled to length 1; none may be zero."""
    scaled: Vectors = vectors / np.sqrt(dot(vectors, vectors))[..., None]
    return scaled


def rounded(numbers: Vectors) -> Vectors:
    """Numbers to 12 decimals, where C libraries agree; a zero has no sign."""
    tidy: Vectors = np.round(numbers, _DIGITS) + 0.0
    return tidy
