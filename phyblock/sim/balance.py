"""Statics: can blocks stand as they are, and with how much to spare.

Blocks stand when forces in their contacts can bear every weight: each force inside the cone of
friction, all forces and moments of a block in balance. That is a set of linear equations in
forces that only push, each cone as a pyramid of four edges. Where such forces exist, rigid bodies
may stand; where none exist, they cannot.

Non-negative least squares (Lawson and Hanson, 1974) look for forces. Those that it gives are put
into the equations, and that there are none is believed only where the residual proves it (Farkas'
lemma), for a solver may stop early. Linear programming settles the rest.

`surely_stands` and `surely_falls` ask so with all weights off by up to `MARGIN_M` to any side and
long blocks heavier or lighter by `MASS_FACTORS`, with all that lies between, so that no verdict
hangs on an edge that a weight is nearly over. Weights alone do not tell a block that rests on two
edges with nothing over them, so what stands has to stand on smaller contacts too: those that are
left wherever two blocks are off by up to the margin from one another.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import FRICTION, SHAPES, BlockType, euler_deg_to_matrix
from phyblock.domain.scene import Block
from phyblock.errors import PhyblockError
from phyblock.sim.contact import (
    CONTACT_TOLERANCE_M,
    bounds_m,
    boxes_near,
    contact_corners_m,
    piece_pairs,
    pieces_of,
)
from phyblock.sim.geometry import cross

Floats = NDArray[np.float64]

MARGIN_M = 0.005  # Distance by which every weight may be off its place [m].
FRICTIONS = (0.28, 0.45)  # The least and the most friction that a verdict has to hold under.
Masses = tuple[tuple[BlockType, float], ...]
"""Types of which every block has so many times its mass."""
MASS_FACTORS = (0.87, 1.15)
"""Long blocks may have so many times their mass at the least, and at the most."""
MASSES: tuple[Masses, ...] = tuple(
    tuple((block_type, factor) for block_type, shape in SHAPES.items() if shape.is_long)
    for factor in reversed(MASS_FACTORS)
)
"""Factors of mass at the ends of that range: long blocks heavier, and lighter."""
_SIDES = np.array([(math.cos(a), math.sin(a)) for a in np.arange(8) * math.pi / 4])
_LEAST_VERTICAL = 0.15
_TOLERANCE = 1e-5
_PROOF = 1e4  # A residual is a proof for forces that add up to so many times all weights, no more.
_UP = np.array([0.0, 0.0, 1.0])
_STEEP = 0.9
_SAME_GAP_M = 1e-4
_KEPT = 2048


def surely_stands(blocks: Sequence[Block]) -> bool:
    """True if blocks are in balance with a margin of `MARGIN_M`, little friction, any masses."""
    return is_balanced(blocks, FRICTIONS[0], MARGIN_M, MASSES)


def surely_falls(blocks: Sequence[Block]) -> bool:
    """True if blocks fall with weights off by up to `MARGIN_M`, much friction, any masses.

    One linear program has forces, shifts (of all long blocks, of all others) and the mass of long
    blocks as its unknowns, and no solution.
    """
    # SciPy takes a third of a second to import, which a run that asks nobody does without.
    from scipy import sparse  # type: ignore[import-untyped]

    forces = _forces(blocks, FRICTIONS[1])
    if not forces.size:
        return bool(blocks)
    is_long = np.array([SHAPES[block.type].is_long for block in blocks])
    masses = np.array([SHAPES[block.type].mass_kg for block in blocks])
    loads = []
    for chosen in (~is_long, is_long):  # What they need, and its growth for `MARGIN_M` along x, y.
        weights = masses * chosen / masses.sum()
        needs = _needs(blocks, weights)
        steps = [_needs(blocks, weights, MARGIN_M * side) - needs for side in np.eye(2)]
        loads.append(np.column_stack([needs, *steps]))
    count = forces.shape[1]
    # A mass, and the mass times each part of its shift: the shift alone would not be linear.
    octagon = np.column_stack([-np.ones(len(_SIDES)), _SIDES])
    both = sparse.csr_matrix(np.kron(np.eye(2), octagon))
    shifts = sparse.hstack([sparse.csr_matrix((16, count)), both])
    free = (None, None)
    bounds = [(0, None)] * count + [(1.0, 1.0), free, free, MASS_FACTORS, free, free]
    unknown = np.hstack([forces, *(-load for load in loads)])
    left = _least_residual(unknown, np.zeros(len(unknown)), bounds, shifts)
    return left >= _TOLERANCE


def is_balanced(
    blocks: Sequence[Block],
    friction: float = FRICTION,
    margin_m: float = 0.0,
    masses: Sequence[Masses] = ((),),
) -> bool:
    """True if contacts can bear all weights, whichever of the masses blocks have.

    With a margin [m], also all weights moved by up to so much to any side, and those in their place
    where every contact is narrower by it. The former is asked at the corners of an octagon: of two
    shifts, or masses, that can be borne, what lies between is borne by the mean of their forces.
    """
    forces = _forces(blocks, friction)
    shifts = margin_m / math.cos(math.pi / 8) * _SIDES if margin_m else np.zeros((1, 2))
    if not all(_bears(forces, _weights(blocks, at, kg)) for at in shifts for kg in masses):
        return False
    narrow = _forces(blocks, friction, margin_m) if margin_m else forces
    return not margin_m or all(_bears(narrow, _weights(blocks, (0, 0), kg)) for kg in masses)


def _bears(forces: Floats, weights: Floats) -> bool:
    """True if some sum of the forces, each as large as need be, balances all weights."""
    if not forces.size:
        return not weights.size
    from scipy.optimize import nnls  # type: ignore[import-untyped]

    try:
        pushes, _ = nnls(forces, weights)
    except RuntimeError:  # It found no end, which says nothing of whether there is a balance.
        return _least_residual(forces, weights) < _TOLERANCE
    left = weights - forces @ pushes
    if float(np.linalg.norm(left)) < _TOLERANCE:
        return True
    # A sum of forces, each of which `left` is at odds with, does nothing that `left` asks for.
    if _PROOF * float((left @ forces).max()) < float(left @ weights):
        return False
    return _least_residual(forces, weights) < _TOLERANCE


def _least_residual(
    unknown: Floats,
    target: Floats,
    bounds: Sequence[tuple[float | None, float | None]] | None = None,
    at_most_zero: Any = None,
) -> float:
    """The least residual of a target, as a sum, by linear programming, which always ends."""
    from scipy import sparse
    from scipy.optimize import linprog

    rows, count = unknown.shape
    left_over = sparse.identity(rows)
    slack = [(0.0, None)] * (2 * rows)
    within = sparse.csr_matrix((0, count)) if at_most_zero is None else at_most_zero
    solution = linprog(
        np.concatenate([np.zeros(count), np.ones(2 * rows)]),
        A_eq=sparse.hstack([sparse.csr_matrix(unknown), left_over, -left_over]),
        b_eq=target,
        A_ub=sparse.hstack([within, sparse.csr_matrix((within.shape[0], 2 * rows))]),
        b_ub=np.zeros(within.shape[0]),
        bounds=[*(bounds or [(0.0, None)] * count), *slack],
        method="highs",
    )
    if solution.status != 0:
        raise PhyblockError(f"statics of {rows // 6} blocks are not decided: {solution.message}")
    return float(solution.fun)


def _weights(
    blocks: Sequence[Block], shift_m: Sequence[float] | Floats, masses: Masses = ()
) -> Floats:
    """The force up that each block needs, and its moment, shape (6 n,), of a whole weight of 1."""
    factors = dict(masses)
    weights = np.array([SHAPES[b.type].mass_kg * factors.get(b.type, 1.0) for b in blocks])
    return _needs(blocks, weights / weights.sum(), shift_m)


def _needs(
    blocks: Sequence[Block], weights: Floats, shift_m: Sequence[float] | Floats = (0.0, 0.0)
) -> Floats:
    """The force up that each block of some weight needs, and its moment, shape (6 n,)."""
    centers = np.zeros((len(blocks), 3))
    for center, b in zip(centers, blocks, strict=True):
        center += euler_deg_to_matrix(b.euler_deg) @ np.array(SHAPES[b.type].center_of_mass_m)
        center += b.position_m
    centers[:, :2] += shift_m
    return _wrenches(centers, np.outer(weights, _UP)).ravel()


def _forces(blocks: Sequence[Block], friction: float, margin_m: float = 0.0) -> Floats:
    """Effect of a unit of force along each edge of each cone on each block, shape (6 n, k)."""
    contacts: list[tuple[int | None, int, Floats, Floats]] = [
        (None, i, corners, _UP) for i, b in enumerate(blocks) for corners in _on_floor(b)
    ]
    for (below, one), (above, other) in combinations(enumerate(blocks), 2):
        contacts += [(below, above, *place) for place in _between(one, other, margin_m)]
    columns = []
    for pusher, pushed, corners_m, normal in contacts:
        helper = _UP if abs(normal[2]) < _STEEP else np.array([1.0, 0.0, 0.0])
        side = cross(normal, helper)
        side /= np.linalg.norm(side)
        across = cross(normal, side)
        edges = normal + friction * np.stack([side, -side, across, -across])
        places = np.repeat(corners_m, len(edges), axis=0)
        wrenches = _wrenches(places, np.tile(edges, (len(corners_m), 1)))
        column = np.zeros((len(wrenches), len(blocks), 6))
        column[:, pushed] = wrenches
        if pusher is not None:
            column[:, pusher] = -wrenches
        columns.append(column.reshape(len(wrenches), -1))
    return np.concatenate(columns).T if columns else np.empty((0, 0))


def _wrenches(at_m: Floats, force: Floats) -> Floats:
    """Forces (k, 3) and their moments about the origin in decimeters, shape (k, 6)."""
    return np.hstack([force, 10 * cross(at_m, force)])


@functools.lru_cache(maxsize=_KEPT)
def _on_floor(block: Block) -> tuple[Floats, ...]:
    """Corners of a block's contact with the ground; empty where there is none."""
    points = np.vstack([piece.vertices_m for piece in pieces_of(block)])
    if points[:, 2].min() >= CONTACT_TOLERANCE_M:
        return ()
    foot = points[points[:, 2] < points[:, 2].min() + CONTACT_TOLERANCE_M]
    # The points that lie farthest out in sixteen directions.
    angles = np.arange(16) * math.pi / 8 + 0.01
    reach = foot[:, :2] @ np.stack([np.cos(angles), np.sin(angles)])
    return (foot[sorted(set(reach.argmax(axis=0).tolist()))],)


@functools.lru_cache(maxsize=_KEPT)
def _between(one: Block, other: Block, margin_m: float) -> tuple[tuple[Floats, Floats], ...]:
    """Corners and normal of each contact of two blocks, the normal from the first on."""
    if not boxes_near(bounds_m(one), bounds_m(other), CONTACT_TOLERANCE_M):
        return ()
    met = []
    for first, second, axes in piece_pairs(one, other):
        if not -2 * CONTACT_TOLERANCE_M <= axes.gap_m <= CONTACT_TOLERANCE_M:
            continue
        best = axes.directions[axes.gaps_m > axes.gap_m - _SAME_GAP_M]
        direction = best[int(np.argmax(np.abs(best[:, 2])))]
        corners = contact_corners_m(first, second, direction, margin_m)
        if abs(direction[2]) >= _LEAST_VERTICAL and len(corners):
            met.append((corners, direction))
    return tuple(met)
