"""Where pictures are made: worker processes, and a cache on disk by content."""

from __future__ import annotations

import asyncio
import contextlib
import os
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from phyblock.errors import DataError, SimulationError
from phyblock.files import LARGEST_PICTURE_BYTES, atomic_write, picture_size, read_bytes, writing
from phyblock.models.base import Image
from phyblock.workers import WorkerDiedError, WorkerPool

__all__ = ["Drawing", "Studio", "Workshop", "render_workers", "to_image"]

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
    """What studios may share: `workers` processes, which start with the first work that there is,
    and the pictures that are being made or were used last.
    """

    def __init__(self, workers: int) -> None:
        self.making: dict[Path, asyncio.Task[bytes]] = {}
        self.recent: OrderedDict[tuple[Studio, str], tuple[Image, ...]] = OrderedDict()
        self._workers = workers
        self._pool: WorkerPool | None = None
        self._alone = asyncio.Lock()

    async def work_out(self, work: Callable[[], _Result]) -> _Result:
        """What `work`, a `partial` of a function of a module, gives in a worker process.

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
        """What `work`, a `partial` of a function of a module, gives in a worker process."""
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
    """How many processes draw pictures."""
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
