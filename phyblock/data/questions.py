"""`questions.jsonl`: one multiple-choice question about a scene per line; see docs/vqa.md.

Pictures are recipes: each describes its differences from the question's scene.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictInt, TypeAdapter

from phyblock.config.validation import BackgroundName, Fault, SubtaskName, checked
from phyblock.config.yaml import shown
from phyblock.data import base, scenes
from phyblock.data.base import Dataset, QuestionSet, QuestionTask
from phyblock.data.scenes import Angles, Format, Name, Position, StoredBlock, StoredKind, Text, View
from phyblock.domain.blocks import Color
from phyblock.domain.question import (
    LETTERS,
    Category,
    Mark,
    Question,
    QuestionPicture,
    category_of,
    is_picture_option,
)
from phyblock.domain.scene import Scene
from phyblock.records.record import Line, decode
from phyblock.types import Background

QUESTIONS_FILE = "questions.jsonl"


class StoredPose(Line, extra="ignore"):
    """The pose of a block in a picture."""

    position: Position
    """As for a block."""
    euler: Angles
    """As for a block."""


class StoredMark(Line, extra="ignore"):
    """A lettered place."""

    letter: Literal["A", "B", "C", "D", "X"]
    """A to D if the places are the options, X if the text refers to one."""
    position: Position
    """Its place [m]."""


# The blocks of several outcomes, so that all of their pictures have the same frame.
_Framed = Annotated[tuple[StoredBlock, ...], Field(min_length=1, max_length=4 * scenes.MAX_BLOCKS)]
_SOME = Field(min_length=1, max_length=scenes.MAX_BLOCKS)


class StoredPicture(Line, extra="forbid"):
    """The differences of a picture from the scene, recolored as in `colors`."""

    label: Literal["scene", "block", "A", "B", "C", "D"]
    """Its content: the scene, the block asked about, or the option of this letter."""
    view: View
    """Azimuth (0 from +x, 90 from +y) and elevation of the camera [degrees]."""
    without: Annotated[tuple[StrictInt, ...], _SOME] = ()
    """Orders of blocks that are not drawn."""
    poses: dict[str, StoredPose] = Field(default_factory=dict)
    """Poses of blocks that are not at their place, by order."""
    swap: dict[str, StoredKind] = Field(default_factory=dict)
    """Kinds of blocks that differ from the scene, by order."""
    add: Annotated[tuple[StoredBlock, ...], _SOME] = ()
    """Blocks that the scene does not have, as whole entries."""
    marks: Annotated[tuple[StoredMark, ...], _SOME] = ()
    """Places."""
    framed: Literal[True] | _Framed = ()
    """Blocks that the camera is framed on; true: the whole scene; missing: all drawn blocks."""

    @classmethod
    def of(cls, picture: QuestionPicture, scene: Scene) -> Self:
        """Return the stored form of a recipe."""
        known = {block.order: block for block in scene.blocks}
        drawn = {block.order for block in picture.blocks}
        poses, swap, add = {}, {}, []
        for new in picture.blocks:
            old, name = known.get(new.order), str(new.order)
            if old is None:
                add.append(StoredBlock.of(new))
                continue
            if (old.position_m, old.euler_deg) != (new.position_m, new.euler_deg):
                poses[name] = {"position": new.position_m, "euler": new.euler_deg}
            if old.kind != new.kind:
                swap[name] = {"type": new.type, "color": new.color}
        recipe = {
            "without": [order for order in known if order not in drawn],
            "poses": poses,
            "swap": swap,
            "add": add,
            "marks": [{"letter": m.letter, "position": m.position_m} for m in picture.marks],
            "framed": picture.framed == scene.blocks or [*map(StoredBlock.of, picture.framed)],
        }
        given = {name: part for name, part in recipe.items() if part}
        return cls.model_validate({"label": picture.label, "view": picture.view_deg, **given})

    def picture(self, scene: Scene, background: Background | None) -> QuestionPicture:
        """Return the picture of a scene by this recipe."""
        drawn = [b for b in scene.blocks if b.order not in self.without]
        for n, block in enumerate(drawn):
            if kind := self.swap.get(str(block.order)):
                drawn[n] = replace(drawn[n], type=kind.type, color=kind.color)
            if pose := self.poses.get(str(block.order)):
                drawn[n] = replace(drawn[n], position_m=pose.position, euler_deg=pose.euler)
        drawn += [stored.block() for stored in self.add]
        framed = scene.blocks if self.framed is True else tuple(b.block() for b in self.framed)
        marks = tuple(Mark(mark.letter, mark.position) for mark in self.marks)
        return QuestionPicture(self.label, tuple(drawn), self.view, marks, framed, background)

    def faults(self, scene: Scene) -> Iterator[Fault]:
        """Yield its faults as a picture of a scene."""
        for field, given in (("without", self.without), ("poses", self.poses), ("swap", self.swap)):
            yield from _unknown_orders(given, scene, field)
        taken = {block.order for block in scene.blocks} & {block.order for block in self.add}
        for order in sorted(taken):
            yield Fault("has the order of a block of the scene", found=str(order), at=("add",))
        if not self.add and len(set(self.without)) == len(scene):
            yield Fault("draws no blocks", found="")


def _unknown_orders(orders: Iterable[object], scene: Scene, field: str) -> Iterator[Fault]:
    known = [str(block.order) for block in scene.blocks]
    allowed = "orders of the scene: " + ", ".join(known)
    for order in orders:
        if str(order) not in known:
            yield Fault("names no block", allowed, shown(order), (field,))


def _option_faults(options: Sequence[str]) -> Iterator[Fault]:
    # Options must differ in more than letter case and spaces.
    read = [" ".join(option.lower().split()) for option in options]
    for i, option in enumerate(options):
        if (first := read.index(read[i])) != i:
            message = f"is the same as option {LETTERS[first]}"
            yield Fault(message, "four options that differ", shown(option), (i,))
    wanted = [f"<img{i}>" for i in range(1, len(LETTERS) + 1)]
    if any(map(is_picture_option, options)) and list(options) != wanted:
        yield Fault("are not the four pictures", " ".join(wanted))


Options = Annotated[tuple[Text, ...], Field(min_length=4, max_length=4), checked(_option_faults)]
"""Four different texts, or the four pictures in order."""


class StoredQuestion(Line, extra="forbid"):
    """A multiple-choice question about a scene."""

    id: Name
    """Unique in the file."""
    subtask: SubtaskName
    """The letters of its subtask."""
    category: Category | None = None
    """The paper's category of the subtask."""
    scene_id: str
    """The scene of the question."""
    wording: str = ""
    """Id of the template of the text."""
    question: Text
    """The text."""
    options: Options
    """Four texts, or `<img1>` to `<img4>` for pictures A to D."""
    answer: str
    """`A` to `D`; for ordering all four letters in the right order, like `BADC`."""
    colors: dict[str, Color] = Field(default_factory=dict)
    """Colors of recolored blocks, by order; missing: none."""
    background: BackgroundName | None = None
    """Background of all its pictures; missing: the run's own, as in older sets."""
    pictures: Annotated[tuple[StoredPicture, ...], Field(min_length=1, max_length=2 + len(LETTERS))]
    """Its pictures."""
    evidence: dict[str, Any] = Field(default_factory=dict)
    """Facts that the answer was derived from; `slots` are the words in the template."""
    format: Format = 1
    """Version of the line; default 1."""

    @classmethod
    def of(cls, question: Question, original: Scene) -> Self:
        """Return the stored form of a question; `original` is the scene as stored."""
        about = {name: getattr(question, name) for name in ("id", "subtask", "category", "wording")}
        about |= {"scene_id": question.scene.id, "question": question.text}
        about |= {"options": question.options, "answer": question.answer_letters}
        pairs = zip(question.scene.blocks, original.blocks, strict=True)
        if colors := {str(new.order): new.color for new, old in pairs if new.color != old.color}:
            about["colors"] = colors
        if question.pictures and question.pictures[0].background is not None:
            about["background"] = question.pictures[0].background
        about["pictures"] = [StoredPicture.of(one, question.scene) for one in question.pictures]
        return cls.model_validate({**about, "evidence": dict(question.evidence)})

    def about(self, original: Scene) -> Question:
        """Return the question about its scene, which is given as stored."""
        blocks = (replace(b, color=self.colors.get(str(b.order), b.color)) for b in original.blocks)
        scene = replace(original, blocks=tuple(blocks))
        answer = tuple(map(LETTERS.index, self.answer))
        pictures = tuple(picture.picture(scene, self.background) for picture in self.pictures)
        told = self.question, self.options, answer, pictures, self.wording, self.evidence
        return Question(self.id, self.subtask, scene, *told)

    def faults(self, scene: Scene) -> Iterator[Fault]:
        """Yield its faults as a question about a scene."""
        if self.category not in (None, category_of(self.subtask)):
            known = category_of(self.subtask)
            yield Fault("is not known", known, shown(self.category), ("category",))
        is_order = self.subtask == "OR"
        allowed = "all of A, B, C, D in the right order" if is_order else "A, B, C or D"
        if "".join(sorted(self.answer)) not in ([LETTERS] if is_order else [*LETTERS]):
            yield Fault("is none of the options", allowed, shown(self.answer), ("answer",))
        yield from _unknown_orders(self.colors, scene, "colors")
        for i, picture in enumerate(self.pictures):
            for each in picture.faults(scene):
                yield each._replace(at=("pictures", i, *each.at))
        labels = [picture.label for picture in self.pictures]
        for i, label in enumerate(labels):
            if label in labels[:i]:
                yield Fault("is used twice", found=shown(label), at=("pictures", i, "label"))
        wanted = set(LETTERS) if any(map(is_picture_option, self.options)) else set()
        missing, spare = sorted(wanted - set(labels)), sorted(set(LETTERS) & set(labels) - wanted)
        if missing or spare:
            what = "is missing for options" if missing else "is there for no option"
            yield Fault(f"a picture {what}", "", shown(missing or spare), ("pictures",))
        marked = {mark.letter for picture in self.pictures for mark in picture.marks}
        unmarked = sorted(set(LETTERS) - marked)
        if unmarked and list(self.options) == [f"place {letter}" for letter in LETTERS]:
            allowed = "marks A to D where the options are places"
            yield Fault("no picture marks the places", allowed, shown(unmarked), ("pictures",))


def read_questions(folder: Path, dataset: Dataset) -> QuestionSet:
    """Return all questions of a folder, about this data set. Raises DataError with all problems."""
    adapter = TypeAdapter(StoredQuestion)

    def read(line: bytes, where: str) -> QuestionTask:
        stored = decode(adapter, line, where, StoredQuestion)
        scene = dataset.task(stored.scene_id, where, "scene_id").scene
        base.report(stored.faults(scene), where)
        return QuestionTask(stored.about(scene))

    path = folder / QUESTIONS_FILE
    tasks = base.read_each(base.lines_of(path, base.read_set(path), "question"), read)
    return QuestionSet(folder.name, folder, tasks)
