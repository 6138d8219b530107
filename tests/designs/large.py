"""Structures of level 4, designed by hand: thirteen to twenty-two blocks.

Coordinates are grid units of 2.5 cm; y runs along the front that the camera sees best.
"""

from __future__ import annotations

from tests.designs.pad import Design, Pad

__all__ = ["LEVEL_4"]


def _castle(s: Pad) -> None:
    s.put("arch")
    for side in (-3, 3):
        s.put("cube", side, color="blue")
    s.put("cuboid2", pose="flat-y")
    for side in (-3, 3):
        s.put("cuboid1", side)
    for side in (-3, 3):
        s.put("cylinder", side)
    for side in (-1, 1):
        s.put("cube", side, color="green")
    s.put("cuboid2", pose="flat-y")
    s.put("triangle")
    for side in (-3, 3):
        s.put("cuboid1", side)
    for side in (-3, 3):
        s.put("triangle", side)


def _temple(s: Pad) -> None:
    for depth in (-1, 1):
        s.put("cuboid3", x=depth, pose="flat-y")
    for depth in (-1, 1):
        for side in (-2, 2):
            s.put("cylinder", side, depth)
    for depth in (-1, 1):
        s.put("cuboid3", x=depth, pose="flat-y")
    for depth in (-1, 1):
        s.put("cuboid2", x=depth, pose="flat-y")
    # A ramp behind these two, on the left, would show from nowhere in front.
    s.put("triangle", 1, -1, pose="ramp+y")
    s.put("triangle", -1, 1, pose="ramp-y")
    s.put("triangle", 1, 1, pose="ramp+y")


def _aqueduct(s: Pad) -> None:
    for side in (-4, 0, 4):
        s.put("arch", side)
    for side in (-3, 3):
        s.put("cuboid3", side, pose="flat-y")
    for side in (-2, 2):
        s.put("arch", side)
    for side in (-5, 5):
        s.put("cube", side, color="yellow")
    for side in (-2, 2):
        s.put("cuboid2", side, pose="flat-y")
    for side in (-5, 5):
        s.put("semi_cylinder", side)
    s.put("arch")
    s.put("triangle")


def _twin_towers(s: Pad) -> None:
    for side in (-3, 3):
        s.put("cuboid2", side, pose="flat-x")
    for side in (-3, 3):
        for depth in (-1, 1):
            s.put("cylinder", side, depth)
    for side in (-3, 3):
        s.put("cuboid2", side, pose="flat-x")
    for depth in (-1, 1):
        for side in (-3, 3):
            s.put("cuboid3", side, depth, pose="flat-y")
    for side in (-3, 3):
        s.put("arch", side, pose="gate-turned")
    for side in (-3, 3):
        s.put("triangle", side, pose="roof-turned")


def _cathedral(s: Pad) -> None:
    s.put("arch")
    s.pair("cube", 3, color="yellow")
    s.pair("triangle", 5, poses=("ramp-y", "ramp+y"))
    s.put("cuboid2", pose="flat-y")
    s.pair("cylinder", 3)
    s.put("arch")
    s.pair("cube", 3, color="blue")
    s.put("triangle")
    s.pair("triangle", 3, poses=("roof", "roof"))


def _harbor(s: Pad) -> None:
    s.origin = (-5.0, 0.0)
    s.put("cuboid2", x=-1, pose="flat-y")
    s.put("cuboid2", x=1, pose="flat-y")
    s.put("cube", color="red")
    s.put("cuboid1")
    s.put("cylinder")
    s.put("cuboid1")
    s.put("cube", color="yellow")
    s.put("semi_cylinder")
    s.origin = (3.0, 0.0)
    s.put("arch", pose="cradle")
    s.put("cuboid3", pose="flat-y")
    s.put("cube", -1, color="blue")
    s.put("cube", 1, color="green")
    s.put("cuboid2", pose="flat-y")
    s.put("semi_cylinder", 1, pose="round-y")
    s.put("triangle", -1)


def _playground(s: Pad) -> None:
    s.origin = (-4.0, 0.0)
    s.pair("cuboid1", 2)
    s.pair("cylinder", 2)
    s.put("cuboid3", pose="flat-y")
    s.put("cube", color="red")
    s.pair("semi_cylinder", 2)
    s.put("triangle")
    s.origin = (4.0, 0.0)
    s.put("cube", -2, color="blue")
    s.put("cube", color="green")
    s.put("triangle", 2, pose="ramp+y")
    s.put("cube", -2, color="yellow")
    s.put("triangle", 0, pose="ramp+y")
    s.put("triangle", -2)


def _palace(s: Pad) -> None:
    for side in (-3, 3):
        s.put("cuboid3", side, pose="flat-y")
    for side in (-5, 5):
        s.put("cube", side, color="red")
    for side in (-2, 2):
        s.put("arch", side)
    for side in (-4, 4):
        s.put("cuboid2", side, pose="flat-y")
    s.put("cuboid2", pose="flat-y")
    s.put("arch")
    for side in (-3, 3):
        s.put("cube", side, color="blue")
    for side in (-5, 5):
        s.put("semi_cylinder", side)
    s.put("cuboid2", pose="flat-y")
    s.put("triangle", -3, pose="ramp-y")
    s.put("triangle", 3, pose="ramp+y")
    s.put("cylinder")
    s.put("triangle")


LEVEL_4: dict[str, Design] = {
    "l4-aqueduct": _aqueduct,
    "l4-castle": _castle,
    "l4-cathedral": _cathedral,
    "l4-harbor": _harbor,
    "l4-palace": _palace,
    "l4-playground": _playground,
    "l4-temple": _temple,
    "l4-twin-towers": _twin_towers,
}
