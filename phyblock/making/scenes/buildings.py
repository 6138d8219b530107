"""Themes of masonry: towers, gates, houses, bridges, arcades, walls, pyramids, stairs, courts."""

from __future__ import annotations

from itertools import pairwise

from phyblock.domain.blocks import BlockType
from phyblock.making.scenes.motifs import (
    EDGES,
    OUT,
    column,
    crown,
    deck,
    flank,
    gable,
    piers,
    topping,
)
from phyblock.making.scenes.sketch import Draft, Theme

__all__ = ["BUILDINGS"]


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
