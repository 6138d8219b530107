"""Themes of structures: motifs, masonry, things that stand for something, and compositions of them.

Motifs are written for the front, along y, and are symmetric about their middle where they can be.
Sizes are grid units of 2.5 cm: a cube is 2 wide, a cuboid2 4, a cuboid3 6, an arch 4 wide and 2
high, a cylinder 4 high.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.blocks import BlockType
from phyblock.domain.scene import Block
from phyblock.domain.symmetry import Symmetry
from phyblock.making.scenes.sketch import UNIT_M, Draft, Theme, transformed
from phyblock.sim.contact import whole_bounds_m

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
    """The end of a structure, on a deck `width` wide (2, 4, 6 or 8)."""
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
    """Blocks that lean on both ends of a row that stands on the ground."""
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


def _tower(d: Draft) -> None:
    for width in d.pick(((), (4,), (4, 4), (6,), (6, 4))):
        piers(d, width)
        deck(d, width)
    column(d, d.pick((1, 1, 2, 2, 3)))
    topping(d)
    if d.maybe(0.25):
        flank(d, 2)


def _gate(d: Draft) -> None:
    width = d.pick((4, 6))
    piers(d, width)
    deck(d, width)
    crown(d, width, 1)
    if d.maybe(0.35):
        flank(d, width)


def _house(d: Draft) -> None:
    storeys = d.pick(((4,), (6,), (8,), (6, 4), (8, 4), (8, 6), (6, 6)))
    for number, width in enumerate(storeys):
        piers(d, width, number)
        deck(d, width)
    if d.maybe(0.6):
        gable(d, storeys[-1], len(storeys))
    else:
        crown(d, storeys[-1], len(storeys))
    if d.maybe(0.35):
        flank(d, storeys[0], len(storeys))


def _bridge(d: Draft) -> None:
    width = d.pick((4, 8, 8))
    if width == 4:
        d.put("arch")
    else:
        d.pair("arch", 2)
    d.pair("triangle", width / 2 + 1, OUT)
    if d.maybe(0.7):
        deck(d, width)
        if d.maybe(0.6):
            crown(d, width)
    elif width == 8:
        crown(d, d.pick((4, 6, 8)))
    else:
        topping(d)


def _arcade(d: Draft) -> None:
    spans = d.pick((2, 3))
    ys = [4.0 * i - 2.0 * (spans - 1) for i in range(spans)]
    for y in ys:
        d.put("arch", y)
    for y in ys:
        d.put("cuboid2", y, pose="flat-y")
    upper = d.pick(("arches", "toppings", "alternate", "row"))
    inner = [(a + b) / 2 for a, b in pairwise(ys)]
    for y in inner if upper == "arches" else ys:
        if upper == "arches":
            d.put("arch", y)
        elif upper == "row":
            d.put("cube", y, tone=1)
    if upper == "alternate":
        d.pair("cube", ys[-1], tone=1)
        d.pair("triangle", ys[-1])
        d.put("arch" if spans == 3 else "semi_cylinder")
    elif upper == "arches" and d.maybe():
        d.pair("cube", 2 * spans - 1, tone=1)
        d.pair("semi_cylinder", 2 * spans - 1)
    for y in inner if upper == "arches" else (ys if upper != "alternate" else ()):
        d.put("triangle" if spans == 3 else "semi_cylinder", y)


def _wall(d: Draft) -> None:
    kind = d.pick(("bond", "panels", "slabs"))
    length = d.pick((2, 3))
    ends = 2.0 * length - 1
    if kind == "bond":
        for i in range(length):
            d.put("cuboid2", 4.0 * i - 2.0 * (length - 1), pose="edge-x")
        for i in range(length - 1):
            d.put("cuboid2", 4.0 * i - 2.0 * (length - 2), pose="flat-y")
    elif kind == "panels":
        for i in range(length):
            d.put("cube" if i % 2 else "arch", 4.0 * i - 2.0 * (length - 1))
        for y in [4.0 * i - 2.0 * (length - 1) for i in range(length)]:
            d.put("cuboid2", y, pose="flat-y")
    else:
        d.pair("cube", ends - 1)
        d.put("cube", tone=1)
        d.put("cuboid3", pose="flat-y")
    count = d.pick((2, 3))
    for i in range(count):
        y = (i - (count - 1) / 2) * (4 if count == 2 else 2.5)
        d.put("cube", y, tone=i)
    for i in range(count):
        y = (i - (count - 1) / 2) * (4 if count == 2 else 2.5)
        d.put("triangle" if count == 2 else "semi_cylinder", y)


def _pyramid(d: Draft) -> None:
    base = d.pick((2, 3, 3, 4))
    for row in range(base, 0, -1):
        ys = [2.0 * i - (row - 1) for i in range(row)]
        # From both ends inward, so that the row below is loaded evenly.
        for y in sorted(ys, key=lambda at: (-abs(at), at)):
            d.put("cube", y, tone=row)
        if row == base and d.maybe(0.4):
            d.pair("triangle", row + 1, OUT)
        if row == 2 and d.maybe(0.4):
            d.put("cuboid2", pose="flat-y")
    topping(d)


def _stair(d: Draft) -> None:
    steps, double = d.pick((2, 3)), d.maybe(0.4)
    heights = [*range(1, steps + 1), *(range(steps - 1, 0, -1) if double else ())]
    start = -(len(heights) - 1.0)
    for i, height in enumerate(heights):
        for number in range(height):
            d.put("cube", start + 2 * i, tone=number)
    style = d.pick(("ramps", "slabs"))
    for i, height in enumerate(heights):
        top = height == steps
        if not top and style == "ramps":
            d.put("triangle", start + 2 * i, pose="ramp-y" if i < steps - 1 else "ramp+y")
        elif not top:
            d.put("cuboid1", start + 2 * i)
        else:
            topping(d, start + 2 * i)
    if style == "ramps":
        d.put("triangle", start - 2, pose="ramp-y")


def _court(d: Draft) -> None:
    """Four columns, two beams, a roof across: a structure that is as deep as it is wide."""
    posts: tuple[tuple[BlockType, tuple[str, str]], ...] = (
        ("cylinder", ("", "")),
        ("cube", ("", "")),
        ("cuboid1", ("", "")),
        ("cuboid1", EDGES),
    )
    post, poses = d.pick(posts)
    half = d.pick((1, 2))
    for x in (-1, 1):
        d.pair(post, half, poses, x=x)
    for x in (-1, 1):
        d.put("cuboid3" if half == 2 else "cuboid2", 0, x, "flat-y")
    kind = d.pick(("hall", "nave", "across", "tower"))
    if kind == "hall":
        for y in (-1, 1):
            d.put("cuboid2", y, pose="flat-x")
        column(d, 1)
        topping(d)
    elif kind == "nave":
        for x in (-1, 1):
            d.pair("triangle", 1, OUT, x=x)
    elif kind == "across":
        for y in (-half, half):
            d.put("cuboid2", y, pose="flat-x")
        for y in (-half, half):
            topping(d, y)
    else:
        d.put("cuboid2", pose="flat-x")
        d.put("cylinder")
        topping(d)


def _monument(d: Draft) -> None:
    base = d.pick(("plate", "cross", "step", "block"))
    if base == "plate":
        for x in (-1, 1):
            d.put("cuboid2", 0, x, "flat-y")
    elif base == "cross":
        d.put("cuboid3", pose="flat-y")
        d.put("cuboid2", pose="flat-x")
    elif base == "step":
        d.put("cuboid3", pose="flat-y")
        d.put("cuboid2", pose="flat-y")
    else:
        for x in (-1, 1):
            d.pair("cube", 1, x=x)
        d.put("cuboid2", pose="flat-y")
    column(d, d.pick((1, 2, 2)))
    if base != "cross" and d.maybe(0.4):
        d.put("cuboid2", pose="flat-y")
        d.pair("semi_cylinder", 1)
    else:
        topping(d)
    if base == "step":
        d.pair("semi_cylinder" if d.maybe() else "triangle", 3 if d.maybe() else 4)


def _henge(d: Draft) -> None:
    spans = d.pick((1, 2))
    ys = (-2.0, 2.0) if spans == 1 else (-4.0, 0.0, 4.0)
    post = d.pick_type("cylinder", "cube", "cuboid2")
    for y in ys:
        d.put(post, y, pose="upright-x" if post == "cuboid2" else "")
    if spans == 1:
        d.put("cuboid3", pose="flat-y")
    else:
        d.pair("cuboid2", 2, ("flat-y", "flat-y"))
    for y in ys if d.maybe() else ys[:: len(ys) - 1]:
        d.put("cuboid1", y)
    d.put("cuboid3" if spans == 1 else "cuboid2", pose="flat-y")
    topping(d)


def _balance(d: Draft) -> None:
    column(d, d.pick((1, 2)))
    d.put(d.pick(("cuboid3", "cuboid3", "cuboid2")), pose="flat-y")
    half = d.pick((1.0, 2.0)) if d.blocks[-1].type == "cuboid3" else 1.0
    d.pair("cube" if d.maybe() else "cuboid1", half)
    d.pair(d.pick(("semi_cylinder", "triangle")), half)


BUILDINGS: dict[str, Theme] = {
    "arcade": _arcade,
    "balance": _balance,
    "bridge": _bridge,
    "court": _court,
    "gate": _gate,
    "henge": _henge,
    "house": _house,
    "monument": _monument,
    "pyramid": _pyramid,
    "stair": _stair,
    "tower": _tower,
    "wall": _wall,
}


def _animal(d: Draft) -> None:
    """Four legs, a back, a neck and a head at one end, a tail at the other."""
    legs = d.pick(("arch", "arch", "arches", "cubes", "posts", "feet"))
    width = 4 if legs in ("arch", "feet") else d.pick((4, 6))
    end = width / 2 - 1
    if legs == "arch":
        d.put("arch")
    elif legs == "arches":
        d.put("arch", x=-1)
        d.put("arch", x=1)
        width, end = 4, 1.0
    elif legs == "cubes":
        d.pair("cube", end)
    elif legs == "posts":
        d.pair("cylinder", end)
    else:
        d.pair("cuboid1", end, EDGES)
    if legs == "arches":
        d.pair("cuboid2", 1, ("flat-x", "flat-x"))
    elif legs != "arch" or d.maybe():
        d.put("cuboid2" if width == 4 else "cuboid3", pose="flat-y")
    neck = d.pick(("none", "cube", "cube", "long", "thick"))
    if neck == "cube":
        d.put("cube", end, tone=1)
    elif neck == "long":
        d.put("cylinder", end)
    elif neck == "thick":
        d.put("cuboid1", end)
        d.put("cube", end, tone=1)
    if d.maybe(0.6):
        tail = d.pick_type("triangle", "semi_cylinder")
        d.put(tail, -end, pose="ramp-y" if tail == "triangle" else "dome")
    head = d.pick(("snout", "dome", "ears", "muzzle"))
    if head == "snout":
        d.put("triangle", end, pose="ramp+y")
    elif head == "dome":
        d.put("semi_cylinder", end, pose="dome-turned")
    elif head == "ears":
        d.put("triangle", end)
    else:
        d.put("cuboid2", end + 0.5, pose="flat-y")
        d.put("triangle", end, pose="ramp+y")


_LEGS: dict[str, BlockType] = {"cylinder": "cylinder", "cube": "cube", "cuboid1": "cuboid1"}


def _figure(d: Draft) -> None:
    """Two legs, a trunk with arms, a head with a hat."""
    legs = d.pick(("cylinder", "cube", "cuboid1", "boots", "skirt"))
    if legs == "skirt":
        d.pair("triangle", 1, OUT)
        d.put("cube")
    elif legs == "boots":
        d.pair("cuboid1", 1)
        d.pair("cube", 1)
    else:
        d.pair(_LEGS[legs], 1)
    if legs != "skirt":
        d.put("cuboid2", pose="flat-y")
    trunk = d.pick(("cube", "two", "arch", "barrel"))
    if legs == "skirt":
        trunk = "none"
    if trunk == "cube":
        d.put("cube", tone=1)
    elif trunk == "two":
        d.pair("cube", 1, tone=1)
    elif trunk == "arch":
        d.put("arch", pose="cradle")
    elif trunk == "barrel":
        d.put("cylinder")
    d.put(d.pick(("cuboid3", "cuboid2")), pose="flat-y")
    head = d.pick(("cube", "cuboid1", "dome"))
    if head == "dome":
        d.put("semi_cylinder")
        return
    if head == "cube":
        d.put("cube", tone=0)
    else:
        d.put("cuboid1")
    if d.maybe(0.8):
        topping(d)


def _car(d: Draft) -> None:
    """Wheels, a chassis, and a cab, a load or a chimney on it."""
    wheels = d.pick((2, 2, 3))
    if wheels == 3:
        d.put("cylinder", -2, pose="lying-x")
        d.put("cylinder", 0, pose="lying-x")
        d.put("cylinder", 2, pose="lying-x")
    else:
        d.pair("cylinder", d.pick((1.5, 2.0)), ("lying-x", "lying-x"))
    d.put("cuboid3", pose="flat-y")
    cab = d.pick(("cube", "high", "arch", "slab"))
    if cab == "arch":
        d.put("arch", -1)
    elif cab == "slab":
        d.put("cuboid2", -1, pose="flat-y")
    else:
        d.put("cube", -2, tone=0)
    if cab == "high":
        d.put("cuboid1", -2)
    front = d.pick(("hood", "round", "load", "ramp", "tank"))
    if front == "hood":
        d.put("cube", 2 if cab in ("arch", "slab") else 0, tone=1)
        d.put("triangle", 2, pose="ramp+y")
    elif front == "round":
        d.put("semi_cylinder", 2, pose="round+y")
    elif front == "load":
        d.put("cuboid1", 2)
        d.put("semi_cylinder", 2)
    elif front == "ramp":
        d.put("triangle", 2, pose="ramp+y")
    elif cab in ("arch", "slab"):
        d.put("cube", 2, tone=1)
    else:
        d.put("cylinder", 1, pose="lying-y")
    if d.maybe(0.6):
        d.put(d.pick_type("semi_cylinder", "triangle", "cuboid1"), -2)


def _ship(d: Draft) -> None:
    hull = d.pick(("cradle", "twin", "slab"))
    if hull == "cradle":
        d.put("arch", pose="cradle")
        d.put("cuboid3", pose="flat-y")
    elif hull == "twin":
        d.pair("arch", 2, ("cradle", "cradle"))
        d.pair("cuboid2", 2, ("flat-y", "flat-y"))
    else:
        d.put("cuboid2", pose="flat-y")
        d.put("cuboid3", pose="flat-y")
    cabin = d.pick(("house", "mast", "bridge", "funnel"))
    if cabin == "house":
        d.put("cube", tone=0)
        topping(d)
    elif cabin == "mast":
        d.put("cylinder")
        d.put("triangle", 0, 0, d.pick(("roof", "ramp+y")))
    elif cabin == "bridge":
        d.put("cuboid2", pose="flat-y")
        d.put("cube", tone=0)
        d.put("semi_cylinder")
    else:
        d.put("cube", -1, tone=0)
        d.put("cuboid1", 1)
        d.put("semi_cylinder", -1)
    if hull == "twin" or d.maybe(0.4):
        d.pair("semi_cylinder" if d.maybe() else "triangle", 3 if hull == "twin" else 2)


def _rocket(d: Draft) -> None:
    body = d.pick(("cylinder", "cylinder", "cube", "pad"))
    if body == "pad":
        d.put("cuboid3", pose="flat-y")
        d.put("cylinder")
        d.pair("triangle", 2, OUT)
    else:
        d.put("cube" if body == "cube" else "cylinder")
        d.pair("triangle", 2, OUT)
        if d.maybe(0.4):
            d.put("triangle", 0, 2, "ramp+x")
    for tone in range(d.pick((1, 2))):
        d.put(d.pick_type("cube", "cylinder", "cuboid1"), tone=tone)
    topping(d)


def _table(d: Draft) -> None:
    """A table, bench or bed, and what stands on it or beside it."""
    width = d.pick((4, 6, 6))
    end = width / 2 - 1
    d.pair(d.pick(("cube", "cuboid1", "cylinder")), end)
    d.put("cuboid2" if width == 4 else "cuboid3", pose="flat-y")
    kind = d.pick(("vase", "meal", "bed", "back", "lamp", "bowl"))
    if kind == "vase":
        d.put("cylinder", d.pick((0.0, end)))
    elif kind == "meal":
        d.pair("semi_cylinder", end)
        if d.maybe():
            d.put("cuboid1")
    elif kind == "bed":
        d.put("semi_cylinder", -end, pose="dome")
        d.put("cuboid1", -end + 2 if width == 6 else end)
    elif kind == "back":
        d.put("cuboid2" if width == 4 else "cuboid3", 0, -0.5, "edge-x")
    elif kind == "lamp":
        d.put("cuboid1", end)
        d.put("triangle", end)
    else:
        d.put("arch", pose="cradle")


def _chair(d: Draft) -> None:
    seat = d.pick_type("cube", "cuboid1", "arch")
    d.put(seat)
    width = 2 if seat == "arch" else 1
    d.put("cuboid2", 0, -1.5, d.pick(("upright-x", "edge-x")))
    if seat != "arch":
        d.pair("cuboid1", width + 0.5, ("edge-y", "edge-y"))
    d.put(d.pick_type("semi_cylinder", "cuboid1", "triangle"))


def _slide(d: Draft) -> None:
    height = d.pick((1, 2))
    d.put("cube", -2 * height + 2)
    for _ in range(height - 1):
        d.put("cube", 0, tone=1)
        d.put("cube", -2, tone=1)
        d.put("triangle", 0, pose="ramp+y")
    d.put("triangle", 2, pose="ramp+y")
    top = -2 * height + 2
    if d.maybe():
        d.put("triangle", top - 2, pose="ramp-y")
    if d.maybe():
        d.put("cuboid1", top)
    topping(d, top)


def _fountain(d: Draft) -> None:
    for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        d.put("cuboid1", y, x)
    d.put(d.pick(("cylinder", "cube")))
    if d.maybe():
        d.put("arch", pose="cradle")
    topping(d)
    if d.maybe():
        d.pair("semi_cylinder", 2.5, ("round-y", "round+y"))


def _tree(d: Draft) -> None:
    d.put(d.pick(("cylinder", "cylinder", "cube")))
    if d.maybe(0.5):
        d.put("cuboid1")
    leaves = d.pick(("fir", "crown", "palm"))
    if leaves == "fir":
        d.put("cuboid3" if d.maybe() else "cuboid2", pose="flat-y")
        d.pair("triangle", 1, OUT)
    elif leaves == "crown":
        d.put("arch")
        d.put("semi_cylinder", pose="dome")
    else:
        d.put("cuboid3", pose="flat-y")
        d.pair("semi_cylinder", 2)
        d.put("cube", tone=1)
        d.put("triangle")


CREATURES: dict[str, Theme] = {
    "animal": _animal,
    "car": _car,
    "chair": _chair,
    "figure": _figure,
    "fountain": _fountain,
    "rocket": _rocket,
    "ship": _ship,
    "slide": _slide,
    "table": _table,
    "tree": _tree,
}


Axis = int
"""Along which parts stand side by side: 0 is x, the depth; 1 is y, the front."""
_ACROSS = Symmetry(2, mirrored=True)
"""The mirror image across the plane y = 0."""


def beside(parts: Sequence[Sequence[Block]], gap_units: float, axis: Axis = 1) -> list[Block]:
    """The parts in a row with gaps between their outlines [grid units], numbered through."""
    row: list[Block] = []
    edge_m = 0.0
    for part in parts:
        low_m, high_m = whole_bounds_m(part)
        shift = -(low_m + high_m) / 2
        shift[2] = 0.0
        shift[axis] = edge_m - low_m[axis]
        row += [_shifted(block, shift, len(row) + i) for i, block in enumerate(part, 1)]
        edge_m += float(high_m[axis] - low_m[axis]) + gap_units * UNIT_M
    return row


def _shifted(block: Block, shift: NDArray[np.float64], order: int) -> Block:
    x, y, z = (np.array(block.position_m) + shift).tolist()
    place = (round(x, 6) + 0.0, round(y, 6) + 0.0, round(z, 6) + 0.0)
    return replace(block, order=order, position_m=place)


def _part(d: Draft, *themes: Theme) -> list[Block]:
    """The blocks of a part drawn apart, in the colors of the whole."""
    apart = d.fresh()
    d.pick(themes)(apart)
    return apart.blocks


def _framed(d: Draft) -> None:
    """A building between two towers that mirror one another."""
    names = ("tower", "monument", "balance", "pyramid")
    side = _part(d, *(BUILDINGS[name] for name in names))
    middle = _part(d, *(BUILDINGS[name] for name in ("house", "gate", "arcade", "court")))
    parts = [side, middle, transformed(side, _ACROSS)]
    d.take(beside(parts, d.pick((0.0, 0.0, 1.0))))


def _avenue(d: Draft) -> None:
    """A structure, its mirror image, and something between them."""
    names = ("bridge", "stair", "house", "gate")
    side = _part(d, *(BUILDINGS[name] for name in names))
    middle = _part(d, CREATURES["fountain"], CREATURES["tree"], BUILDINGS["monument"])
    d.take(beside([side, middle, transformed(side, _ACROSS)], d.pick((1.0, 2.0))))


def _street(d: Draft) -> None:
    """A building with a scene before its door."""
    building = _part(d, *(BUILDINGS[name] for name in ("house", "arcade", "court", "tower")))
    names = ("animal", "car", "figure", "tree", "table")
    second = _part(d, *(CREATURES[name] for name in names))
    d.take(beside([building, second], d.pick((1.0, 2.0))))


def _train(d: Draft) -> None:
    """Two or three cars in a row."""
    cars = [_part(d, CREATURES["car"]) for _ in range(d.pick((2, 2, 3)))]
    d.take(beside(cars, 1.0))


COMPOSITIONS: dict[str, Theme] = {
    "avenue": _avenue,
    "framed": _framed,
    "street": _street,
    "train": _train,
}
