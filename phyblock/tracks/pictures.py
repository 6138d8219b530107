"""Pictures of samples: rendered in worker processes while calls run, made once, kept on disk."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from phyblock.data import AssemblyTask
from phyblock.errors import DataError, Problem
from phyblock.files import decode_picture, read_picture
from phyblock.models.base import Image
from phyblock.sim.pictures import (
    PictureStyle,
    candidates_key,
    candidates_png,
    composite_png,
    goal_key,
    goal_png,
    goal_style,
    joined_size_px,
    to_png,
)
from phyblock.stable import hex_digest
from phyblock.tracks.showing import ShownTask
from phyblock.tracks.studio import Drawing, Studio, Workshop, to_image
from phyblock.types import CandidateScale, PictureLayout, PictureName, PictureSource

__all__ = ["PicturePolicy", "Pictures"]


@dataclass(frozen=True)
class PicturePolicy:
    """Which pictures a sample carries, in which order.

    `source`: rendered here, or the data set's own composite. `layout`: one composite, or the two
    pictures apart in `order`.
    """

    source: PictureSource
    layout: PictureLayout
    order: tuple[PictureName, ...]
    style: PictureStyle


class Pictures(Studio):
    """The pictures of assembly tasks under one policy."""

    def __init__(self, folder: Path, policy: PicturePolicy, shop: Workshop | int) -> None:
        super().__init__(folder, shop)
        self.policy = policy

    @property
    def candidate_scale(self) -> CandidateScale | None:
        """How candidates are scaled, for the prompt; None where pictures are the data set's."""
        return None if self.policy.source == "dataset" else self.policy.style.candidate_scale

    def style_of(self, task: AssemblyTask) -> PictureStyle:
        """How the pictures of a task are drawn: larger than usual where its goal is wide."""
        return goal_style(task.scene, self.policy.style)

    async def of(self, task: AssemblyTask) -> tuple[Image, ...]:
        """The pictures of one task as they are sent.

        Raises DataError when the data set has no picture of it or a broken one, StoreError when
        the cache folder cannot be written.
        """
        name = _name(task)
        if (recent := self.recalled(name)) is not None:
            return recent
        if self.policy.source == "dataset":
            return self.remembered(name, self._from_dataset(task))
        return self.remembered(name, await self.images(self._drawings(task)))

    def outline(self, task: AssemblyTask) -> tuple[tuple[Image, ...], bool]:
        """The pictures as far as they are at hand, and whether all are; nothing is rendered.

        A picture that is not made yet is stood in for by an empty one of its size.
        """
        if self.policy.source == "dataset":
            return self._from_dataset(task), True
        drawings = self._drawings(task)
        side = self._shown_style(task).size_px
        is_joined = drawings[0].label == "composite"
        return self.outlined(drawings, joined_size_px(side) if is_joined else (side, side))

    def keys(self, task: AssemblyTask) -> tuple[str, ...]:
        """What decides the pixels of a task's pictures: digests of content, style and renderer."""
        if self.policy.source == "dataset":
            of = dict.fromkeys(one.composite for one in (task, _goal_of(task)) if one is not None)
            parts = (b"" if path is None else read_picture(path) for path in of)
            return tuple(hex_digest(data) for data in parts)
        return tuple(drawing.key for drawing in self._drawings(task))

    def _shown_style(self, task: AssemblyTask) -> PictureStyle:
        """The style of what is shown: a goal that is not shown has no part in its size."""
        goal = _goal_of(task)
        return self.policy.style if goal is None else self.style_of(goal)

    def _drawings(self, task: AssemblyTask) -> tuple[Drawing, ...]:
        candidates, style = task.candidates, self._shown_style(task)
        grid = Drawing(
            "candidates",
            candidates_key(candidates, style),
            partial(candidates_png, candidates, style),
        )
        of = _goal_of(task)
        if of is None:
            return (grid,)
        goal = Drawing("goal", goal_key(of.scene, style), partial(goal_png, of.scene, style))
        if self.policy.layout == "separate":
            apart = {"goal": goal, "candidates": grid}
            return tuple(apart[label] for label in self.policy.order)
        key = hex_digest(f"composite {goal.key} {grid.key}")
        return (Drawing("composite", key, partial(_composite, goal.make, grid.make)),)

    def _from_dataset(self, task: AssemblyTask) -> tuple[Image, ...]:
        of, data = _goal_of(task), _composite_file(task)
        if self.policy.layout == "composite" and not isinstance(task, ShownTask):
            return (to_image(data, "composite"),)
        _, grid = _halves(data, task.composite)
        if of is None:
            return (to_image(grid, "candidates"),)
        goal, _ = _halves(_composite_file(of), of.composite)
        if self.policy.layout == "composite":
            return (to_image(composite_png(goal, grid), "composite"),)
        halves = {"goal": goal, "candidates": grid}
        return tuple(to_image(halves[label], label) for label in self.policy.order)


def _goal_of(task: AssemblyTask) -> AssemblyTask | None:
    """The task whose goal is shown, None where none is."""
    return task.goal if isinstance(task, ShownTask) else task


def _name(task: AssemblyTask) -> str:
    """Tells apart the ways in which a task is shown."""
    if not isinstance(task, ShownTask):
        return task.key
    return f"{task.key} {task.order} {task.goal and task.goal.key}"


def _composite_file(task: AssemblyTask) -> bytes:
    if task.composite is None:
        where = f"scene {task.scene.id}"
        hint = "render the pictures: --set images.source=render"
        raise DataError(Problem(where, "the data set has no picture of it", hint=hint))
    return read_picture(task.composite)


def _composite(make_goal: Callable[[], bytes], make_grid: Callable[[], bytes]) -> bytes:
    return composite_png(make_goal(), make_grid())


def _halves(composite: bytes, path: Path | None) -> tuple[bytes, bytes]:
    """Goal and candidates cut out of a 2:1 composite: two squares but for the gap between."""
    with decode_picture(composite, str(path)) as picture:
        # PNG knows no CMYK, in which JPEG files may come.
        picture = picture.convert("RGB") if picture.mode == "CMYK" else picture
        width, height = picture.size
        side = width // 2 - width // 256
        left = picture.crop((0, 0, side, height))
        right = picture.crop((width - side, 0, width, height))
        return to_png(left), to_png(right)
