"""Base scenes and their variations, each from its own seed, and candidate sets.

A scene is a pure function of its request: a seed, a group, a number, and for a variation the
requests of the scenes it is made from. So any process can draw any scene, in any order.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence, Set
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from phyblock.data.scenes import read_builtin
from phyblock.domain import scene as scenes
from phyblock.domain.blocks import COLORS, BlockType
from phyblock.domain.scene import AssemblyTask, Block, Candidate, CandidateSet, Kind, Look, Scene
from phyblock.errors import DataError, Problem
from phyblock.files import bundled, read_own_yaml
from phyblock.making.checks import LEVEL_LIMITS, is_acceptable
from phyblock.making.scenes import sketch
from phyblock.making.scenes.sketch import PALETTES, POSES, Draft, Palette, colorless
from phyblock.sim.contact import find_gaps
from phyblock.text import drawn_bytes
from phyblock.workers import Workers


class Group(NamedTuple):
    """Requirements on the scenes of a group, and the sources of variations (`groups.yaml`)."""

    levels: tuple[int, ...]
    least: int
    base: int
    varied: int
    themes: tuple[str, ...]
    sources: tuple[tuple[int, tuple[str, ...]], ...]


GROUPS: dict[str, Group] = {
    name: Group(**facts)
    for name, facts in read_own_yaml(Path(__file__).with_name("groups.yaml")).items()
}
_TRIES = 25
_KEPT = 2048
"""Number of cached base scenes; many variations are made from each."""
_MAX_LOOKS = 14


@dataclass(frozen=True)
class Request:
    """The source of a scene; `parents` are empty for a base scene."""

    seed: int
    palette: Palette
    group: str
    number: int
    parents: tuple[Request, ...] = ()

    def rng(self) -> np.random.Generator:
        """Return the random source of this request."""
        kind = "variation" if self.parents else "base"
        text = f"{self.seed}/{self.palette}/{self.group}/{kind}/{self.number}"
        return np.random.default_rng(int.from_bytes(drawn_bytes(text)[:16], "big"))


def draw(request: Request) -> Scene | None:
    """Return the scene of a request, or None if the rules gave none that fits.

    Its name is its theme, `recolored` or `combined`; accepted scenes get names and parents later.
    """
    if not request.parents:
        return _drawn_base(request)
    rng = request.rng()
    parts: list[tuple[Block, ...]] = []
    for parent in request.parents:
        scene = draw(parent)
        assert scene is not None
        symmetry = scenes.SYMMETRIES[int(rng.integers(len(scenes.SYMMETRIES)))]
        parts.append(sketch.transformed(scene.blocks, symmetry))
    if len(parts) > 1:
        gap, axis = (1.0, 1.0, 2.0)[int(rng.integers(3))], (1, 1, 0)[int(rng.integers(3))]
        return _fitting("combined", request.group, sketch.beside(parts, gap, axis))
    # Blocks of one type and color keep one color in common, a new one if the palette has one.
    taken: dict[Kind, Kind] = {}
    for kind in dict.fromkeys(block.kind for block in parts[0]):
        kinds = [(kind[0], color) for color in COLORS if color != kind[1]]
        free = [one for one in kinds if one in PALETTES[request.palette]]
        unused = [one for one in free if one not in taken.values()] or [kind]
        taken[kind] = unused[int(rng.integers(len(unused)))]
    blocks = [replace(block, color=taken[block.kind][1]) for block in parts[0]]
    return _fitting("recolored", request.group, blocks)


@functools.lru_cache(maxsize=_KEPT)
def _drawn_base(request: Request) -> Scene | None:
    names = GROUPS[request.group].themes
    name, rng = names[request.number % len(names)], request.rng()
    for _ in range(_TRIES):
        draft = Draft(rng, request.palette)
        draft.follow(name)
        scene = _fitting(name, request.group, draft.blocks)
        if scene is not None:
            # A block lowered along the face of another may catch on its edge and float there.
            return None if find_gaps(scene.blocks) else scene
    return None


def _fitting(name: str, group: str, blocks: list[Block]) -> Scene | None:
    """Return the scene of blocks if it is within the limits of a group, or None."""
    levels, least = tuple(GROUPS[group].levels), GROUPS[group].least
    limits = [LEVEL_LIMITS[level] for level in levels]
    if not least <= len(blocks) <= min(limit.most_blocks for limit in limits):
        return None
    with suppress(scenes.CycleError):
        scene = sketch.make_scene(name, levels, blocks)
        is_low = max(scene.graph.layers) <= min(limit.most_layers for limit in limits)
        if is_low and len({block.look for block in scene.blocks}) <= _MAX_LOOKS:
            return scene
    return None


_PATIENCE = 150
"""Number of candidates in a row, all refused or known, after which the search ends."""
_LARGEST_ROUND = 256


class Share(NamedTuple):
    """The wanted scenes of a group: numbers of base scenes and of variations."""

    group: str
    base: int
    varied: int


def shares(count: int, levels: Sequence[int] = (1, 2, 3, 4)) -> tuple[Share, ...]:
    """Return the shares of `count` scenes of these levels, in the proportions of the built-in 400.

    Scenes that count in levels 1 and 2 are included if both are. Rounded by largest remainders.
    """
    wanted = {
        (name, part): (group.base, group.varied)[part]
        for name, group in GROUPS.items()
        if set(group.levels) <= set(levels)
        for part in (0, 1)
    }
    total = sum(wanted.values())
    exact = {key: count * number / total for key, number in wanted.items()}
    given = {key: math.floor(number) for key, number in exact.items()}
    by_rest = sorted(exact, key=lambda key: (given[key] - exact[key], key[1], key[0]))
    for key in by_rest[: count - sum(given.values())]:
        given[key] += 1
    names = dict.fromkeys(name for name, _ in wanted)
    return tuple(Share(name, given[name, 0], given[name, 1]) for name in names)


@functools.cache
def builtin_forms() -> frozenset[bytes]:
    """Return the colorless forms of the built-in set, which no generated scene may have."""
    tasks = read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks
    return frozenset(colorless(task.scene.blocks) for task in tasks)


class Drawn(NamedTuple):
    """A scene that was drawn, with its fingerprints with and without colors."""

    request: Request
    scene: Scene
    form: bytes
    colorless: bytes


def _drawn(request: Request) -> Drawn | None:
    scene = draw(request)
    if scene is None:
        return None
    return Drawn(request, scene, scenes.fingerprint(scene.blocks), colorless(scene.blocks))


class Production:
    """Produces the scenes of a seed; it keeps 16 bytes per candidate and a request per base scene.

    The same arguments give the same scenes with any workers: a candidate depends only on its
    number, and of equal ones the lowest is kept. `rejected` counts those with a form of `excluded`.
    """

    def __init__(self, seed: int, palette: Palette, workers: Workers, excluded: Set[bytes]) -> None:
        self._seed, self._palette, self._workers = seed, palette, workers
        self._excluded, self.rejected = excluded, 0
        self._seen: set[bytes] = set()
        self._bases: dict[Request, str] = {}
        self._next: Counter[str] = Counter()
        self._named: Counter[int] = Counter()

    def tasks(self, wanted: Sequence[Share]) -> Iterator[AssemblyTask]:
        """Yield base scenes by group, then variations, or more base scenes for missing ones. Raises
        DataError if the rules give no more different scenes.
        """
        width = max(3, len(str(sum(share.base + share.varied for share in wanted))))

        def named(scene: Scene, *parents: str) -> AssemblyTask:
            level = scene.levels[0]
            self._named[level] += 1
            name = f"l{level}-{self._named[level]:0{width}d}-{scene.id}"
            scene = replace(scene, id=name, parents=parents or (name,))
            return AssemblyTask(scene, make_candidates(scene, palette=self._palette))

        def bases(group: str, count: int) -> Iterator[AssemblyTask]:
            taken, request = 0, functools.partial(Request, self._seed, self._palette, group)
            for made, scene in self._accepted(count, request, self._next[group]):
                taken, self._next[group], task = taken + 1, made.number + 1, named(scene)
                self._bases[made] = task.key
                yield task
            if taken < count:
                message = f"gave no more than {taken} new scenes of {count}"
                hint = "ask for fewer scenes, for other levels, or for --palette full"
                raise DataError(Problem(f"level {group}", message, hint=hint))

        for share in wanted:
            yield from bases(share.group, share.base)
        for share in wanted:
            taken = 0
            for made, scene in self._varied(share):
                taken += 1
                yield named(scene, *dict.fromkeys(self._bases[base] for base in made.parents))
            yield from bases(share.group, share.varied - taken)

    def _varied(self, share: Share) -> Iterator[tuple[Request, Scene]]:
        """Yield variations of a group, as `_accepted`; none if there are too few base scenes."""
        sources = []
        for count, groups in GROUPS[share.group].sources:
            bases = [base for one in groups for base in self._bases if base.group == one]
            if len(bases) >= count:
                sources.append((count, bases))

        def request(number: int) -> Request:
            text = f"{self._seed}/{share.group}/parents/{number}"
            rng = np.random.default_rng(list(text.encode()))
            count, bases = sources[int(rng.integers(len(sources)))]
            chosen = rng.choice(len(bases), size=count, replace=False)
            parents = tuple(bases[int(i)] for i in chosen)
            return Request(self._seed, self._palette, share.group, number, parents)

        yield from self._accepted(share.varied, request, 0) if sources else ()

    def _accepted(
        self, wanted: int, request: Callable[[int], Request], first: int
    ) -> Iterator[tuple[Request, Scene]]:
        """Yield the first `wanted` sound and new candidates, in the order of their numbers."""
        number, taken, last = first, 0, first
        while taken < wanted and number - last <= _PATIENCE:
            size = min(_LARGEST_ROUND, max(8, math.ceil((wanted - taken) * 1.3)))
            requests = [request(number + i) for i in range(size)]
            number += size
            fresh = []
            for one in filter(None, self._workers.map(_drawn, requests)):
                if one.colorless in self._excluded:
                    self.rejected += 1
                elif one.form not in self._seen:
                    self._seen.add(one.form)
                    fresh.append(one)
            sound = self._workers.map(is_acceptable, [one.scene for one in fresh])
            kept = (one for one, is_kept in zip(fresh, sound, strict=True) if is_kept)
            for one in itertools.islice(kept, wanted - taken):
                taken, last = taken + 1, one.request.number
                yield one.request, one.scene


# Candidate sets: the needed blocks, and distractors that other goals need as often. Nothing may
# reveal whether a candidate is needed: neither its look, nor the number of poses in which its kind
# is offered, nor its place in the list. So distractors are drawn at rates that make every look
# needed in the same share of the sets that offer it.

NEEDED: dict[BlockType, dict[str, float]] = read_own_yaml(Path(__file__).with_name("needed.yaml"))
"""Mean number of looks of a type and pose, over all its colors, that a goal of the grammar needs,
counted in 1,200 goals. Poses that no goal needs would give themselves away and are not offered."""
_EVEN_SHARE = 0.36
"""Share of the sets that offer a look in which it is needed: 5.76 of 16 on average."""
_TIERS: dict[BlockType, int] = {
    **{"arch": 0, "cylinder": 1, "cuboid2": 2, "cuboid3": 3, "cube": 4, "cuboid1": 5},
    **{"triangle": 6, "semi_cylinder": 6},
}
"""Types from those low in goals to those high in them. So naming all candidates as listed is
already a good building order, and a reader gains nothing by finding a better one."""
_RARER: dict[BlockType, float] = {"triangle": 0.7}
"""Factors on how often a type is drawn as a distractor. Triangles have one color and six poses: in
setting B, where poses do not count, they are one block offered often, and omitting some pays."""
_MOST_DRAWN = 0.98
"""Upper limit: looks that more than `_EVEN_SHARE` of all goals need are nearly always offered."""


def make_candidates(scene: Scene, seed: int = 0, *, palette: Palette = "kit") -> CandidateSet:
    """Return up to `MAX_CANDIDATES` candidates that look different, with all that a scene needs.

    Types that are low in goals come first, else the order is random. The same scene id and seed
    give the same set everywhere. Raises DataError if the scene needs more looks.
    """
    needed: dict[Look, Candidate] = {}
    for block in scene.blocks:
        needed.setdefault(block.look, Candidate(block.type, block.color, block.euler_deg))
    if len(needed) > scenes.MAX_CANDIDATES:
        allowed = f"at most {scenes.MAX_CANDIDATES}"
        message = "needs more different blocks than a candidate set holds"
        raise DataError(Problem(scene.id, message, "blocks", str(len(needed)), allowed))
    # The rate per unit of time at which each look that some goal needs is drawn as a distractor:
    # the probability of being drawn within one unit gives the look its even share.
    colors = Counter(block_type for block_type, _ in PALETTES[palette])
    others: dict[Candidate, float] = {}
    for block_type, color in PALETTES[palette]:
        added = dict.fromkeys(POSES[block_type], _EVEN_SHARE)
        for pose, count in NEEDED.get(block_type, added).items():
            share = count / colors[block_type]
            drawn = min(share * (1 / _EVEN_SHARE - 1) / (1 - share), _MOST_DRAWN)
            one = Candidate(block_type, color, POSES[block_type][pose])
            if one.look not in needed:
                others[one] = -math.log1p(-drawn) * _RARER.get(block_type, 1.0)

    def number(one: Candidate, purpose: str) -> float:
        """Return a number in (0, 1) from a hash: the same on every platform and Python."""
        digest = drawn_bytes(f"{seed}/{scene.id}/{purpose}/{one}")
        return (int.from_bytes(digest[:6], "big") + 0.5) / 2**48

    def waiting(one: Candidate) -> float:
        """Draw a candidate's exponential waiting time (Efraimidis and Spirakis 2006)."""
        return -math.log(number(one, "drawn")) / others[one]

    def place(one: Candidate) -> tuple[int, float]:
        return _TIERS.get(one.type, len(_TIERS)), number(one, "place")

    distractors = sorted(others, key=waiting)[: scenes.MAX_CANDIDATES - len(needed)]
    return CandidateSet(tuple(sorted([*needed.values(), *distractors], key=place)))


Split = Literal["train", "dev"]
"""Endless series of scenes that share no form with each other or the built-in test set."""
_DEV_BELOW = 26
"""Forms whose first byte is below this belong to `dev`: a tenth of all."""
_LONGEST_SEARCH = 2000


def split_tasks(
    split: Split,
    seed: int = 0,
    *,
    levels: Sequence[int] = (1, 2, 3, 4),
    palette: Palette = "kit",
    excluded: Set[bytes] = frozenset(),
    first: int = 0,
    step: int = 1,
) -> Iterator[AssemblyTask]:
    """Yield an endless series of scenes with candidates, in the proportions of the built-in set.

    Each depends only on its number; every `step`-th is drawn, from number `first`. Names follow
    from content, so equal scenes have the same name. Raises DataError if all are `excluded`.
    """
    barred = builtin_forms() | excluded
    parts = [(share, part) for share in shares(10_000, levels) for part in (0, 1)]
    weights = np.array([(share.base, share.varied)[part] for share, part in parts])
    for number in itertools.count(first, step):
        text = f"{split}/{seed}/{number}"
        rng = np.random.default_rng(int.from_bytes(drawn_bytes(text)[:16], "big"))

        def base(group: str, rng: np.random.Generator = rng) -> Request:
            return Request(int(rng.integers(2**62)), palette, group, int(rng.integers(2**31)))

        for _ in range(_LONGEST_SEARCH):
            share, is_varied = parts[int(rng.choice(len(parts), p=weights / weights.sum()))]
            made, sources = base(share.group), list[Request]()
            if is_varied:
                found = GROUPS[share.group].sources
                count, groups = found[int(rng.integers(len(found)))]
                sources = [base(groups[int(rng.integers(len(groups)))]) for _ in range(count)]
            parents = [one for one in map(_drawn, sources) if one is not None]
            if len(parents) < len(sources):
                continue
            one = _drawn(replace(made, parents=tuple(sources)))
            if one is None or any(
                each.colorless in barred or (each.colorless[0] < _DEV_BELOW) != (split == "dev")
                for each in (*parents, one)
            ):
                continue
            if is_acceptable(one.scene):
                name, *names = (f"{p.scene.id}-{p.form.hex()[:12]}" for p in (one, *parents))
                scene = replace(one.scene, id=name, parents=tuple(dict.fromkeys(names or [name])))
                yield AssemblyTask(scene, make_candidates(scene, palette=palette))
                break
        else:
            message = f"none new in {_LONGEST_SEARCH} tries"
            hint = "ask for other levels, or for palette full"
            raise DataError(Problem(f"split {split}", message, hint=hint))
