"""Structures of levels 1 and 2, designed by hand: up to five blocks, up to three or four layers.

Coordinates are grid units of 2.5 cm; y runs along the front that the camera sees best.
"""

from __future__ import annotations

from tests.designs.pad import Design, Pad

__all__ = ["LEVEL_1", "LEVEL_2"]


def _gate(s: Pad) -> None:
    s.put("arch")
    s.put("cuboid2", pose="flat-y")
    s.put("triangle")


def _lighthouse(s: Pad) -> None:
    s.put("cube", color="blue")
    s.put("cylinder")
    s.put("semi_cylinder", pose="dome-turned")


def _cottage(s: Pad) -> None:
    s.put("cube", -1, color="yellow")
    s.put("cube", 1, color="green")
    s.put("cuboid2", pose="flat-y")
    s.put("triangle")


def _dolmen(s: Pad) -> None:
    s.pair("cylinder", 2)
    s.put("cuboid3", pose="flat-y")
    s.put("triangle")


def _boat(s: Pad) -> None:
    s.put("arch", pose="cradle")
    s.put("cuboid3", pose="flat-y")
    s.put("cube", color="blue")


def _dog(s: Pad) -> None:
    s.put("arch")
    s.put("cube", 1, color="blue")
    s.put("triangle", -1, pose="ramp-y")
    s.put("semi_cylinder", 1)


def _bench(s: Pad) -> None:
    s.pair("cuboid1", 2)
    s.put("cuboid3", pose="flat-y")
    s.put("semi_cylinder", 2, pose="dome")


def _slide(s: Pad) -> None:
    s.put("cube", color="red")
    s.put("triangle", 2, pose="ramp+y")
    s.put("cuboid1")


def _castle_gate(s: Pad) -> None:
    s.put("arch")
    s.pair("cube", 3, color="green")
    s.pair("triangle", 3, poses=("roof", "roof"))


def _bridge(s: Pad) -> None:
    s.put("arch")
    s.pair("triangle", 3, poses=("ramp-y", "ramp+y"))
    s.put("cuboid2", pose="flat-y")
    s.put("semi_cylinder")


def _locomotive(s: Pad) -> None:
    s.pair("cylinder", 2, poses=("lying-x", "lying-x"))
    s.put("cuboid3", pose="flat-y")
    s.put("cube", -2, color="blue")
    s.put("semi_cylinder", 1.5, pose="round+y")


def _throne(s: Pad) -> None:
    s.put("cuboid1")
    s.put("cuboid2", x=-1.5, pose="upright-x")
    s.pair("cuboid1", 1.5, poses=("edge-x", "edge-x"))
    s.put("semi_cylinder")


def _chapel(s: Pad) -> None:
    s.put("cuboid3", pose="flat-y")
    s.put("cube", 2, color="green")
    s.put("arch", -1, pose="gate")
    s.put("semi_cylinder", -1)
    s.put("triangle", 2)


def _rocket(s: Pad) -> None:
    s.put("cylinder")
    s.pair("triangle", 2, poses=("ramp-y", "ramp+y"))
    s.put("cube", color="red")
    s.put("triangle")


LEVEL_1: dict[str, Design] = {
    "l1-bench": _bench,
    "l1-boat": _boat,
    "l1-cottage": _cottage,
    "l1-dog": _dog,
    "l1-dolmen": _dolmen,
    "l1-gate": _gate,
    "l1-lighthouse": _lighthouse,
    "l1-slide": _slide,
}
LEVEL_2: dict[str, Design] = {
    "l2-bridge": _bridge,
    "l2-castle-gate": _castle_gate,
    "l2-chapel": _chapel,
    "l2-locomotive": _locomotive,
    "l2-rocket": _rocket,
    "l2-throne": _throne,
}
