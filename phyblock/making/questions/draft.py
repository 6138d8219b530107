"""Drafts of questions, and what all makers share: wordings, slots, choices, the one answer."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import yaml

from phyblock.domain.question import Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Scene
from phyblock.errors import PhyblockError

T = TypeVar("T")
Option = str | QuestionPicture | Mark
"""A text; a picture, labeled later; or a place, which is marked in the first picture."""
WORDINGS: dict[str, str] = {
    f"{stem}-{number}": text
    for stem, texts in yaml.safe_load(
        Path(__file__).with_name("wordings.yaml").read_text(encoding="utf-8")
    ).items()
    for number, text in enumerate(texts, 1)
}
"""All templates by id: subtask, kind where there are several, and number (`rp-corner-2`)."""


def add_wordings(stem: str, texts: Sequence[str]) -> None:
    """Add templates under the ids `stem-1`, `stem-2` and so on."""
    WORDINGS.update({f"{stem}-{number}": text for number, text in enumerate(texts, 1)})


class UnfairError(PhyblockError):
    """A question has no answer, more than one, or names what cannot be told from the picture."""


@dataclass(frozen=True)
class Draft:
    """A fair question whose options have no letters yet.

    `scene` is the scene as shown, recolored where that is needed; `options` has the right one
    first, or for ordering all four in the right order. `wording` is the id of the template that
    `text` was filled from. `kind` names a sort of question within a subtask, and `value` a sort
    of answer: production takes as even a share of kinds as the scenes allow, and of values where
    the options are no texts. `evidence` is what JSON can hold, and names no letters: they are
    dealt later; `evidence["slots"]` holds what the template was filled with. `looks` are measures
    of options that are no texts, by which a reader might guess: drafts are dropped until these
    tell nothing.
    """

    scene: Scene
    text: str
    options: tuple[Option, ...]
    pictures: tuple[QuestionPicture, ...]
    wording: str
    value: str
    kind: str = ""
    looks: tuple[tuple[float, ...], ...] = ()
    evidence: Mapping[str, Any] = field(default_factory=dict)


class Maker(ABC):
    """Makes the questions of one subtask and can derive an answer again."""

    subtask: Subtask
    scenes_tried: int = 400
    """The number of scenes, drawn evenly over the levels, that are asked for drafts."""
    drafts_a_scene: int = 1
    """The most drafts that are taken of one scene."""

    @abstractmethod
    def drafts(self, scene: Scene, rng: np.random.Generator) -> Iterator[Draft]:
        """Fair questions about a scene, in an order drawn with `rng`; none when it allows none."""

    @abstractmethod
    def rederive(self, question: Question) -> tuple[int, ...]:
        """The right answer, found anew from scene, pictures and simulator; never from `answer`.

        Raises UnfairError when there is not exactly one, or something named cannot be seen.
        """


def draft(
    scene: Scene,
    rng: np.random.Generator,
    stem: str,
    options: Sequence[Option],
    pictures: Sequence[QuestionPicture],
    value: str,
    slots: Mapping[str, str],
    kind: str | None = None,
    **facts: Any,
) -> Draft:
    """A draft in a wording drawn from those of a stem, the right option first.

    Without a `kind` the stem is its kind, which the evidence then names. `facts` are evidence.
    """
    wording = pick(rng, wording_ids(stem))
    evidence = {"slots": dict(slots), **facts}
    return Draft(
        scene=scene,
        text=fill_template(WORDINGS[wording], slots),
        options=tuple(options),
        pictures=tuple(pictures),
        wording=wording,
        value=value,
        kind=stem if kind is None else kind,
        evidence={"kind": stem, **evidence} if kind is None else evidence,
    )


def wording_ids(stem: str) -> list[str]:
    """The ids `stem-1`, `stem-2` and so on, in that order."""
    return [name for name in WORDINGS if stem_of(name) == stem]


def stem_of(wording: str) -> str:
    """The part that all wordings of a kind share: `rp-corner` of `rp-corner-2`."""
    return wording.rsplit("-", 1)[0]


def fill_template(template: str, slots: Mapping[str, str]) -> str:
    """The template with its slots filled, capitalized."""
    text = template.format(**slots)
    return text[:1].upper() + text[1:]


def slots_of(question: Question) -> Mapping[str, str]:
    """The slots of a question's text, from its evidence.

    The text of a wording that is known must be its template filled with exactly these; of any
    other wording, each slot must stand in the text; UnfairError otherwise.
    """
    slots = question.evidence.get("slots", {})
    if question.wording in WORDINGS:
        try:
            held = fill_template(WORDINGS[question.wording], slots) == question.text
        except KeyError:
            held = False
    else:
        held = all(str(slot).lower() in question.text.lower() for slot in slots.values())
    if not held:
        raise UnfairError("the text is not its wording with the slots of the evidence")
    return {name: str(slot) for name, slot in slots.items()}


def index_of(question: Question, right: str) -> tuple[int, ...]:
    """The place of the right option; UnfairError unless exactly one option says so."""
    places = [i for i, option in enumerate(question.options) if option == right]
    if len(places) != 1:
        raise UnfairError(f"the right answer {right!r} is {len(places)} of the options")
    return (places[0],)


def only_index(right: Sequence[bool]) -> tuple[int]:
    """Index of the one option that is right; UnfairError when there is not exactly one."""
    found = [index for index, is_right in enumerate(right) if is_right]
    if len(found) != 1:
        raise UnfairError(f"{len(found)} of {len(right)} options are right")
    return (found[0],)


def right_first(right: T, options: Sequence[T]) -> list[T]:
    """The options with the right one at the front."""
    return [right, *(option for option in options if option != right)]


def pick(rng: np.random.Generator, options: Sequence[T]) -> T:
    """One of the options."""
    return options[int(rng.integers(len(options)))]


def shuffled(rng: np.random.Generator, items: Sequence[T]) -> list[T]:
    """The items in an order drawn with `rng`."""
    return [items[int(i)] for i in rng.permutation(len(items))]
