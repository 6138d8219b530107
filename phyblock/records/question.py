"""A line of `questions.jsonl`: a multiple-choice question about a scene."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field, ValidationInfo
from typing_extensions import Self

from phyblock.domain.blocks import Color
from phyblock.domain.question import (
    LETTERS,
    Category,
    Question,
    Subtask,
    category_of,
    is_picture_option,
)
from phyblock.domain.scene import Scene
from phyblock.records.data_values import Filled, Format, Name, Text
from phyblock.records.decode import shown
from phyblock.records.faults import Fault, fits, free_of
from phyblock.records.line import Line
from phyblock.records.picture import OF_BLOCKS, About, Picture, StoredPicture
from phyblock.types import Background

__all__ = ["Options", "SceneId", "StoredQuestion"]

_MOST_OPTIONS = 26
_MOST_PICTURES = 2 + len(LETTERS)


def _scene_faults(_: str, info: ValidationInfo) -> Iterator[Fault]:
    if isinstance(info.context, About) and info.context.scene is None:
        allowed = f"one of the {info.context.n_scenes} scenes of the data set"
        yield Fault("names no scene of the data set", allowed)


def _plain_words(option: str) -> str:
    """An option as a reader takes it: letter case and spaces do not tell options apart."""
    return " ".join(option.lower().split())


def _option_faults(options: Sequence[str]) -> Iterator[Fault]:
    if len(options) != len(LETTERS):
        yield Fault("are not four", "four options", str(len(options)))
    read = [_plain_words(option) for option in options]
    for i, option in enumerate(options):
        first = read.index(read[i])
        if first != i:
            message = f"is the same as option {LETTERS[first]}" if first < 4 else "stands twice"
            yield Fault(message, "four options that differ", shown(option), (i,))
    wanted = [f"<img{i}>" for i in range(1, len(LETTERS) + 1)]
    if any(map(is_picture_option, options)) and list(options) != wanted:
        yield Fault("are not the four pictures", " ".join(wanted))


def _answer_faults(answer: str, info: ValidationInfo) -> Iterator[Fault]:
    is_order = info.data.get("subtask") == "OR"
    if is_order and sorted(answer) != list(LETTERS):
        yield Fault("is none of the options", "all of A, B, C, D in the right order")
    if not is_order and answer not in tuple(LETTERS):
        yield Fault("is none of the options", "A, B, C or D")


def _category_faults(category: Category, info: ValidationInfo) -> Iterator[Fault]:
    subtask = info.data.get("subtask")
    if subtask is not None and category != category_of(subtask):
        yield Fault("is not known", category_of(subtask))


def _picture_faults(pictures: Sequence[StoredPicture], info: ValidationInfo) -> Iterator[Fault]:
    """A label twice; pictures or marks of options that are missing, and pictures of none."""
    options = info.data.get("options", ())
    labels = [picture.label for picture in pictures]
    for i, label in enumerate(labels):
        if label in labels[:i]:
            yield Fault("is used twice", found=shown(label), at=(i, "label"))
    shown_options = set(labels) & set(LETTERS)
    wanted = set(LETTERS) if any(map(is_picture_option, options)) else set()
    if options and shown_options != wanted:
        missing, spare = sorted(wanted - shown_options), sorted(shown_options - wanted)
        what = "is missing for options" if missing else "is there for no option"
        yield Fault(f"a picture {what}", found=shown(missing or spare))
    if list(options) == [f"place {letter}" for letter in LETTERS]:
        marked = {mark.letter for picture in pictures for mark in picture.marks}
        if unmarked := sorted(set(LETTERS) - marked):
            allowed = "marks A to D where the options are places"
            yield Fault("no picture marks the places", allowed, shown(unmarked))


SceneId = Annotated[str, fits(_scene_faults)]
"""The id of the scene that a question is held against."""
Options = Annotated[tuple[Text, ...], Filled(_MOST_OPTIONS), free_of(_option_faults)]
"""Four different texts, or the four pictures in order."""


class StoredQuestion(Line, extra="forbid"):
    """A multiple-choice question about a scene."""

    id: Name
    """Unique in the file."""
    subtask: Subtask
    """The letters of its subtask, as above."""
    category: Annotated[Category, fits(_category_faults)] | None = None
    """The category of the paper that the subtask belongs to."""
    scene_id: SceneId
    """The scene in the data set that the questions are about."""
    wording: str = ""
    """Id of the template that the text was filled from."""
    question: Text
    """The text."""
    options: Options
    """Four texts, or `<img1>` to `<img4>` for pictures A to D."""
    answer: Annotated[str, fits(_answer_faults)]
    """`A` to `D`; for ordering all four letters in the right order, like `BADC`."""
    colors: Annotated[dict[str, Color], OF_BLOCKS] = Field(default_factory=dict)
    """Colors of blocks that are recolored, by order; left out where none is."""
    background: Background | None = None
    """Ground of all its pictures; left out where a run's own is drawn, as in older sets."""
    pictures: Annotated[tuple[Picture, ...], Filled(_MOST_PICTURES), fits(_picture_faults)]
    """Its pictures."""
    evidence: dict[str, Any] = Field(default_factory=dict)
    """What the answer was derived from; `slots` are the words in the template."""
    format: Format = 1
    """Version of the line, 1 where it does not say."""

    @classmethod
    def of(cls, question: Question, original: Scene) -> Self:
        """A question as it is written; `original` is the scene as stored."""
        colors = {
            str(block.order): block.color
            for block, before in zip(question.scene.blocks, original.blocks, strict=True)
            if block.color != before.color
        }
        grounds = [picture.background for picture in question.pictures[:1]]
        optional: dict[str, Any] = {"colors": colors, "background": (*grounds, None)[0]}
        return cls(
            id=question.id,
            subtask=question.subtask,
            category=question.category,
            scene_id=question.scene.id,
            wording=question.wording,
            question=question.text,
            options=question.options,
            answer=question.answer_letters,
            **{name: value for name, value in optional.items() if value},
            pictures=tuple(StoredPicture.of(p, question.scene) for p in question.pictures),
            evidence=dict(question.evidence),
        )

    def about(self, original: Scene) -> Question:
        """The question that it asks about the scene that it names, given as stored."""
        colors = self.colors
        blocks = tuple(
            replace(block, color=colors.get(str(block.order), block.color))
            for block in original.blocks
        )
        scene = replace(original, blocks=blocks)
        return Question(
            self.id,
            self.subtask,
            scene,
            self.question,
            self.options,
            tuple(map(LETTERS.index, self.answer)),
            tuple(
                replace(picture.picture(scene), background=self.background)
                for picture in self.pictures
            ),
            self.wording,
            self.evidence,
        )
