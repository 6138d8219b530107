"""A question of each subtask with its pictures, options and answer, as cards."""

from __future__ import annotations

import io
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from phyblock.config.suite import ImagesSpec
from phyblock.data import Dataset
from phyblock.domain import (
    CATEGORIES,
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Question,
    QuestionPicture,
    is_picture_option,
)
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_png
from phyblock.tables.drawing import COLORS, INK, MUTED, headed, new_figure, wrapped
from phyblock.tables.load import Run
from phyblock.tracks.opening import picture_style
from phyblock.tracks.vqa.opening import open_questions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["subtask_cards"]

_LEAST_IN = 6.5
_TEXT_PT = 5.8
_LINE_IN = 0.1
_PICTURE_IN, _OPTION_IN = 0.95, 0.4
_PICTURE_PX = 320
_HEAD_IN = 0.2
_GAP_IN = 0.16
_RIGHT = "#00704f"
_CATEGORY_COLORS = (COLORS[0], COLORS[1], COLORS[2], COLORS[6])


def subtask_cards(run: Run, dataset: Dataset, scene: str) -> Figure | None:
    """Four cards a category: the pictures that are shown, what is asked, the options and the right
    one. The shortest question of each subtask, about `scene` where that is named; None where there
    is no question with a recipe of its pictures.
    """
    recorded = run.manifest.questions
    if recorded is None:
        return None
    questions = open_questions(recorded.format, Path(recorded.root), dataset)
    asked = (task.question for task in questions.tasks if task.question.pictures)
    cards = _cards(asked, scene)
    if not cards:
        return None
    style = replace(picture_style(run.section("images", ImagesSpec)), size_px=_PICTURE_PX)
    figure = new_figure(0.5, _LEAST_IN)
    width_in = figure.get_figwidth() / 4
    texts = {card.subtask: _text(card, width_in - 0.12) for card in cards.values()}
    rows = [[n for n in names if n in cards] for names in CATEGORIES.values()]
    rows = [names for names in rows if names]
    heights = [
        _HEAD_IN + _PICTURE_IN + _GAP_IN + _LINE_IN * max(len(texts[name]) for name in names)
        for names in rows
    ]
    figure.set_figheight(0.5 + sum(heights))
    headed(
        figure,
        "A question of each subtask",
        "The shortest of each; the right answer stands in green, four letters are an order",
    )
    figure.set_layout_engine("none")
    whole, top = figure.get_figheight(), figure.get_figheight() - sum(heights)
    for names, height in zip(rows, heights, strict=True):
        for column, name in enumerate(names):
            place = (column / 4, 1 - (top + height) / whole, 1 / 4, height / whole)
            # In inches, so that pictures and lines keep their places.
            ax = figure.add_axes(place, xlim=(0, width_in), ylim=(height, 0))
            ax.set_axis_off()
            _card(ax, cards[name], texts[name], style, width_in)
        top += height
    return figure


def _cards(questions: Iterable[Question], scene: str) -> dict[str, Question]:
    """The shortest question of each subtask, by its name."""
    by_subtask: dict[str, Question] = {}
    for question in questions:
        if scene and question.scene.id != scene:
            continue
        known = by_subtask.get(question.subtask)
        if known is None or _length(question) < _length(known):
            by_subtask[question.subtask] = question
    return {name: by_subtask[name] for name in SUBTASKS if name in by_subtask}


def _length(question: Question) -> tuple[int, str]:
    return sum(map(len, (question.text, *question.options))), question.id


def _text(question: Question, width_in: float) -> list[tuple[str, str]]:
    """Lines of a card with their colors."""
    lines = [(line, INK) for line in wrapped(question.text, width_in, _TEXT_PT)]
    is_order = len(question.answer) > 1
    for place, option in enumerate(question.options):
        if is_picture_option(option):
            continue
        color = _RIGHT if not is_order and place in question.answer else MUTED
        text = f"{LETTERS[place]}. {option}"
        lines += [(line, color) for line in wrapped(text, width_in, _TEXT_PT)]
    if is_order or any(map(is_picture_option, question.options)):
        lines.append((f"Answer: {question.answer_letters}", _RIGHT))
    return lines


def _card(
    ax: Axes,
    question: Question,
    lines: list[tuple[str, str]],
    style: PictureStyle,
    width_in: float,
) -> None:
    place = list(CATEGORIES).index(question.category)
    title = f"{question.subtask}  {SUBTASK_NAMES[question.subtask]}"
    ax.text(0.03, 0.1, title, fontsize=7.5, fontweight="bold", color=_CATEGORY_COLORS[place])
    _pictures(ax, question, style, width_in)
    top = _HEAD_IN + _PICTURE_IN + 0.1
    for n, (line, color) in enumerate(lines):
        ax.text(0.03, top + n * _LINE_IN, line, fontsize=_TEXT_PT, color=color)


def _pictures(ax: Axes, question: Question, style: PictureStyle, width_in: float) -> None:
    """The scene, beside it the block asked about, or the options in two rows."""
    scenes = [one for one in question.pictures if one.label == "scene"]
    others = [one for one in question.pictures if one.label != "scene"]
    room_in = width_in - 0.1
    side = min(_PICTURE_IN, room_in - 2 * _OPTION_IN) if len(others) > 1 else _PICTURE_IN
    for recipe in scenes:
        _put(ax, recipe, style, 0.03, _HEAD_IN, side)
    left = 0.07 + side if scenes else 0.03
    small = min((width_in - left - 0.05) / min(2, max(1, len(others))), _PICTURE_IN / 2)
    for n, recipe in enumerate(others):
        row, column = divmod(n, 2)
        corner = (left + column * small, _HEAD_IN + row * small)
        _put(ax, recipe, style, *corner, small - 0.02)
        if recipe.label in LETTERS:
            ax.text(
                corner[0] + 0.03,
                corner[1] + 0.1,
                recipe.label,
                fontsize=6,
                fontweight="bold",
                color=INK,
                bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none"},
            )


def _put(
    ax: Axes, recipe: QuestionPicture, style: PictureStyle, left: float, top: float, side: float
) -> None:
    with Image.open(io.BytesIO(question_png(recipe, style))) as image:
        pixels = np.asarray(image.convert("RGB"))
    limits = ax.get_xlim(), ax.get_ylim()
    ax.imshow(pixels, extent=(left, left + side, top + side, top), aspect="equal")
    ax.set(xlim=limits[0], ylim=limits[1])
