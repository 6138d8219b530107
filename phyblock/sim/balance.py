"""Whether blocks can stand as they are, by statics alone, and with how much to spare.

Blocks stand when forces in their contacts can bear every weight: each force inside the cone of
friction, all forces and moments of a block in balance. That is a set of linear equations in
forces that only push, solved by non-negative least squares (Lawson and Hanson, 1974) or, where that
finds no end, by linear programming, with each cone as a pyramid of four edges. Where such forces
exist, rigid bodies may stand; where none exist, they cannot. `surely_stands` and `surely_falls` ask
so with every weight moved by `MARGIN_M` to
one side after another, so that no verdict hangs on an edge that a weight is nearly over.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import sparse  # type: ignore[import-untyped]
from scipy.optimize import linprog, nnls  # type: ignore[import-untyped]

from phyblock.domain.blocks import FRICTION, SHAPES, BlockType, euler_deg_to_matrix
from phyblock.domain.scene import Block
from phyblock.errors import PhyblockError
from phyblock.sim.convex import contact_corners_m, cross, separating_axes
from phyblock.sim.geometry import ConvexPiece
from phyblock.sim.support import CONTACT_TOLERANCE_M, bounds_m, boxes_near, pieces_of

__all__ = ["FRICTIONS", "MARGIN_M", "MASSES", "is_balanced", "surely_falls", "surely_stands"]

MARGIN_M = 0.005
"""How far every weight is moved to one side [m]."""
FRICTIONS = (0.28, 0.45)
"""The least and the most friction that a verdict has to hold under."""
_LONG: tuple[BlockType, ...] = ("cuboid2", "cuboid3", "arch")
Masses = tuple[tuple[BlockType, float], ...]
"""Types of which every block has so many times its mass."""
MASSES: tuple[Masses, ...] = (
    tuple((one, 1.15) for one in _LONG),
    tuple((one, 0.87) for one in _LONG),
)
"""Factors of mass that a verdict has to hold under: long blocks heavier, and lighter."""
_SIDES = tuple((math.cos(a), math.sin(a)) for a in np.arange(8) * math.pi / 4)
_LEAST_VERTICAL = 0.15
_TOLERANCE = 1e-5
_UP = np.array([0.0, 0.0, 1.0])
_STEEP = 0.9
_SAME_GAP_M = 1e-4
_KEPT = 2048


class _Contact(NamedTuple):
    """Places (k, 3) [m] where `below` (None: the ground) pushes `above` along `normal`."""

    below: int | None
    above: int
    corners_m: NDArray[np.float64]
    normal: NDArray[np.float64]


def surely_stands(blocks: Sequence[Block]) -> bool:
    """Whether blocks stand with every weight up to `MARGIN_M` off, little friction, any masses."""
    forces = _forces(blocks, FRICTIONS[0])
    return all(_bears(forces, _weights(blocks, *case)) for case in _cases())


def surely_falls(blocks: Sequence[Block]) -> bool:
    """Whether blocks fall with every weight up to `MARGIN_M` off, much friction, any masses."""
    forces = _forces(blocks, FRICTIONS[1])
    return not any(_bears(forces, _weights(blocks, *case)) for case in _cases())


def is_balanced(blocks: Sequence[Block], friction: float = FRICTION, margin_m: float = 0.0) -> bool:
    """Whether contacts can bear all weights as they are, or, with a margin, all of them moved by so
    much to each of four sides.
    """
    forces = _forces(blocks, friction)
    sides = _SIDES[::2] if margin_m else _SIDES[:1]
    shifts = ((margin_m * x, margin_m * y) for x, y in sides)
    return all(_bears(forces, _weights(blocks, shift, ())) for shift in shifts)


def _cases() -> Iterator[tuple[tuple[float, float], Masses]]:
    """A way in which all weights are off [m], and masses, to try one after another."""
    for number, (x, y) in enumerate(_SIDES):
        yield (MARGIN_M * x, MARGIN_M * y), MASSES[number % len(MASSES)]


def _bears(forces: NDArray[np.float64], weights: NDArray[np.float64]) -> bool:
    """Whether some sum of the forces, each as large as need be, balances all weights."""
    if not forces.size:
        return not weights.size
    try:
        _, residual = nnls(forces, weights)
    except RuntimeError:  # It found no end, which says nothing of whether there is a balance.
        residual = _least_residual(forces, weights)
    return bool(residual < _TOLERANCE)


def _least_residual(forces: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """The least sum of what is left of all weights, by linear programming, which always ends.

    Raises PhyblockError where it does not.
    """
    rows, count = forces.shape
    left_over = sparse.identity(rows)
    found = linprog(
        np.concatenate([np.zeros(count), np.ones(2 * rows)]),
        A_eq=sparse.hstack([sparse.csr_matrix(forces), left_over, -left_over]),
        b_eq=weights,
        method="highs",
    )
    if found.status != 0:
        raise PhyblockError(f"statics of {rows // 6} blocks are not decided: {found.message}")
    return float(found.fun)


def _weights(
    blocks: Sequence[Block], shift_m: tuple[float, float], masses: Masses
) -> NDArray[np.float64]:
    """The force up that each block needs, and its moment, shape (6 n,), of a whole weight of 1."""
    if not blocks:
        return np.empty(0)
    factors = dict(masses)
    weights = np.array([SHAPES[b.type].mass_kg * factors.get(b.type, 1.0) for b in blocks])
    centers = np.array(
        [
            np.array(b.position_m)
            + euler_deg_to_matrix(b.euler_deg) @ np.array(SHAPES[b.type].center_of_mass_m)
            for b in blocks
        ]
    )
    centers[:, :2] += shift_m
    return _wrenches(centers, np.outer(weights / weights.sum(), _UP)).ravel()


def _forces(blocks: Sequence[Block], friction: float) -> NDArray[np.float64]:
    """What a unit of force along each edge of each cone does to each block, shape (6 n, k)."""
    columns = []
    for contact in _contacts(blocks):
        helper = _UP if abs(contact.normal[2]) < _STEEP else np.array([1.0, 0.0, 0.0])
        side = cross(contact.normal, helper)
        side /= np.linalg.norm(side)
        across = cross(contact.normal, side)
        edges = contact.normal + friction * np.stack([side, -side, across, -across])
        places = np.repeat(contact.corners_m, len(edges), axis=0)
        wrenches = _wrenches(places, np.tile(edges, (len(contact.corners_m), 1)))
        column = np.zeros((len(wrenches), len(blocks), 6))
        column[:, contact.above] = wrenches
        if contact.below is not None:
            column[:, contact.below] = -wrenches
        columns.append(column.reshape(len(wrenches), -1))
    return np.concatenate(columns).T if columns else np.empty((0, 0))


def _wrenches(at_m: NDArray[np.float64], force: NDArray[np.float64]) -> NDArray[np.float64]:
    """Forces (k, 3) and their moments about the origin in decimeters, shape (k, 6)."""
    return np.hstack([force, 10 * cross(at_m, force)])


def _contacts(blocks: Sequence[Block]) -> list[_Contact]:
    found = [_Contact(None, i, place, _UP) for i, b in enumerate(blocks) for place in _on_floor(b)]
    for (below, one), (above, other) in combinations(enumerate(blocks), 2):
        found += [_Contact(below, above, *place) for place in _between(one, other)]
    return found


@functools.lru_cache(maxsize=_KEPT)
def _on_floor(block: Block) -> tuple[NDArray[np.float64], ...]:
    """Where a block stands on the ground; empty where it does not."""
    points = np.vstack([piece.vertices_m for piece in pieces_of(block)])
    if points[:, 2].min() >= CONTACT_TOLERANCE_M:
        return ()
    return (_outline(points[points[:, 2] < points[:, 2].min() + CONTACT_TOLERANCE_M]),)


@functools.lru_cache(maxsize=_KEPT)
def _between(
    one: Block, other: Block
) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...]:
    """Corners and normal of each contact of two blocks, the normal from the first on."""
    if not boxes_near(bounds_m(one), bounds_m(other), CONTACT_TOLERANCE_M):
        return ()
    met = [_touching(a, b) for a in pieces_of(one) for b in pieces_of(other)]
    return tuple(contact for contact in met if contact is not None)


def _touching(
    first: ConvexPiece, second: ConvexPiece
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    axes = separating_axes(first, second)
    if not -2 * CONTACT_TOLERANCE_M <= axes.gap_m <= CONTACT_TOLERANCE_M:
        return None
    best = axes.directions[axes.gaps_m > axes.gap_m - _SAME_GAP_M]
    direction = best[int(np.argmax(np.abs(best[:, 2])))]
    corners = contact_corners_m(first, second, direction)
    return (corners, direction) if abs(direction[2]) >= _LEAST_VERTICAL and len(corners) else None


def _outline(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points of a flat set that lie farthest out in sixteen directions."""
    angles = np.arange(16) * math.pi / 8 + 0.01
    reach = points[:, :2] @ np.stack([np.cos(angles), np.sin(angles)])
    return points[sorted(set(reach.argmax(axis=0).tolist()))]
