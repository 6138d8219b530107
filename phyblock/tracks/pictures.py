"""Drawing of pictures: worker processes, and a cache on disk by content."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections import OrderedDict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from phyblock.data import AssemblyTask
from phyblock.domain import BLOCK_TYPES, Block, CandidateSet, Scene
from phyblock.errors import DataError, Problem, SimulationError
from phyblock.files import (
    LARGEST_PICTURE_BYTES,
    atomic_write,
    decode_picture,
    picture_size,
    read_bytes,
    read_picture,
    writing,
)
from phyblock.models.request import Image
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.pictures import (
    COLOR_RGB,
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
from phyblock.tracks.items import ShownTask
from phyblock.types import CandidateScale, PictureLayout, PictureName, PictureSource
from phyblock.workers import WorkerDiedError, WorkerPool

_Result = TypeVar("_Result")
_RENDER_WORKERS = 4
_KEPT = 128
"""Samples whose pictures stay in memory: more than are under way at once."""


@dataclass(frozen=True)
class Drawing:
    """A picture to be made: what it shows, the digest of what decides it, and how to make it.

    `make` runs in a worker process: a `partial` of a function of a module.
    """

    label: str
    key: str
    make: Callable[[], bytes]


class Workshop:
    """The shared part of studios: `workers` processes, which start with the first work that there
    is, and the pictures that are being made or were used last.
    """

    def __init__(self, workers: int) -> None:
        self.making: dict[Path, asyncio.Task[bytes]] = {}
        self.recent: OrderedDict[tuple[Studio, str], tuple[Image, ...]] = OrderedDict()
        self._workers = workers
        self._pool: WorkerPool | None = None
        self._alone = asyncio.Lock()

    async def work_out(self, work: Callable[[], _Result]) -> _Result:
        """Return what `work`, a `partial` of a function of a module, gives in a worker process.

        Where one was killed it is done once more, alone; SimulationError where it is killed again.
        """
        self._pool = self._pool or WorkerPool(self._workers)
        loop = asyncio.get_running_loop()
        with contextlib.suppress(WorkerDiedError):
            return await loop.run_in_executor(self._pool, work)
        # Alone, so that what is killed for memory finds as much as there is.
        async with self._alone:
            try:
                return await loop.run_in_executor(self._pool, work)
            except WorkerDiedError as error:
                message = "a process that draws and simulates was killed twice"
                raise SimulationError(message) from error

    def close(self) -> None:
        """Stop the worker processes."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None


class Studio:
    """Makes pictures once and keeps them in `folder` by content.

    `shop` is where the work is done, by so many processes of its own where it is a number.
    `rendered` counts the files made in this object's lifetime.
    """

    def __init__(self, folder: Path, shop: Workshop | int) -> None:
        self.rendered = 0
        self._folder = folder
        self._shop = Workshop(shop) if isinstance(shop, int) else shop

    def recalled(self, name: str) -> tuple[Image, ...] | None:
        """Pictures that are still in memory under a name."""
        recent = self._shop.recent
        if (self, name) in recent:
            recent.move_to_end((self, name))
        return recent.get((self, name))

    def remembered(self, name: str, images: tuple[Image, ...]) -> tuple[Image, ...]:
        """The pictures, now in memory under a name; those unused for longest make room."""
        recent = self._shop.recent
        recent[self, name] = images
        if len(recent) > _KEPT:
            recent.popitem(last=False)
        return images

    async def images(self, drawings: Sequence[Drawing]) -> tuple[Image, ...]:
        """Pictures from the cache or made now, at the same time; raises as `image`."""
        return tuple(await asyncio.gather(*(self.image(drawing) for drawing in drawings)))

    def outlined(
        self, drawings: Sequence[Drawing], size_px: tuple[int, int]
    ) -> tuple[tuple[Image, ...], bool]:
        """Pictures as far as they are at hand, and whether all are; nothing is rendered.

        Where one is not made yet, empty ones of `size_px` stand in for all.
        """
        kept = [image for drawing in drawings if (image := self.kept(drawing)) is not None]
        if len(kept) == len(drawings):
            return tuple(kept), True
        return tuple(Image(b"", drawing.label, *size_px) for drawing in drawings), False

    def kept(self, drawing: Drawing) -> Image | None:
        """A picture from the cache, or None where it is not there, not whole, or no picture."""
        data = _whole_png(self._path(drawing.key))
        try:
            return None if data is None else to_image(data, drawing.label)
        except DataError:
            # It is drawn anew.
            return None

    async def image(self, drawing: Drawing) -> Image:
        """A picture from the cache, or made now.

        Raises StoreError when the cache folder cannot be written, SimulationError when a worker
        was killed.
        """
        path = self._path(drawing.key)
        if (kept := self.kept(drawing)) is not None:
            return kept
        making = self._shop.making
        if path not in making:
            making[path] = asyncio.create_task(self._draw(path, drawing))
            making[path].add_done_callback(_take_note)
        # Shielded: others may wait for the same picture when one waiter is cancelled.
        return to_image(await asyncio.shield(making[path]), drawing.label)

    async def _draw(self, path: Path, drawing: Drawing) -> bytes:
        try:
            data = await self.work_out(drawing.make)
            self.rendered += 1
            with writing(path, "name another cache folder with PHYBLOCK_CACHE"):
                path.parent.mkdir(parents=True, exist_ok=True)
                atomic_write(path, data)
        finally:
            del self._shop.making[path]
        return data

    async def work_out(self, work: Callable[[], _Result]) -> _Result:
        """Return what `work`, a `partial` of a function of a module, gives in a worker process."""
        return await self._shop.work_out(work)

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f"{key}.png"

    def close(self) -> None:
        """Stop the worker processes."""
        self._shop.close()


def _take_note(drawn: asyncio.Task[bytes]) -> None:
    # Where all who waited were cancelled, nobody asks for the failure, and asyncio would print it.
    if not drawn.cancelled():
        drawn.exception()


def render_workers() -> int:
    """Return the number of processes that draw pictures."""
    return min(_RENDER_WORKERS, os.cpu_count() or 1)


def to_image(data: bytes, label: str) -> Image:
    """An encoded picture as it is sent; DataError for what is none."""
    return Image(data, label, *picture_size(data, f"picture {label}"))


def _whole_png(path: Path) -> bytes | None:
    """The bytes of a picture in the cache; None when it is not there, or not whole."""
    try:
        data = read_bytes(path, LARGEST_PICTURE_BYTES)
    except (OSError, ValueError):
        return None
    is_whole = data.startswith(b"\x89PNG\r\n\x1a\n") and data.endswith(b"IEND\xaeB`\x82")
    return data if is_whole else None


_DECIMALS = 6


def kit() -> dict[str, Any]:
    """Shapes (vertices [m] and triangles in the body frame) and colors of all blocks."""
    meshes = {name: solid_mesh(name) for name in BLOCK_TYPES}
    return {
        "shapes": {
            name: {
                "vertices": [rounded(corner) for corner in mesh.vertices_m.tolist()],
                "triangles": mesh.triangles.tolist(),
            }
            for name, mesh in meshes.items()
        },
        "colors": COLOR_RGB,
    }


def scene_entry(scene: Scene, candidates: CandidateSet) -> dict[str, Any]:
    """A scene with its candidates.

    `depend` holds positions of blocks in the list, from 0; `candidate` is the number of the
    candidate that stands for the block in setting A, null where there is none.
    """
    needs = scene.graph.depends_on
    return {
        "blocks": [
            {
                **block_entry(block),
                "order": block.order,
                "depend": sorted(needs[vertex]),
                "candidate": candidates.index_of(block.look),
            }
            for vertex, block in enumerate(scene.blocks)
        ],
        "candidates": [
            {"type": one.type, "color": one.color, "euler": rounded(one.euler_deg)}
            for one in candidates.candidates
        ],
    }


def block_entry(block: Block) -> dict[str, Any]:
    """A block: its kind and pose."""
    return {
        "type": block.type,
        "color": block.color,
        "position": rounded(block.position_m),
        "euler": rounded(block.euler_deg),
    }


def rounded(values: Iterable[float]) -> list[float]:
    """Numbers with as many decimals as a drawing needs."""
    return [round(float(value), _DECIMALS) for value in values]


@dataclass(frozen=True)
class PicturePolicy:
    """The pictures that a sample carries, and their order.

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
        """The scale of candidates, for the prompt; None where pictures are the data set's."""
        return None if self.policy.source == "dataset" else self.policy.style.candidate_scale

    def style_of(self, task: AssemblyTask) -> PictureStyle:
        """Return how the pictures of a task are drawn: larger than usual where its goal is wide."""
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
        """Return what decides the pixels of a task's pictures: digests of content, style and
        renderer.
        """
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
