"""Statics: proofs that blocks stand or fall, with a margin.

Blocks stand when forces in their contacts can bear every weight: each force inside the cone of
friction, all forces and moments of a block in balance. Those are linear equations in forces that
only push, with each cone as a pyramid of four edges. If such forces exist, rigid bodies can stand;
if none exist, they cannot. Least squares find most, linear programming decides the rest.

`surely_stands` and `surely_falls` require this with all weights shifted by up to `MARGIN_M` to any
side and long blocks heavier or lighter, and everything in between, so that no verdict depends on a
weight that is nearly over an edge. Shifted weights do not detect a block that rests on two edges
with no area over them, so blocks also have to stand on smaller contacts: those that remain if two
blocks are off by up to the margin from one another. `prove` returns the forces, or the motion of a
fall, for `certificate` to check, which trusts only the contacts computed here.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import FRICTION, SHAPES
from phyblock.domain.scene import Block
from phyblock.errors import PhyblockError
from phyblock.sim import certificate, contact
from phyblock.sim.certificate import Body, Contact, Falls, Stands, Structure
from phyblock.sim.contact import CONTACT_TOLERANCE_M, Turned
from phyblock.sim.geometry import centers_m, cross

Floats = NDArray[np.float64]

MARGIN_M = round(certificate.MARGIN / certificate.ONE, 9)
"""Distance by which every weight may be shifted [m]."""
FRICTIONS = (certificate.LITTLE / 100, certificate.MUCH / 100)
"""The least and the most friction for which a verdict has to hold."""
MASS_FACTORS = (certificate.LIGHT / 100, certificate.HEAVY / 100)
"""The least and the most mass of long blocks, as a multiple of their own."""
SHIFTS_M = np.array(certificate.SHIFTS) / certificate.ONE
"""Corners of a polygon around all shifts (x, y) of a weight [m]."""
_LEAST_VERTICAL = 0.15
_TOLERANCE = 1e-5
_UP = np.array([0.0, 0.0, 1.0])
_STEEP = 0.9
_SAME_GAP_M, _NEARLY_SAME_M = 1e-4, 1e-3
_EXACT, _RIDGE = 1e-11, 1e-9
_LITTLE, _MUCH = FRICTIONS[0] - 1e-7, FRICTIONS[1] + 1e-7
"""Slightly beyond the proven range, since numbers of proofs are rounded."""
_ROUNDS = 6
_KEPT = 1 << 15


def is_balanced(blocks: Sequence[Block], lean: tuple[float, float] = (0.0, 0.0)) -> bool:
    """True if contacts can bear all weights as they are, on a floor with the slope `lean`."""
    weights = _weights(blocks, up=np.array([*lean, 1.0]))
    forces = _matrix(_contacts(blocks), len(blocks), FRICTION)
    return _pushes(forces, weights[:, None]) is not None


def surely_stands(blocks: Sequence[Block]) -> bool:
    """True if blocks are in balance with a margin of `MARGIN_M`, low friction and any masses."""
    return _borne(blocks) is not None


def surely_falls(blocks: Sequence[Block]) -> bool:
    """True if blocks fall with weights off by up to `MARGIN_M`, high friction and any masses."""
    forces = _matrix(_contacts(blocks), len(blocks), FRICTIONS[1])
    if not forces.size:
        return bool(blocks)
    return bool(_least_imbalance(blocks, forces).fun >= _TOLERANCE)


class Proven(NamedTuple):
    """The structure of a proof, and the proof."""

    structure: Structure
    proof: Stands | Falls

    @property
    def stands(self) -> bool:
        """True if the blocks stand, False if they fall."""
        return isinstance(self.proof, Stands)


def prove_standing(blocks: Sequence[Block]) -> Proven | None:
    """Return a checked proof that blocks stand, or None."""
    if not blocks or contact.find_overlaps(blocks):
        return None
    if (borne := _borne(blocks)) is None:
        return None
    forces = []
    for met, shares in borne:
        edges = met.edges(_LITTLE)
        forces += [*np.einsum("kel,kec->lkc", shares.reshape(*edges.shape[:2], -1), edges)]
    proof = Stands(tuple(map(_exact, forces)))
    plain, narrow = (_stated(met) for met, _ in borne)
    structure = Structure(_bodies(blocks), plain, narrow, ())
    return Proven(structure, proof) if certificate.proves(proof, structure) else None


def prove(blocks: Sequence[Block]) -> Proven | None:
    """Return a checked proof that blocks stand or fall; None if statics cannot decide.

    Nothing is proven about blocks that overlap, since they push one another apart.
    """
    if (standing := prove_standing(blocks)) or not blocks or contact.find_overlaps(blocks):
        return standing
    wide = _contacts(blocks, -MARGIN_M)
    solution = _least_imbalance(blocks, _matrix(wide, len(blocks), _MUCH))
    scales = np.tile([[1.0], [10.0]], (len(blocks), 1))
    motion = _exact(-solution.eqlin.marginals.reshape(-1, 3) * scales)
    proof = Falls(tuple(zip(motion[::2], motion[1::2], strict=True)))
    structure = Structure(_bodies(blocks), (), (), _stated(wide))
    return Proven(structure, proof) if certificate.proves(proof, structure) else None


def _borne(blocks: Sequence[Block]) -> list[tuple[_Contacts, Floats]] | None:
    """Contacts as they are, and narrower, each with forces (k, m) that bear its `LOADS`, or None.

    All between two shifts, or masses, that can be borne is borne by the mean of their forces.
    """
    found: list[tuple[_Contacts, Floats]] = []
    for margin_m, shifts_m in ((MARGIN_M, np.zeros((1, 2))), (0.0, SHIFTS_M)):
        met = _contacts(blocks, margin_m)
        loads = [_weights(blocks, at_m, mass) for at_m in shifts_m for mass in MASS_FACTORS[::-1]]
        pushes = _pushes(_matrix(met, len(blocks), _LITTLE), np.column_stack(loads))
        if pushes is None:
            return None
        found.insert(0, (met, pushes))
    return found


def _pushes(forces: Floats, weights: Floats) -> Floats | None:
    """Return the forces, (k, m), that balance weights (6 n, m); None if none do."""
    if not forces.size:
        return None if weights.size else np.zeros((0, weights.shape[1]))
    pushes, is_borne = _least_squares(forces, weights)
    for number in np.flatnonzero(~is_borne):
        weight, used = weights[:, number], np.ones(forces.shape[1], dtype=bool)
        # Without the forces that would have to pull, others may push enough.
        for _ in range(_ROUNDS):
            used &= pushes[:, number] > 0
            some, is_found = _least_squares(forces[:, used], weight[:, None])
            pushes[:, number] = 0.0
            pushes[used, number] = some[:, 0]
            if is_found[0]:
                break
        else:
            solution = _least_residual(forces, weight)
            if solution.fun >= _TOLERANCE:
                return None
            pushes[:, number] = solution.x[: forces.shape[1]]
    return pushes


def _least_squares(forces: Floats, weights: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Forces (k, m) of least squares that bear weights, and True for each without a pull."""
    # SciPy takes a third of a second to import, and a run without requests does not need it.
    from scipy.linalg import cho_factor, cho_solve  # type: ignore[import-untyped]

    square = forces @ forces.T
    factor = cho_factor(square + _RIDGE * np.eye(len(square)), check_finite=False)
    pushes = np.zeros((forces.shape[1], weights.shape[1]))
    for _ in range(3):
        pushes += forces.T @ cho_solve(factor, weights - forces @ pushes, check_finite=False)
    left = np.abs(weights - forces @ pushes).max(axis=0)
    return pushes, (pushes.min(axis=0, initial=0.0) >= 0) & (left < _EXACT)


def _least_imbalance(blocks: Sequence[Block], forces: Floats) -> Any:
    """The solution of a linear program: the least imbalance of weights off by up to `MARGIN_M`.

    Its unknowns are forces, and the weight of all long blocks, and of all others, at each corner of
    `SHIFTS_M`: their sum is the mass, their mean the place.
    """
    others, whole = (
        np.column_stack([_weights(blocks, at_m, mass) for at_m in SHIFTS_M]) for mass in (0.0, 1.0)
    )
    sums = np.hstack([np.zeros((2, forces.shape[1])), np.kron(np.eye(2), np.ones(len(SHIFTS_M)))])
    least, most = zip((1.0, 1.0), MASS_FACTORS, strict=True)
    unknown = np.hstack([forces, -others, others - whole])
    limits = np.vstack([sums, -sums]), np.array([*most, *(-one for one in least)])
    return _least_residual(unknown, np.zeros(len(unknown)), limits)


def _least_residual(
    unknown: Floats, target: Floats, limits: tuple[Floats, Floats] | None = None
) -> Any:
    """The solution of a linear program for the least sum of residuals, which always exists."""
    from scipy import sparse  # type: ignore[import-untyped]
    from scipy.optimize import linprog  # type: ignore[import-untyped]

    rows, count = unknown.shape
    left_over = sparse.identity(rows)
    within, most = limits or (np.zeros((0, count)), np.zeros(0))
    solution = linprog(
        np.concatenate([np.zeros(count), np.ones(2 * rows)]),
        A_eq=sparse.hstack([sparse.csr_matrix(unknown), left_over, -left_over]),
        b_eq=target,
        A_ub=np.hstack([within, np.zeros((len(within), 2 * rows))]),
        b_ub=most,
        method="highs",
        options={"dual_feasibility_tolerance": 1e-10},
    )
    if solution.status != 0:
        raise PhyblockError(f"statics of {rows // 6} blocks are not decided: {solution.message}")
    return solution


def _weights(
    blocks: Sequence[Block],
    shift_m: Sequence[float] | Floats = (0.0, 0.0),
    long: float = 1.0,
    up: Floats = _UP,
) -> Floats:
    """The upward force that each block needs, and its moment, shape (6 n,), if all others weigh 1.

    Long blocks have `long` times their mass.
    """
    kg = np.array([SHAPES[b.type].mass_kg for b in blocks])
    factors = np.array([long if SHAPES[b.type].is_long else 1.0 for b in blocks])
    centers = centers_m(blocks)
    centers[:, :2] += shift_m
    return _wrenches(centers, np.outer(kg * factors / kg.sum(), up)).ravel()


class _Contacts(NamedTuple):
    """Corners of contacts: the pushing and the pushed block (the ground is -1), places (k, 3) [m],
    and directions (k, 3, 3): the normal, from one to the other, and two at right angles to it.
    """

    below: NDArray[np.int64]
    above: NDArray[np.int64]
    places_m: Floats
    axes: Floats
    is_wide: bool

    def edges(self, friction: float) -> Floats:
        """Edges of a pyramid inside the friction cone of each, or around it if that is wide."""
        ways = (
            [(1, 1), (1, -1), (-1, 1), (-1, -1)]
            if self.is_wide
            else [(1, 0), (-1, 0), (0, 1), (0, -1)]
        )
        return self.axes[:, None, 0] + friction * np.einsum("es,ksc->kec", ways, self.axes[:, 1:])


def _contacts(blocks: Sequence[Block], margin_m: float = 0.0) -> _Contacts:
    """All contacts of blocks, narrower by a margin, or wider if it is negative."""
    is_wide = margin_m < 0
    found = [
        (certificate.GROUND, i, corners, _UP)
        for i, b in enumerate(blocks)
        for corners in _on_floor(b)
    ]
    for (below, one), (above, other) in combinations(enumerate(blocks), 2):
        if contact.boxes_near(contact.bounds_m(one), contact.bounds_m(other), CONTACT_TOLERANCE_M):
            found += [
                (below, above, corners + one.position_m, normal)
                for corners, normal in _between(*contact.beside(one, other), margin_m)
            ]
    axes = []
    for *_, corners, normal in found:
        helper = _UP if abs(normal[2]) < _STEEP else np.array([1.0, 0.0, 0.0])
        side = cross(normal, helper)
        side /= np.linalg.norm(side)
        axes.append(np.tile(np.stack([normal, side, cross(normal, side)]), (len(corners), 1, 1)))
    if not found:
        none = np.empty(0, dtype=np.int64)
        return _Contacts(none, none, np.empty((0, 3)), np.empty((0, 3, 3)), is_wide)
    pairs, corners_m = np.array([one[:2] for one in found]), [one[2] for one in found]
    below, above = np.repeat(pairs, list(map(len, corners_m)), axis=0).T
    return _Contacts(below, above, np.concatenate(corners_m), np.concatenate(axes), is_wide)


def _matrix(met: _Contacts, count: int, friction: float) -> Floats:
    """Effect of a unit of force along each edge of each cone on so many blocks, shape (6 n, k)."""
    edges = met.edges(friction)
    wrenches = _wrenches(met.places_m[:, None], edges)
    columns = np.zeros((len(edges), edges.shape[1], count, 6))
    at = np.arange(len(edges))
    is_block = met.below != certificate.GROUND
    columns[at, :, met.above] = wrenches
    columns[at[is_block], :, met.below[is_block]] = -wrenches[is_block]
    return columns.reshape(4 * len(edges), 6 * count).T


def _wrenches(at_m: Floats, force: Floats) -> Floats:
    """Forces (..., 3) and their moments about the origin in decimeters, shape (..., 6)."""
    return np.concatenate([force, 10 * cross(at_m, force)], axis=-1)


def _exact(vectors: Floats) -> tuple[certificate.Vector, ...]:
    """Vectors (k, 3) as integers over `certificate.ONE`."""
    return tuple(map(tuple, np.rint(vectors * certificate.ONE).astype(np.int64).tolist()))


def _bodies(blocks: Sequence[Block]) -> tuple[Body, ...]:
    """Blocks as bodies of a proof."""
    kg = [SHAPES[block.type].mass_kg for block in blocks]
    weights = [round(one / sum(kg) * certificate.ONE) for one in kg]
    is_long = [SHAPES[block.type].is_long for block in blocks]
    return tuple(map(Body, weights, is_long, _exact(centers_m(blocks))))


def _stated(met: _Contacts) -> tuple[Contact, ...]:
    """Contacts as contacts of a proof."""
    normals, *sides = (_exact(met.axes[:, axis]) for axis in range(3))
    who = (met.below.tolist(), met.above.tolist())
    return tuple(map(Contact, *who, _exact(met.places_m), normals, zip(*sides, strict=True)))


@functools.lru_cache(maxsize=_KEPT)
def _on_floor(block: Block) -> tuple[Floats, ...]:
    """Corners of a block's contact with the ground; empty if there is none."""
    points = np.vstack([piece.vertices_m for piece in contact.pieces_of(block)])
    if points[:, 2].min() >= CONTACT_TOLERANCE_M:
        return ()
    foot = points[points[:, 2] < points[:, 2].min() + CONTACT_TOLERANCE_M]
    # The outermost points in sixteen directions.
    angles = np.arange(16) * math.pi / 8 + 0.01
    reach = foot[:, :2] @ np.stack([np.cos(angles), np.sin(angles)])
    return (foot[sorted(set(reach.argmax(axis=0).tolist()))],)


@functools.lru_cache(maxsize=_KEPT)
def _between(
    one: Turned, other: Turned, way_m: tuple[float, float, float], margin_m: float
) -> tuple[tuple[Floats, Floats], ...]:
    """Corners of the contacts of two blocks from the first one's place, and normals from it."""
    met, is_wide = [], margin_m < 0
    for first, second, axes in contact.piece_pairs(contact.at(one), contact.at(other, way_m)):
        # A balance must not press on a block across a gap; a fall allows for all that may touch.
        most_m = CONTACT_TOLERANCE_M if is_wide else contact.FIT_TOLERANCE_M
        if not -2 * CONTACT_TOLERANCE_M <= axes.gap_m <= most_m:
            continue
        near_m = _NEARLY_SAME_M if is_wide else _SAME_GAP_M
        best = axes.directions[axes.gaps_m > axes.gap_m - near_m]
        # A fall needs all possible directions of a push; a balance uses the most upright one.
        if not is_wide:
            best = best[[int(np.argmax(np.abs(best[:, 2])))]]
            best = best[np.abs(best[:, 2]) >= _LEAST_VERTICAL]
        for direction in np.unique(best.round(9), axis=0) if is_wide else best:
            corners = contact.contact_corners_m(first, second, direction, margin_m)
            if len(corners):
                met.append((corners, direction))
    return tuple(met)
