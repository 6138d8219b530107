"""Random graphs and small scenes with plans, plain re-implementations to check against, and made-up
worlds of scenes in which the true F1 is known.
"""

import functools
import itertools
from collections.abc import Iterable, Mapping, Set
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from hypothesis import strategies as st

from phyblock.domain.scene import Block, Candidate, CandidateSet, Plan, Scene
from phyblock.scoring.plan import Counts, Floats, Goal, match_plan
from phyblock.scoring.statistics import Clusters
from phyblock.tracks.step_planning import StepPlanning
from phyblock.types import Setting

f1_of = next(one.value for one in StepPlanning.report().measures if one.name == "f1")
"""F1 as tables show it, of counts (..., [tp, fp, fn])."""
Edges = tuple[frozenset[int], ...]


@st.composite
def acyclic(draw: st.DrawFn, max_size: int = 7) -> Edges:
    """Dependencies of up to `max_size` vertices without a cycle, in any file order."""
    n = draw(st.integers(0, max_size))
    rank = draw(st.permutations(range(n)))
    return tuple(
        frozenset(w for w in range(n) if rank[w] < rank[v] and draw(st.booleans()))
        for v in range(n)
    )


@st.composite
def any_edges(draw: st.DrawFn, max_size: int = 6) -> Edges:
    """Dependencies of 1 to `max_size` vertices, mostly with cycles."""
    n = draw(st.integers(1, max_size))
    return tuple(frozenset(draw(st.sets(st.integers(0, n - 1), max_size=2))) for _ in range(n))


# Both types look the same after a half turn about z, so 0 and 180 are one orientation.
KINDS = tuple(itertools.product(("arch", "cuboid3"), ("red", "blue")))
FLAT, TURNED, BACK = (0.0, 0.0, 0.0), (0.0, 0.0, 90.0), (0.0, 0.0, 180.0)


def block(order: int, look: tuple[Any, ...], below: Iterable[int] = ()) -> Block:
    """A block of type, color and orientation, on those of these orders; it may be anywhere."""
    kind, color, euler_deg = look
    return Block(order, kind, color, FLAT, euler_deg, tuple(sorted(below)), 1)


@dataclass(frozen=True)
class Case:
    """A scene, a candidate set and a plan for it."""

    scene: Scene
    candidates: CandidateSet
    plan: Plan


@st.composite
def cases(draw: st.DrawFn, max_blocks: int = 6, max_steps: int = 8) -> Case:
    """Few looks and many dependencies, so that choices matter; candidates may be lacking."""
    edges = draw(acyclic(max_blocks).filter(bool))
    palette = draw(st.lists(st.sampled_from(KINDS), min_size=1, max_size=3))
    looks = st.tuples(st.sampled_from(palette), st.sampled_from([FLAT, TURNED, BACK]))
    blocks = []
    for order, needed in enumerate(edges, 1):
        kind, turn = draw(looks)
        blocks.append(block(order, (*kind, turn), (other + 1 for other in needed)))
    pool = [Candidate(*kind, turn) for kind in KINDS for turn in (FLAT, TURNED)]
    chosen = draw(st.permutations(pool))[: draw(st.integers(1, len(pool)))]
    steps = draw(st.lists(st.integers(1, len(chosen)), max_size=max_steps))
    scene = Scene("s", draw(st.sampled_from([(1, 2), (3,)])), tuple(blocks), ("s",))
    return Case(scene, CandidateSet(tuple(chosen)), Plan(tuple(steps)))


@st.composite
def carriers(draw: st.DrawFn) -> Case:
    """Equal cubes that carry blocks of few kinds: what the plan names depends on which it takes."""
    cubes = range(1, draw(st.integers(2, 3)) + 1)
    base = ("cube", "red", FLAT)
    blocks = [block(order, base) for order in cubes]
    tops = [("arch", "red", FLAT), ("arch", "red", TURNED), ("arch", "blue", FLAT)]
    for cube in cubes:
        for top in draw(st.lists(st.sampled_from(tops), min_size=1, max_size=2)):
            blocks.append(block(len(blocks) + 1, top, [cube]))
    candidates = CandidateSet(tuple(Candidate(*look) for look in (base, *tops)))
    tail = draw(st.lists(st.integers(1, len(candidates)), min_size=3, max_size=7))
    return Case(Scene("s", (3,), tuple(blocks), ("s",)), candidates, Plan((1, *tail)))


def equal(block: Block, candidate: Candidate, setting: Setting) -> bool:
    """True if a candidate stands for a block, said without orientation classes."""
    same_kind = (block.type, block.color) == (candidate.type, candidate.color)
    same_yaw = block.euler_deg[2] % 180 == candidate.euler_deg[2] % 180
    return same_kind and (same_yaw or setting == "B")


def choices(case: Case, index: int, placed: frozenset[int], setting: Setting) -> list[Block]:
    """Unplaced ready blocks, in file order, that a step may place; `placed` holds orders."""
    left = (block for block in case.scene.blocks if block.order not in placed)
    ready = (block for block in left if placed.issuperset(block.depend))
    return [block for block in ready if equal(block, case.candidates[index], setting)]


def greedy_tp(case: Case, setting: Setting) -> int:
    """Algorithm 1: every step takes the first block that it may place."""
    placed: frozenset[int] = frozenset()
    for index in case.plan.steps:
        placed |= {block.order for block in choices(case, index, placed, setting)[:1]}
    return len(placed)


def error_of(case: Case, index: int, placed: Set[int], setting: Setting) -> str:
    """The type of a wrong step by the four definitions, of which exactly one must hold."""
    candidate = case.candidates[index]
    of_kind = [block for block in case.scene.blocks if block.kind == candidate.kind]
    free = [block for block in of_kind if block.order not in placed]
    free_equal = [block for block in free if equal(block, candidate, setting)]
    holds = {
        "shape_not_in_gt": not of_kind,
        "overflow": bool(of_kind) and not free,
        "incorrect_orientation": bool(free) and not free_equal,
        "dependency_not_met": bool(free_equal)
        and not any(placed >= {*block.depend} for block in free_equal),
    }
    (name,) = (name for name, true in holds.items() if true)
    return name


def best_of_all(case: Case, setting: Setting) -> tuple[int, int, int, int]:
    """The best sequence of choices, skipping a step among them: most true positives, then fewest
    steps skipped though a block was ready, `overflow`, and `incorrect_orientation`.
    """

    @functools.cache
    def best(step: int, placed: frozenset[int]) -> tuple[int, int, int, int]:
        if step == len(case.plan):
            return 0, 0, 0, 0
        index = case.plan.steps[step]
        ready = choices(case, index, placed, setting)
        error = None if ready else error_of(case, index, placed, setting)
        missed, skipped, full, turned = best(step + 1, placed)
        full, turned = full + (error == "overflow"), turned + (error == "incorrect_orientation")
        after = [best(step + 1, placed | {block.order}) for block in ready]
        taken = [(missed - 1, *others) for missed, *others in after]
        return min([(missed, skipped + bool(ready), full, turned), *taken])

    missed, *others = best(0, frozenset())
    return (-missed, *others)


def renumbered(case: Case, data: st.DataObject) -> Case:
    """The same case with its blocks and candidates in a drawn order, and the plan to match."""
    blocks = tuple(data.draw(st.permutations(case.scene.blocks)))
    order = data.draw(st.permutations(range(len(case.candidates))))
    candidates = CandidateSet(tuple(case.candidates.candidates[i] for i in order))
    steps = tuple(order.index(index - 1) + 1 for index in case.plan.steps)
    return Case(replace(case.scene, blocks=blocks), candidates, Plan(steps))


def plans_f1(
    scenes: Iterable[Scene],
    sets: Mapping[str, CandidateSet],
    plans: Mapping[str, Plan],
    setting: Setting,
) -> float:
    """F1 of plans of several scenes, by the names of these."""
    goals = {scene.id: Goal(scene, sets[scene.id], setting) for scene in scenes}
    counts = (match_plan(goal, plans[name], "optimal").counts for name, goal in goals.items())
    return sum(counts, Counts()).f1 or 0.0


@dataclass(frozen=True)
class World:
    """`bases` base scenes, each a scene of its own, and `pairs` scenes made of two of them.

    A block is placed rightly with log odds `ease` (less `harder` in a pair), plus what the base
    scene adds (sd `base_sd`, the mean of the two in a pair), plus what the scene alone adds
    (sd `scene_sd`). Every plan is as long as its goal.
    """

    bases: int = 150
    pairs: int = 250
    base_sd: float = 1.2
    scene_sd: float = 0.3
    ease: float = -0.4
    harder: float = 0.5

    def draw(self, rng: np.random.Generator, models: int = 1) -> tuple[Floats, Clusters, Floats]:
        """Counts (scenes, models, [tp, fp, fn]), clusters, and the expected tp and blocks.

        All models share half the variance of each effect.
        """
        alone = np.arange(self.bases)
        couples = np.array([(a, b) for a in alone for b in alone[:a]], dtype=np.intp).reshape(-1, 2)
        chosen = couples[rng.choice(len(couples), self.pairs, replace=False)]
        first, second = np.concatenate([np.stack([alone, alone], axis=1), chosen]).T
        single = first == second
        sizes = rng.integers(3, 11, self.bases)
        blocks = np.where(single, sizes[first], sizes[first] + sizes[second])
        base = self._effects(rng, self.base_sd, self.bases, models)
        scene = self._effects(rng, self.scene_sd, len(first), models)
        odds = self.ease + (base[first] + base[second]) / 2 + scene
        odds -= np.where(single, 0.0, self.harder)[:, None]
        chance = 1 / (1 + np.exp(-odds))
        right = rng.binomial(blocks[:, None], chance).astype(np.float64)
        left = blocks[:, None] - right
        counts = np.stack([right, left, left], axis=-1)
        parents = [[str(a), str(b)] for a, b in zip(first, second, strict=True)]
        expected = np.array([(blocks[:, None] * chance).sum(axis=0)[0], blocks.sum()])
        return counts, Clusters.of(parents), expected

    def true_f1(self, rng: np.random.Generator, worlds: int = 300) -> float:
        """F1 of endlessly many scenes, from `worlds` drawings."""
        right, blocks = sum(self.draw(rng)[2] for _ in range(worlds))
        return float(right / blocks)

    @staticmethod
    def _effects(rng: np.random.Generator, sd: float, size: int, models: int) -> Floats:
        shared, own = rng.normal(0, sd, (size, 1)), rng.normal(0, sd, (size, models))
        return np.asarray((shared + own) / np.sqrt(2))
