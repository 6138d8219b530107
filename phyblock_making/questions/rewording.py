"""Questions of a set asked in further wordings, from a file that `phyblock vqa write` wrote.

A person reads that file first, strikes out lines or sets `accepted` to false, and may change
templates: the form of each is checked again here, and every question that is asked in one is to
have its answer derived again before it is used.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from phyblock.datasets.builtin import scene_lines
from phyblock.datasets.raw import MISSING, RawReader, parse_json
from phyblock.domain import Question
from phyblock.errors import DataError, Problem
from phyblock_making.questions.choices import pick
from phyblock_making.questions.paraphrases import fault_of_form
from phyblock_making.questions.wording import WORDINGS, fill_template, stem_of, wording_ids

__all__ = ["Wording", "read_wordings", "reword"]

_ALLOWED = "a file that phyblock vqa write wrote"


@dataclass(frozen=True)
class Wording:
    """A further wording of a kind of question: `sh-m2` of the stem `sh`."""

    name: str
    template: str

    @property
    def stem(self) -> str:
        """What the wordings of one kind of question share."""
        return stem_of(self.name)

    def asks(self, question: Question) -> Question:
        """The question in this wording, under an id of its own."""
        slots: Mapping[str, str] = question.evidence.get("slots", {})
        name = f"{question.id}-{self.name.removeprefix(f'{self.stem}-')}"
        return replace(
            question, id=name, text=fill_template(self.template, slots), wording=self.name
        )


def read_wordings(path: Path) -> tuple[Wording, ...]:
    """The accepted wordings of a file; raises DataError with everything that is wrong in it."""
    wordings: list[Wording] = []
    problems: list[Problem] = []
    for number, line in enumerate(scene_lines(path, _ALLOWED), 1):
        reader = RawReader(f"{path}:{number}")
        try:
            wording = _read_line(reader, parse_json(line, path, number), wordings)
            reader.raise_if_broken()
        except DataError as error:
            problems += error.problems
            continue
        wordings += [] if wording is None else [wording]
    if problems:
        raise DataError(problems)
    if not wordings:
        raise DataError(Problem(str(path), "holds no accepted wording", allowed=_ALLOWED))
    return tuple(wordings)


def reword(
    questions: Iterable[Question], wordings: Sequence[Wording], seed: int
) -> dict[str, Question]:
    """By its id, each question that a wording is for, asked in one of these.

    Which one depends on the seed and the question's id alone.
    """
    reworded = {}
    for question in questions:
        stem = stem_of(question.wording)
        fitting = [wording for wording in wordings if wording.stem == stem]
        if fitting and question.wording in WORDINGS:
            rng = np.random.default_rng([seed, *question.id.encode()])
            reworded[question.id] = pick(rng, fitting).asks(question)
    return reworded


def _read_line(reader: RawReader, content: object, earlier: Sequence[Wording]) -> Wording | None:
    """The wording of a line; None where it is not accepted, or after a complaint."""
    raw = reader.mapping(content)
    name = reader.name(reader.get(raw, "wording"), "wording")
    is_accepted = _flag(reader, raw, "accepted")
    template = reader.get(raw, "template")
    if template is not MISSING and not isinstance(template, str):
        reader.complain("template", "is no text", template, "a question with its slots")
    if reader.problems or not is_accepted:
        return None
    wording = Wording(name, template)
    originals = [WORDINGS[known] for known in wording_ids(wording.stem)]
    if not originals:
        allowed = "a wording of a known kind of question, such as sh-m1"
        reader.complain("wording", "is of no known kind", name, allowed)
    elif name in WORDINGS or any(other.name == name for other in earlier):
        reader.complain("wording", "is used already", name, "a name of its own, such as sh-m1")
    else:
        alike = [other.template for other in earlier if other.stem == wording.stem]
        fault = fault_of_form(template, [*originals, *alike])
        if fault is not None:
            reader.complain("template", f"cannot be used: {fault}", template)
    return wording


def _flag(reader: RawReader, raw: Any, field: str) -> bool:
    value = reader.get(raw, field)
    if value is not MISSING and not isinstance(value, bool):
        reader.complain(field, "is neither true nor false", value, "true or false")
    return value is True
