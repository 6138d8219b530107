"""Pictures of samples: drawn once in worker processes, and kept on disk by content."""

from __future__ import annotations

import asyncio
import contextlib
import os
import threading
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Self, TypeVar

from phyblock import files
from phyblock.config.suite import ImagesSpec
from phyblock.domain.scene import AssemblyTask
from phyblock.errors import DataError, Problem, SimulationError
from phyblock.models.request import Image
from phyblock.sim import pictures
from phyblock.sim.pictures import PictureStyle
from phyblock.text import hex_digest
from phyblock.types import BACKGROUNDS, View

_Result = TypeVar("_Result")
_KEPT = 256
"""Pictures kept in memory: more than are in use at once."""
_PNG_START, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"


@dataclass(frozen=True)
class Drawing:
    """A picture to be made: its label, the digest of everything that determines it, and `make`.

    `make` runs in a worker process: a `partial` of a module-level function. `size_px` are width and
    height of the picture. A drawing that `is_file` is read, and not kept in the cache.
    """

    label: str
    key: str
    make: Callable[[], bytes]
    size_px: tuple[int, int] = (0, 0)
    is_file: bool = False

    @classmethod
    def of(
        cls, label: str, key: Callable[..., str], make: Callable[..., bytes], *what: Any
    ) -> Self:
        """Return the drawing of `what`, which ends in the style of a square picture."""
        side_px = what[-1].size_px
        return cls(label, key(*what), partial(make, *what), (side_px, side_px))


class Workshop:
    """Draws pictures and does other long work in processes, which start on first use.

    Pictures are kept in `folder` by content, the last ones in memory; `rendered` counts new ones.
    """

    def __init__(self, workers: int = 0, folder: Path | None = None) -> None:
        """Without `workers`, as many as there are processors, at most four."""
        self.rendered = 0
        self._folder = folder or files.cache_dir() / "pictures"
        self._workers = workers or min(4, os.cpu_count() or 1)
        self._pool: Executor | None = None
        self._alone = asyncio.Lock()
        self._drawn: defaultdict[str, asyncio.Lock] = defaultdict(asyncio.Lock)
        self._recent: dict[tuple[str, str], Image] = {}
        self._recent_lock = threading.Lock()

    async def compute(self, work: Callable[[], _Result]) -> _Result:
        """Return the result of `work`, a `partial` of a module-level function, in a worker process.

        Work that is killed is repeated alone. Raises SimulationError if it is killed again.
        """
        from concurrent.futures.process import BrokenProcessPool

        from phyblock.workers import open_pool

        loop = asyncio.get_running_loop()
        pool = self._pool = self._pool or open_pool(self._workers)
        try:
            return await loop.run_in_executor(pool, work)
        except BrokenProcessPool:
            if self._pool is pool:
                self._pool = None
        # Alone, so that work that was killed for memory gets all there is.
        async with self._alone:
            with open_pool(1) as alone:
                try:
                    return await loop.run_in_executor(alone, work)
                except BrokenProcessPool as error:
                    message = "a process that draws and simulates was killed twice"
                    hint = 'a script needs `if __name__ == "__main__":` around its calls'
                    raise SimulationError(f"{message}; {hint}") from error

    async def images(self, drawings: Sequence[Drawing]) -> tuple[Image, ...]:
        """Return pictures from memory, from the cache, or drawn now.

        Raises DataError for a file that is not a picture, StoreError when the cache folder cannot
        be written, SimulationError when a worker was killed.
        """
        return tuple([await self._image(one) for one in drawings])

    def outlines(self, drawings: Sequence[Drawing]) -> tuple[Image, ...]:
        """Return pictures in memory or cache, else empty ones of their size; raises as `images`."""
        return tuple(self._kept(one) or Image(b"", one.label, *one.size_px) for one in drawings)

    def close(self) -> None:
        """Stop the worker processes."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    async def _image(self, drawing: Drawing) -> Image:
        if (image := self._kept(drawing)) is None:
            # All who ask for the same picture wait for the first of them.
            async with self._drawn[drawing.key]:
                if (image := self._kept(drawing)) is None:
                    image = self._keep(drawing, await self.compute(drawing.make))
        return image

    def _kept(self, drawing: Drawing) -> Image | None:
        """Return a picture from memory or the cache; None if it is missing or damaged."""
        image = self._recent.get((drawing.key, drawing.label))
        if image is None and drawing.is_file:
            image = self._remembered(drawing, drawing.make())
        elif image is None:
            # A damaged file is drawn again.
            with contextlib.suppress(OSError, ValueError, DataError):
                data = files.read_bytes(self._path(drawing.key), files.LARGEST_PICTURE_BYTES)
                if data.startswith(_PNG_START) and data.endswith(_PNG_END):
                    image = self._remembered(drawing, data)
        return image

    def _remembered(self, drawing: Drawing, data: bytes) -> Image:
        with files.open_picture(data, f"picture {drawing.label}") as opened:
            image = Image(data, drawing.label, *opened.size)
        with self._recent_lock:
            self._recent[drawing.key, drawing.label] = image
            if len(self._recent) > _KEPT:
                del self._recent[next(iter(self._recent))]
        return image

    def _keep(self, drawing: Drawing, data: bytes) -> Image:
        self.rendered += 1
        path = self._path(drawing.key)
        with files.writing(path, "name another cache folder with PHYBLOCK_CACHE"):
            path.parent.mkdir(parents=True, exist_ok=True)
            files.atomic_write(path, data)
        return self._remembered(drawing, data)

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f"{key}.png"


class LocalShop(Workshop):
    """Draws and works in the calling thread; its coroutines never wait and need no event loop."""

    _one_at_a_time = threading.Lock()

    async def compute(self, work: Callable[[], _Result]) -> _Result:
        """Return the result of `work`; one at a time, as a physics engine requires."""
        with self._one_at_a_time:
            return work()

    async def _image(self, drawing: Drawing) -> Image:
        image = self._kept(drawing)
        return self._keep(drawing, drawing.make()) if image is None else image


def picture_style(images: ImagesSpec, view: View | None = None) -> PictureStyle:
    """Return the style of pictures in a suite, in its own view or another."""
    ground = images.background or BACKGROUNDS[0]
    return PictureStyle.from_view(view or images.view, images.size_px, ground)


def scene_drawings(task: AssemblyTask, images: ImagesSpec) -> tuple[Drawing, ...]:
    """Return the goal and the candidates of a scene: one composite, or two pictures.

    They are drawn, or cut out of the data set's own composites. A goal that is not shown does not
    affect the size. Raises DataError if the data set lacks a picture that it must provide.
    """
    if images.source == "render":
        style = picture_style(images)
        style = style if task.is_blind else pictures.goal_style(task.scene, style)
        goal = Drawing.of("goal", pictures.goal_key, pictures.goal_png, task.scene, style)
        grid = Drawing.of(
            "candidates", pictures.candidates_key, pictures.candidates_png, task.candidates, style
        )
        key, join = hex_digest(f"composite {goal.key} {grid.key}"), partial(_joined, goal, grid)
        both = Drawing("composite", key, join, pictures.joined_size_px(style.size_px))
        made = {one.label: one for one in (goal, grid, both)}
    elif (path := task.composite) is not None:
        makes = {"goal": partial(_half, path, is_goal=True), "candidates": partial(_half, path)}
        makes["composite"] = partial(files.read_picture, path)
        key = hex_digest(files.read_picture(path))
        made = {label: Drawing(label, key, make, is_file=True) for label, make in makes.items()}
    else:
        message, hint = "the data set has no picture of it", "use images.source: render"
        raise DataError(Problem(f"scene {task.key}", message, "images.source", hint=hint))
    if task.is_blind:
        return (made["candidates"],)
    labels = ("composite",) if images.layout == "composite" else images.order
    return tuple(made[label] for label in labels)


def _joined(goal: Drawing, grid: Drawing) -> bytes:
    return pictures.composite_png(goal.make(), grid.make())


def _half(composite: Path, *, is_goal: bool = False) -> bytes:
    """Return goal or candidates cut out of a 2:1 composite: two squares, with a gap between."""
    with files.open_picture(files.read_picture(composite), str(composite)) as picture:
        # PNG has no CMYK, which JPEG files may use.
        picture = picture.convert("RGB") if picture.mode == "CMYK" else picture
        width, height = picture.size
        side = width // 2 - width // 256
        left = 0 if is_goal else width - side
        return pictures.to_png(picture.crop((left, 0, left + side, height)))
