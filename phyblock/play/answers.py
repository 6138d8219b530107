"""The file of answers that a folder without a server gives, and its way into a run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from phyblock.data.base import parse_json
from phyblock.errors import DataError, Problem, reason_of
from phyblock.files import load_json, read_bytes, read_text
from phyblock.models import HaltedError, Request
from phyblock.play.page import default_consent
from phyblock.play.person import Given, Person, picking_of
from phyblock.records.line import Amount, problems_of
from phyblock.run.plan import RunPlan
from phyblock.stable import hex_digest
from phyblock.tracks.base import shown_item
from phyblock.tracks.by_hand import Picking, picks_of

__all__ = ["ANSWERS_FORMAT", "AnswersFile", "FileAnswers", "default_text", "read_answers"]

ANSWERS_FORMAT = 1
_LARGEST_BYTES = 4 * 1024 * 1024
_IS_NOT = "is no file of answers"
_AS_SAVED = "give the file as the page saved it"


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class GivenAnswer(_Strict):
    """An answer: the question's number from 1, places among its choices, seconds it took.

    `numbers` are those of each pick, where numbers go with them.
    """

    number: int = Field(ge=1)
    picks: list[int] = Field(max_length=1000)
    numbers: list[list[Amount]] = Field(default=[], max_length=1000)
    took_s: float = Field(ge=0, le=1e9, allow_inf_nan=False)


class AnswersFile(_Strict):
    """Answers of one person: whose they are, to which run and under which text, and the answers."""

    format: Literal[1]
    run: str
    model: str
    consent: str
    agreed: str = Field(pattern=r"^\d{4}-\d\d-\d\dT[\d:.]+Z$")
    answers: list[GivenAnswer]


def default_text(path: Path) -> str:
    """Which of the texts that come with phyblock was agreed to in a file: folders of earlier
    versions had that of the server. What is wrong with the file `read_answers` says.
    """
    texts = [default_consent(offline=offline) for offline in (True, False)]
    try:
        found = load_json(read_bytes(path, _LARGEST_BYTES))
    except (OSError, ValueError):
        return texts[0]
    agreed = found.get("consent") if isinstance(found, dict) else None
    return next((text for text in texts if hex_digest(text) == agreed), texts[0])


def read_answers(path: Path, plan: RunPlan, person: Person) -> dict[int, Given]:
    """The answers in a file by number.

    Raises DataError for a file that is none, or is of another person or run.
    """
    file = _read_file(path)
    problems = list(_other_sitting(path, file, plan, person))
    given: dict[int, Given] = {}
    for place, answer in enumerate(file.answers):
        field = f"answers[{place}].number"
        if answer.number > plan.samples_per_model:
            allowed = f"1 to {plan.samples_per_model}"
            problems.append(
                Problem(str(path), "is no question", field, str(answer.number), allowed)
            )
        if answer.number in given:
            problems.append(Problem(str(path), "is there twice", field, str(answer.number)))
        try:
            picks = picks_of(answer.picks, answer.numbers)
        except ValueError as error:
            problems.append(Problem(str(path), str(error), f"answers[{place}].numbers"))
            continue
        given[answer.number] = Given(picks, answer.took_s)
    if problems:
        raise DataError(problems)
    _check_picks(path, given, plan, person)
    return given


def _read_file(path: Path) -> AnswersFile:
    """Raises DataError for a file that is none of answers."""
    try:
        text = read_text(path, _LARGEST_BYTES)
    except OSError as error:
        raise DataError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    except ValueError as error:
        raise DataError(Problem(str(path), f"{_IS_NOT}: {error}")) from error
    try:
        return AnswersFile.model_validate(parse_json(text, path))
    except ValidationError as error:
        problems = problems_of(error, str(path), is_not=_IS_NOT, hint=_AS_SAVED)
        raise DataError(problems) from error


def _other_sitting(
    path: Path, file: AnswersFile, plan: RunPlan, person: Person
) -> Iterator[Problem]:
    """What first tells the sitting of a file from the one that is named; nothing where it is it."""
    for field, value, known in (
        ("model", file.model, (person.model,)),
        ("consent", file.consent, (person.consent_sha256,)),
        ("run", file.run, (plan.manifest.identity,)),
    ):
        if value not in known:
            hint = "give the suite, --set, --limit, --name, --number and --consent of the export"
            message = "is of another sitting than the one that is named"
            yield Problem(str(path), message, field, value, known[0], hint)
            return


def _check_picks(path: Path, given: Mapping[int, Given], plan: RunPlan, person: Person) -> None:
    """Raise DataError for picks that make no answer to their question."""
    problems: list[Problem] = []
    for number, sample in enumerate(plan.samples(person.model), 1):
        if number not in given:
            continue
        item = shown_item(sample.track, sample.item, sample.seed)
        request, _ = next(iter(sample.track.outlines(item)))
        picks = given[number].picks
        try:
            picking_of(request, plan.suite).reply(picks)
        except ValueError as error:
            field = f"the answer to question {number}"
            found = ", ".join(str(pick.place) for pick in picks)
            problems.append(Problem(str(path), str(error), field, found))
    if problems:
        raise DataError(problems)


class FileAnswers:
    """Answers requests out of a file, of a run that asks each item once; counts those `taken`."""

    def __init__(self, given: Mapping[int, Given], plan: RunPlan, model: str) -> None:
        self.taken = 0
        self._given = given
        self._numbers = {
            (sample.track.name, sample.item.key): number
            for number, sample in enumerate(plan.samples(model), 1)
        }

    async def ask(self, request: Request, picking: Picking) -> Given:
        """What was picked; HaltedError where nothing was."""
        del picking
        given = self._given.get(self._numbers[request.track, request.key])
        if given is None:
            raise HaltedError("has no answer in the file")
        self.taken += 1
        return given
