"""The pictures of questions, in the order in which they are sent."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Literal

from phyblock.domain import LETTERS, Question, QuestionPicture
from phyblock.errors import DataError, Problem
from phyblock.files import read_picture
from phyblock.models.base import Image
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import (
    LETTERED_VERSION,
    lettered_sheet_png,
    question_key,
    question_png,
    sheet_size_px,
)
from phyblock.stable import hex_digest
from phyblock.tracks.studio import Drawing, Studio, Workshop, to_image
from phyblock.types import Background

__all__ = ["OptionsAs", "QuestionPictures", "ShownQuestion"]

OptionsAs = Literal["images", "letters"]
SHEET = "options"
"""The label of the sheet that holds all options."""

_ORDER = ("scene", "block", *LETTERS)
_MOST_CELL_PX = 1024


@dataclass(frozen=True)
class ShownQuestion:
    """A question as it is shown, with the picture files, by label, that its data set brings."""

    question: Question
    files: Mapping[str, Path]

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of its pictures in the order sent: the scene, the block, then the options."""
        known = {picture.label for picture in self.question.pictures} | set(self.files)
        return tuple(label for label in _ORDER if label in known)


class QuestionPictures(Studio):
    """The pictures of questions under one style, as many as the question has.

    First the scene, then the block by itself where there is one, then the options A to D: each a
    picture of its own (`images`), or all on one sheet (`letters`). Questions bring backgrounds of
    their own, which `background` overrides; those that bring none have the style's.
    """

    def __init__(
        self,
        folder: Path,
        style: PictureStyle,
        options_as: OptionsAs,
        shop: Workshop | int,
        background: Background | None = None,
    ) -> None:
        super().__init__(folder, shop)
        self._background = background
        self._style = style
        self._options_as = options_as

    async def of(self, shown: ShownQuestion) -> tuple[Image, ...]:
        """The pictures of one question as they are sent.

        Raises DataError when a file is missing or no picture, StoreError when the cache folder
        cannot be written.
        """
        drawings = self._drawings(shown)
        name = " ".join(f"{drawing.label}={drawing.key}" for drawing in drawings)
        recent = self.recalled(name)
        return recent or self.remembered(name, await self.images(drawings))

    def outline(self, shown: ShownQuestion) -> tuple[tuple[Image, ...], bool]:
        """The pictures as far as they are at hand, and whether all are; nothing is rendered."""
        drawings = self._drawings(shown)
        side = self._style.size_px
        images, are_real = self.outlined(drawings, (side, side))
        if are_real:
            return images, True
        sheet = sheet_size_px(len(LETTERS), self._cell_px)
        return tuple(
            Image(b"", image.label, *sheet) if image.label == SHEET else image for image in images
        ), False

    def keys(self, shown: ShownQuestion) -> tuple[str, ...]:
        """What decides the pixels of a question's pictures."""
        return tuple(drawing.key for drawing in self._drawings(shown))

    @property
    def _cell_px(self) -> int:
        return min(self._style.size_px, _MOST_CELL_PX)

    def _drawings(self, shown: ShownQuestion) -> tuple[Drawing, ...]:
        drawings = [self._drawing(shown, label) for label in shown.labels]
        options = [drawing for drawing in drawings if drawing.label in LETTERS]
        if not options or self._options_as == "images":
            return tuple(drawings)
        letters = "".join(drawing.label for drawing in options)
        parts = " ".join(drawing.key for drawing in options)
        text = f"sheet {LETTERED_VERSION} {self._cell_px} {letters} {parts}"
        key = hex_digest(text)
        makes = tuple(drawing.make for drawing in options)
        sheet = Drawing(SHEET, key, partial(_sheet, makes, letters, self._cell_px))
        return (*(drawing for drawing in drawings if drawing.label not in LETTERS), sheet)

    def _drawing(self, shown: ShownQuestion, label: str) -> Drawing:
        if label in shown.files:
            path = shown.files[label]
            key = hex_digest(read_picture(path))
            return Drawing(label, key, partial(read_picture, path))
        recipe = _recipe(shown.question, label)
        recipe = replace(recipe, background=self._background or recipe.background)
        key = question_key(recipe, self._style)
        return Drawing(label, key, partial(question_png, recipe, self._style))

    async def image(self, drawing: Drawing) -> Image:
        """A picture from the cache, or made now; files are read and not copied into the cache."""
        if isinstance(drawing.make, partial) and drawing.make.func is read_picture:
            return to_image(drawing.make(), drawing.label)
        return await super().image(drawing)

    def kept(self, drawing: Drawing) -> Image | None:
        """A picture that is at hand."""
        if isinstance(drawing.make, partial) and drawing.make.func is read_picture:
            return to_image(drawing.make(), drawing.label)
        return super().kept(drawing)


def _recipe(question: Question, label: str) -> QuestionPicture:
    for recipe in question.pictures:
        if recipe.label == label:
            return recipe
    raise DataError(Problem(f"question {question.id}", "has no such picture", "pictures", label))


def _sheet(makes: Sequence[Callable[[], bytes]], letters: str, side_px: int) -> bytes:
    return lettered_sheet_png([make() for make in makes], letters, side_px)
