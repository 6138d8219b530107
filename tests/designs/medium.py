"""Structures of level 3, designed by hand: six to twelve blocks, up to eight layers.

Coordinates are grid units of 2.5 cm; y runs along the front that the camera sees best.
"""

from __future__ import annotations

from tests.designs.pad import Design, Pad

__all__ = ["LEVEL_3"]


def _torii(s: Pad) -> None:
    s.pair("cuboid1", 2)
    s.pair("cylinder", 2)
    s.put("cuboid3", pose="flat-y")
    s.put("cube", color="red")
    s.pair("cuboid1", 2, poses=("edge-x", "edge-x"))
    s.put("cuboid3", pose="flat-y")
    s.pair("triangle", 2, poses=("ramp+y", "ramp-y"))


def _beacon(s: Pad) -> None:
    s.put("cuboid2", x=-1, pose="flat-y")
    s.put("cuboid2", x=1, pose="flat-y")
    s.put("cube", color="red")
    s.put("cuboid1")
    s.put("cylinder")
    s.put("cuboid1")
    s.put("cube", color="yellow")
    s.put("triangle")


def _robot(s: Pad) -> None:
    s.pair("cylinder", 1)
    s.put("cuboid2", pose="flat-y")
    s.put("cube", -1, color="blue")
    s.put("cube", 1, color="blue")
    s.put("cuboid3", pose="flat-y")
    s.put("cube", color="green")
    s.put("semi_cylinder")


def _viaduct(s: Pad) -> None:
    s.pair("arch", 2)
    s.pair("triangle", 5, poses=("ramp-y", "ramp+y"))
    s.pair("cuboid2", 2, poses=("flat-y", "flat-y"))
    s.put("arch")
    s.pair("cube", 3, color="blue")
    s.pair("semi_cylinder", 3)
    s.put("triangle")


def _elephant(s: Pad) -> None:
    s.put("arch", x=-1)
    s.put("arch", x=1)
    s.put("cuboid2", -1, pose="flat-x")
    s.put("cuboid2", 1, pose="flat-x")
    s.put("cube", 1, color="blue")
    s.put("triangle", 3, pose="ramp+y")
    s.put("triangle", -1, pose="ramp-y")
    s.put("semi_cylinder", 1)


def _brick_pyramid(s: Pad) -> None:
    s.pair("cube", 2, color="blue")
    s.put("cube", color="green")
    s.pair("cube", 1, color="yellow")
    s.put("cuboid2", pose="flat-y")
    s.put("cube", color="red")
    s.put("semi_cylinder")


def _town_hall(s: Pad) -> None:
    s.put("arch")
    s.pair("cube", 3, color="yellow")
    s.pair("cuboid2", 2, poses=("flat-y", "flat-y"))
    s.put("cube", color="green")
    s.put("cuboid1")
    s.put("triangle")
    s.pair("triangle", 3, poses=("ramp-y", "ramp+y"))


def _balance(s: Pad) -> None:
    s.put("cuboid2", pose="flat-y")
    s.put("cylinder")
    s.put("arch", pose="cradle")
    s.put("cuboid3", pose="flat-y")
    s.pair("cube", 2, color="green")
    s.pair("semi_cylinder", 2)


def _tractor(s: Pad) -> None:
    s.pair("cylinder", 2, poses=("lying-x", "lying-x"))
    s.put("cuboid3", x=0, pose="flat-y")
    s.put("cube", -2, color="red")
    s.put("cuboid2", 1, pose="flat-y")
    s.put("cuboid1", -2)
    s.put("semi_cylinder", 2.5, pose="round+y")
    s.put("triangle", 0.5, pose="ramp+y")
    s.put("semi_cylinder", -2)


def _giraffe(s: Pad) -> None:
    s.put("arch")
    s.put("cuboid2", pose="flat-y")
    s.put("triangle", -1, pose="ramp-y")
    s.put("cylinder", 1)
    s.put("cube", 1, color="yellow")
    s.put("cuboid2", 1.6, pose="flat-y")
    s.put("triangle", 2, pose="ramp+y")


LEVEL_3: dict[str, Design] = {
    "l3-balance": _balance,
    "l3-beacon": _beacon,
    "l3-brick-pyramid": _brick_pyramid,
    "l3-elephant": _elephant,
    "l3-giraffe": _giraffe,
    "l3-robot": _robot,
    "l3-torii": _torii,
    "l3-town-hall": _town_hall,
    "l3-tractor": _tractor,
    "l3-viaduct": _viaduct,
}
