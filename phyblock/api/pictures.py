"""A scene as a picture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, get_args

from phyblock.api.given import expect
from phyblock.data import AssemblyTask
from phyblock.errors import Problem, SpecError
from phyblock.files import write_named
from phyblock.sim.pictures import PictureStyle, candidates_png, composite_png, goal_png, goal_style
from phyblock.types import Background, View

__all__ = ["Picture", "Shown", "render"]

Shown = Literal["both", "goal", "candidates"]


@dataclass(frozen=True, repr=False)
class Picture:
    """A picture as PNG; a notebook shows it."""

    png: bytes

    def save(self, path: str | Path) -> Path:
        """Write the PNG in place of what is there; StoreError where that cannot be."""
        write_named(Path(path), self.png)
        return Path(path)

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"<picture: PNG, {len(self.png):,} bytes>"


def render(
    scene: AssemblyTask,
    *,
    show: Shown = "both",
    view: View = "oblique",
    background: Background = "checkerboard",
    size_px: int = 512,
) -> Picture:
    """Draw a scene as models see it: goal and numbered candidates, or one of the two.

    `size_px` is the side of each square [pixels]. Raises SpecError for a view, background or size
    that there is not and for arguments of another kind, DataError for a scene without blocks.
    """
    texts = {"show": show, "view": view, "background": background}
    expect(
        "render",
        {
            "scene": (scene, AssemblyTask, "a scene of a suite: suite.scenes[ID]"),
            "size_px": (size_px, int, "a whole number of pixels"),
            **{name: (text, str, "a word") for name, text in texts.items()},
        },
    )
    if show not in get_args(Shown):
        raise SpecError(Problem("render", "is not known", "show", str(show), _any(Shown)))
    try:
        style = PictureStyle.from_view(view, size_px, background)
    except ValueError as error:
        raise SpecError(Problem("render", str(error))) from error
    style = style if show == "candidates" else goal_style(scene.scene, style)
    if show == "goal":
        return Picture(goal_png(scene.scene, style))
    candidates = candidates_png(scene.candidates, style)
    if show == "candidates":
        return Picture(candidates)
    return Picture(composite_png(goal_png(scene.scene, style), candidates))


def _any(words: object) -> str:
    return ", ".join(get_args(words))
