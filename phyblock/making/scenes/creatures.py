"""Themes that stand for something: animals, people, vehicles, ships, furniture, playthings."""

from __future__ import annotations

from phyblock.domain.blocks import BlockType
from phyblock.making.scenes.motifs import EDGES, OUT, topping
from phyblock.making.scenes.sketch import Draft, Theme

__all__ = ["CREATURES"]


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
