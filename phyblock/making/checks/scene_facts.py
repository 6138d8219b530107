"""What checks look at: a scene with what geometry, rendering and simulation say about it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from phyblock.domain.aov import AOVGraph, CycleError
from phyblock.domain.blocks import KIT_PALETTE
from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Block, Kind, Scene
from phyblock.making.checks.tolerances import OURS, VIEW, Tolerances
from phyblock.sim.stability import Stability, check
from phyblock.sim.steps import check_at_rest, check_steps
from phyblock.sim.support import GROUND, Gap, Overlap, find_gaps, find_overlaps, support_graph
from phyblock.sim.visibility import hidden_blocks, visible_shares

__all__ = ["SceneFacts", "declared_orders", "graph_of"]


class SceneFacts:
    """A scene whose orders are unique, and facts about it; each is worked out once, when asked for.

    The scene's dependencies need not be sound. Facts raise SimulationError as the simulator does.
    """

    def __init__(
        self,
        scene: Scene,
        candidates: CandidateSet | None = None,
        tolerances: Tolerances = OURS,
        palette: tuple[Kind, ...] = KIT_PALETTE,
    ) -> None:
        """Without `candidates` checks of them find nothing."""
        self.scene = scene
        self.candidates = candidates
        self.tolerances = tolerances
        self.palette = palette

    @cached_property
    def overlaps(self) -> tuple[Overlap, ...]:
        """Blocks that share space, with one another or with the ground."""
        return find_overlaps(self.scene.blocks, self.tolerances.fit_m)

    @cached_property
    def gaps(self) -> tuple[Gap, ...]:
        """Blocks that hang above what is below them."""
        return find_gaps(self.scene.blocks, self.tolerances.fit_m)

    @cached_property
    def contacts(self) -> Mapping[int, frozenset[int]]:
        """For each block, by its order, the orders that it rests on; the ground only alone.

        Empty for a block that touches nothing below it.
        """
        graph = support_graph(self.scene.blocks)
        return {order: (below - {GROUND}) or below for order, below in graph.items()}

    @cached_property
    def declared(self) -> Mapping[int, frozenset[int]]:
        """The same as the file declares it."""
        return {block.order: declared_orders(block) for block in self.scene.blocks}

    @cached_property
    def graph(self) -> AOVGraph | None:
        """The graph of the declared dependencies; None when they are unsound."""
        return graph_of(self.declared)

    @cached_property
    def finished(self) -> Stability:
        """What becomes of the finished structure, watched to the end or until it is at rest."""
        blocks, trial, rest = self.scene.blocks, self.tolerances.trial, self.tolerances.rest
        return check(blocks, trial) if rest is None else check_at_rest(blocks, trial, rest)

    @cached_property
    def steps(self) -> tuple[Stability, ...]:
        """What becomes of the structure after each step of the stored order."""
        blocks = self.scene.blocks if self.tolerances.last_step else self.scene.blocks[:-1]
        return check_steps(blocks, self.tolerances.step_trial)

    @cached_property
    def shown(self) -> Mapping[int, float]:
        """For each block, by its order, the share of its outline that shows in the goal picture."""
        return visible_shares(self.scene, VIEW)

    @cached_property
    def hidden(self) -> tuple[int, ...]:
        """Orders of the blocks that do not show in the goal picture."""
        return hidden_blocks(self.scene)


def declared_orders(block: Block) -> frozenset[int]:
    """The orders that a block is declared to rest on; the ground alone is {0}."""
    return frozenset(block.depend) or frozenset({GROUND})


def graph_of(rests_on: Mapping[int, frozenset[int]]) -> AOVGraph | None:
    """The graph over blocks in the order given; None for unknown blocks or a cycle."""
    vertex_of = {order: vertex for vertex, order in enumerate(rests_on)}
    if any(order not in vertex_of for orders in rests_on.values() for order in orders - {GROUND}):
        return None
    edges = [
        frozenset(vertex_of[order] for order in orders - {GROUND}) for orders in rests_on.values()
    ]
    try:
        return AOVGraph(tuple(edges))
    except CycleError:
        return None
