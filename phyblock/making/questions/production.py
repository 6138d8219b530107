"""Questions of all subtasks from a seed: drafts, a choice of them, letters, files; and answers
derived again.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain, islice
from pathlib import Path

import numpy as np

from phyblock.data import VERSION_FILE
from phyblock.data.questions import StoredQuestion
from phyblock.domain.question import (
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Mark,
    Question,
    QuestionPicture,
    Subtask,
)
from phyblock.domain.scene import Block, Scene
from phyblock.errors import DataError, PhyblockError, Problem, StoreError
from phyblock.files import atomic_write, check_free, writing
from phyblock.making.questions.affordance import AffordanceMaker
from phyblock.making.questions.base import Draft, Maker, UnfairError, pick, shuffled
from phyblock.making.questions.dynamics import CounterfactualMaker, PredictiveMaker
from phyblock.making.questions.properties import NumberMaker, PropertyMaker, SizeMaker, TallyMaker
from phyblock.making.questions.relations import (
    DependencyMaker,
    DistanceMaker,
    PositionMaker,
    RotationMaker,
)
from phyblock.making.questions.selection import even_letters, select
from phyblock.making.questions.views import OrderingMaker, ViewpointMaker
from phyblock.making.workers import Workers
from phyblock.sim.engine import other_engine
from phyblock.stable import hex_digest
from phyblock.types import BACKGROUNDS, Background

MAKERS: dict[Subtask, Maker] = {
    maker.subtask: maker
    for maker in (
        PropertyMaker("SH"),
        PropertyMaker("CO"),
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
}
"""The makers of questions, by subtask; plugins add theirs."""
PER_SUBTASK: Mapping[Subtask, int] = {s: 50 if s in ("OR", "AD") else 150 for s in SUBTASKS}
"""Questions of each subtask in the built-in set: 2,200 together, as in the paper."""
_DIGITS = 6
_BATCH = 8


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
    tried = {subtask: _tried(subtask, scenes, seed) for subtask in wanted}
    most = {subtask: len(tried[subtask]) * MAKERS[subtask].drafts_a_scene for subtask in wanted}
    short = {subtask: most[subtask] for subtask, count in wanted.items() if most[subtask] < count}
    _check_enough(short, wanted)
    for subtask, count in wanted.items():
        pool: list[Draft] = []
        tasks = [(subtask, seed, scene) for scene in tried[subtask]]
        for drafts in workers.map(scene_drafts, tasks):
            pool += drafts
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
    return list(islice(maker.drafts(scene, _rng(seed, subtask, scene.id)), maker.drafts_a_scene))


def _check_enough(short: Mapping[Subtask, int], wanted: Mapping[Subtask, int]) -> None:
    """Raise DataError that names the subtasks of which there are too few, if any, and how many."""
    if short:
        hint = "ask for fewer, or give more scenes"
        raise DataError(
            Problem(s, f"the scenes give no more than {n} of {wanted[s]} questions", hint=hint)
            for s, n in short.items()
        )


def _rng(seed: int, *parts: str) -> np.random.Generator:
    return np.random.default_rng(list("/".join((str(seed), *parts)).encode()))


def _tried(subtask: Subtask, scenes: Sequence[Scene], seed: int) -> list[Scene]:
    """The scenes that are asked: all, or as many of each level as there are to ask."""
    drawn = shuffled(_rng(seed, subtask, "scenes"), scenes)
    by_level: dict[int, list[Scene]] = {}
    for scene in drawn:
        by_level.setdefault(scene.level, []).append(scene)
    ranked = sorted(
        ((i, level, scene) for level, group in by_level.items() for i, scene in enumerate(group)),
        key=lambda entry: entry[:2],
    )
    return [scene for _, _, scene in ranked[: MAKERS[subtask].scenes_tried]]


def _dealt(
    subtask: Subtask, taken: Sequence[Draft], rng: np.random.Generator
) -> Iterator[Question]:
    """Questions in an order drawn, with letters that are drawn and about as often right."""
    width = max(3, len(str(len(taken))))
    letters = even_letters(len(taken), rng)
    for number, (one, right) in enumerate(zip(shuffled(rng, taken), letters, strict=True), 1):
        if subtask == "OR":
            places = [int(i) for i in rng.permutation(len(LETTERS))]
        else:
            rest = [place for place in range(len(LETTERS)) if place != right]
            places = [right, *shuffled(rng, rest)]
        name = f"{subtask.lower()}-{number:0{width}d}"
        yield as_question(name, subtask, one, places, pick(rng, BACKGROUNDS))


def as_question(
    name: str, subtask: Subtask, draft: Draft, places: Sequence[int], background: Background
) -> Question:
    """A draft with its options dealt: `places` says of each, in their order, where it goes."""
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


def _tidy(picture: QuestionPicture) -> QuestionPicture:
    """The picture with its numbers as the file holds them, and orders that rise."""

    def rounded(vector: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z = (round(float(number), _DIGITS) + 0.0 for number in vector)
        return (x, y, z)

    def tidy(block: Block) -> Block:
        place, angles = rounded(block.position_m), rounded(block.euler_deg)
        return replace(block, position_m=place, euler_deg=angles)

    azimuth, elevation, _ = rounded((*picture.view_deg, 0.0))
    return replace(
        picture,
        blocks=tuple(sorted(map(tidy, picture.blocks), key=lambda block: block.order)),
        marks=tuple(replace(mark, position_m=rounded(mark.position_m)) for mark in picture.marks),
        framed=tuple(map(tidy, picture.framed)),
        view_deg=(azimuth, elevation),
    )


def problem_of(question: Question) -> str | None:
    """The fault of a question, in one sentence; None when its answer was found again."""
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
        letters = "".join(LETTERS[index] for index in derived)
        return f"the answer is {letters}, not {question.answer_letters}"
    return None


def verify_questions(
    questions: Sequence[Question], workers: Workers
) -> Iterator[tuple[Question, str | None]]:
    """Each question with its fault, if any, scene by scene, so that pictures are shared."""
    by_scene = sorted(questions, key=lambda question: question.scene.id)
    batches = [by_scene[i : i + _BATCH] for i in range(0, len(by_scene), _BATCH)]
    problems = chain.from_iterable(workers.map(_problems, batches))
    yield from zip(by_scene, problems, strict=True)


def _problems(questions: Sequence[Question]) -> list[str | None]:
    return [problem_of(question) for question in questions]


QUESTIONS_FILE = "questions.jsonl"
_CARD_FILE = "CARD.md"
_SUMS_FILE = "SHA256SUMS"
SET_VERSION = 4
"""Raised whenever questions of a name ask something else, so that no results are mixed."""


def check_place(folder: Path, replace: bool) -> None:
    """Raise StoreError when the folder holds questions already and is not to be replaced, or files
    of others by the names that will be written.
    """
    if (folder / QUESTIONS_FILE).exists() and not replace:
        hint = "give another --out, or --replace"
        raise StoreError(Problem(str(folder), "holds questions already", hint=hint))
    if not (folder / QUESTIONS_FILE).exists():
        others = [folder / name for name in (QUESTIONS_FILE, _CARD_FILE, VERSION_FILE, _SUMS_FILE)]
        check_free(others, "give another --out")


def write_questions(
    folder: Path,
    questions: Sequence[Question],
    originals: Mapping[str, Scene],
    scenes_name: str,
    made_by: str,
) -> None:
    """Write the questions, sorted as they are, with card and checksums; StoreError if it cannot.

    `originals` are the scenes as stored, by id, of the set `scenes_name`; `made_by` is the command
    that makes the same files.
    """
    lines = "".join(f"{StoredQuestion.of(q, originals[q.scene.id]).as_json()}\n" for q in questions)
    files = {
        _CARD_FILE: question_card(folder.name, scenes_name, questions, made_by).encode(),
        QUESTIONS_FILE: lines.encode(),
        VERSION_FILE: f"{SET_VERSION}\n".encode(),
    }
    sums = "".join(f"{hex_digest(d)}  {name}\n" for name, d in files.items())
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, data in {**files, _SUMS_FILE: sums.encode()}.items():
            atomic_write(folder / name, data)


def question_card(name: str, scenes_name: str, questions: Sequence[Question], made_by: str) -> str:
    """Return the Markdown card of a set of questions called `name` about those scenes."""
    by_subtask = {s: [q for q in questions if q.subtask == s] for s in SUBTASKS}
    text = Path(__file__).with_name("card.md").read_text(encoding="utf-8")
    return text.format(
        name=name,
        scenes_name=scenes_name,
        count=len(questions),
        scenes=len({question.scene.id for question in questions}),
        subtasks=sum(bool(asked) for asked in by_subtask.values()),
        made_by=made_by,
        simulators=f", with {engine}," if (engine := other_engine()) else "",
        rows="\n".join(_row(asked) for asked in by_subtask.values() if asked),
    )


def _row(questions: Sequence[Question]) -> str:
    subtask, count = questions[0].subtask, len(questions)
    letters = Counter(question.answer[0] for question in questions)
    texts = Counter(question.options[question.answer[0]] for question in questions)
    scenes = {question.scene.id for question in questions}
    wordings = {question.wording for question in questions}
    shares = [f"{letters[i] / count:.0%}" for i in range(len(LETTERS))]
    most = "" if "<img1>" in texts or "place A" in texts else f"{max(texts.values()) / count:.0%}"
    cells = [subtask, SUBTASK_NAMES[subtask], count, len(scenes), len(wordings), *shares, most]
    return f"| {' | '.join(map(str, cells))} |"
