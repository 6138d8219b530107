"""Proofs of standing and falling: accepted as they are, and refused once anything is changed."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator
from itertools import product
from pathlib import Path
from typing import Any

import pytest

from phyblock.sim import certificate
from phyblock.sim.balance import prove
from phyblock.sim.certificate import ONE, Falls, Stands, proves
from tests.sim.structures import block, tower

STANDING = prove([*tower(1), block(2, "cuboid3", (0, 0, 0.0625), (0, 0, 90))])
FALLING = prove([*tower(1), block(2, "cuboid2", (0.06, 0, 0.0625))])


def put(value: Any, path: tuple[int, ...], change: Callable[[int], int]) -> Any:
    """Nested tuples with the number at a path changed."""
    if not path:
        return change(value)
    parts = [
        put(part, path[1:], change) if at == path[0] else part for at, part in enumerate(value)
    ]
    return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)


def numbers(value: Any, path: tuple[int, ...] = ()) -> Iterator[tuple[int, ...]]:
    """The path of each number in nested tuples."""
    if not isinstance(value, tuple):
        yield path
    else:
        for at, part in enumerate(value):
            yield from numbers(part, (*path, at))


def test_a_proof_holds_for_what_it_was_found_for_alone() -> None:
    assert STANDING is not None
    assert FALLING is not None
    assert (STANDING.stands, FALLING.stands) == (True, False)
    assert isinstance(STANDING.proof, Stands)
    assert isinstance(FALLING.proof, Falls)
    assert proves(STANDING.proof, STANDING.structure)
    assert proves(FALLING.proof, FALLING.structure)
    assert not proves(STANDING.proof, FALLING.structure)
    assert not proves(FALLING.proof, STANDING.structure)


def test_a_proof_with_any_force_changed_or_left_out_is_refused() -> None:
    assert STANDING is not None
    paths = list(numbers(STANDING.proof))
    for path in paths[:: max(1, len(paths) // 150)]:
        for by in (ONE // 10**4, -ONE // 10**4):
            wrong = put(STANDING.proof, path, lambda number, by=by: number + by)
            assert not proves(wrong, STANDING.structure)
    forces = STANDING.proof.forces
    for fewer in ((), forces[:-1], (forces[0][:-1], *forces[1:]), (*forces, forces[0])):
        assert not proves(Stands(fewer), STANDING.structure)


@pytest.mark.parametrize("field", ["bodies", "contacts", "narrow"])
def test_a_standing_that_is_not_as_its_proof_has_it_is_refused(field: str) -> None:
    assert STANDING is not None
    at = STANDING.structure._fields.index(field)
    for path in numbers(STANDING.structure[at]):
        # How high a weight is, or forces that are all upright, does not matter.
        if path[1:] == (2, 2):
            continue
        # An index, a flag or a length: each is changed to what it is not.
        wrong = put(
            STANDING.structure,
            (at, *path),
            lambda n: (
                (not n) if isinstance(n, bool) else n + (1 if abs(n) < 9 and n else ONE // 20)
            ),
        )
        assert not proves(STANDING.proof, wrong), (field, path)


def test_a_fall_with_its_motion_or_its_contacts_changed_is_refused() -> None:
    assert FALLING is not None
    motion = FALLING.proof.motion
    still = ((0, 0, 0), (0, 0, 0))
    up = tuple(((-a, -b, -c), (-d, -e, -f)) for (a, b, c), (d, e, f) in motion)
    for wrong in ((), motion[:-1], (still,) * len(motion), up, (motion[1], motion[0])):
        assert not proves(Falls(wrong), FALLING.structure)
    for body, axis, by in product((0, 1), (0, 1, 2), (ONE, -ONE)):
        wrong = put(FALLING.proof, (0, body, 0, axis), lambda number, by=by: number + by)
        assert not proves(wrong, FALLING.structure), (body, axis, by)
    for contact in range(len(FALLING.structure.wide)):
        for path in ((0,), (1,)):
            wrong = put(FALLING.structure, (3, contact, *path), lambda _: 7)
            assert not proves(FALLING.proof, wrong)
        wrong = put(FALLING.structure, (3, contact, 3, 2), lambda number: number // 2)
        assert not proves(FALLING.proof, wrong)


def test_the_checker_needs_the_standard_library_alone() -> None:
    tree = ast.parse(Path(certificate.__file__).read_text(encoding="utf-8"))
    names = [node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.Import)]
    assert {str(name).partition(".")[0] for name in names} <= set(sys.stdlib_module_names)
