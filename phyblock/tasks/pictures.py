"""Pictures of samples: rendered in worker processes while calls run, made once, kept on disk."""

from __future__ import annotations

import asyncio
import functools
import io
import os
import signal
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Literal

from PIL import Image as PillowImage
from PIL import UnidentifiedImageError

from phyblock.datasets import AssemblyTask
from phyblock.errors import DataError, Problem, StoreError
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


class Pictures:
    """The pictures of assembly tasks under one policy, cached in `folder` by content.

    `workers` processes render; they start with the first picture that is not in the cache.
    `rendered` counts the pictures made in this process's lifetime.
    """

    def __init__(self, folder: Path, policy: PicturePolicy, workers: int) -> None:
        self.policy = policy
        self.rendered = 0
        self._folder = folder
        self._workers = workers
        self._pool: ProcessPoolExecutor | None = None
        self._making: dict[str, asyncio.Task[bytes]] = {}

    async def of(self, task: AssemblyTask) -> tuple[Image, ...]:
        """The pictures of one task as they are sent.

        Raises DataError when the data set has no picture of it or a broken one, StoreError when
        the cache folder cannot be written.
        """
        if self.policy.source == "dataset":
            return self._from_dataset(task)
        style = self.policy.style
        goal, candidates = await asyncio.gather(
            self._get(goal_key(task.scene, style), functools.partial(goal_png, task.scene, style)),
            self._get(
                candidates_key(task.candidates, style),
                functools.partial(candidates_png, task.candidates, style),
            ),
        )
        if self.policy.layout == "composite":
            return (_image(composite_png(goal, candidates), "composite"),)
        apart = {"goal": goal, "candidates": candidates}
        return tuple(_image(apart[label], label) for label in self.policy.order)

    def keys(self, task: AssemblyTask) -> tuple[str, ...]:
        """What decides the pixels of a task's pictures: digests of content, style and renderer."""
        if self.policy.source == "dataset":
            return (str(task.composite and task.composite.name),)
        style = self.policy.style
        return (goal_key(task.scene, style), candidates_key(task.candidates, style))

    def close(self) -> None:
        """Stop the worker processes."""
        if self._pool is not None:
            self._pool.shutdown(wait=True, cancel_futures=True)
            self._pool = None

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

    async def _get(self, key: str, make: Callable[[], bytes]) -> bytes:
        path = self._folder / key[:2] / f"{key}.png"
        if path.is_file():
            return path.read_bytes()
        if key not in self._making:
            self._making[key] = asyncio.create_task(self._make(path, make))
            self._making[key].add_done_callback(lambda _: self._making.pop(key, None))
        return await asyncio.shield(self._making[key])

    async def _make(self, path: Path, make: Callable[[], bytes]) -> bytes:
        if self._pool is None:
            self._pool = ProcessPoolExecutor(
                self._workers, get_context("spawn"), initializer=_ignore_interrupts
            )
        data = await asyncio.get_running_loop().run_in_executor(self._pool, make)
        self.rendered += 1
        partial = path.with_suffix(f".{os.getpid()}.part")
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            partial.write_bytes(data)
            os.replace(partial, path)
        except OSError as error:
            hint = "choose another folder with PHYBLOCK_CACHE"
            problem = Problem(str(path), f"cannot be written: {error.strerror}", hint=hint)
            raise StoreError(problem) from error
        return data


def read_picture(path: Path) -> bytes:
    """The bytes of a PNG or JPEG file; DataError when it is missing or no picture."""
    try:
        data = path.read_bytes()
        with PillowImage.open(io.BytesIO(data)) as picture:
            picture.verify()
    except (OSError, UnidentifiedImageError, SyntaxError) as error:
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


def _ignore_interrupts() -> None:
    # Ctrl-C reaches the whole process group; only the runner decides what to do about it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
