"""The makers of questions, one a subtask."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice

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
from phyblock.making.questions.affordance import AffordanceMaker
from phyblock.making.questions.counterfactual import CounterfactualMaker
from phyblock.making.questions.counting import NumberMaker, TallyMaker
from phyblock.making.questions.dependencies import DependencyMaker
from phyblock.making.questions.distances import DistanceMaker
from phyblock.making.questions.ordering import OrderingMaker
from phyblock.making.questions.positions import PositionMaker
from phyblock.making.questions.predictive import PredictiveMaker
from phyblock.making.questions.properties import ColorMaker, ShapeMaker
from phyblock.making.questions.question_draft import Draft, Maker, Option, UnfairError
from phyblock.making.questions.rotations import RotationMaker
from phyblock.making.questions.selection import Pooled, even_letters, pick, select, shuffled
from phyblock.making.questions.sizes import SizeMaker
from phyblock.making.questions.viewpoint import ViewpointMaker
from phyblock.making.workers import Workers
from phyblock.types import BACKGROUNDS, Background

_MAKERS: tuple[Maker, ...] = (
    ShapeMaker(),
    ColorMaker(),
    SizeMaker(),
    NumberMaker(),
    PositionMaker(),
    DistanceMaker(),
    DependencyMaker(),
    RotationMaker(),
    TallyMaker("OC"),
    TallyMaker("LC"),
    TallyMaker("TC"),
    ViewpointMaker(),
    CounterfactualMaker(),
    PredictiveMaker(),
    OrderingMaker(),
    AffordanceMaker(),
)

MAKERS: Mapping[Subtask, Maker] = {maker.subtask: maker for maker in _MAKERS}
"""By subtask."""


PER_SUBTASK: Mapping[Subtask, int] = {
    subtask: 50 if subtask in ("OR", "AD") else 150 for subtask in SUBTASKS
}
"""How many questions the built-in set has, as the paper's (appendix A.4)."""
_DIGITS = 6


def make_questions(
    scenes: Sequence[Scene],
    wanted: Mapping[Subtask, int],
    seed: int,
    workers: Workers,
    report: Callable[[Subtask, int], None] = lambda _, __: None,
) -> Iterator[Question]:
    """The questions, subtask by subtask; the same for the same arguments, whatever the workers.

    Drafts of a scene depend on seed, subtask and scene alone; what is taken of them, and which
    letter is right, on seed and subtask. `report` hears of every scene that was asked, and of
    how many there are to ask. Raises DataError that names every subtask of which the scenes give
    too few: at once where they are too few for so many, else when all have been asked.
    """
    most = {
        subtask: len(_tried(subtask, scenes, seed)) * MAKERS[subtask].drafts_a_scene
        for subtask in wanted
    }
    short = {subtask: most[subtask] for subtask, count in wanted.items() if most[subtask] < count}
    _check_enough(short, wanted)
    for subtask, count in wanted.items():
        pool: list[Pooled] = []
        tasks = [(subtask, seed, scene) for scene in _tried(subtask, scenes, seed)]
        for drafts in workers.map(scene_drafts, tasks):
            pool += [Pooled(draft, _texts(draft.options)) for draft in drafts]
            report(subtask, len(tasks))
        rng = _rng(seed, subtask, "choice")
        taken = select(pool, count, rng)
        if len(taken) < count:
            short[subtask] = len(taken)
        if not short:
            yield from _dealt(subtask, taken, rng)
    _check_enough(short, wanted)


def scene_drafts(task: tuple[Subtask, int, Scene]) -> list[Draft]:
    """The drafts of a subtask, by a seed, about a scene; they depend on nothing else."""
    subtask, seed, scene = task
    maker = MAKERS[subtask]
    drafts = maker.drafts(scene, _rng(seed, subtask, scene.id))
    return list(islice(drafts, maker.drafts_a_scene))


def _check_enough(short: Mapping[Subtask, int], wanted: Mapping[Subtask, int]) -> None:
    """Raise DataError that names the subtasks of which there are too few, if any, and how many."""
    hint = "ask for fewer, or give more scenes"
    problems = [
        Problem(
            subtask, f"the scenes give no more than {n} of {wanted[subtask]} questions", hint=hint
        )
        for subtask, n in short.items()
    ]
    if problems:
        raise DataError(problems)


def tidy_picture(picture: QuestionPicture) -> QuestionPicture:
    """The picture with its numbers as the file holds them, and orders that rise."""
    blocks = sorted(map(_tidy_block, picture.blocks), key=lambda block: block.order)
    marks = tuple(replace(mark, position_m=_round(mark.position_m)) for mark in picture.marks)
    framed = tuple(map(_tidy_block, picture.framed))
    azimuth, elevation = (round(float(angle), _DIGITS) + 0.0 for angle in picture.view_deg)
    return replace(
        picture, blocks=tuple(blocks), marks=marks, framed=framed, view_deg=(azimuth, elevation)
    )


def _rng(seed: int, *parts: str) -> np.random.Generator:
    return np.random.default_rng(list("/".join((str(seed), *parts)).encode()))


def _tried(subtask: Subtask, scenes: Sequence[Scene], seed: int) -> list[Scene]:
    """The scenes that are asked: all, or as many of each level as there are to ask."""
    rng = _rng(seed, subtask, "scenes")
    drawn = [scenes[int(i)] for i in rng.permutation(len(scenes))]
    by_level: dict[int, list[Scene]] = {}
    for scene in drawn:
        by_level.setdefault(scene.level, []).append(scene)
    ranked = sorted(
        ((i, level, scene) for level, group in by_level.items() for i, scene in enumerate(group)),
        key=lambda entry: entry[:2],
    )
    return [scene for _, _, scene in ranked[: MAKERS[subtask].scenes_tried]]


def _texts(options: Sequence[Option]) -> tuple[str, ...]:
    """The options as texts; of pictures and places, whose texts tell nothing, none."""
    return tuple(option for option in options if isinstance(option, str))


def _dealt(
    subtask: Subtask, taken: Sequence[Pooled], rng: np.random.Generator
) -> Iterator[Question]:
    """Questions in an order drawn, with letters that are drawn and about as often right."""
    width = max(3, len(str(len(taken))))
    letters = even_letters(len(taken), rng)
    for number, (one, right) in enumerate(zip(shuffled(rng, taken), letters, strict=True), 1):
        order = _places(subtask, right, rng)
        name = f"{subtask.lower()}-{number:0{width}d}"
        yield as_question(name, subtask, one.draft, order, pick(rng, BACKGROUNDS))


def _places(subtask: Subtask, right: int, rng: np.random.Generator) -> list[int]:
    """For each option of a draft, where it is put; the right one, which is first, at `right`."""
    if subtask == "OR":
        return [int(i) for i in rng.permutation(len(LETTERS))]
    rest = [place for place in range(len(LETTERS)) if place != right]
    return [right, *(rest[int(i)] for i in rng.permutation(len(rest)))]


def as_question(
    name: str, subtask: Subtask, draft: Draft, places: Sequence[int], background: Background
) -> Question:
    """A draft with its options dealt: `places` says of each, in their order, where it goes."""
    options: list[str] = [""] * len(places)
    pictures = list(draft.pictures)
    marks: list[Mark] = []
    shown: list[QuestionPicture] = []
    for option, place in zip(draft.options, places, strict=True):
        letter = LETTERS[place]
        if isinstance(option, QuestionPicture):
            options[place] = f"<img{place + 1}>"
            shown.append(replace(option, label=letter))
        elif isinstance(option, Mark):
            options[place] = f"place {letter}"
            marks.append(replace(option, letter=letter))
        else:
            options[place] = option
    if marks:
        lettered = tuple(sorted(marks, key=lambda mark: mark.letter))
        pictures[0] = replace(pictures[0], marks=(*pictures[0].marks, *lettered))
    pictures += sorted(shown, key=lambda picture: picture.label)
    answer = tuple(places) if subtask == "OR" else (places[0],)
    tidy = tuple(replace(tidy_picture(one), background=background) for one in pictures)
    evidence = dict(draft.evidence)
    text, wording = draft.text, draft.wording
    return Question(
        name, subtask, draft.scene, text, tuple(options), answer, tidy, wording, evidence
    )


def _tidy_block(block: Block) -> Block:
    return replace(block, position_m=_round(block.position_m), euler_deg=_round(block.euler_deg))


def _round(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    x, y, z = (round(float(number), _DIGITS) + 0.0 for number in vector)
    return (x, y, z)


_BATCH = 8


def problem_of(question: Question) -> str | None:
    """What is wrong with a question, in one sentence; None when its answer was found again."""
    maker = MAKERS.get(question.subtask)
    if maker is None:
        return "its subtask is made by no rule"
    try:
        derived = maker.rederive(question)
    except UnfairError as error:
        return str(error)
    except PhyblockError as error:
        return f"could not be derived: {error}"
    if derived != question.answer:
        return f"the answer is {_letters(derived)}, not {question.answer_letters}"
    return None


def verify_questions(
    questions: Sequence[Question], workers: Workers
) -> Iterator[tuple[Question, str | None]]:
    """Each question with what is wrong with it, scene by scene, so that pictures are shared."""
    by_scene = sorted(questions, key=lambda question: question.scene.id)
    batches = [by_scene[i : i + _BATCH] for i in range(0, len(by_scene), _BATCH)]
    answers = chain.from_iterable(workers.map(_problems, batches))
    yield from zip(by_scene, answers, strict=True)


def _problems(questions: Sequence[Question]) -> list[str | None]:
    return [problem_of(question) for question in questions]


def _letters(answer: tuple[int, ...]) -> str:
    return "".join(LETTERS[index] for index in answer)
