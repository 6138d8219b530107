"""A session without a server: a folder that any browser opens, and the file of answers it gives."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from phyblock.data.base import parse_json
from phyblock.errors import DataError, Problem, SpecError, reason_of
from phyblock.files import OutFolder, read_text
from phyblock.models import HaltedError, Request
from phyblock.records.line import Amount, problems_of
from phyblock.records.manifest import MANIFEST
from phyblock.run.plan import RunPlan
from phyblock.tracks import SingleTrack
from phyblock.tracks.baselines import Picking, picks_of
from phyblock.web.server import assets
from phyblock.web.session import Given, Person, Place, picking_of, pictures_of, shown

ANSWERS_FORMAT = 1
_LARGEST_BYTES = 4 * 1024 * 1024
_PAGE = "index.html"
_PICTURES = "pictures"
_IS_NOT = "is no file of answers"


def check_offline(plan: RunPlan) -> None:
    """Raise SpecError for tracks whose next request depends on the answer to the last."""
    turned = [track.name for track in plan.tracks if not isinstance(track, SingleTrack)]
    if turned:
        message = "goes turn by turn, which needs the server"
        hint = "leave it out: --set tracks=[...]"
        raise SpecError(Problem("--export", message, "tracks", ", ".join(turned), hint=hint))


def check_folder(folder: Path, runs: Path) -> None:
    """Raise SpecError where the folder holds runs, or is where they are put: who is given the
    folder would be given what is in them.
    """
    places = [folder, *folder.iterdir()] if folder.is_dir() else []
    if folder.resolve() == runs.resolve() or any((one / MANIFEST).exists() for one in places):
        message = "is a folder of runs, which would be handed out with it"
        hint = "name one of its own"
        raise SpecError(Problem("--export", message, found=str(folder), hint=hint))


async def export_session(
    plan: RunPlan, person: Person, folder: Path, done: Callable[[int], object]
) -> Path:
    """Write the folder of a plan that passed `check_offline`, and return the path of its page.

    It holds what a person is shown, and nothing that tells what is right: no scene, no name of one,
    no answer. Files are numbered in the order of the session. `done` is called with the number of
    tasks that are drawn. Raises StoreError where something is in the way or the disk refuses.
    """
    config = person.planned().config
    questions: list[dict[str, Any]] = []
    page = assets("offline.js", _PAGE)
    out = OutFolder(folder)
    out.check([*page, "questions.js", f"{_PICTURES}/"])
    with out.alone(), out.making() as new:
        (new / _PICTURES).mkdir()
        for number, sample in enumerate(plan.samples(person.model), 1):
            item, track = sample.track.shown(sample.item, sample.seed), sample.track
            assert isinstance(track, SingleTrack)
            request = await track.request(item, sample.seed, config.params, with_messages=True)
            names = []
            for place, picture in enumerate(pictures_of(request), 1):
                names.append(f"{_PICTURES}/{number:04d}-{place}.png")
                (new / names[-1]).write_bytes(picture.data)
            place_of = Place(number, plan.samples_per_model)
            questions.append(shown(request, picking_of(request, plan.suite), place_of, names))
            done(number)
        for name, (_, content) in page.items():
            (new / name).write_bytes(content)
        head = {"format": ANSWERS_FORMAT, "run": plan.manifest.identity, "model": person.model}
        head["consent"] = person.consent_sha256
        session = {"head": head, "name": person.name, "text": person.consent}
        script = f"const SESSION = {json.dumps({**session, 'questions': questions})};\n"
        (new / "questions.js").write_text(script, encoding="utf-8")
        drawn = {path.relative_to(new).as_posix() for path in (new / _PICTURES).iterdir()}
        # What an earlier session left behind may be of scenes that this one does not show.
        out.remove(set(out.names(f"{_PICTURES}/")) - drawn)
    return folder / _PAGE


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


def read_answers(path: Path, plan: RunPlan, person: Person) -> dict[int, Given]:
    """Return the answers in a file by number.

    Raises DataError for a file that is none, is of another person or run, or whose picks make no
    answer to their question.
    """
    where = str(path)
    try:
        file = AnswersFile.model_validate(parse_json(read_text(path, _LARGEST_BYTES), path))
    except OSError as error:
        raise DataError(Problem(where, f"cannot be read: {reason_of(error)}")) from error
    except ValidationError as error:
        hint = "give the file as the page saved it"
        raise DataError(problems_of(error, where, is_not=_IS_NOT, hint=hint)) from error
    except ValueError as error:
        raise DataError(Problem(where, f"{_IS_NOT}: {error}")) from error
    problems: list[Problem] = []
    told = {"model": person.model, "consent": person.consent_sha256, "run": plan.manifest.identity}
    for field, known in told.items():
        if getattr(file, field) != known:
            hint = "give the suite, --set, --limit, --name, --number and --consent of the export"
            message = "is of another session than the one that is named"
            problems.append(Problem(where, message, field, getattr(file, field), known, hint))
            break
    given: dict[int, Given] = {}
    for place, answer in enumerate(file.answers):
        number, field = answer.number, f"answers[{place}].number"
        if number > plan.samples_per_model:
            allowed = f"1 to {plan.samples_per_model}"
            problems.append(Problem(where, "is no question", field, str(number), allowed))
        if number in given:
            problems.append(Problem(where, "is there twice", field, str(number)))
        try:
            given[number] = Given(picks_of(answer.picks, answer.numbers), answer.took_s)
        except ValueError as error:
            problems.append(Problem(where, str(error), f"answers[{place}].numbers"))
    for number, sample in enumerate(plan.samples(person.model), 1):
        if problems or number not in given:
            continue
        item = sample.track.shown(sample.item, sample.seed)
        request, _ = next(iter(sample.track.outlines(item)))
        picks = given[number].picks
        try:
            picking_of(request, plan.suite).reply(picks)
        except ValueError as error:
            found = ", ".join(str(pick.place) for pick in picks)
            raise DataError(
                Problem(where, str(error), f"the answer to question {number}", found)
            ) from error
    if problems:
        raise DataError(problems)
    return given


class FileAnswers:
    """Answers out of a file, of a run that asks each item once; counts those `taken`."""

    def __init__(self, given: Mapping[int, Given], plan: RunPlan, model: str) -> None:
        self.taken = 0
        self._given = given
        self._numbers = {
            (sample.track.name, sample.item.key): number
            for number, sample in enumerate(plan.samples(model), 1)
        }

    async def ask(self, request: Request, picking: Picking) -> Given:
        """Return what was picked; HaltedError where nothing was."""
        del picking
        given = self._given.get(self._numbers[request.track, request.key])
        if given is None:
            raise HaltedError("has no answer in the file")
        self.taken += 1
        return given
