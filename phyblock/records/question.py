"""A line of `questions.jsonl`: a question about a scene, its pictures as what differs from it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    StrictInt,
    Tag,
    ValidationInfo,
    model_validator,
)
from typing_extensions import Self

from phyblock.domain.blocks import BlockType, Color
from phyblock.domain.question import (
    LETTERS,
    Category,
    Mark,
    Question,
    QuestionPicture,
    Subtask,
    category_of,
    is_picture_option,
)
from phyblock.domain.scene import Block, Scene
from phyblock.records.data_values import (
    Angles,
    Filled,
    Format,
    Name,
    Position,
    Text,
    View,
    plain,
    triple,
)
from phyblock.records.decode import shown
from phyblock.records.faults import Fault, fault, free_of
from phyblock.records.line import Line
from phyblock.records.scene import MAX_BLOCKS, StoredBlock

__all__ = ["About", "Options", "SceneId", "StoredPicture", "StoredQuestion"]

_MOST_OPTIONS = 26
_MOST_PICTURES = 2 + len(LETTERS)


@dataclass(frozen=True)
class About:
    """What a question is held against: the scene that it names, if it is one of `n_scenes`."""

    scene: Scene | None
    n_scenes: int

    @classmethod
    def named_in(cls, raw: object, scenes: Mapping[str, Scene]) -> Self:
        """The scene that a decoded line names."""
        name = raw.get("scene_id") if isinstance(raw, dict) else None
        return cls(scenes.get(name) if isinstance(name, str) else None, len(scenes))


def _scene_of(info: ValidationInfo) -> Scene | None:
    return info.context.scene if isinstance(info.context, About) else None


def _is_there(name: str, info: ValidationInfo) -> str:
    if isinstance(info.context, About) and info.context.scene is None:
        allowed = f"one of the {info.context.n_scenes} scenes of the data set"
        raise fault(Fault("names no scene of the data set", allowed))
    return name


def _refuse_unknown(names: Iterable[object], info: ValidationInfo) -> None:
    """Orders, as they were given, that are of no block of the scene."""
    scene = _scene_of(info)
    if scene is None:
        return
    known = [block.order for block in scene.blocks]
    allowed = "orders of the scene: " + ", ".join(map(str, known))
    unknown = [name for name in names if str(name) not in map(str, known)]
    if unknown:
        raise fault(*(Fault("names no block", allowed, shown(name)) for name in unknown))


def _of_blocks(value: object, info: ValidationInfo) -> object:
    if isinstance(value, dict):
        _refuse_unknown(value, info)
    return value


def _left_out(orders: tuple[int, ...], info: ValidationInfo) -> tuple[int, ...]:
    _refuse_unknown(orders, info)
    return orders


def _are_new(blocks: tuple[StoredBlock, ...], info: ValidationInfo) -> tuple[StoredBlock, ...]:
    scene = _scene_of(info)
    known = () if scene is None else [block.order for block in scene.blocks]
    message = "has the order of a block of the scene"
    if twice := [block.order for block in blocks if block.order in known]:
        raise fault(*(Fault(message, found=str(order)) for order in twice))
    return blocks


class StoredPose(Line, extra="ignore"):
    """Where a block stands in a picture."""

    position: Position
    """As of a block."""
    euler: Angles
    """As of a block."""


class StoredKind(Line, extra="ignore"):
    """What a block is in a picture."""

    type: BlockType
    """Its shape."""
    color: Color
    """Its color."""


class StoredMark(Line, extra="ignore"):
    """A lettered place."""

    letter: Literal["A", "B", "C", "D", "X"]
    """A to D where the places are the options, X where the text speaks of one."""
    position: Position
    """Where it is [m]."""


_Whole = Annotated[Literal[True], Tag("true")]
_Blocks = Annotated[tuple[StoredBlock, ...], Filled(MAX_BLOCKS)]


class StoredPicture(Line, extra="forbid"):
    """How a picture differs from the scene, recolored as in `colors`."""

    label: Literal["scene", "block", "A", "B", "C", "D"]
    """What it shows: the scene, the block asked about, or the option of this letter."""
    view: View
    """Azimuth (0 from +x, 90 from +y) and elevation of the camera [degrees]."""
    without: Annotated[tuple[StrictInt, ...], Filled(MAX_BLOCKS), AfterValidator(_left_out)] = ()
    """Orders of blocks that are not drawn."""
    poses: Annotated[dict[str, StoredPose], BeforeValidator(_of_blocks)] = Field(
        default_factory=dict
    )
    """By order, where blocks stand that are not at their place."""
    swap: Annotated[dict[str, StoredKind], BeforeValidator(_of_blocks)] = Field(
        default_factory=dict
    )
    """By order, what blocks are that differ."""
    add: Annotated[_Blocks, AfterValidator(_are_new)] = ()
    """Whole blocks that the scene does not have."""
    marks: Annotated[tuple[StoredMark, ...], Filled(MAX_BLOCKS)] = ()
    """Places."""
    framed: Annotated[
        _Whole | Annotated[_Blocks, Tag("")],
        Discriminator(lambda value: "true" if value is True else ""),
    ] = ()
    """What the camera is framed on: true, the whole scene; or these blocks. Left out: what is
    drawn."""

    @model_validator(mode="after")
    def _draws_something(self, info: ValidationInfo) -> Self:
        scene = _scene_of(info)
        if scene is not None and not self.add and len(set(self.without)) == len(scene):
            raise fault(Fault("draws no blocks", found=""))
        return self

    @classmethod
    def of(cls, picture: QuestionPicture, scene: Scene) -> Self:
        """A recipe as it is written."""
        known = {block.order: block for block in scene.blocks}
        drawn = {block.order: block for block in picture.blocks}
        kept = [(known[order], block) for order, block in drawn.items() if order in known]
        recipe: dict[str, Any] = {
            "without": [order for order in known if order not in drawn],
            "poses": {
                str(new.order): {"position": plain(new.position_m), "euler": plain(new.euler_deg)}
                for old, new in kept
                if (old.position_m, old.euler_deg) != (new.position_m, new.euler_deg)
            },
            "swap": {
                str(new.order): {"type": new.type, "color": new.color}
                for old, new in kept
                if old.kind != new.kind
            },
            "add": [StoredBlock.of(block) for order, block in drawn.items() if order not in known],
            "marks": [
                {"letter": mark.letter, "position": plain(mark.position_m)}
                for mark in picture.marks
            ],
            "framed": picture.framed == scene.blocks or [*map(StoredBlock.of, picture.framed)],
        }
        given = {name: part for name, part in recipe.items() if part}
        return cls.model_validate(
            {"label": picture.label, "view": plain(picture.view_deg), **given}
        )

    def picture(self, scene: Scene) -> QuestionPicture:
        """The picture that it makes of a scene."""
        kept = (block for block in scene.blocks if block.order not in self.without)
        added = (stored.block() for stored in self.add)
        azimuth, elevation, _ = triple((*self.view, 0.0))
        framed = scene.blocks if self.framed is True else (b.block() for b in self.framed)
        return QuestionPicture(
            self.label,
            (*map(self._changed, kept), *added),
            (azimuth, elevation),
            tuple(Mark(mark.letter, triple(mark.position)) for mark in self.marks),
            tuple(framed),
        )

    def _changed(self, block: Block) -> Block:
        name = str(block.order)
        if kind := self.swap.get(name):
            block = replace(block, type=kind.type, color=kind.color)
        if pose := self.poses.get(name):
            position_m, euler_deg = triple(pose.position), triple(pose.euler)
            block = replace(block, position_m=position_m, euler_deg=euler_deg)
        return block


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


def _is_answer(answer: str, info: ValidationInfo) -> str:
    is_order = info.data.get("subtask") == "OR"
    if is_order and sorted(answer) != list(LETTERS):
        raise fault(Fault("is none of the options", "all of A, B, C, D in the right order"))
    if not is_order and answer not in tuple(LETTERS):
        raise fault(Fault("is none of the options", "A, B, C or D"))
    return answer


def _is_of_subtask(category: Category, info: ValidationInfo) -> Category:
    subtask = info.data.get("subtask")
    if subtask is not None and category != category_of(subtask):
        raise fault(Fault("is not known", category_of(subtask)))
    return category


def _fit(pictures: tuple[StoredPicture, ...], info: ValidationInfo) -> tuple[StoredPicture, ...]:
    """Pictures and marks of all options, no label twice."""
    if faults := tuple(_picture_faults(pictures, info.data.get("options", ()))):
        raise fault(*faults)
    return pictures


def _picture_faults(pictures: Sequence[StoredPicture], options: Sequence[str]) -> Iterator[Fault]:
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


SceneId = Annotated[str, AfterValidator(_is_there)]
"""The id of the scene that a question is held against."""
Options = Annotated[tuple[Text, ...], Filled(_MOST_OPTIONS), free_of(_option_faults)]
"""Four different texts, or the four pictures in order."""


class StoredQuestion(Line, extra="forbid"):
    """A multiple-choice question about a scene."""

    id: Name
    """Unique in the file."""
    subtask: Subtask
    """The letters of its subtask, as above."""
    category: Annotated[Category, AfterValidator(_is_of_subtask)] | None = None
    """The category of the paper that the subtask belongs to."""
    scene_id: SceneId
    """The scene in the data set that the questions are about."""
    wording: str = ""
    """Id of the template that the text was filled from."""
    question: Text
    """The text."""
    options: Options
    """Four texts, or `<img1>` to `<img4>` for pictures A to D."""
    answer: Annotated[str, AfterValidator(_is_answer)]
    """`A` to `D`; for ordering all four letters in the right order, like `BADC`."""
    colors: Annotated[dict[str, Color], BeforeValidator(_of_blocks)] = Field(default_factory=dict)
    """By order, the colors of blocks that are recolored; left out where none is."""
    pictures: Annotated[tuple[StoredPicture, ...], Filled(_MOST_PICTURES), AfterValidator(_fit)]
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
        return cls.model_validate(
            {
                "id": question.id,
                "subtask": question.subtask,
                "category": question.category,
                "scene_id": question.scene.id,
                "wording": question.wording,
                "question": question.text,
                "options": question.options,
                "answer": question.answer_letters,
                **({"colors": colors} if colors else {}),
                "pictures": [StoredPicture.of(p, question.scene) for p in question.pictures],
                "evidence": question.evidence,
            }
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
            tuple(picture.picture(scene) for picture in self.pictures),
            self.wording,
            self.evidence,
        )
