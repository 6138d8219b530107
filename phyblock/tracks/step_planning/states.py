"""The pictures of the assembly that the turns of an episode were sent."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from phyblock.data import AssemblyTask
from phyblock.sim.pictures import PictureStyle, goal_style
from phyblock.sim.question_pictures import question_key, state_picture
from phyblock.tracks.step_planning.record import EpisodeRecord

__all__ = ["state_keys"]


def state_keys(record: Any, task: AssemblyTask, style: PictureStyle) -> Iterator[str]:
    """The names in the cache of what stood before each step of an episode."""
    if not isinstance(record, EpisodeRecord):
        return
    wide = goal_style(task.scene, style)
    world: tuple[int, ...] = ()
    for turn in record.turns:
        blocks = [task.scene.blocks[vertex] for vertex in world]
        yield question_key(state_picture(task.scene, blocks, wide), wide)
        if turn.outcome is not None:
            world = turn.world
