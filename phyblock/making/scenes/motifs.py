"""The parts that structures are made of: columns, piers, decks, crowns, flanks.

All are written for the front, along y, and are symmetric about their middle where they can be.
Sizes are grid units of 2.5 cm: a cube is 2 wide, a cuboid2 4, a cuboid3 6, an arch 4 wide and 2
high, a cylinder 4 high.
"""

from __future__ import annotations

from phyblock.making.scenes.sketch import Draft

__all__ = ["EDGES", "OUT", "column", "crown", "deck", "flank", "gable", "piers", "topping"]

OUT = ("ramp-y", "ramp+y")
"""A pair of ramps that slope away from the middle."""
EDGES = ("edge-x", "edge-x")
"""A pair of slabs on edge, thin from front to back."""
_ROUND_OUT = ("round-y", "round+y")


def topping(d: Draft, y: float = 0.0) -> None:
    """A roof or a dome on something two wide, its ridge either way."""
    if d.pick_type("triangle", "semi_cylinder") == "triangle":
        d.put("triangle", y, pose=d.pick(("roof", "roof-turned")))
    else:
        d.put("semi_cylinder", y, pose=d.pick(("dome", "dome-turned")))


def column(d: Draft, parts: int) -> None:
    """Blocks two wide on one another, no two slabs running."""
    last = ""
    for number in range(parts):
        kinds = [kind for kind in ("cube", "cylinder", "cuboid1") if kind != last or kind == "cube"]
        last = d.pick(kinds)
        if last == "cube":
            d.put("cube", tone=number)
        elif last == "cylinder":
            d.put("cylinder")
        else:
            d.put("cuboid1")


def piers(d: Draft, width: int, tone: int = 0) -> None:
    """A row that carries a deck `width` wide (4, 6 or 8), level on top."""
    kinds = {
        4: ("arch", "arch", "cube", "cylinder", "edge", "slab"),
        6: ("cube", "cylinder", "cylinder", "edge", "three", "post", "barrel"),
        8: ("arches", "arches", "arch+cubes", "post", "cube"),
    }
    kind, y = d.pick(kinds[width]), width / 2 - 1
    if kind == "arch":
        d.put("arch")
    elif kind in ("cube", "three"):
        d.pair("cube", y, tone=tone)
        if kind == "three" or width == 8:
            d.put("cube" if width == 6 else "arch", tone=tone + 1)
    elif kind == "cylinder":
        d.pair("cylinder", y)
    elif kind == "edge":
        d.pair("cuboid1", y, EDGES)
    elif kind == "slab":
        d.pair("cuboid1", y)
    elif kind == "post":
        d.pair("cuboid1", y)
        d.pair("cylinder" if width == 6 else "cube", y, tone=tone)
        if width == 8:
            d.put("cuboid2", pose="flat-y")
            d.put("arch")
    elif kind == "barrel":
        d.pair("cylinder", y, ("lying-x", "lying-x"))
    elif kind == "arches":
        d.pair("arch", 2)
    else:
        d.put("arch")
        d.pair("cube", 3, tone=tone)


def deck(d: Draft, width: int) -> None:
    """Slabs over a row of piers."""
    if width == 8:
        d.pair("cuboid2", 2, ("flat-y", "flat-y"))
    else:
        d.put("cuboid2" if width == 4 else "cuboid3", pose="flat-y")


def gable(d: Draft, width: int, tone: int = 1) -> None:
    """A roof as wide as the deck: two ramps, with blocks between when it is wider."""
    if width == 8:
        d.pair("cube", 1, tone=tone)
        d.pair("triangle", 3, OUT)
        d.put("triangle")
    elif width == 6:
        d.put("cube", tone=tone)
        d.pair("triangle", 2, OUT)
        topping(d)
    else:
        d.pair("triangle", 1, OUT)


def crown(d: Draft, width: int, tone: int = 1) -> None:
    """What ends a structure, on a deck `width` wide (2, 4, 6 or 8)."""
    if width == 2:
        topping(d)
        return
    kinds = ("gable", "middle", "turret", "pair", "lantern", "cradle", "battlement", "temple")
    kind, y = d.pick(kinds), width / 2 - 1
    if kind == "gable":
        gable(d, width, tone)
    elif kind == "middle":
        topping(d)
    elif kind == "turret":
        d.put("cube", tone=tone)
        topping(d)
    elif kind == "pair":
        d.pair("cube", y, tone=tone)
        d.pair(d.pick(("triangle", "semi_cylinder")), y)
        if width > 4:
            topping(d)
    elif kind == "lantern":
        d.put("cuboid1")
        d.put("cylinder")
        topping(d)
    elif kind == "cradle":
        d.put("arch", pose="cradle")
        if width > 4:
            d.pair("semi_cylinder", max(3.0, y))
    elif kind == "battlement":
        d.pair("semi_cylinder" if d.maybe() else "cuboid1", y)
        if width > 4:
            d.put("cube", tone=tone)
            topping(d)
    else:
        d.put("arch")
        if width > 4:
            d.pair("semi_cylinder", 3)
        topping(d)


def flank(d: Draft, width: int, tone: int = 0) -> None:
    """What leans on both ends of a row that stands on the ground."""
    kind, y = d.pick(("ramp", "ramp", "turret", "apse", "fence")), width / 2 + 1
    if kind == "ramp":
        d.pair("triangle", y, OUT)
    elif kind == "turret":
        d.pair("cube", y, tone=tone)
        d.pair(d.pick(("triangle", "semi_cylinder")), y)
    elif kind == "apse":
        d.pair("semi_cylinder", width / 2 + 0.5, _ROUND_OUT)
    else:
        d.pair("cuboid1", y)
