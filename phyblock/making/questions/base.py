"""The base of all kinds of questions: a maker proposes questions and derives their answers again.

`StaticMaker.right` and `Maker.answer` alone decide what is right and what is fair: a draft is kept
if they find its first option, and `phyblock questions verify` calls them for every stored question.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml
from numpy.typing import NDArray

from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Scene
from phyblock.errors import PhyblockError

T = TypeVar("T")
Floats = NDArray[np.float64]
Slots = Mapping[str, str]
"""Values of the words in braces of a template."""
View = tuple[float, float]
"""Azimuth and elevation of a camera [degrees]."""
Option = str | QuestionPicture | Mark
"""A text; a picture, labeled later; or a place, which is marked in the first picture."""

WORDINGS: dict[str, str] = yaml.safe_load(
    Path(__file__).with_name("wordings.yaml").read_text(encoding="utf-8")
)
"""The text of each kind of question; words in braces are slots."""
WORDS: Mapping[str, Any] = WORDINGS.pop("words")  # type: ignore[assignment]
"""Words that options and slots are made of."""
BALANCE = (0.22, 0.28)
"""Limits of the share of right answers for each letter."""


class UnfairError(PhyblockError):
    """A question has no answer, more than one, or names something that cannot be seen."""


@dataclass(frozen=True)
class Draft:
    """A question whose options have no letters yet.

    `scene` is the scene as shown. `options` has the right one first, or for ordering all four in
    the right order; a `StaticMaker` may list them in any order, or leave them to `offer`. `slots`
    fill the template of the `wording`. `facts` are further evidence, which JSON can hold. Selection
    takes an even share of each `kind`, by default the wording. `looks` are measures of the
    pictures, a row for each option, by which a reader might guess: drafts are dropped until these
    reveal nothing. Base scenes have at most one question with the same wording, slots and `about`.
    """

    wording: str
    scene: Scene
    pictures: tuple[QuestionPicture, ...]
    slots: Slots = field(default_factory=dict)
    options: Sequence[Option] = ()
    kind: str = ""
    facts: Mapping[str, Any] = field(default_factory=dict)
    looks: tuple[tuple[float, ...], ...] = ()
    about: Hashable = None

    @property
    def picture(self) -> QuestionPicture:
        """The first picture."""
        return self.pictures[0]

    @property
    def drawn(self) -> tuple[QuestionPicture, ...]:
        """The options that are pictures."""
        return tuple(option for option in self.options if isinstance(option, QuestionPicture))

    @property
    def group(self) -> str:
        """The kind, or else the wording."""
        return self.kind or self.wording

    @property
    def texts(self) -> tuple[str, ...]:
        """The options that are texts; empty for pictures and places, whose texts reveal nothing."""
        return tuple(option for option in self.options if isinstance(option, str))

    @property
    def text(self) -> str:
        """The wording with its slots filled."""
        return fill_template(WORDINGS[self.wording], self.slots)


class Maker(ABC):
    """Makes the questions of one subtask, and derives their answers again."""

    subtask: Subtask
    count: int = 150
    """Default number of questions."""
    spare: float = 1.5
    """Drafts per wanted question; no more scenes are drafted once there are as many."""
    doubtful: float = 1.05
    """Drafts selected per wanted question, since some are refused in the end."""
    drafts_a_scene: int = 1
    """Maximum number of drafts per scene."""

    @abstractmethod
    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose questions about a scene, in random order and without simulations."""

    @abstractmethod
    def answer(self, asked: Draft) -> tuple[int, ...]:
        """Return the index of the right option, or all in the right order, derived from the scene,
        pictures, slots, options and simulations. Raises UnfairError unless there is exactly one
        and all that is named can be seen.
        """


_VIEWS_A_SCENE, _DRAFTS_A_VIEW = 3, 8


class StaticMaker(Maker):
    """Makes questions about one picture, from views drawn for each scene."""

    spare = 20.0
    drafts_a_scene = _VIEWS_A_SCENE * _DRAFTS_A_VIEW

    @abstractmethod
    def ask(self, scene: Scene, view: View, rng: np.random.Generator) -> Iterator[Draft]:
        """Propose questions, fair or not, with a picture of a scene, recolored or not, from a view.

        `options` are in any order; if there are none, `offer` gives some once `right` is known.
        """

    @abstractmethod
    def right(self, asked: Draft) -> str:
        """Return the text of the right option. Raises UnfairError as `answer`."""

    def offer(self, asked: Draft, right: str, rng: np.random.Generator) -> Sequence[str]:
        """Return four options, the right one among them, or none if there are too few."""
        raise NotImplementedError

    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Yield fair questions about a scene, view by view."""
        for _ in range(_VIEWS_A_SCENE):
            found = 0
            for asked in self.ask(scene, drawn_view(rng), rng):
                try:
                    right = self.right(asked)
                except UnfairError:
                    continue
                options = asked.texts or self.offer(asked, right, rng)
                if right not in options:
                    continue
                shown = replace(scene, blocks=asked.picture.blocks[: len(scene)])
                wrong = (option for option in options if option != right)
                yield replace(asked, scene=shown, options=(right, *wrong))
                found += 1
                if found == _DRAFTS_A_VIEW:
                    break

    def answer(self, asked: Draft) -> tuple[int, ...]:
        """Return the answer, derived only from the one picture and the slots of the text."""
        labels, (low, high) = [picture.label for picture in asked.pictures], ELEVATIONS_DEG
        if labels != ["scene"]:
            raise UnfairError(f"has pictures {labels}, not one of the scene alone")
        if not low <= asked.picture.view_deg[1] <= high:
            raise UnfairError(f"is not seen from {low} to {high} degrees above the floor")
        right = self.right(asked)
        return only_index([option == right for option in asked.options])


def fill_template(template: str, slots: Slots) -> str:
    """Return the template with its slots filled, capitalized."""
    text = template.format(**slots)
    return text[:1].upper() + text[1:]


def read_again(question: Question) -> Draft:
    """Return a question as its maker gets it to find the answer, which is not used.

    Options that are pictures are no longer among its `pictures`. Raises UnfairError unless the
    wording with its slots is the text, and the scene the first of the other pictures.
    """
    slots = question.evidence.get("slots", {})
    if fill_template(WORDINGS[question.wording], slots) != question.text:
        raise UnfairError("the text is not its wording with the slots of the evidence")
    texts = {name: str(slot) for name, slot in slots.items()}
    pictures = {picture.label: picture for picture in question.pictures}
    options = [pictures.pop(a, b) for a, b in zip(LETTERS, question.options, strict=True)]
    if (labels := [*pictures]) not in ([], ["scene"], ["scene", "block"]):
        raise UnfairError(f"has the pictures {labels}, and not the scene first")
    shown = tuple(pictures.values())
    return Draft(question.wording, question.scene, shown, texts, tuple(options))


def only_index(right: Sequence[bool | None]) -> tuple[int]:
    """Return the index of the right option. Raises UnfairError unless there is exactly one."""
    found = [index for index, is_right in enumerate(right) if is_right]
    if len(found) != 1:
        raise UnfairError(f"{len(found)} of {len(right)} options are right")
    return (found[0],)


def window(rng: np.random.Generator, values: Sequence[int], right: int) -> list[str]:
    """Return four neighboring allowed values, the right one among them, or none."""
    if right not in values:
        return []
    start = values.index(right) - int(rng.integers(len(LETTERS)))
    found = values[start : start + len(LETTERS)] if start >= 0 else ()
    return list(map(str, found)) if len(found) == len(LETTERS) else []


def pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    """Return one of the options, each equally likely."""
    return options[int(rng.integers(len(options)))]


def shuffled(rng: np.random.Generator, items: Sequence[T]) -> list[T]:
    """Return the items in random order."""
    return [items[int(i)] for i in rng.permutation(len(items))]


ELEVATIONS_DEG = (18, 38)
"""Range of elevations in static questions: both tops and sides are visible."""


def drawn_view(rng: np.random.Generator, elevations_deg: tuple[int, int] = ELEVATIONS_DEG) -> View:
    """Return a random view in whole degrees: any azimuth, an elevation within the range."""
    low, high = elevations_deg
    return (float(rng.integers(360)), float(rng.integers(low, high + 1)))


# Options among which the right one does not stand out


_WRONG = len(LETTERS) - 1
_MOST_OFF = 1.0
"""Limit on how far the right option is from the wanted ranks, on average over measures."""
_EQUAL, _UNLIKE_STEPS = 0.02, 5.0


def four_alike(
    measures: Floats, unlike: Floats, least: float, rng: np.random.Generator
) -> list[int]:
    """Return the indices of row 0, the right one, and three wrong rows that give it random ranks.

    `measures` has shape (n, k). `unlike`, shape (n, n), holds the differences of any two rows:
    those returned differ by `least` or more, and the sum over the other three is one more measure.
    The wanted ranks are those of a random row among four. Empty if no ranks come close.
    """
    if len(measures) < len(LETTERS):
        return []
    one, *others = rng.choice(len(measures), size=len(LETTERS), replace=False).tolist()
    wanted = ranks_among(measures, unlike, one, np.array([others]))[0]
    threes = np.array(list(itertools.combinations(range(1, len(measures)), _WRONG)))
    for i, j in itertools.combinations(range(_WRONG), 2):
        threes = threes[unlike[threes[:, i], threes[:, j]] >= least]
    threes = threes[(unlike[0][threes] >= least).all(axis=1)]
    off = np.abs(ranks_among(measures, unlike, 0, threes) - wanted).mean(axis=1)
    is_near = bool(off.min(initial=_MOST_OFF) < _MOST_OFF)
    return [0, *threes[off.argmin()].tolist()] if is_near else []


def ranks_among(measures: Floats, unlike: Floats, right: int, threes: NDArray[np.int64]) -> Floats:
    """Return the number of each three below the right one, by measure; equal ones count half."""
    steps = measures[threes] - measures[right]
    four = np.column_stack([np.full(len(threes), right), threes])
    sums = unlike[four[:, :, None], four[:, None, :]].sum(axis=2)
    odd = (sums[:, 1:] - sums[:, :1]) * _UNLIKE_STEPS / max(float(unlike.max()), 1.0)
    steps = np.concatenate([steps, odd[:, :, None]], axis=2)
    equal = (np.abs(steps) <= _EQUAL).sum(axis=1)
    below: Floats = (steps < -_EQUAL).sum(axis=1) + equal / 2
    return below
