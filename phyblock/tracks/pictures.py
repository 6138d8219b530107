"""Pictures of samples: drawn once in worker processes, and kept on disk by content."""

from __future__ import annotations

import asyncio
import contextlib
import os
from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from phyblock.config.suite import ImagesSpec
from phyblock.data import AssemblyTask
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
from phyblock.resources import cache_dir
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
from phyblock.tracks.items import ShownTask
from phyblock.types import BACKGROUNDS, CandidateScale
from phyblock.workers import WorkerDiedError, WorkerPool

_Result = TypeVar("_Result")
_WORKERS = 4
_KEPT = 256
"""Pictures that stay in memory: more than are under way at once."""
_PNG_START, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"


@dataclass(frozen=True)
class Drawing:
    """A picture to be made: what it shows, the digest of what decides it, and how to make it.

    `make` runs in a worker process: a `partial` of a function of a module. `size_px` are width and
    height of the picture. One that `is_file` is read, and not kept in the cache.
    """

    label: str
    key: str
    make: Callable[[], bytes]
    size_px: tuple[int, int] = (0, 0)
    is_file: bool = False


class Workshop:
    """Draws pictures and does other long work in processes, which start with the first of it.

    Pictures are kept in `folder` by content, and the last ones in memory. `rendered` counts those
    made in this object's lifetime.
    """

    def __init__(self, workers: int = 0, folder: Path | None = None) -> None:
        """Without `workers`, as many as there are processors, at most four."""
        self.rendered = 0
        self._folder = folder or cache_dir() / "pictures"
        self._workers = workers or min(_WORKERS, os.cpu_count() or 1)
        self._pool: WorkerPool | None = None
        self._alone = asyncio.Lock()
        self._making: dict[str, asyncio.Task[bytes]] = {}
        self._recent: OrderedDict[tuple[str, str], Image] = OrderedDict()

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

    async def image(self, drawing: Drawing) -> Image:
        """Return a picture from memory, from the cache, or made now.

        Raises DataError for a file that is no picture, StoreError when the cache folder cannot be
        written, SimulationError when a worker was killed.
        """
        if (kept := self.kept(drawing)) is not None:
            return kept
        key = drawing.key
        if key not in self._making:
            self._making[key] = asyncio.create_task(self._draw(drawing))
            # Where all who waited were cancelled, nobody asks for the failure: asyncio prints it.
            self._making[key].add_done_callback(lambda done: done.cancelled() or done.exception())
        # Shielded: others may wait for the same picture when one waiter is cancelled.
        data = await asyncio.shield(self._making[key])
        return self._remembered(drawing, data)

    def kept(self, drawing: Drawing) -> Image | None:
        """Return a picture at hand; None where it is not there, not whole, or no picture.

        Raises DataError for a file that is no picture.
        """
        name = (drawing.key, drawing.label)
        if name in self._recent:
            self._recent.move_to_end(name)
            return self._recent[name]
        if drawing.is_file:
            return self._remembered(drawing, drawing.make())
        # One that is not whole, or no picture, is drawn again.
        with contextlib.suppress(OSError, ValueError, DataError):
            data = read_bytes(self._path(drawing.key), LARGEST_PICTURE_BYTES)
            if data.startswith(_PNG_START) and data.endswith(_PNG_END):
                return self._remembered(drawing, data)
        return None

    def close(self) -> None:
        """Stop the worker processes."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    def _remembered(self, drawing: Drawing, data: bytes) -> Image:
        image = Image(data, drawing.label, *picture_size(data, f"picture {drawing.label}"))
        self._recent[drawing.key, drawing.label] = image
        if len(self._recent) > _KEPT:
            self._recent.popitem(last=False)
        return image

    async def _draw(self, drawing: Drawing) -> bytes:
        path = self._path(drawing.key)
        try:
            data = await self.work_out(drawing.make)
            self.rendered += 1
            with writing(path, "name another cache folder with PHYBLOCK_CACHE"):
                path.parent.mkdir(parents=True, exist_ok=True)
                atomic_write(path, data)
        finally:
            del self._making[drawing.key]
        return data

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f"{key}.png"


class Pictures(ABC):
    """The pictures of a track's items; a track says how an item is drawn."""

    def __init__(self, shop: Workshop) -> None:
        self.shop = shop
        self._drawings: dict[str, tuple[Drawing, ...]] = {}

    @abstractmethod
    def draw(self, item: Any) -> tuple[Drawing, ...]:
        """Return the pictures of an item as it is shown, in the order sent."""

    def drawings(self, item: Any) -> tuple[Drawing, ...]:
        """Return what `draw` does, computed once for each name of what is shown."""
        name = getattr(item, "shown_as", item.key)
        if name not in self._drawings:
            self._drawings[name] = self.draw(item)
        return self._drawings[name]

    async def of(self, item: Any) -> tuple[Image, ...]:
        """Return the pictures of an item, drawn at the same time; raises as `Workshop.image`."""
        return tuple(await asyncio.gather(*map(self.shop.image, self.drawings(item))))

    def outline(self, item: Any) -> tuple[tuple[Image, ...], bool]:
        """Return the pictures as far as they are at hand, and True if all are; none is rendered.

        Where one is not made yet, empty ones of their sizes stand in for all.
        """
        return outlined(self.shop, self.drawings(item))

    def keys(self, item: Any) -> tuple[str, ...]:
        """Return what decides the pixels: digests of content, style and renderer."""
        return tuple(drawing.key for drawing in self.drawings(item))


def outlined(shop: Workshop, drawings: Iterable[Drawing]) -> tuple[tuple[Image, ...], bool]:
    """Return pictures as `Pictures.outline` does."""
    wanted = tuple(drawings)
    kept = [image for drawing in wanted if (image := shop.kept(drawing)) is not None]
    if len(kept) == len(wanted):
        return tuple(kept), True
    return tuple(Image(b"", drawing.label, *drawing.size_px) for drawing in wanted), False


def picture_style(images: ImagesSpec) -> PictureStyle:
    """Return the style in which a suite wants pictures drawn."""
    ground = images.background or BACKGROUNDS[0]
    seen = PictureStyle.from_view(images.view, images.size_px, ground)
    return replace(seen, candidate_scale=images.candidate_scale)


class ScenePictures(Pictures):
    """The goal and the candidates of a scene, as the section `images` of a suite says."""

    def __init__(self, shop: Workshop, images: ImagesSpec) -> None:
        super().__init__(shop)
        self._images = images
        self._style = picture_style(images)

    @property
    def candidate_scale(self) -> CandidateScale | None:
        """The scale of candidates, for the prompt; None where pictures are the data set's."""
        return None if self._images.source == "dataset" else self._style.candidate_scale

    def style_of(self, task: AssemblyTask) -> PictureStyle:
        """Return how the pictures of a task are drawn: larger than usual where its goal is wide."""
        return goal_style(task.scene, self._style)

    def keys(self, item: AssemblyTask) -> tuple[str, ...]:
        """Return what decides the pixels; of the data set's own pictures, digests of the files."""
        if self._images.source != "dataset":
            return super().keys(item)
        of = dict.fromkeys(one.composite for one in (item, goal_of(item)) if one is not None)
        parts = (b"" if path is None else read_picture(path) for path in of)
        return tuple(hex_digest(data) for data in parts)

    def draw(self, item: AssemblyTask) -> tuple[Drawing, ...]:
        """Return one composite, or the two pictures apart; DataError where the data set has none.

        A goal that is not shown has no part in the size of what is.
        """
        if self._images.source == "dataset":
            return self._files(item)
        shown = goal_of(item)
        style = self._style if shown is None else self.style_of(shown)
        side = (style.size_px, style.size_px)
        key = candidates_key(item.candidates, style)
        grid = Drawing("candidates", key, partial(candidates_png, item.candidates, style), side)
        if shown is None:
            return (grid,)
        key, make = goal_key(shown.scene, style), partial(goal_png, shown.scene, style)
        goal = Drawing("goal", key, make, side)
        if self._images.layout == "separate":
            apart = {"goal": goal, "candidates": grid}
            return tuple(apart[label] for label in self._images.order)
        key = hex_digest(f"composite {goal.key} {grid.key}")
        join = partial(_joined, goal.make, grid.make)
        return (Drawing("composite", key, join, joined_size_px(style.size_px)),)

    def _files(self, task: AssemblyTask) -> tuple[Drawing, ...]:
        """Return the data set's own composite, or what is cut out of it."""
        shown, own = goal_of(task), _composite(task)
        grid: Callable[[], bytes] = partial(_half, own, is_goal=False)
        makes = {"candidates": grid}
        if shown is not None:
            goal = partial(_half, _composite(shown), is_goal=True)
            makes = {"goal": goal, "candidates": grid}
            if self._images.layout == "composite":
                is_whole = not isinstance(task, ShownTask)
                whole = partial(read_picture, own) if is_whole else partial(_joined, goal, grid)
                makes = {"composite": whole}
        labels = self._images.order if len(makes) == 2 else makes
        name = getattr(task, "shown_as", task.key)
        return tuple(Drawing(label, name, makes[label], is_file=True) for label in labels)


def goal_of(task: AssemblyTask) -> AssemblyTask | None:
    """Return the task whose goal is shown, None where none is."""
    return task.goal if isinstance(task, ShownTask) else task


def _composite(task: AssemblyTask) -> Path:
    if task.composite is None:
        where = f"scene {task.scene.id}"
        hint = "render the pictures: --set images.source=render"
        raise DataError(Problem(where, "the data set has no picture of it", hint=hint))
    return task.composite


def _joined(make_goal: Callable[[], bytes], make_grid: Callable[[], bytes]) -> bytes:
    return composite_png(make_goal(), make_grid())


def _half(composite: Path, *, is_goal: bool) -> bytes:
    """Return goal or candidates cut out of a 2:1 composite: two squares but for the gap between."""
    with decode_picture(read_picture(composite), str(composite)) as picture:
        # PNG knows no CMYK, in which JPEG files may come.
        picture = picture.convert("RGB") if picture.mode == "CMYK" else picture
        width, height = picture.size
        side = width // 2 - width // 256
        left = 0 if is_goal else width - side
        return to_png(picture.crop((left, 0, left + side, height)))
