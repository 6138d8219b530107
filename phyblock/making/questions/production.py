"""Questions of all subtasks from a seed: drafts, a choice of them, letters; answers found again."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np

from phyblock.domain.question import (
    LETTERS,
    SUBTASKS,
    Mark,
    Question,
    QuestionPicture,
    Subtask,
)
from phyblock.domain.scene import Block, Scene
from phyblock.errors import DataError, PhyblockError, Problem
from phyblock.making.questions.base import Draft, Maker, StaticMaker, pick, shuffled
from phyblock.making.questions.dynamics import AffordanceMaker, CounterfactualMaker, PredictiveMaker
from phyblock.making.questions.properties import PropertyMaker, SizeMaker, TallyMaker
from phyblock.making.questions.relations import (
    DependencyMaker,
    DistanceMaker,
    PositionMaker,
    RotationMaker,
)
from phyblock.making.questions.selection import even_letters, select
from phyblock.making.questions.views import OrderingMaker, ViewpointMaker
from phyblock.making.workers import Workers
from phyblock.types import BACKGROUNDS, Background

MAKERS: dict[Subtask, Maker] = {
    maker.subtask: maker
    for maker in (
        *(PropertyMaker("SH"), PropertyMaker("CO"), SizeMaker(), TallyMaker("NU")),
        *(PositionMaker(), DistanceMaker(), DependencyMaker(), RotationMaker()),
        *(TallyMaker("OC"), TallyMaker("LC"), TallyMaker("TC"), ViewpointMaker()),
        *(CounterfactualMaker(), PredictiveMaker(), OrderingMaker(), AffordanceMaker()),
    )
}
"""The makers of questions, by subtask; plugins add theirs."""
PER_SUBTASK: Mapping[Subtask, int] = {s: 50 if s in ("OR", "AD") else 150 for s in SUBTASKS}
"""Questions of each subtask in the built-in set: 2,200 together, as in the paper."""
_DIGITS = 6
_PLACES = range(len(LETTERS))


def make_questions(
    scenes: Sequence[Scene],
    wanted: Mapping[Subtask, int],
    seed: int,
    workers: Workers,
    track: Callable[[Iterable[Any], int, str], Iterable[Any]] = lambda items, *_: items,
) -> list[Question]:
    """Return the questions, subtask by subtask; the same for the same arguments.

    Drafts of a scene depend on seed, subtask and scene alone; what is taken of them, and which
    letter is right, on seed and subtask. `track` may show progress: it is given what is drafted,
    the number of scenes and a title. Raises DataError that names every subtask of which the scenes
    give too few.
    """
    questions: list[Question] = []
    short = []
    for subtask, count in wanted.items():
        tasks = [(subtask, seed, scene) for scene in _by_levels(scenes, _rng(seed, subtask))]
        pool: list[Draft] = []
        for drafts in track(workers.map(scene_drafts, tasks), len(tasks), f"Drafting {subtask}"):
            pool += drafts
            if len(pool) >= MAKERS[subtask].spare * count:
                break
        rng = _rng(seed, subtask, "choice")
        taken = select(pool, count, rng)
        if len(taken) < count:
            message = f"the scenes give no more than {len(taken)} of {count} questions"
            short.append(Problem(subtask, message, hint="ask for fewer, or give more scenes"))
        questions += _dealt(subtask, taken, rng)
    if short:
        raise DataError(short)
    return questions


def scene_drafts(task: tuple[Subtask, int, Scene]) -> list[Draft]:
    """Return the drafts of a subtask, by a seed, about a scene; they depend on nothing else."""
    subtask, seed, scene = task
    maker = MAKERS[subtask]
    drafts = maker.drafts(scene, _rng(seed, subtask, scene.id))
    if not isinstance(maker, StaticMaker):
        drafts = (one for one in drafts if problem_of(_first(subtask, one)) is None)
    return list(islice(drafts, maker.drafts_a_scene))


def _first(subtask: Subtask, one: Draft) -> Question:
    """Return a draft as the question whose first option is right, or which is in order."""
    return as_question("", subtask, one, _PLACES, BACKGROUNDS[0])


def _rng(seed: int, *parts: str) -> np.random.Generator:
    return np.random.default_rng(list("/".join((str(seed), *parts)).encode()))


def _by_levels(scenes: Sequence[Scene], rng: np.random.Generator) -> list[Scene]:
    """Return the scenes in an order drawn, one of each level in turn."""
    by_level: dict[int, list[Scene]] = {}
    for scene in shuffled(rng, scenes):
        by_level.setdefault(scene.level, []).append(scene)
    turns = [(i, level) for level, group in by_level.items() for i in range(len(group))]
    return [by_level[level][i] for i, level in sorted(turns)]


def _dealt(
    subtask: Subtask, taken: Sequence[Draft], rng: np.random.Generator
) -> Iterator[Question]:
    """Yield questions in an order drawn, with letters that are drawn and about as often right."""
    width = max(3, len(str(len(taken))))
    letters = even_letters(len(taken), rng)
    for number, (one, right) in enumerate(zip(shuffled(rng, taken), letters, strict=True), 1):
        rest = shuffled(rng, [place for place in _PLACES if place != right])
        places = shuffled(rng, _PLACES) if subtask == "OR" else [right, *rest]
        name = f"{subtask.lower()}-{number:0{width}d}"
        yield as_question(name, subtask, one, places, pick(rng, BACKGROUNDS))


def as_question(
    name: str, subtask: Subtask, draft: Draft, places: Sequence[int], background: Background
) -> Question:
    """Return a draft with its options dealt: `places` says of each, in order, where it goes."""
    options: list[str] = [""] * len(places)
    pictures = list(draft.pictures)
    for place, option in sorted(zip(places, draft.options, strict=True), key=lambda one: one[0]):
        letter = LETTERS[place]
        if isinstance(option, QuestionPicture):
            options[place] = f"<img{place + 1}>"
            pictures.append(replace(option, label=letter))
        elif isinstance(option, Mark):
            options[place] = f"place {letter}"
            marks = (*pictures[0].marks, replace(option, letter=letter))
            pictures[0] = replace(pictures[0], marks=marks)
        else:
            options[place] = option
    return Question(
        id=name,
        subtask=subtask,
        scene=draft.scene,
        text=draft.text,
        options=tuple(options),
        answer=tuple(places) if subtask == "OR" else (places[0],),
        pictures=tuple(replace(_tidy(one), background=background) for one in pictures),
        wording=draft.wording,
        evidence=dict(draft.evidence),
    )


def _rounded(vector: tuple[float, ...]) -> Any:
    return tuple(round(float(number), _DIGITS) + 0.0 for number in vector)


def _tidy(picture: QuestionPicture) -> QuestionPicture:
    """Return the picture with its numbers as the file holds them, and orders that rise."""

    def tidy(block: Block) -> Block:
        place, angles = _rounded(block.position_m), _rounded(block.euler_deg)
        return replace(block, position_m=place, euler_deg=angles)

    return replace(
        picture,
        blocks=tuple(sorted(map(tidy, picture.blocks), key=lambda block: block.order)),
        marks=tuple(replace(mark, position_m=_rounded(mark.position_m)) for mark in picture.marks),
        framed=tuple(map(tidy, picture.framed)),
        view_deg=_rounded(picture.view_deg),
    )


def problem_of(question: Question) -> str | None:
    """Return what is wrong with a question, in one sentence; None when its answer was found."""
    maker = MAKERS.get(question.subtask)
    if maker is None:
        return "its subtask is made by no rule"
    try:
        derived = maker.rederive(question)
    except PhyblockError as error:
        return str(error)
    if derived != question.answer:
        letters = "".join(LETTERS[index] for index in derived)
        return f"the answer is {letters}, not {question.answer_letters}"
    return None
