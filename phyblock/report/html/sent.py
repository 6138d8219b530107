"""Pictures as they were sent, out of the picture cache, put beside the page."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from phyblock.data import AssemblyTask
from phyblock.files import atomic_write
from phyblock.models import Image
from phyblock.resources import cache_dir
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks import PicturePolicy, Pictures
from phyblock.tracks.measures import PageItems
from phyblock.tracks.pictures import Drawing, Studio

__all__ = ["PictureShelf"]

_DIGITS = 24
_MOST_COPIED_BYTES = 256 * 2**20


class PictureShelf:
    """A folder of pictures named by digest; `names` are those that are there, `is_whole` says
    whether all are.

    Nothing is rendered: a picture that is not in the cache is left out. Pictures are hard links
    into the cache; on a file system where that is not possible they are copied, up to 256 MiB.
    """

    def __init__(self, folder: Path, earlier: Path) -> None:
        """Put pictures into `folder` unless `earlier` holds them."""
        self.names: dict[str, str] = {}
        self.is_whole = True
        self._folder = folder
        self._earlier = earlier
        self._cache = cache_dir() / "pictures"
        self._room = _MOST_COPIED_BYTES

    def add_scenes(self, tasks: Iterable[AssemblyTask], policy: PicturePolicy) -> None:
        """Keep goals and candidates of tasks as they were shown, drawn as `policy` says; raises
        OSError where the disk refuses.
        """
        pictures = Pictures(self._cache, policy, 1)
        is_drawn = policy.source == "render"
        for task in tasks:
            found, are_real = pictures.outline(task)
            self.is_whole &= are_real
            if are_real:
                self._keep(found, pictures.keys(task) if is_drawn else ())

    def add_items(self, items: PageItems, asked: Iterable[Any], style: PictureStyle) -> None:
        """Keep the pictures of what was asked about; raises OSError where the disk refuses."""
        pictures = items.pictures(self._cache, style)
        for shown in asked:
            found, are_real = pictures.outline(shown)
            self.is_whole &= are_real
            if are_real:
                self._keep(found, pictures.keys(shown))

    def add_kept(self, keys: Iterable[str]) -> None:
        """Keep pictures by their names in the cache; raises OSError where the disk refuses."""
        studio = Studio(self._cache, 1)
        for key in dict.fromkeys(keys):
            found = studio.kept(Drawing("", key, bytes))
            self.is_whole &= found is not None
            if found is not None:
                self._keep((found,), (key,))

    def _keep(self, images: Sequence[Image], keys: Sequence[str]) -> None:
        cached: list[Path | None] = [self._cache / key[:2] / f"{key}.png" for key in keys]
        cached = cached or [None] * len(images)
        for image, source in zip(images, cached, strict=True):
            name = f"{image.sha256[:_DIGITS]}.png"
            path = self._folder / name
            if (
                (self._earlier / name).exists()
                or path.exists()
                or self._put(path, image.data, source)
            ):
                self.names[image.sha256] = name
            else:
                self.is_whole = False

    def _put(self, path: Path, data: bytes, source: Path | None) -> bool:
        """Link or copy a picture; False where it would have to be copied and there is no room."""
        if source is not None and source.is_file():
            try:
                os.link(source, path)
            except OSError as error:
                if error.errno not in (errno.EXDEV, errno.EPERM, errno.EMLINK, errno.ENOTSUP):
                    raise
            else:
                return True
        self._room -= len(data)
        if self._room < 0:
            return False
        atomic_write(path, data)
        return True
