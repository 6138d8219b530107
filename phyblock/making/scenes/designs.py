"""Themes of structures: motifs, masonry, things that stand for something, and compositions of them.

Motifs are written for the front, along y, and are symmetric about their middle where they can be.
Sizes are grid units of 2.5 cm: a cube is 2 wide, a cuboid2 4, a cuboid3 6, an arch 4 wide and 2
high, a cylinder 4 high. `Draft.build` says how blocks are written.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from phyblock.domain.scene import Block
from phyblock.domain.symmetry import Symmetry
from phyblock.making.scenes.sketch import UNIT_M, Draft, Theme, transformed
from phyblock.sim.contact import whole_bounds_m

_PIERS = {
    4: ("arch", "arch", "2 cube 1", "2 cylinder 1", "2 cuboid1:edge-x 1", "2 cuboid1 1"),
    6: (
        *("2 cube 2", "2 cylinder 2", "2 cylinder 2", "2 cuboid1:edge-x 2", "2 cube 2; cube +1"),
        *("2 cuboid1 2; 2 cylinder 2", "2 cylinder:lying-x 2"),
    ),
    8: (
        *("2 arch 2", "2 arch 2", "arch; 2 cube 3"),
        *("2 cuboid1 3; 2 cube 3; cuboid2:flat-y; arch", "2 cube 3; arch"),
    ),
}
_DECKS = {4: "cuboid2:flat-y", 6: "cuboid3:flat-y", 8: "2 cuboid2:flat-y 2"}
_GABLES = {
    4: "2 triangle:ramp 1",
    6: "cube; 2 triangle:ramp 2; top",
    8: "2 cube 1; 2 triangle:ramp 3; triangle",
}


def column(d: Draft, parts: int) -> None:
    """Blocks two wide on one another, no two slabs or cylinders running."""
    last = ""
    for number in range(parts):
        last = d.pick([k for k in ("cube", "cylinder", "cuboid1") if k != last or k == "cube"])
        d.build(last, number)


def storey(d: Draft, width: int, tone: int = 0) -> None:
    """A row that carries a deck `width` wide (4, 6 or 8), and the deck."""
    d.any_of(*_PIERS[width], tone=tone)
    d.build(_DECKS[width])


def crown(d: Draft, width: int, tone: int = 1) -> None:
    """The end of a structure, on a deck `width` wide (4, 6 or 8)."""
    y, is_wide = width / 2 - 1, width > 4
    cradle = f"arch:cradle; 2 semi_cylinder {max(3.0, y)}" if is_wide else "arch:cradle"
    temple = "arch; 2 semi_cylinder 3; top" if is_wide else "arch; top"
    lantern = "cuboid1; cylinder; top"
    kind = d.pick(
        (_GABLES[width], "top", "cube; top", "pair", lantern, cradle, "battlement", temple)
    )
    if kind == "pair":
        _turrets(d, y, tone)
        d.build("top" if is_wide else "")
    elif kind == "battlement":
        d.build(f"2 semi_cylinder {y}" if d.maybe() else f"2 cuboid1 {y}")
        d.build("cube; top" if is_wide else "", tone)
    else:
        d.build(kind, tone)


def _turrets(d: Draft, y: float, tone: int) -> None:
    d.build(f"2 cube {y}", tone)
    d.any_of(f"2 triangle {y}", f"2 semi_cylinder {y}")


def flank(d: Draft, width: int, tone: int = 0) -> None:
    """Blocks that lean on both ends of a row that stands on the ground."""
    y = width / 2 + 1
    ramps, apses = f"2 triangle:ramp {y}", f"2 semi_cylinder:round {y - 0.5}"
    kind = d.pick((ramps, ramps, "turrets", apses, f"2 cuboid1 {y}"))
    if kind == "turrets":
        _turrets(d, y, tone)
    else:
        d.build(kind)


def _tower(d: Draft) -> None:
    for width in d.pick(((), (4,), (4, 4), (6,), (6, 4))):
        storey(d, width)
    column(d, d.pick((1, 1, 2, 2, 3)))
    d.build("top")
    if d.maybe(0.25):
        flank(d, 2)


def _gate(d: Draft) -> None:
    width = d.pick((4, 6))
    storey(d, width)
    crown(d, width)
    if d.maybe(0.35):
        flank(d, width)


def _house(d: Draft) -> None:
    storeys = d.pick(((4,), (6,), (8,), (6, 4), (8, 4), (8, 6), (6, 6)))
    for number, width in enumerate(storeys):
        storey(d, width, number)
    if d.maybe(0.6):
        d.build(_GABLES[storeys[-1]], len(storeys))
    else:
        crown(d, storeys[-1], len(storeys))
    if d.maybe(0.35):
        flank(d, storeys[0], len(storeys))


def _bridge(d: Draft) -> None:
    width = d.pick((4, 8, 8))
    d.build("arch; 2 triangle:ramp 3" if width == 4 else "2 arch 2; 2 triangle:ramp 5")
    if d.maybe(0.7):
        d.build(_DECKS[width])
        if d.maybe(0.6):
            crown(d, width)
    elif width == 8:
        crown(d, d.pick((4, 6, 8)))
    else:
        d.build("top")


def _row(block: str, ys: Sequence[float], tone: int = 0) -> str:
    """One block of a sort at each place."""
    return "; ".join(f"{block} {y} +{tone}" for y in ys)


def _spaced(count: int, step: float) -> list[float]:
    """Places of `count` blocks, the middle of which is 0."""
    return [step * (i - (count - 1) / 2) for i in range(count)]


def _arcade(d: Draft) -> None:
    spans = d.pick((2, 3))
    ys = _spaced(spans, 4)
    d.build(f"{_row('arch', ys)}; {_row('cuboid2:flat-y', ys)}")
    upper = d.pick(("arches", "toppings", "alternate", "row"))
    inner = [(a + b) / 2 for a, b in pairwise(ys)]
    if upper == "arches":
        d.build(_row("arch", inner))
        if d.maybe():
            d.build(f"2 cube {2 * spans - 1} +1; 2 semi_cylinder {2 * spans - 1}")
    elif upper == "row":
        d.build(_row("cube", ys, 1))
    elif upper == "alternate":
        middle = "arch" if spans == 3 else "semi_cylinder"
        d.build(f"2 cube {ys[-1]} +1; 2 triangle {ys[-1]}; {middle}")
    if upper != "alternate":
        top = "triangle" if spans == 3 else "semi_cylinder"
        d.build(_row(top, inner if upper == "arches" else ys))


def _wall(d: Draft) -> None:
    kind = d.pick(("bond", "panels", "slabs"))
    length = d.pick((2, 3))
    ys = _spaced(length, 4)
    if kind == "bond":
        d.build(f"{_row('cuboid2:edge-x', ys)}; {_row('cuboid2:flat-y', _spaced(length - 1, 4))}")
    elif kind == "panels":
        for i, y in enumerate(ys):
            d.build(f"{'cube' if i % 2 else 'arch'} {y}")
        d.build(_row("cuboid2:flat-y", ys))
    else:
        d.build(f"2 cube {2 * length - 2}; cube +1; cuboid3:flat-y")
    count = d.pick((2, 3))
    ys = _spaced(count, 4 if count == 2 else 2.5)
    for i, y in enumerate(ys):
        d.build(f"cube {y}", i)
    d.build(_row("triangle" if count == 2 else "semi_cylinder", ys))


def _pyramid(d: Draft) -> None:
    base = d.pick((2, 3, 3, 4))
    for row in range(base, 0, -1):
        # From both ends inward, so that the row below is loaded evenly.
        d.build(_row("cube", sorted(_spaced(row, 2), key=lambda at: (-abs(at), at)), row))
        if row == base and d.maybe(0.4):
            d.build(f"2 triangle:ramp {row + 1}")
        if row == 2 and d.maybe(0.4):
            d.build("cuboid2:flat-y")
    d.build("top")


def _stair(d: Draft) -> None:
    steps, is_double = d.pick((2, 3)), d.maybe(0.4)
    heights = [*range(1, steps + 1), *(range(steps - 1, 0, -1) if is_double else ())]
    ys = _spaced(len(heights), 2)
    for y, height in zip(ys, heights, strict=True):
        for number in range(height):
            d.build(f"cube {y}", number)
    has_ramps = d.pick((True, False))
    for i, (y, height) in enumerate(zip(ys, heights, strict=True)):
        ramp = f"triangle:{'ramp-y' if i < steps - 1 else 'ramp+y'}"
        d.build(f"{'top' if height == steps else ramp if has_ramps else 'cuboid1'} {y}")
    if has_ramps:
        d.build(f"triangle:ramp-y {ys[0] - 2}")


def _court(d: Draft) -> None:
    """Four columns, two beams, a roof across: a structure that is as deep as it is wide."""
    post = d.pick(("cylinder", "cube", "cuboid1", "cuboid1:edge-x"))
    half = d.pick((1, 2))
    beam = "cuboid3:flat-y" if half == 2 else "cuboid2:flat-y"
    d.build(f"2 {post} {half},-1; 2 {post} {half},1; {beam} 0,-1; {beam} 0,1")
    hall, nave = "2 cuboid2:flat-x 1", "2 triangle:ramp 1,-1; 2 triangle:ramp 1,1"
    across = f"2 cuboid2:flat-x {half}; top {-half}; top {half}"
    if d.any_of(hall, nave, across, "cuboid2:flat-x; cylinder; top") == hall:
        column(d, 1)
        d.build("top")


def _monument(d: Draft) -> None:
    plates, block = "cuboid2:flat-y 0,-1; cuboid2:flat-y 0,1", "2 cube 1,-1; 2 cube 1,1"
    cross, step = "cuboid3:flat-y; cuboid2:flat-x", "cuboid3:flat-y; cuboid2:flat-y"
    base = d.any_of(plates, cross, step, f"{block}; cuboid2:flat-y")
    column(d, d.pick((1, 2, 2)))
    d.build("cuboid2:flat-y; 2 semi_cylinder 1" if base != cross and d.maybe(0.4) else "top")
    if base == step:
        side = "semi_cylinder" if d.maybe() else "triangle"
        d.build(f"2 {side} {3 if d.maybe() else 4}")


def _henge(d: Draft) -> None:
    spans = d.pick((1, 2))
    ys = (-2.0, 2.0) if spans == 1 else (-4.0, 0.0, 4.0)
    d.build(_row(d.pick(("cylinder", "cube", "cuboid2:upright-x")), ys))
    d.build("cuboid3:flat-y" if spans == 1 else "2 cuboid2:flat-y 2")
    d.build(_row("cuboid1", ys if d.maybe() else ys[:: len(ys) - 1]))
    d.build("cuboid3:flat-y; top" if spans == 1 else "cuboid2:flat-y; top")


def _balance(d: Draft) -> None:
    column(d, d.pick((1, 2)))
    beam = d.any_of("cuboid3:flat-y", "cuboid3:flat-y", "cuboid2:flat-y")
    half = d.pick((1.0, 2.0)) if beam.startswith("cuboid3") else 1.0
    d.build(f"2 cube {half}" if d.maybe() else f"2 cuboid1 {half}")
    d.any_of(f"2 semi_cylinder {half}", f"2 triangle {half}")


def _animal(d: Draft) -> None:
    """Four legs, a back, a neck and a head at one end, a tail at the other."""
    legs = d.pick(("arch", "arch", "arches", "cubes", "posts", "feet"))
    width = 4 if legs in ("arch", "feet") else d.pick((4, 6))
    back = _DECKS[width]
    if legs == "arches":
        width, back = 4, "2 cuboid2:flat-x 1"
    end = width / 2 - 1
    blocks = {"cubes": "cube", "posts": "cylinder", "feet": "cuboid1:edge-x"}
    pairs = {name: f"2 {block} {end}" for name, block in blocks.items()}
    d.build({"arch": "arch", "arches": "arch 0,-1; arch 0,1", **pairs}[legs])
    if legs != "arch" or d.maybe():
        d.build(back)
    cube = f"cube {end} +1"
    d.any_of("", cube, cube, f"cylinder {end}", f"cuboid1 {end}; {cube}")
    if d.maybe(0.6):
        d.any_of(f"triangle:ramp-y {-end}", f"semi_cylinder:dome {-end}")
    d.any_of(
        f"triangle:ramp+y {end}",
        f"semi_cylinder:dome-turned {end}",
        f"triangle {end}",
        f"cuboid2:flat-y {end + 0.5}; triangle:ramp+y {end}",
    )


def _figure(d: Draft) -> None:
    """Two legs, a trunk with arms, a head with a hat."""
    skirt = "2 triangle:ramp 1; cube"
    posts = ("2 cylinder 1", "2 cube 1", "2 cuboid1 1", "2 cuboid1 1; 2 cube 1")
    legs = d.any_of(*posts, skirt)
    trunk = d.pick(("cube +1", "2 cube 1 +1", "arch:cradle", "cylinder"))
    if legs != skirt:
        d.build(f"cuboid2:flat-y; {trunk}")
    d.any_of("cuboid3:flat-y", "cuboid2:flat-y")
    head = d.any_of("cube", "cuboid1", "semi_cylinder")
    if head != "semi_cylinder" and d.maybe(0.8):
        d.build("top")


def _car(d: Draft) -> None:
    """Wheels, a chassis, and a cab, a load or a chimney on it."""
    wheel = "cylinder:lying-x"
    is_long = d.pick((False, False, True))
    d.build(_row(wheel, (-2, 0, 2)) if is_long else f"2 {wheel} {d.pick((1.5, 2.0))}")
    d.build("cuboid3:flat-y")
    cab = d.any_of("cube -2", "cube -2; cuboid1 -2", "arch -1", "cuboid2:flat-y -1")
    is_wide = not cab.startswith("cube")
    d.any_of(
        f"cube {2 if is_wide else 0} +1; triangle:ramp+y 2",
        "semi_cylinder:round+y 2",
        "cuboid1 2; semi_cylinder 2",
        "triangle:ramp+y 2",
        "cube 2 +1" if is_wide else "cylinder:lying-y 1",
    )
    if d.maybe(0.6):
        d.any_of("semi_cylinder -2", "triangle -2", "cuboid1 -2")


def _ship(d: Draft) -> None:
    hull = d.any_of(
        "arch:cradle; cuboid3:flat-y",
        "2 arch:cradle 2; 2 cuboid2:flat-y 2",
        "cuboid2:flat-y; cuboid3:flat-y",
    )
    is_twin = hull.startswith("2")
    bridge, funnel = "cuboid2:flat-y; cube; semi_cylinder", "cube -1; cuboid1 1; semi_cylinder -1"
    if d.any_of("cube; top", "cylinder", bridge, funnel) == "cylinder":
        d.any_of("triangle:roof", "triangle:ramp+y")
    if is_twin or d.maybe(0.4):
        side = "semi_cylinder" if d.maybe() else "triangle"
        d.build(f"2 {side} {3 if is_twin else 2}")


def _rocket(d: Draft) -> None:
    body = d.any_of("cylinder", "cylinder", "cube", "cuboid3:flat-y; cylinder")
    d.build("2 triangle:ramp 2")
    if not body.startswith("cuboid3") and d.maybe(0.4):
        d.build("triangle:ramp+x 0,2")
    for tone in range(d.pick((1, 2))):
        d.any_of("cube", "cylinder", "cuboid1", tone=tone)
    d.build("top")


def _table(d: Draft) -> None:
    """A table, bench or bed, and what stands on it or beside it."""
    width = d.pick((4, 6, 6))
    end, board = width / 2 - 1, _DECKS[width].partition(":")[0]
    d.any_of(f"2 cube {end}", f"2 cuboid1 {end}", f"2 cylinder {end}")
    d.build(_DECKS[width])
    bed = f"semi_cylinder:dome {-end}; cuboid1 {-end + 2 if width == 6 else end}"
    back, lamp = f"{board}:edge-x 0,-0.5", f"cuboid1 {end}; triangle {end}"
    kind = d.pick(("vase", "meal", bed, back, lamp, "arch:cradle"))
    if kind == "vase":
        d.build(f"cylinder {d.pick((0.0, end))}")
    elif kind == "meal":
        d.build(f"2 semi_cylinder {end}")
        d.build("cuboid1" if d.maybe() else "")
    else:
        d.build(kind)


def _chair(d: Draft) -> None:
    seat = d.any_of("cube", "cuboid1", "arch")
    d.any_of("cuboid2:upright-x 0,-1.5", "cuboid2:edge-x 0,-1.5")
    d.build("" if seat == "arch" else "2 cuboid1:edge-y 1.5")
    d.any_of("semi_cylinder", "cuboid1", "triangle")


def _slide(d: Draft) -> None:
    height = d.pick((1, 2))
    top = -2 * height + 2
    d.build(f"cube {top}")
    d.build("cube +1; cube -2 +1; triangle:ramp+y" if height == 2 else "")
    d.build("triangle:ramp+y 2")
    d.build(f"triangle:ramp-y {top - 2}" if d.maybe() else "")
    d.build(f"cuboid1 {top}" if d.maybe() else "")
    d.build(f"top {top}")


def _fountain(d: Draft) -> None:
    d.build("2 cuboid1 1,-1; 2 cuboid1 1,1")
    d.any_of("cylinder", "cube")
    d.build("arch:cradle; top" if d.maybe() else "top")
    d.build("2 semi_cylinder:round 2.5" if d.maybe() else "")


def _tree(d: Draft) -> None:
    d.any_of("cylinder", "cylinder", "cube")
    d.build("cuboid1" if d.maybe() else "")
    leaves = d.pick(("fir", "crown", "palm"))
    if leaves == "fir":
        d.build("cuboid3:flat-y" if d.maybe() else "cuboid2:flat-y")
        d.build("2 triangle:ramp 1")
    elif leaves == "crown":
        d.build("arch; semi_cylinder:dome")
    else:
        d.build("cuboid3:flat-y; 2 semi_cylinder 2; cube +1; triangle")


def _crane(d: Draft) -> None:
    """A beam whose load tips it where the weight at its other end is not there first."""
    column(d, d.pick((1, 2, 2, 3)))
    d.build("cuboid3:flat-y 0.5")
    weight = d.pick(("cube", "cylinder"))
    d.build(f"{weight} -1.5")
    d.build(f"{weight} 2.5 +1")
    d.build("top 2.5" if d.maybe() else "")


def _keep(d: Draft) -> None:
    """Storeys on storeys, and a turret: as deep a dependency as rests on two piers."""
    widths = d.pick(((8, 8, 6, 4), (8, 6, 6, 4), (8, 8, 6, 6, 4), (6, 6, 4, 4, 4)))
    for number, width in enumerate(widths):
        storey(d, width, number)
    column(d, d.pick((1, 2)))
    d.build("top")


_ACROSS = Symmetry(2, mirrored=True)
"""The mirror image across the plane y = 0."""


def beside(parts: Sequence[Sequence[Block]], gap_units: float, axis: int = 1) -> list[Block]:
    """Return the parts in a row with gaps between their outlines [grid units], numbered through.

    They stand side by side along x, the depth (`axis` 0), or y, the front (1).
    """
    row: list[Block] = []
    edge_m = 0.0
    for part in parts:
        low_m, high_m = whole_bounds_m(part)
        shift = -(low_m + high_m) / 2
        shift[2] = 0.0
        shift[axis] = edge_m - low_m[axis]
        for block in part:
            x, y, z = np.round(np.array(block.position_m) + shift, 6) + 0.0
            place = (float(x), float(y), float(z))
            row.append(replace(block, order=len(row) + 1, position_m=place))
        edge_m += float(high_m[axis] - low_m[axis]) + gap_units * UNIT_M
    return row


def _part(d: Draft, *names: str) -> list[Block]:
    """The blocks of a part drawn apart, in the colors of the whole."""
    apart = d.fresh()
    THEMES[d.pick(names)](apart)
    return apart.blocks


def _framed(d: Draft) -> None:
    """A building between two towers that mirror one another."""
    side = _part(d, "tower", "monument", "balance", "pyramid")
    middle = _part(d, "house", "gate", "arcade", "court")
    d.blocks += beside([side, middle, transformed(side, _ACROSS)], d.pick((0.0, 0.0, 1.0)))


def _avenue(d: Draft) -> None:
    """A structure, its mirror image, and something between them."""
    side = _part(d, "bridge", "stair", "house", "gate")
    middle = _part(d, "fountain", "tree", "monument")
    d.blocks += beside([side, middle, transformed(side, _ACROSS)], d.pick((1.0, 2.0)))


def _street(d: Draft) -> None:
    """A building with a scene before its door."""
    building = _part(d, "house", "arcade", "court", "tower")
    second = _part(d, "animal", "car", "figure", "tree", "table")
    d.blocks += beside([building, second], d.pick((1.0, 2.0)))


def _train(d: Draft) -> None:
    """Two or three cars in a row."""
    cars = [_part(d, "car") for _ in range(d.pick((2, 2, 3)))]
    d.blocks += beside(cars, 1.0)


def _castle(d: Draft) -> None:
    """Towers, wings and a middle, mirrored."""
    side = _part(d, "tower", "keep", "crane")
    wing = _part(d, "wall", "arcade", "house", "bridge")
    middle = _part(d, "gate", "house", "keep", "pyramid")
    mirrored = [transformed(part, _ACROSS) for part in (wing, side)]
    d.blocks += beside([side, wing, middle, *mirrored], d.pick((0.0, 1.0)))


def _site(d: Draft) -> None:
    """A building between two cranes, and another beside them."""
    crane, middle = _part(d, "crane"), _part(d, "keep", "house", "pyramid", "arcade")
    last = _part(d, "tower", "gate", "stair", "wall")
    d.blocks += beside([crane, middle, transformed(crane, _ACROSS), last], d.pick((1.0, 2.0)))


def _town(d: Draft) -> None:
    """Buildings in a row."""
    names = ("arcade", "bridge", "gate", "house", "keep", "pyramid", "stair", "wall")
    row = [_part(d, *names) for _ in range(d.pick((3, 3, 4)))]
    d.blocks += beside(row, d.pick((1.0, 2.0)))


THEMES: dict[str, Theme] = {
    theme.__name__[1:]: theme
    for theme in (
        *(_arcade, _balance, _bridge, _court, _gate, _henge, _house, _monument, _pyramid, _stair),
        *(_tower, _wall, _animal, _car, _chair, _figure, _fountain, _rocket, _ship, _slide, _table),
        *(_tree, _avenue, _framed, _street, _train, _castle, _site, _town, _crane, _keep),
    )
}
"""By name: buildings, creatures and things, compositions, great ones, and parts of these alone."""
