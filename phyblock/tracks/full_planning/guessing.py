"""Plans that are learned without the goal, as a seed shows the candidates; made when asked for."""

from __future__ import annotations

from collections.abc import Sequence

from phyblock.datasets import AssemblyTask
from phyblock.domain import Plan
from phyblock.tracks.full_planning.goal_blind import goal_blind_plans
from phyblock.tracks.showing import Showing, ShownTask, TaskShowing
from phyblock.words import Setting

__all__ = ["BlindGuesses"]


class BlindGuesses:
    """The goal-blind plans of tasks, learned from all of `pool` in the form that each seed shows.

    A place in the list tells something only where the order is the file's, so plans are learned
    anew for every order.
    """

    def __init__(
        self, showing: TaskShowing, pool: Sequence[AssemblyTask], setting: Setting
    ) -> None:
        # A goal is not learned from, whichever is shown.
        self._showing = TaskShowing(Showing(showing.how.order))
        self._pool = pool
        self._setting = setting
        self._plans: dict[int, dict[str, Plan]] = {}

    def plan(self, task: AssemblyTask) -> Plan:
        """The plan for a task of the pool as it is shown, in the numbers that are shown."""
        is_shuffled = self._showing.how.order == "shuffled"
        seed = task.seed if is_shuffled and isinstance(task, ShownTask) else 0
        if seed not in self._plans:
            shown = [self._showing.of(one, seed) for one in self._pool]
            self._plans[seed] = goal_blind_plans(
                [one.scene for one in shown],
                {one.key: one.candidates for one in shown},
                self._setting,
            )
        return self._plans[seed][task.key]
