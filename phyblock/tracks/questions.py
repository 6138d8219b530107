"""Questions with four options, in 16 subtasks: the track `vqa`."""

from __future__ import annotations

import functools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from phyblock.config.suite import Suite
from phyblock.config.validation import Flag, PictureControls, SubtaskName, TemplateName, UniqueSome
from phyblock.data.base import Dataset, QuestionSet, QuestionTask
from phyblock.data.official import read_official_questions
from phyblock.data.questions import QUESTIONS_FILE, read_questions
from phyblock.domain.question import (
    CATEGORIES,
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Question,
    Subtask,
    is_picture_option,
    rotated,
    rotated_label,
)
from phyblock.domain.scene import Scene
from phyblock.errors import DataError, Problem, SpecError
from phyblock.files import bundled, bundled_sets, read_picture
from phyblock.models.request import Image
from phyblock.parsing.answer import ParsedAnswer, choice_form, parse_answer
from phyblock.parsing.text import AnswerForm
from phyblock.records.files import Manifest
from phyblock.records.record import Line, Record, Whole
from phyblock.scoring.plan import chance
from phyblock.sim.question_pictures import question_key, question_png
from phyblock.text import hex_digest
from phyblock.tracks.base import Choice, Judgement, Picking, Track, limited, select_tasks
from phyblock.tracks.measures import OVERALL, WHOLE, Cell, SampleCounts
from phyblock.tracks.pictures import Drawing, picture_style
from phyblock.types import DataFormat


class VqaSpec(PictureControls):
    """The questions of the vqa track and their presentation."""

    format: DataFormat = "builtin"
    """builtin: a folder with questions.jsonl. official: a folder with question files in the
    official JSON form and their pictures."""
    path: Annotated[str, Field(min_length=1)] = "phyblock-vqa"
    """Name of a bundled question set (phyblock-vqa), or a folder, relative as in dataset.path. Its
    scenes are those of dataset."""
    subtasks: UniqueSome[SubtaskName] = (*SUBTASKS,)
    """Subtasks to ask about."""
    circular: Flag = False
    """Ask every rotation of the options; a question is right only if all are."""
    prompt: TemplateName = "default"
    """default, or the path of a .j2 template."""

    @property
    def rotations(self) -> int:
        """Return the number of times that each question is asked with one seed."""
        return len(LETTERS) if self.circular else 1


class ChoiceParse(Line):
    """The answer that was parsed from a reply."""

    rule: str | None
    """The rule that matched; null: nothing could be parsed."""
    letters: str | None = None
    """One letter, or for ordering all four in order."""
    problem: str | None = None
    """Reason why no answer could be parsed from the requested JSON."""


class QuestionShown(Line):
    """A question and its presentation."""

    id: str
    """Its name in the question set."""
    subtask: str
    """Its subtask."""
    category: str = ""
    """The category of the subtask."""
    rotation: Whole = 0
    """Places by which its options were rotated."""
    blind: bool = False
    """True if no picture was sent."""


class GivenAnswer(Line):
    """The given and the right answer."""

    right: str
    """The right letters."""
    given: str | None
    """The letters given, null: none."""
    correct: bool
    """True if they are the same."""


class ChoiceRecord(Record):
    """An answer to a question."""

    track: Literal["vqa"]
    """`vqa`."""
    parse: ChoiceParse | None = None
    """The parsed answer."""
    question: QuestionShown
    """The question and its presentation."""
    answer: GivenAnswer | None = None
    """The given answer and the right one."""

    exported: ClassVar[Mapping[str, tuple[str, str]]] = {
        "question_id": ("string", "question.id"),
        "question_subtask": ("string", "question.subtask"),
        "question_category": ("string", "question.category"),
        "question_rotation": ("Int64", "question.rotation"),
        "answer_right": ("string", "answer.right"),
        "answer_given": ("string", "answer.given"),
        "answer_correct": ("boolean", "answer.correct"),
    }

    @property
    def part(self) -> str:
        """The subtask."""
        return self.question.subtask

    @property
    def group(self) -> str:
        """The question, each rotation of which is a sample."""
        return self.question.id

    @property
    def is_correct(self) -> bool | None:
        """True if the answer is right."""
        return None if self.answer is None else self.answer.correct

    @property
    def target(self) -> str:
        """The right letters."""
        return "" if self.answer is None else self.answer.right

    @property
    def parsed_text(self) -> str | None:
        """The letters given."""
        return None if self.answer is None else self.answer.given


_HEADINGS = ("Property", "Relationship", "Scene", "Dynamics")
"""Headings of the categories, in their order."""


def cells_of(suite: Suite, manifest: Manifest) -> tuple[Cell, ...]:
    """Return subtasks' cells by category, with its mean as in Table 2, then the overall mean."""
    counts = manifest.tracks.get("vqa", {}).get("by_subtask", {})
    asked = counts or suite.section(VqaSpec).subtasks
    cells: list[Cell] = []
    for heading, (category, subtasks) in zip(_HEADINGS, CATEGORIES.items(), strict=True):
        if names := tuple(name for name in subtasks if name in asked):
            cells += [Cell(name, name, heading) for name in names]
            cells.append(Cell(category, heading, heading, names))
    return (*cells, Cell(OVERALL, WHOLE.heading, of=tuple(cell.name for cell in cells if cell.of)))


def _answer(record: ChoiceRecord) -> tuple[int, ...]:
    return bool(record.is_correct), 1


_LETTERS = [(kind, letter) for letter in LETTERS for kind in ("right", "given")]


def _letters(record: ChoiceRecord) -> tuple[int, ...] | None:
    """Count answers with one right letter, which excludes ordering."""
    answer = record.answer
    if answer is None or len(answer.right) != 1:
        return None
    return (*(getattr(answer, kind) == letter for kind, letter in _LETTERS), 1)


def _rotations(suite: Suite) -> int:
    return suite.section(VqaSpec).rotations


def _guessing(suite: Suite, cell: str) -> float:
    """Return the expected accuracy of uniform guesses in a subtask."""
    (subtask,) = (name for name in SUBTASKS if name == cell)
    return chance(subtask) ** _rotations(suite)


_SAME = ("suite.vqa.circular", "tracks.vqa.questions")
_COLUMNS = (*(f"{kind}_{letter.lower()}" for kind, letter in _LETTERS), "n")


@dataclass(frozen=True)
class ChoiceSubject:
    """A presented question for baselines and people; `guess` answers it by `majority_rule`."""

    question: Question
    guess: Callable[[], tuple[int, ...]] = field(compare=False)


Rule = Callable[[Question], tuple[int, ...]]
"""A guess at `Question.answer`: the indices of options."""
FOLDS = 5
"""Number of folds: each is answered by rules learned from the others."""


class Folds:
    """Questions dealt into five folds in turn, by their first base scene.

    A fold is answered by rules learned from questions that share no base scene with it. If answers
    are balanced over the whole set, such rules score below chance: an option right more often in
    known questions is right less often in others. Only a score above chance indicates a shortcut.
    """

    def __init__(self, questions: Sequence[Question]) -> None:
        bases = sorted({_bases(question)[0] for question in questions})
        self._fold = {base: place % FOLDS for place, base in enumerate(bases)}

    def of(self, question: Question) -> int:
        """Return the fold of a question. Raises KeyError if its base scene was not dealt."""
        return self._fold[_bases(question)[0]]

    def is_known(self, fold: int, question: Question) -> bool:
        """True if a question shares no base scene with the questions of a fold."""
        return all(self._fold.get(base) != fold for base in _bases(question))


def guesses_of(questions: Sequence[Question], learn: Callable[[Sequence[Question]], Rule]) -> Rule:
    """Return a rule that answers by those that `learn` returns for questions about other scenes."""
    folds = Folds(questions)

    @functools.cache
    def learned(subtask: Subtask, fold: int) -> Rule:
        mine = (question for question in questions if question.subtask == subtask)
        return learn([question for question in mine if folds.is_known(fold, question)])

    return lambda question: learned(question.subtask, folds.of(question))(question)


def majority_rule(known: Sequence[Question]) -> Rule:
    """Learn to pick the option whose text is most often right when it is offered.

    An unseen text counts as right one time in four. For options that are pictures or lettered
    places, the letter counts instead of the text; for orders, the most frequent one is picked.
    """
    letters = Counter(question.answer for question in known)
    right = Counter(question.options[question.answer[0]] for question in known)
    shown = Counter(option for question in known for option in question.options)

    def guess(question: Question) -> tuple[int, ...]:
        options, is_ordering = list(question.options), question.subtask == "OR"
        places = [f"place {letter}" for letter in "ABCD"[: len(options)]]
        if is_ordering or all(map(is_picture_option, options)) or options == places:
            first = tuple(range(len(options))) if is_ordering else (0,)
            return min(letters, key=lambda answer: (-letters[answer], answer), default=first)
        rates = [(right[option] + 1) / (shown[option] + 4) for option in options]
        ties = [index for index, rate in enumerate(rates) if rate == max(rates)]
        return (max(ties, key=lambda index: (letters[(index,)], -index)),)

    return guess


def _bases(question: Question) -> tuple[str, ...]:
    return question.scene.parents or (question.scene.id,)


def choice_text(indices: Iterable[int]) -> str:
    """Return an answer in the reply form of the benchmark."""
    return "Answer: " + ", ".join(LETTERS[index] for index in indices)


def _random(subject: ChoiceSubject, rng: np.random.Generator) -> str:
    n, is_ordering = len(subject.question.options), subject.question.subtask == "OR"
    return choice_text(rng.permutation(n).tolist() if is_ordering else [int(rng.integers(n))])


@dataclass(frozen=True)
class AskedQuestion:
    """A question with its options in one order; `rotation` 0 is that of the data set."""

    task: QuestionTask
    rotation: int = 0
    is_one_of_many: bool = False

    @functools.cached_property
    def question(self) -> Question:
        """The question as shown."""
        return rotated(self.task.question, self.rotation)

    @property
    def key(self) -> str:
        """The question's id, with the rotation if all are asked."""
        return f"{self.task.key}-r{self.rotation}" if self.is_one_of_many else self.task.key

    @property
    def scene(self) -> Scene:
        """The scene as the question shows it."""
        return self.task.scene


class Vqa(Track):
    """Asks multiple-choice questions."""

    name = "vqa"
    title = "VQA"
    item = "question"
    section = name
    options = VqaSpec
    template = bundled("prompts", "vqa.j2")
    baselines: ClassVar = {
        "random": _random,
        "oracle": lambda subject, _: choice_text(subject.question.answer),
        "majority": lambda subject, _: choice_text(subject.guess()),
    }
    record = ChoiceRecord
    counted = (
        SampleCounts("answer", ("correct", "n"), record=_answer, parts=_rotations, same=_SAME),
        SampleCounts("rotations", ("correct", "n"), record=_answer, same=_SAME),
        SampleCounts("letters", _COLUMNS, record=_letters, cells=(WHOLE,), same=_SAME),
    )
    results: ClassVar = {"cells": cells_of, "chance": _guessing, "part_names": SUBTASK_NAMES}
    varies = ("prompt", "background", "repeats")
    spec: VqaSpec

    @staticmethod
    def by_hand(subject: ChoiceSubject) -> Picking:
        """Return the choices of a person: the options, as texts or pictures."""
        options, is_ordering = subject.question.options, subject.question.subtask == "OR"
        picked = len(options) if is_ordering else 1
        choices = tuple(
            Choice(letter, labels=(letter,))
            if is_picture_option(option)
            else Choice(letter, option)
            for letter, option in zip(LETTERS, options, strict=False)
        )
        return Picking(
            choices,
            lambda picks: choice_text(pick.place for pick in picks),
            subject.question.text,
            noun="place" if is_ordering else "option",
            least=picked,
            most=picked,
        )

    def open(self) -> None:
        """Select questions. Raises SpecError if there are none."""
        suite, spec = self.suite, self.spec
        folder = suite.files.folders[self.name]
        self.questions = known = open_questions(spec.format, folder, self.dataset)
        asked = [task for task in known.tasks if task.question.subtask in spec.subtasks]
        asked = [task for task in asked if {*suite.levels} & {*task.scene.levels}]
        if suite.dataset.difficulty.ranges:
            fitting = {one.key for one in select_tasks(self.dataset.tasks, suite, None)}
            asked = [task for task in asked if task.scene.id in fitting]
        strata = [SUBTASKS.index(task.question.subtask) for task in asked]
        if not (tasks := limited(asked, strata, self.limit)):
            where = suite.where("vqa", "subtasks")
            found = ", ".join(sorted({task.question.subtask for task in known.tasks}))
            message = "no question is of these subtasks, levels and difficulty"
            raise SpecError(Problem(where, message, "vqa.subtasks", found=f"questions of {found}"))
        shown = product(tasks, range(spec.rotations))
        self.items = tuple(AskedQuestion(task, turn, spec.circular) for task, turn in shown)
        self._guess = guesses_of([task.question for task in known.tasks], majority_rule)

    def draw(self, item: AskedQuestion) -> tuple[Drawing, ...]:
        """Return the pictures of a question: scene, the block by itself if there is one, options.

        A suite's background overrides questions'. Raises DataError for a missing picture.
        """
        images, n, files = self.suite.images, len(item.question.options), item.task.files
        recipes = {recipe.label: recipe for recipe in item.question.pictures}
        paths = {rotated_label(at, item.rotation, n): path for at, path in files.items()}
        drawings = []
        for label in () if self.is_blind else ("scene", "block", *LETTERS):
            if label in paths:
                read = partial(read_picture, paths[label])
                drawings.append(Drawing(label, hex_digest(read()), read, is_file=True))
            elif label in recipes:
                ground = images.background or recipes[label].background
                what = replace(recipes[label], background=ground), picture_style(images)
                drawings.append(Drawing.of(label, question_key, question_png, *what))
        return tuple(drawings)

    def about(self, item: AskedQuestion) -> dict[str, Any]:
        """Return the question and its presentation."""
        asked = {name: getattr(item.question, name) for name in ("id", "subtask", "category")}
        return {"question": {**asked, "rotation": item.rotation, "blind": self.is_blind}}

    def identity(self) -> dict[str, Any]:
        """Return digests of all questions, of the selected ones, the prompt and the pictures."""
        return {
            "questions": self.questions.sha256,
            "asked": hex_digest(json.dumps([item.key for item in self.items])),
            "by_subtask": dict(Counter(item.question.subtask for item in self.items)),
            **super().identity(),
        }

    def json_form(self, item: AskedQuestion) -> AnswerForm[str]:
        """Return the JSON form of an answer."""
        return choice_form(item.question.options, item.question.subtask == "OR")

    def facts(self, item: AskedQuestion, pictures: Sequence[Image]) -> dict[str, object]:
        """Return the variables of templates; none of them reveals the answer."""
        question = item.question
        return {
            **super().facts(item, pictures),
            "question": question.text,
            "options": [
                {"letter": letter, "text": option, "is_picture": is_picture_option(option)}
                for letter, option in zip(LETTERS, question.options, strict=False)
            ],
            "letters": list(LETTERS[: len(question.options)]),
            "is_ordering": question.subtask == "OR",
        }

    def subject_of(self, item: AskedQuestion) -> ChoiceSubject:
        """Return the subject of baselines."""
        return ChoiceSubject(item.question, lambda: self._guess(item.question))

    def judge(self, item: AskedQuestion, text: str | None) -> Judgement:
        """Parse and score a reply; a missing reply (None) is no answer."""
        question, parsed = item.question, ParsedAnswer(None, None)
        if text is not None:
            parsed = parse_answer(text, question.options, question.subtask == "OR")
        given, right = parsed.letters, question.answer_letters
        problem = {"problem": parsed.problem} if parsed.problem else {}
        parse = {"rule": parsed.rule, "letters": given, **problem}
        answer = {"right": right, "given": given, "correct": given == right}
        return Judgement(parsed.rule is not None, {"parse": parse, "scores": [], "answer": answer})


def open_questions(format_name: str, path: Path, dataset: Dataset) -> QuestionSet:
    """Read a question set about the scenes of a data set. Raises DataError if it is missing."""
    if format_name == "official":
        return read_official_questions(path, dataset)
    if (path / QUESTIONS_FILE).is_file():
        return read_questions(path, dataset)
    names = ", ".join(bundled_sets(QUESTIONS_FILE))
    allowed = f"a folder with {QUESTIONS_FILE}, or a bundled set of questions: {names}"
    raise DataError(Problem(str(path), "holds no questions", "vqa.path", allowed=allowed))
