"""Pictures as they were sent, out of the picture cache, put beside the page."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from phyblock.datasets import AssemblyTask
from phyblock.files import atomic_write
from phyblock.resources import cache_dir
from phyblock.sim import PictureStyle
from phyblock.tasks import PicturePolicy, Pictures

__all__ = ["keep_pictures"]

_DIGITS = 24


def keep_pictures(
    folder: Path, suite: Mapping[str, Any], tasks: Iterable[AssemblyTask]
) -> dict[str, str]:
    """Put the pictures of tasks that are at hand into `folder`; file names by digest.

    Nothing is rendered: a picture that is not in the cache is left out. Raises OSError where the
    disk refuses.
    """
    images = suite["images"]
    style = PictureStyle(size_px=images["size_px"], background=images["background"])
    policy = PicturePolicy(images["source"], images["layout"], tuple(images["order"]), style)
    pictures = Pictures(cache_dir() / "pictures", policy, 1)
    kept = {}
    for task in tasks:
        found, are_real = pictures.outline(task)
        for image in found if are_real else ():
            name = f"{image.sha256[:_DIGITS]}.png"
            if not (folder / name).exists():
                folder.mkdir(parents=True, exist_ok=True)
                atomic_write(folder / name, image.data)
            kept[image.sha256] = name
    return kept
