"""Plans that are learned without the goal, as a seed shows the candidates; made when asked for."""

from __future__ import annotations

import functools
from collections.abc import Sequence

from phyblock.data import AssemblyTask
from phyblock.domain import Plan
from phyblock.tracks.goal_blind.kept_plans import kept_plans
from phyblock.tracks.showing import Showing, ShownTask, TaskShowing
from phyblock.types import CandidateOrder, Setting

__all__ = ["BlindGuesses"]


class BlindGuesses:
    """The goal-blind plans of tasks, learned from all of `pool` in the form that each seed shows.

    A place in the list tells something only where the order is the file's, so plans are learned
    anew for every order.
    """

    def __init__(
        self, showing: TaskShowing, pool: Sequence[AssemblyTask], setting: Setting
    ) -> None:
        self._order = showing.how.order
        self._pool = pool
        self._setting = setting
        self._plans: dict[int, dict[str, Plan]] = {}

    def plan(self, task: AssemblyTask) -> Plan:
        """The plan for a task of the pool as it is shown, in the numbers that are shown."""
        is_shuffled = self._order == "shuffled"
        seed = task.seed if is_shuffled and isinstance(task, ShownTask) else 0
        if seed not in self._plans:
            self._plans[seed] = _learned(tuple(self._pool), self._order, seed, self._setting)
        return self._plans[seed][task.key]


@functools.lru_cache(maxsize=8)
def _learned(
    pool: tuple[AssemblyTask, ...], order: CandidateOrder, seed: int, setting: Setting
) -> dict[str, Plan]:
    """Plans for all of `pool` by name; ways of asking that show the same order share them."""
    # A goal is not learned from, whichever is shown.
    showing = TaskShowing(Showing(order))
    shown = [showing.of(one, seed) for one in pool]
    candidates = {one.key: one.candidates for one in shown}
    return kept_plans([one.scene for one in shown], candidates, setting)
