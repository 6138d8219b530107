"""Proofs that blocks stand or fall, and a checker of them that needs only integers.

Every number is an exact rational: an integer over `ONE`. Places are in meters, forces and weights
in units of the total weight. `balance` describes the blocks and contacts as a `Structure` and finds
proofs in floating point; the search does not have to be trusted.

`Stands` holds forces, inside the friction cones, that bear all weights up to a billionth, with long
blocks lighter or heavier: once with all weights together shifted by `MARGIN` to any side, and once
with weights in place and every contact narrower by the margin. `Falls` holds a motion of every
block that releases energy, and that no force in any contact, made wider by the margin, works
against (Farkas' lemma): a balance would need forces that sum to `_STRONGEST` times the weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

ONE = 2**40
Vector = tuple[int, int, int]
MARGIN = ONE * 5 // 1000  # Distance by which weights, and contacts of blocks, may be off [m].
LITTLE, MUCH = 28, 45  # The least and the most friction [percent].
LIGHT, HEAVY = 87, 115  # The least and the most mass of a long block [percent].
_FAR, _HALF = MARGIN * 10824 // 10000, MARGIN * 7654 // 10000
SHIFTS = tuple(
    (x, y)
    for x, y in product((-_FAR, -_HALF, 0, _HALF, _FAR), repeat=2)
    if (abs(x), abs(y)) in ((_FAR, 0), (0, _FAR), (_HALF, _HALF))
)
"""Corners of an octagon around all shifts of a weight."""
LOADS = (*product(SHIFTS, (HEAVY, LIGHT), (False,)), *product(((0, 0),), (HEAVY, LIGHT), (True,)))
"""Shift of all weights, mass of long blocks, and True for narrow contacts."""
GROUND = -1
_REMAINDER, _STRONGEST = 10**9, 10**5


class Body(NamedTuple):
    """A block: its share of the total weight, and its center of mass."""

    weight: int
    is_long: bool
    center: Vector


class Contact(NamedTuple):
    """A place where `below` may push `above`, the unit normal that way, and two axes across it."""

    below: int
    above: int
    place: Vector
    normal: Vector
    sides: tuple[Vector, Vector]


class Structure(NamedTuple):
    """Blocks, and the corners of their contacts as they are, narrower and wider."""

    bodies: tuple[Body, ...]
    contacts: tuple[Contact, ...]
    narrow: tuple[Contact, ...]
    wide: tuple[Contact, ...]


class Stands(NamedTuple):
    """A force in each contact for each of `LOADS`."""

    forces: tuple[tuple[Vector, ...], ...]


class Falls(NamedTuple):
    """The velocity of each body at the origin, and its angular velocity."""

    motion: tuple[tuple[Vector, Vector], ...]


def proves(proof: Stands | Falls, structure: Structure) -> bool:
    """Return True if the proof holds for the structure."""
    contacts = (*structure.contacts, *structure.narrow, *structure.wide)
    count = len(structure.bodies)
    if not all(GROUND <= one.below < count and 0 <= one.above < count for one in contacts):
        return False
    for axes in {(one.normal, *one.sides) for one in contacts}:
        for (i, a), (j, b) in product(enumerate(axes), repeat=2):
            # Unit vectors at right angles, but for rounding.
            if abs(_dot(a, b) - ONE**2 * (i == j)) >= ONE**2 >> 20:
                return False
    if isinstance(proof, Falls):
        return _releases(structure, proof.motion)
    cases = zip(LOADS, proof.forces, strict=False)
    return len(proof.forces) == len(LOADS) and all(_bears(structure, *case) for case in cases)


def _bears(
    structure: Structure, load: tuple[tuple[int, int], int, bool], forces: Sequence[Vector]
) -> bool:
    """True if forces are within friction, and bear a load up to the allowed remainder."""
    shift, mass, is_narrow = load
    contacts = structure.narrow if is_narrow else structure.contacts
    if len(forces) != len(contacts):
        return False
    left = []
    for body in structure.bodies:
        weight = body.weight * (mass if body.is_long else 100)
        x, y = (body.center[axis] + shift[axis] for axis in (0, 1))
        left.append([0, 0, -weight * ONE, -y * weight, x * weight, 0])
    for contact, force in zip(contacts, forces, strict=True):
        push = _dot(force, contact.normal)
        aside = _dot(force, contact.sides[0]) ** 2 + _dot(force, contact.sides[1]) ** 2
        if push < 0 or 100**2 * aside > LITTLE**2 * push**2:
            return False
        x, y, z = force
        wrench = (ONE * x, ONE * y, ONE * z, *_cross(contact.place, force))
        for number, sign in ((contact.above, 100), (contact.below, -100)):
            if number != GROUND:
                left[number] = [a + sign * b for a, b in zip(left[number], wrench, strict=True)]
    most = sum(body.weight for body in structure.bodies) * ONE * 100 // _REMAINDER
    return all(abs(part) <= most for parts in left for part in parts)


def _releases(structure: Structure, motion: Sequence[tuple[Vector, Vector]]) -> bool:
    """True if a motion releases more energy than forces in the contacts could absorb."""
    if len(motion) != len(structure.bodies):
        return False
    against = 0
    for contact in structure.wide:
        away = _velocity(motion[contact.above], contact.place)
        if contact.below != GROUND:
            other = _velocity(motion[contact.below], contact.place)
            away = (away[0] - other[0], away[1] - other[1], away[2] - other[2])
        # An upper bound of friction in directions between the sides.
        aside = sum(abs(_dot(away, side)) for side in contact.sides)
        against = max(against, MUCH * aside - 100 * _dot(away, contact.normal))
    released = []
    for is_long in (False, True):
        energy, turn_x, turn_y = 0, 0, 0
        for body, move in zip(structure.bodies, motion, strict=True):
            weight = body.weight * (body.is_long == is_long)
            energy -= weight * _velocity(move, body.center)[2]
            turn_x, turn_y = turn_x + weight * move[1][0], turn_y + weight * move[1][1]
        released.append(energy - max(turn_x * y - turn_y * x for x, y in SHIFTS))
    return all(released[0] * 100 + released[1] * m > _STRONGEST * against for m in (LIGHT, HEAVY))


def _dot(one: Vector, other: Vector) -> int:
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]


def _cross(one: Vector, other: Vector) -> Vector:
    (a, b, c), (x, y, z) = one, other
    return b * z - c * y, c * x - a * z, a * y - b * x


def _velocity(move: tuple[Vector, Vector], place: Vector) -> Vector:
    """The velocity of a moving body at a place, over `ONE` squared."""
    (x, y, z), (a, b, c) = move[0], _cross(move[1], place)
    return ONE * x + a, ONE * y + b, ONE * z + c
