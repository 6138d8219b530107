"""The pictures of pose planning: the goal on a ruled floor from each view, and the kit."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

from phyblock.data import AssemblyTask
from phyblock.models.base import Image
from phyblock.sim.camera import VIEWS
from phyblock.sim.pictures import PictureStyle, goal_style
from phyblock.sim.ruled import kit_key, kit_png, ruled_key, ruled_png, written_style
from phyblock.tracks.pose_planning.spec import ViewSpec
from phyblock.tracks.showing import ShownTask
from phyblock.tracks.studio import Drawing, Studio, Workshop
from phyblock.types import View

__all__ = ["KIT_LABEL", "PosePictures", "shows_three_sides"]

KIT_LABEL = "blocks"
_LEAST_TURN_DEG, _LEAST_DEG, _MOST_DEG = 10.0, 10.0, 75.0


class PosePictures(Studio):
    """Pictures of assembly tasks: the goal from every view, then the sheet of the candidates."""

    def __init__(
        self,
        folder: Path,
        style: PictureStyle,
        views: tuple[View | ViewSpec, ...],
        shop: Workshop | int,
    ) -> None:
        super().__init__(folder, shop)
        # The prompt says that the sheet has one scale, whatever other pictures of candidates have.
        self._style = replace(style, candidate_scale="common")
        self._views = views

    async def of(self, task: AssemblyTask) -> tuple[Image, ...]:
        """The pictures of one task; StoreError where the cache folder cannot be written."""
        name = _name(task)
        recent = self.recalled(name)
        return recent or self.remembered(name, await self.images(self._drawings(task)))

    def outline(self, task: AssemblyTask) -> tuple[tuple[Image, ...], bool]:
        """The pictures as far as they are at hand, and whether all are; nothing is rendered."""
        side = written_style(self._style).size_px
        return self.outlined(self._drawings(task), (side, side))

    def keys(self, task: AssemblyTask) -> tuple[str, ...]:
        """What decides the pixels of a task's pictures."""
        return tuple(drawing.key for drawing in self._drawings(task))

    def _drawings(self, task: AssemblyTask) -> tuple[Drawing, ...]:
        seen = [_seen(self._style, view) for view in self._views]
        style = written_style(seen[0][1])
        sheet = partial(kit_png, task.candidates, style)
        drawings = [Drawing(KIT_LABEL, kit_key(task.candidates, style), sheet)]
        goal = task.goal if isinstance(task, ShownTask) else task
        if goal is not None:
            drawings = [*(self._goal(goal, name, one) for name, one in seen), *drawings]
        return tuple(drawings)

    def _goal(self, task: AssemblyTask, name: str, style: PictureStyle) -> Drawing:
        style = written_style(goal_style(task.scene, style))
        make = partial(ruled_png, task.scene, style)
        return Drawing(f"goal, {name}", ruled_key(task.scene, style), make)


def shows_three_sides(view: View | ViewSpec) -> bool:
    """Whether a block that is seen so shows its top and two sides, as the sheet of blocks needs."""
    azimuth_deg, elevation_deg = _direction(view)
    off_axis_deg = abs((azimuth_deg + 45) % 90 - 45)
    return off_axis_deg >= _LEAST_TURN_DEG and _LEAST_DEG <= elevation_deg <= _MOST_DEG


def _direction(view: View | ViewSpec) -> tuple[float, float]:
    if isinstance(view, ViewSpec):
        return view.azimuth_deg, view.elevation_deg
    return VIEWS[view]


def _seen(style: PictureStyle, view: View | ViewSpec) -> tuple[str, PictureStyle]:
    """A view as words for people, and the style that looks from there."""
    azimuth_deg, elevation_deg = _direction(view)
    name = f"azimuth {azimuth_deg:g}°, elevation {elevation_deg:g}°"
    if not isinstance(view, ViewSpec):
        name = view
    return name, replace(style, azimuth_deg=azimuth_deg, elevation_deg=elevation_deg)


def _name(task: AssemblyTask) -> str:
    """Tells apart the ways in which a task is shown."""
    if not isinstance(task, ShownTask):
        return task.key
    return f"{task.key} {task.order} {task.goal and task.goal.key}"
