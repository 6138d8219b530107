"""Questions of a set asked in further wordings, from a file that `phyblock vqa write` wrote.

A person reads that file first, strikes out lines or sets `accepted` to false, and may change
templates: the form of each is checked again here, and every question that is asked in one is to
have its answer derived again before it is used.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import StrictBool

from phyblock.datasets.raw import lines_of, parse_json
from phyblock.domain import Question
from phyblock.errors import DataError, Problem
from phyblock.making.questions.choices import pick
from phyblock.making.questions.paraphrases import fault_of_form
from phyblock.making.questions.wording import WORDINGS, fill_template, stem_of, wording_ids
from phyblock.records.data_values import Name
from phyblock.records.decode import shown
from phyblock.records.faults import Fault, refuse, validated
from phyblock.records.line import Line

__all__ = ["Wording", "read_wordings", "reword"]

_ALLOWED = "a file that phyblock vqa write wrote"


class _StoredWording(Line, extra="ignore"):
    wording: Name
    accepted: StrictBool
    template: str


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
    for number, text in enumerate(lines_of(path, _ALLOWED), 1):
        where = f"{path}:{number}"
        try:
            line = validated(_StoredWording, parse_json(text, path, number), where)
            if line.accepted:
                refuse(_faults(line, wordings), where)
                wordings.append(Wording(line.wording, line.template))
        except DataError as error:
            problems += error.problems
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


def _faults(line: _StoredWording, earlier: Sequence[Wording]) -> Iterator[Fault]:
    """Why an accepted line cannot be used beside those before it."""
    stem = stem_of(line.wording)
    originals = [WORDINGS[known] for known in wording_ids(stem)]
    if not originals:
        allowed = "a wording of a known kind of question, such as sh-m1"
        yield Fault("is of no known kind", allowed, shown(line.wording), ("wording",))
    elif line.wording in WORDINGS or any(other.name == line.wording for other in earlier):
        allowed = "a name of its own, such as sh-m1"
        yield Fault("is used already", allowed, shown(line.wording), ("wording",))
    else:
        alike = [other.template for other in earlier if other.stem == stem]
        fault = fault_of_form(line.template, [*originals, *alike])
        if fault is not None:
            message = f"cannot be used: {fault}"
            yield Fault(message, found=shown(line.template), at=("template",))
