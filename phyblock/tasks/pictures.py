"""Pictures of samples: rendered in worker processes while calls run, made once, kept on disk."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import io
import os
import signal
import threading
from collections import OrderedDict
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Literal

from PIL import Image as PillowImage
from PIL import UnidentifiedImageError

from phyblock.datasets import AssemblyTask
from phyblock.errors import DataError, Problem, SimulationError, StoreError
from phyblock.files import atomic_write
from phyblock.models.base import Image
from phyblock.sim import (
    PictureStyle,
    candidates_key,
    candidates_png,
    composite_png,
    goal_key,
    goal_png,
)

__all__ = ["PicturePolicy", "Pictures"]


_KEPT = 128
"""Tasks whose pictures stay in memory: more than are under way at once."""


@dataclass(frozen=True)
class PicturePolicy:
    """Which pictures a sample carries, in which order.

    `source`: rendered here, or the data set's own composite. `layout`: one composite, or the two
    pictures apart in `order`.
    """

    source: Literal["render", "dataset"]
    layout: Literal["composite", "separate"]
    order: tuple[Literal["goal", "candidates"], ...]
    style: PictureStyle


@dataclass(frozen=True)
class _Drawing:
    """A picture to be made: what it shows, the digest of what decides it, and how to make it."""

    label: str
    key: str
    make: Callable[[], bytes]


class Pictures:
    """The pictures of assembly tasks under one policy, cached in `folder` by content.

    `workers` processes render; they start with the first picture that is not in the cache.
    `rendered` counts the files made in this object's lifetime.
    """

    def __init__(self, folder: Path, policy: PicturePolicy, workers: int) -> None:
        self.policy = policy
        self.rendered = 0
        self._folder = folder
        self._workers = workers
        self._pool: ProcessPoolExecutor | None = None
        self._making: dict[str, asyncio.Task[bytes]] = {}
        self._recent: OrderedDict[str, tuple[Image, ...]] = OrderedDict()

    async def of(self, task: AssemblyTask) -> tuple[Image, ...]:
        """The pictures of one task as they are sent.

        Raises DataError when the data set has no picture of it or a broken one, StoreError when
        the cache folder cannot be written.
        """
        if task.scene.id not in self._recent:
            made = (
                self._from_dataset(task)
                if self.policy.source == "dataset"
                else tuple(
                    await asyncio.gather(
                        *(self._image(drawing) for drawing in self._drawings(task))
                    )
                )
            )
            self._recent[task.scene.id] = made
            if len(self._recent) > _KEPT:
                self._recent.popitem(last=False)
        self._recent.move_to_end(task.scene.id)
        return self._recent[task.scene.id]

    def outline(self, task: AssemblyTask) -> tuple[tuple[Image, ...], bool]:
        """The pictures as far as they are at hand, and whether all are; nothing is rendered.

        A picture that is not made yet is stood in for by an empty one of its size.
        """
        if self.policy.source == "dataset":
            return self._from_dataset(task), True
        drawings = self._drawings(task)
        kept = [_whole_png(self._path(drawing.key)) for drawing in drawings]
        images = [
            _image(data, drawing.label)
            for data, drawing in zip(kept, drawings, strict=True)
            if data is not None
        ]
        if len(images) == len(drawings):
            return tuple(images), True
        side = self.policy.style.size_px
        wide = 2 * side if self.policy.layout == "composite" else side
        return tuple(Image(b"", drawing.label, wide, side) for drawing in drawings), False

    def keys(self, task: AssemblyTask) -> tuple[str, ...]:
        """What decides the pixels of a task's pictures: digests of content, style and renderer."""
        if self.policy.source == "dataset":
            data = b"" if task.composite is None else read_picture(task.composite)
            return (hashlib.sha256(data).hexdigest(),)
        return tuple(drawing.key for drawing in self._drawings(task))

    def close(self) -> None:
        """Stop the worker processes."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

    def _drawings(self, task: AssemblyTask) -> tuple[_Drawing, ...]:
        scene, candidates, style = task.scene, task.candidates, self.policy.style
        goal = _Drawing("goal", goal_key(scene, style), partial(goal_png, scene, style))
        grid = _Drawing(
            "candidates",
            candidates_key(candidates, style),
            partial(candidates_png, candidates, style),
        )
        if self.policy.layout == "separate":
            apart = {"goal": goal, "candidates": grid}
            return tuple(apart[label] for label in self.policy.order)
        key = hashlib.sha256(f"composite {goal.key} {grid.key}".encode()).hexdigest()
        return (_Drawing("composite", key, partial(_composite, goal.make, grid.make)),)

    def _from_dataset(self, task: AssemblyTask) -> tuple[Image, ...]:
        if task.composite is None:
            where = f"scene {task.scene.id}"
            hint = "render the pictures: --set images.source=render"
            raise DataError(Problem(where, "the data set has no picture of it", hint=hint))
        data = read_picture(task.composite)
        if self.policy.layout == "composite":
            return (_image(data, "composite"),)
        halves = dict(zip(("goal", "candidates"), _halves(data), strict=True))
        return tuple(_image(halves[label], label) for label in self.policy.order)

    async def _image(self, drawing: _Drawing) -> Image:
        path = self._path(drawing.key)
        if (kept := _whole_png(path)) is not None:
            return _image(kept, drawing.label)
        if drawing.key not in self._making:
            self._making[drawing.key] = asyncio.create_task(self._draw(path, drawing))
            self._making[drawing.key].add_done_callback(_take_note)
        # Shielded: others may wait for the same picture when one waiter is cancelled.
        return _image(await asyncio.shield(self._making[drawing.key]), drawing.label)

    async def _draw(self, path: Path, drawing: _Drawing) -> bytes:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(
                self._workers, get_context("spawn"), initializer=_start_worker
            )
        try:
            with _workers_without_interrupts():
                drawn = asyncio.get_running_loop().run_in_executor(self._pool, drawing.make)
            data = await drawn
            self.rendered += 1
            path.parent.mkdir(parents=True, exist_ok=True)
            atomic_write(path, data)
        except OSError as error:
            hint = "name another cache folder with PHYBLOCK_CACHE"
            problem = Problem(str(path), f"cannot be written: {error.strerror}", hint=hint)
            raise StoreError(problem) from error
        except BrokenProcessPool as error:
            raise SimulationError("a process that draws pictures was killed") from error
        finally:
            del self._making[drawing.key]
        return data

    def _path(self, key: str) -> Path:
        return self._folder / key[:2] / f"{key}.png"


@contextlib.contextmanager
def _workers_without_interrupts() -> Iterator[None]:
    """Processes that start here never see Ctrl-C, not even while they import."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _take_note(drawn: asyncio.Task[bytes]) -> None:
    # Of a failure that every waiter was cancelled before: asyncio would print it otherwise.
    if not drawn.cancelled():
        drawn.exception()


def _composite(make_goal: Callable[[], bytes], make_grid: Callable[[], bytes]) -> bytes:
    return composite_png(make_goal(), make_grid())


def read_picture(path: Path) -> bytes:
    """The bytes of a PNG or JPEG file; DataError when it is missing or no picture."""
    try:
        data = path.read_bytes()
        with PillowImage.open(io.BytesIO(data)) as picture:
            picture.verify()
    except UnidentifiedImageError as error:
        raise DataError(Problem(str(path), "is no picture", allowed="PNG or JPEG")) from error
    except (OSError, SyntaxError) as error:
        problem = Problem(str(path), f"is not a readable picture: {error}", allowed="PNG or JPEG")
        raise DataError(problem) from error
    return data


def _halves(composite: bytes) -> tuple[bytes, bytes]:
    """Goal and candidates cut out of a 2:1 composite: two squares but for the gap between."""
    with PillowImage.open(io.BytesIO(composite)) as picture:
        width, height = picture.size
        side = width // 2 - width // 256
        boxes = ((0, 0, side, height), (width - side, 0, width, height))
        return (_encode(picture.crop(boxes[0])), _encode(picture.crop(boxes[1])))


def _encode(picture: PillowImage.Image) -> bytes:
    buffer = io.BytesIO()
    picture.save(buffer, "PNG")
    return buffer.getvalue()


def _image(data: bytes, label: str) -> Image:
    with PillowImage.open(io.BytesIO(data)) as picture:
        return Image(data, label, *picture.size)


def _whole_png(path: Path) -> bytes | None:
    """The bytes of a picture in the cache; None when it is not there, or not whole."""
    data = path.read_bytes() if path.is_file() else b""
    is_whole = data.startswith(b"\x89PNG\r\n\x1a\n") and data.endswith(b"IEND\xaeB`\x82")
    return data if is_whole else None


def _start_worker() -> None:
    # Ctrl-C reaches the whole process group; only the runner decides what to do about it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A runner that is killed tells its workers nothing: without this they would stay for ever."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
