"""Multiple-choice questions about scenes: the 16 subtasks, pictures as recipes, answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal, cast, get_args

from phyblock.domain.scene import Block, Scene
from phyblock.types import Background

Subtask = Literal[
    "SH", "CO", "SI", "NU", "RP", "AP", "RD", "RR", "OC", "LC", "TC", "VP", "CF", "PD", "OR", "AD"
]
Category = Literal[
    "object_property", "object_relationship", "scene_understanding", "dynamic_reasoning"
]

SUBTASKS: list[Subtask] = [*get_args(Subtask)]
"""Subtasks in the order of the paper's Table 2, then those that plugins add."""
CATEGORIES: dict[Category, tuple[Subtask, ...]] = {
    "object_property": ("SH", "CO", "SI", "NU"),
    "object_relationship": ("RP", "AP", "RD", "RR"),
    "scene_understanding": ("OC", "LC", "TC", "VP"),
    "dynamic_reasoning": ("CF", "PD", "OR", "AD"),
}
"""The four categories of paper section 3.3 and their subtasks."""
SUBTASK_NAMES: dict[Subtask, str] = {
    "SH": "shape",
    "CO": "color",
    "SI": "size",
    "NU": "number",
    "RP": "relative position",
    "AP": "absolute position",
    "RD": "relative dependency",
    "RR": "relative rotation",
    "OC": "object counting",
    "LC": "layer counting",
    "TC": "type counting",
    "VP": "viewpoint",
    "CF": "counterfactual",
    "PD": "predictive",
    "OR": "ordering",
    "AD": "affordance",
}
LETTERS = "ABCD"  # The options of a question, in order.


def add_subtask(code: str, name: str, category: Category) -> None:
    """Add a kind of question to a category. Raises ValueError if the code is taken."""
    if code in SUBTASK_NAMES:
        raise ValueError(f"there is a subtask of this code: {code}")
    subtask = cast(Subtask, code)
    SUBTASKS.append(subtask)
    SUBTASK_NAMES[subtask] = name
    CATEGORIES[category] = (*CATEGORIES[category], subtask)


def category_of(subtask: Subtask) -> Category:
    """The category that a subtask belongs to."""
    return next(name for name, subtasks in CATEGORIES.items() if subtask in subtasks)


def is_picture_option(option: str) -> bool:
    """True if an option is a picture: `<img1>` to `<img4>`, as in the official files."""
    return option in ("<img1>", "<img2>", "<img3>", "<img4>")


@dataclass(frozen=True)
class Mark:
    """A lettered place drawn into a picture; `position_m` in the world [m]."""

    letter: str
    position_m: tuple[float, float, float]


@dataclass(frozen=True)
class QuestionPicture:
    """The recipe of a picture: its blocks, camera and background.

    `label` is `scene`, the letter of the option that it is (`A` to `D`), or `block` for the block
    asked about. `blocks` are drawn at these poses, which need not be goal poses; `view_deg` is the
    camera's azimuth and elevation [degrees]; it is framed on `framed`, or else on `blocks`, so that
    pictures to be compared share a camera. `background` is None for that of the run.
    """

    label: str
    blocks: tuple[Block, ...]
    view_deg: tuple[float, float]
    marks: tuple[Mark, ...] = ()
    framed: tuple[Block, ...] = ()
    background: Background | None = None


@dataclass(frozen=True)
class Question:
    """One multiple-choice question (paper section 3.3, appendix A.4).

    `scene` is the scene as shown, recolored where the question says so; `options` are texts or
    `<img1>` to `<img4>`, which are the pictures labeled A to D; `answer` holds the 0-based index
    of the right option, or for ordering (`OR`) all four indices in the right order; `wording`
    names the template of the text; `evidence` is what the answer was derived from.
    """

    id: str
    subtask: Subtask
    scene: Scene
    text: str
    options: tuple[str, ...]
    answer: tuple[int, ...]
    pictures: tuple[QuestionPicture, ...] = ()
    wording: str = ""
    evidence: Mapping[str, Any] = field(default_factory=dict)

    @property
    def category(self) -> Category:
        """The category of its subtask."""
        return category_of(self.subtask)

    @property
    def answer_letters(self) -> str:
        """The answer as letters: `B`, or for ordering `BADC`."""
        return "".join(LETTERS[index] for index in self.answer)


def rotated(question: Question, by: int) -> Question:
    """The same question with option `by` as A, the next as B, and so on cyclically.

    Pictures and lettered places that are options keep their place and take their new letter.
    """
    n, options = len(question.options), question.options
    marked = {mark.letter for picture in question.pictures for mark in picture.marks}
    # Options may name places lettered in a picture: `place A`, `place B`, ...
    names_marks = marked.issuperset(LETTERS[:n]) and all(
        option.split()[-1:] == [letter] for option, letter in zip(options, LETTERS[:n], strict=True)
    )
    pictures = []
    for picture in question.pictures:
        marks = picture.marks
        if names_marks:
            marks = tuple(Mark(rotated_label(m.letter, by, n), m.position_m) for m in marks)
        pictures.append(replace(picture, label=rotated_label(picture.label, by, n), marks=marks))
    if not names_marks and not all(map(is_picture_option, options)):
        options = tuple(options[(i + by) % n] for i in range(n))
    answer = tuple((index - by) % n for index in question.answer)
    return replace(question, options=options, answer=answer, pictures=tuple(pictures))


def rotated_label(label: str, by: int, n: int) -> str:
    """Return the new label of a picture; only labels of options change."""
    if label not in LETTERS[:n]:
        return label
    return LETTERS[(LETTERS.index(label) - by) % n]
