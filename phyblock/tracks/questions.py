"""Questions with four options, in 16 subtasks."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import csv
import functools
import json
from collections import Counter
from collections.abc import AsyncIterator, Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field

from phyblock.config.suite import Suite
from phyblock.config.validation import (
    Count,
    Flag,
    PictureControls,
    SubtaskName,
    TemplateName,
    UniqueSome,
)
from phyblock.data import (
    QUESTIONS_FILE,
    Dataset,
    QuestionSet,
    QuestionTask,
    find_questions,
    read_official_questions,
    read_questions,
    read_version,
)
from phyblock.domain import (
    LETTERS,
    SUBTASKS,
    Question,
    QuestionPicture,
    Scene,
    Subtask,
    is_picture_option,
)
from phyblock.domain.question import rotated, rotated_label
from phyblock.errors import DataError, Problem, SpecError
from phyblock.files import OutFolder, read_picture, writing
from phyblock.models.request import Image
from phyblock.parsing.answer import ParsedAnswer, choice_form, parse_answer
from phyblock.parsing.structured import AnswerForm
from phyblock.records.line import Line, Whole
from phyblock.records.manifest import Manifest
from phyblock.records.record import Record
from phyblock.resources import bundled, bundled_sets, needs
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import (
    LETTERED_VERSION,
    lettered_sheet_png,
    question_key,
    question_png,
    sheet_size_px,
)
from phyblock.stable import hex_digest
from phyblock.tracks.base import (
    AskedOnce,
    Opening,
    TrackKind,
    picture_folder,
    picture_style,
    template_prompt,
)
from phyblock.tracks.baselines import Choice, Guesses, Picking, Spot
from phyblock.tracks.items import Elsewhere, Examples, examples_of, spread, stratified
from phyblock.tracks.measures import ItemExport, TrackReport
from phyblock.tracks.pictures import Drawing, Studio, Workshop, render_workers, to_image
from phyblock.tracks.prompts import Prompt, form_facts
from phyblock.types import AnswerFormat, Background, DataFormat

BUILTIN_QUESTIONS = "phyblock-vqa"
"""The bundled question set that is used when a suite names none."""


class VqaSpec(PictureControls):
    """The questions of the vqa track and how they are shown."""

    format: DataFormat = Field(
        default="builtin",
        description="builtin: a folder with questions.jsonl. official: a folder with question "
        "files in the official JSON form and their pictures.",
    )
    path: str = Field(
        default=BUILTIN_QUESTIONS,
        min_length=1,
        description="The name of a bundled question set (phyblock-vqa), or a folder; relative "
        "as dataset.path. Its scenes are those of dataset.",
    )
    subtasks: UniqueSome[SubtaskName] = Field(
        default=(*SUBTASKS,), description="Subtasks to ask about."
    )
    per_subtask: Count | None = Field(
        default=None, description="Questions of each subtask at most; null: all."
    )
    options_as: OptionsAs = Field(
        default="images",
        description="Options that are pictures. images: each sent apart. letters: all on one "
        "sheet, lettered.",
    )
    circular: Flag = Field(
        default=False,
        description="Ask every rotation of the options; a question is right only if all are.",
    )
    prompt: TemplateName = Field(
        default="default", description="default, or the path of a .j2 template."
    )

    @property
    def rotations(self) -> int:
        """The number of times that each question is asked with one seed."""
        return len(LETTERS) if self.circular else 1


_QUESTION = ("id", "subtask", "category", "rotation")
_ANSWER = ("right", "given", "correct")


class ChoiceParse(Line):
    """The answer that was read in a reply."""

    rule: str | None
    """The rule that matched; null: nothing could be read."""
    letters: str | None = None
    """One letter, or for ordering all in order."""
    problem: str | None = None
    """Why no answer could be read in the JSON that was asked for."""


class QuestionShown(Line):
    """A question and how it was shown."""

    id: str
    """Its name in the question set."""
    subtask: str
    """Its subtask."""
    category: str = ""
    """The category of the subtask."""
    rotation: Whole = 0
    """Number of places by which its options were turned."""
    options_as: str = ""
    """True if options that are pictures were sent as pictures or as letters in one."""
    blind: bool = False
    """True if no picture was sent."""
    wrong_image: bool = False
    """True if the pictures were those of another scene."""


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
    """The answer that was read."""
    question: QuestionShown
    """Which question it is and how it was shown."""
    answer: GivenAnswer | None = None
    """What was answered."""

    columns: ClassVar[Mapping[str, str]] = {
        "question": "object",
        "subtask": "object",
        "rotation": "Int64",
        "right": "object",
        "given": "object",
    }

    def row(self) -> Mapping[str, Any]:
        """The question, the letters that are right and those given."""
        answer = self.answer
        return {
            "question": self.question.id,
            "subtask": self.question.subtask,
            "rotation": self.question.rotation,
            "right": answer and answer.right,
            "given": answer and answer.given,
        }

    exported: ClassVar[Mapping[str, str]] = {
        "question_id": "string",
        "question_subtask": "string",
        "question_category": "string",
        "question_rotation": "Int64",
        "answer_right": "string",
        "answer_given": "string",
        "answer_correct": "boolean",
    }

    def export_row(self) -> Mapping[str, Any]:
        """The question, the right answer, and the one that was given."""
        question = {name: getattr(self.question, name) for name in _QUESTION}
        answer = {name: getattr(self.answer, name, None) for name in _ANSWER}
        return {
            **{f"question_{name}": value for name, value in question.items()},
            **{f"answer_{name}": value for name, value in answer.items()},
        }

    @property
    def part(self) -> str:
        """The subtask."""
        return self.question.subtask

    @property
    def is_correct(self) -> bool | None:
        """True if the answer is right."""
        return None if self.answer is None else self.answer.correct

    @property
    def target(self) -> str:
        """The right letters."""
        return "" if self.answer is None else self.answer.right

    @property
    def said(self) -> str | None:
        """The letters given."""
        return None if self.answer is None else self.answer.given


@dataclass(frozen=True)
class VqaRules:
    """The presentation of questions.

    `circular`: every rotation of the options is asked; `blind`: no picture is sent;
    `wrong_image`: the pictures are those of a question about another scene.
    """

    options_as: OptionsAs = "images"
    circular: bool = False
    blind: bool = False
    wrong_image: bool = False
    answer_format: AnswerFormat = "text"

    def form(self, question: Question) -> AnswerForm[str] | None:
        """The form in which an answer is asked for; None where that is text."""
        if self.answer_format == "text":
            return None
        return choice_form(question.options, question.subtask == "OR")

    def read(self, question: Question, text: str) -> ParsedAnswer:
        """The answer that a reply gives."""
        return parse_answer(text, question.options, question.subtask == "OR")

    def right_answer(self, question: Question) -> str:
        """A right answer in the form that is asked for."""
        form, letters = self.form(question), question.answer_letters
        if form is None:
            return choice_text(question.answer)
        value = list(letters) if question.subtask == "OR" else letters
        return form.write(value, f"The right answer is {', '.join(letters)}.")


@dataclass(frozen=True)
class ChoiceSubject:
    """One of several options is asked for, of a question as it is shown.

    `guess` returns what a rule over the whole question set answers, by the rule's name: 0-based
    indices as in `question.answer`.
    """

    question: Question
    guess: Callable[[str], tuple[int, ...]] = field(compare=False)


def _random_choice(subject: ChoiceSubject, rng: np.random.Generator) -> str:
    n = len(subject.question.options)
    if subject.question.subtask == "OR":
        return choice_text(int(index) for index in rng.permutation(n))
    return choice_text([int(rng.integers(n))])


def _oracle_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return choice_text(subject.question.answer)


def _majority_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return choice_text(subject.guess("majority"))


def _text_choice(subject: ChoiceSubject, _: np.random.Generator) -> str:
    return choice_text(subject.guess("text-only"))


def choice_text(indices: Iterable[int]) -> str:
    """An answer in the benchmark's own reply form."""
    return "Answer: " + ", ".join(LETTERS[index] for index in indices)


CHOICE_RULES = {
    "random": _random_choice,
    "oracle": _oracle_choice,
    "majority": _majority_choice,
    "text-only": _text_choice,
}
"""Rules by name of the baseline."""


def pick_answer(subject: ChoiceSubject) -> Picking:
    """The letters of the options, with the texts or the pictures that they are."""
    options = subject.question.options
    is_ordering = subject.question.subtask == "OR"
    picked = len(options) if is_ordering else 1
    return Picking(
        tuple(
            Choice(letter, "", (Spot(letter),))
            if is_picture_option(option)
            else Choice(letter, option)
            for letter, option in zip(LETTERS, options, strict=False)
        ),
        least=picked,
        most=picked,
        repeats=False,
        noun="place" if is_ordering else "option",
        write=lambda picks: choice_text([pick.place for pick in picks]),
    )


OptionsAs = Literal["images", "letters"]
SHEET = "options"
"""The label of the sheet that holds all options."""

_ORDER = ("scene", "block", *LETTERS)
_MOST_CELL_PX = 1024


@dataclass(frozen=True)
class ShownQuestion:
    """A question as it is shown, with the picture files, by label, that its data set brings."""

    question: Question
    files: Mapping[str, Path]

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of its pictures in the order sent: the scene, the block, then the options."""
        known = {picture.label for picture in self.question.pictures} | set(self.files)
        return tuple(label for label in _ORDER if label in known)


class QuestionPictures(Studio):
    """The pictures of questions under one style, as many as the question has.

    First the scene, then the block by itself where there is one, then the options A to D: each a
    picture of its own (`images`), or all on one sheet (`letters`). Questions bring backgrounds of
    their own, which `background` overrides; those that bring none have the style's.
    """

    def __init__(
        self,
        folder: Path,
        style: PictureStyle,
        options_as: OptionsAs,
        shop: Workshop | int,
        background: Background | None = None,
    ) -> None:
        super().__init__(folder, shop)
        self._background = background
        self._style = style
        self._options_as = options_as

    async def of(self, shown: ShownQuestion) -> tuple[Image, ...]:
        """The pictures of one question as they are sent.

        Raises DataError when a file is missing or no picture, StoreError when the cache folder
        cannot be written.
        """
        drawings = self._drawings(shown)
        name = " ".join(f"{drawing.label}={drawing.key}" for drawing in drawings)
        recent = self.recalled(name)
        return recent or self.remembered(name, await self.images(drawings))

    def outline(self, shown: ShownQuestion) -> tuple[tuple[Image, ...], bool]:
        """The pictures as far as they are at hand, and whether all are; nothing is rendered."""
        drawings = self._drawings(shown)
        side = self._style.size_px
        images, are_real = self.outlined(drawings, (side, side))
        if are_real:
            return images, True
        sheet = sheet_size_px(len(LETTERS), self._cell_px)
        return tuple(
            Image(b"", image.label, *sheet) if image.label == SHEET else image for image in images
        ), False

    def keys(self, shown: ShownQuestion) -> tuple[str, ...]:
        """Return what decides the pixels of a question's pictures."""
        return tuple(drawing.key for drawing in self._drawings(shown))

    @property
    def _cell_px(self) -> int:
        return min(self._style.size_px, _MOST_CELL_PX)

    def _drawings(self, shown: ShownQuestion) -> tuple[Drawing, ...]:
        drawings = [self._drawing(shown, label) for label in shown.labels]
        options = [drawing for drawing in drawings if drawing.label in LETTERS]
        if not options or self._options_as == "images":
            return tuple(drawings)
        letters = "".join(drawing.label for drawing in options)
        parts = " ".join(drawing.key for drawing in options)
        text = f"sheet {LETTERED_VERSION} {self._cell_px} {letters} {parts}"
        key = hex_digest(text)
        makes = tuple(drawing.make for drawing in options)
        sheet = Drawing(SHEET, key, partial(_sheet, makes, letters, self._cell_px))
        return (*(drawing for drawing in drawings if drawing.label not in LETTERS), sheet)

    def _drawing(self, shown: ShownQuestion, label: str) -> Drawing:
        if label in shown.files:
            path = shown.files[label]
            key = hex_digest(read_picture(path))
            return Drawing(label, key, partial(read_picture, path))
        recipe = _recipe(shown.question, label)
        recipe = replace(recipe, background=self._background or recipe.background)
        key = question_key(recipe, self._style)
        return Drawing(label, key, partial(question_png, recipe, self._style))

    async def image(self, drawing: Drawing) -> Image:
        """A picture from the cache, or made now; files are read and not copied into the cache."""
        if isinstance(drawing.make, partial) and drawing.make.func is read_picture:
            return to_image(drawing.make(), drawing.label)
        return await super().image(drawing)

    def kept(self, drawing: Drawing) -> Image | None:
        """A picture that is at hand."""
        if isinstance(drawing.make, partial) and drawing.make.func is read_picture:
            return to_image(drawing.make(), drawing.label)
        return super().kept(drawing)


def _recipe(question: Question, label: str) -> QuestionPicture:
    for recipe in question.pictures:
        if recipe.label == label:
            return recipe
    raise DataError(Problem(f"question {question.id}", "has no such picture", "pictures", label))


def _sheet(makes: Sequence[Callable[[], bytes]], letters: str, side_px: int) -> bytes:
    return lettered_sheet_png([make() for make in makes], letters, side_px)


@dataclass(frozen=True)
class AskedQuestion:
    """A question with its options in one order; `rotation` 0 is that of the data set."""

    task: QuestionTask
    rotation: int = 0
    is_one_of_many: bool = False

    @functools.cached_property
    def shown(self) -> ShownQuestion:
        """The question with its options and the files of their pictures rotated."""
        n = len(self.task.question.options)
        files = {rotated_label(at, self.rotation, n): path for at, path in self.task.files.items()}
        return ShownQuestion(rotated(self.task.question, self.rotation), files)

    @property
    def question(self) -> Question:
        """The question as it is shown."""
        return self.shown.question

    @property
    def key(self) -> str:
        """The question's id, with the rotation where all are asked."""
        return f"{self.task.key}-r{self.rotation}" if self.is_one_of_many else self.task.key

    @property
    def scene(self) -> Scene:
        """The scene as the question shows it."""
        return self.task.scene


@dataclass(frozen=True)
class ChoiceJudgement:
    """A reply as it was parsed, and whether it is right."""

    parsed: ParsedAnswer
    right: str

    @property
    def is_read(self) -> bool:
        """True if a rule matched."""
        return self.parsed.rule is not None

    def fields(self) -> dict[str, Any]:
        """`parse`, `scores` (none: there are no steps) and `answer` of the record."""
        given = self.parsed.letters
        problem = {"problem": self.parsed.problem} if self.parsed.problem else {}
        return {
            "parse": {"rule": self.parsed.rule, "letters": given, **problem},
            "scores": [],
            "answer": {"right": self.right, "given": given, "correct": given == self.right},
        }


class Vqa(AskedOnce[AskedQuestion, QuestionPictures]):
    """Prompt, parse and score of the track."""

    name = "vqa"

    def __init__(
        self,
        rules: VqaRules,
        questions: QuestionSet,
        tasks: Sequence[QuestionTask],
        prompt: Prompt | None = None,
        pictures: QuestionPictures | None = None,
        examples: Examples[AskedQuestion] | None = None,
    ) -> None:
        """Ask `tasks` out of `questions`, of which all serve as wrong pictures and for baselines.

        `prompt` and `pictures` are None where every model is a recording. Raises SpecError where
        wrong pictures are wanted and some question has no other scene to take them from.
        """
        super().__init__(prompt, pictures, examples)
        rotations = range(len(LETTERS)) if rules.circular else range(1)
        self.rules = rules
        self.items = tuple(
            AskedQuestion(task, rotation, is_one_of_many=rules.circular)
            for task in tasks
            for rotation in rotations
        )
        self._questions = questions
        self._guesses = Guesses([task.question for task in questions.tasks])
        self._elsewhere: Elsewhere[QuestionTask] | None = None
        if rules.wrong_image:
            self._elsewhere = elsewhere_in(questions)
            self._elsewhere.check(tasks, "question", "vqa.wrong_image")

    def about(self, item: AskedQuestion) -> dict[str, Any]:
        """The question and how it is shown."""
        return {
            "question": {
                "id": item.question.id,
                "subtask": item.question.subtask,
                "category": item.question.category,
                "rotation": item.rotation,
                "options_as": self.rules.options_as,
                "blind": self.rules.blind,
                "wrong_image": self.rules.wrong_image,
            }
        }

    def identity(self) -> dict[str, Any]:
        """Digests of all questions, of those asked, the prompt and the pictures."""
        counts = Counter(item.question.subtask for item in self.items)
        keys = [item.key for item in self.items]
        return {
            "questions": self._questions.sha256,
            "asked": hex_digest(json.dumps(keys)),
            "by_subtask": dict(counts),
            **super().identity(),
        }

    def facts(self, item: AskedQuestion, pictures: tuple[Image, ...]) -> dict[str, object]:
        """Return the variables of templates; nothing in it gives the answer away."""
        question = item.question
        letters = LETTERS[: len(question.options)]
        return {
            "question": question.text,
            "options": [
                {"letter": letter, "text": option, "is_picture": is_picture_option(option)}
                for letter, option in zip(letters, question.options, strict=True)
            ],
            "letters": list(letters),
            "is_ordering": question.subtask == "OR",
            "pictures": [picture.label for picture in pictures],
            "is_blind": self.rules.blind,
            **form_facts(self._form(item)),
        }

    def judge(self, item: AskedQuestion, text: str | None) -> ChoiceJudgement:
        """Read and score a reply; None, where there is no reply, is no answer."""
        question = item.question
        parsed = ParsedAnswer(None, None)
        if text is not None:
            parsed = self.rules.read(question, text)
        return ChoiceJudgement(parsed, question.answer_letters)

    def _subject(self, item: AskedQuestion) -> ChoiceSubject:
        question = item.question
        return ChoiceSubject(question, lambda probe: self._guesses.guess(probe, question))

    def _form(self, item: AskedQuestion) -> AnswerForm[str] | None:
        return self.rules.form(item.question)

    def _right_answer(self, item: AskedQuestion) -> str:
        return self.rules.right_answer(item.question)

    def _pictured(self, item: AskedQuestion) -> ShownQuestion | None:
        return None if self.rules.blind else item.shown

    def _pictured_for(self, item: AskedQuestion, seed: int) -> ShownQuestion | None:
        """The question with its own pictures, or with those of another scene.

        Which other one depends on the question and the seed alone, so it is the same for all
        models and for all rotations.
        """
        if self._elsewhere is None:
            return self._pictured(item)
        other = self._elsewhere.of(item.task, seed)
        return self._pictured(AskedQuestion(other, item.rotation))


def elsewhere_in(questions: QuestionSet) -> Elsewhere[QuestionTask]:
    """Return the pool of wrong pictures of a question: others that show what it shows."""
    return Elsewhere(questions.tasks, _sort_of)


def _sort_of(task: QuestionTask) -> tuple[object, ...]:
    """Return what pictures must share to stand in for one another: a text may speak of place B."""
    marks = sorted(
        (picture.label, *sorted(mark.letter for mark in picture.marks))
        for picture in task.question.pictures
    )
    return (task.question.subtask, ShownQuestion(task.question, task.files).labels, *marks)


def open_vqa(opening: Opening) -> Vqa:
    """The track; SpecError, DataError or PromptError with what is wrong."""
    suite = opening.suite
    spec = suite.section(VqaSpec)
    questions = open_questions(spec.format, suite.files.folders[Vqa.name], opening.dataset)
    tasks = select_questions(
        questions.tasks, spec.subtasks, suite.levels, spec.per_subtask, opening.limit
    )
    if not tasks:
        where = suite.where("vqa", "subtasks")
        found = ", ".join(sorted({task.question.subtask for task in questions.tasks}))
        message = "no question is of these subtasks and levels"
        raise SpecError(Problem(where, message, "vqa.subtasks", found=f"questions of {found}"))
    shown = (spec.options_as, spec.circular, spec.blind, spec.wrong_image)
    rules = VqaRules(*shown, suite.answer_format)
    if not opening.with_prompts:
        return Vqa(rules, questions, tasks)
    pictures = QuestionPictures(
        picture_folder(),
        picture_style(suite.images),
        spec.options_as,
        opening.shop,
        suite.images.background,
    )
    elsewhere = elsewhere_in(questions) if rules.wrong_image else None

    def stand_ins(item: AskedQuestion) -> Iterator[AskedQuestion]:
        others = () if elsewhere is None else elsewhere.each(item.task, suite.seeds)
        return map(AskedQuestion, others)

    if elsewhere is not None:
        elsewhere.check(tasks, "question", "vqa.wrong_image")
    pool, items = map(AskedQuestion, questions.tasks), [AskedQuestion(task) for task in tasks]
    examples = examples_of(suite, pool, items, "question", _subtask, stand_ins)
    return Vqa(rules, questions, tasks, template_prompt(suite, Vqa.name), pictures, examples)


def _subtask(item: AskedQuestion) -> str:
    """Return what a question and its worked examples share."""
    return item.task.question.subtask


def open_questions(format_name: str, path: Path, dataset: Dataset) -> QuestionSet:
    """Read a question set about the scenes of a data set; DataError when it is not there."""
    if format_name == "official":
        return read_official_questions(path, dataset)
    if (path / QUESTIONS_FILE).is_file():
        return read_questions(path, dataset)
    names = ", ".join(bundled_sets(QUESTIONS_FILE))
    allowed = f"a folder with {QUESTIONS_FILE}, or a bundled set of questions: {names}"
    raise DataError(Problem(str(path), "holds no questions", "vqa.path", allowed=allowed))


def select_questions(
    tasks: Sequence[QuestionTask],
    subtasks: Sequence[Subtask],
    levels: Sequence[int],
    per_subtask: int | None,
    limit: int | None,
) -> tuple[QuestionTask, ...]:
    """The questions of these subtasks about scenes of these levels, in the order of the set.

    Of each subtask at most `per_subtask` are kept, and `limit` in all, shared over the subtasks;
    those kept are spread evenly over the set, and a higher limit keeps them.
    """
    groups = [
        [task for task in tasks if task.question.subtask == name and _is_of(task, levels)]
        for name in SUBTASKS
        if name in subtasks
    ]
    groups = [group for group in groups if group]
    sizes = [
        len(group) if per_subtask is None else min(per_subtask, len(group)) for group in groups
    ]
    shares = sizes if limit is None else stratified(sizes, limit)
    kept = {
        group[place].key
        for group, share in zip(groups, shares, strict=True)
        for place in spread(len(group), share)
    }
    return tuple(task for task in tasks if task.key in kept)


def _is_of(task: QuestionTask, levels: Sequence[int]) -> bool:
    return bool(set(task.scene.levels) & set(levels))


def _questions(suite: Suite) -> tuple[str, tuple[str, ...], bool]:
    spec = suite.section(VqaSpec)
    return spec.path, ("vqa", "path"), spec.format == "builtin"


def _manifest(suite: Suite) -> Mapping[str, Any]:
    spec = suite.section(VqaSpec)
    root = suite.files.folders[Vqa.name]
    questions = {"format": spec.format, "root": str(root), "version": read_version(root)}
    return {"questions": questions}


def _found_at(manifest: Manifest) -> str | None:
    return None if manifest.questions is None else manifest.questions.root


def _report() -> TrackReport:
    from phyblock.tracks.vqa_results import REPORT

    return REPORT


TRACK = TrackKind(
    name=Vqa.name,
    title="VQA",
    item="question",
    about="multiple-choice questions",
    open=open_vqa,
    report=_report,
    subject=ChoiceSubject,
    baselines=CHOICE_RULES,
    by_hand=pick_answer,
    section=("vqa", VqaSpec, "The questions of the vqa track, and how they are shown."),
    record=ChoiceRecord,
    template=bundled("prompts", "vqa.j2"),
    json_template=bundled("prompts", "vqa_json.j2"),
    prompt_field=("vqa", "prompt"),
    tables=("table2", "letters"),
    own_data=_questions,
    manifest=_manifest,
    own_root=_found_at,
    no_examples="",
    varies=("prompt", "background", "examples", "repeats"),
)


MCQ_FILE, ORDERING_FILE = "PhyBlock_MCQ.tsv", "PhyBlock_Ordering.tsv"
_TSV = ("index", "question", *LETTERS, "answer", "category", "l2-category", "scene")
_LEVELS = (1, 2, 3, 4)
_FILES = {
    "vlmevalkit": (MCQ_FILE, ORDERING_FILE),
    "hf": ("questions.parquet", "README.md", "dataset/"),
}
"""What each format writes, as far as it is known before it is made."""
_AT_ONCE = 4

_Drawn = tuple[QuestionTask, tuple[Image, ...]]


def export_questions(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, form: str, folder: Path
) -> tuple[Path, ...]:
    """Write questions and their pictures into `folder`; what was written.

    Raises StoreError where the folder cannot be written or a file is in the way that we never
    wrote, SpecError where a package is missing,
    DataError for a picture that cannot be had.
    """
    out = OutFolder(folder)
    out.check(_FILES[form])
    with writing(folder), out.making() as made:
        files = _FORMATS[form](tasks, pictures, made)
    return tuple(folder / file.relative_to(made) for file in files)


def _vlmevalkit(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, folder: Path
) -> tuple[Path, ...]:
    """Two TSV files: of one right letter, and of ordering, whose answer is four letters.

    Put into `$LMUData`, the first is a multiple-choice set of VLMEvalKit by its file name. Pictures
    are base64; those of several are lists, with names in `image_path`.
    """
    return asyncio.run(_write_tsv(tasks, pictures, folder))


async def _write_tsv(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, folder: Path
) -> tuple[Path, ...]:
    paths = (folder / MCQ_FILE, folder / ORDERING_FILE)
    with contextlib.ExitStack() as stack:
        files = [
            stack.enter_context(path.open("w", newline="", encoding="utf-8")) for path in paths
        ]
        writers = [csv.writer(file, delimiter="\t", lineterminator="\n") for file in files]
        for writer in writers:
            writer.writerow((*_TSV, "image", "image_path"))
        async for task, drawn in _drawn(tasks, pictures):
            is_ordering = len(task.question.answer) > 1
            writers[is_ordering].writerow(_tsv_row(task, drawn))
    return paths


def _tsv_row(task: QuestionTask, drawn: Sequence[Image]) -> tuple[str, ...]:
    question = task.question
    coded = [base64.b64encode(image.data).decode() for image in drawn]
    names = [f"{question.id}-{image.label}.png" for image in drawn]
    options = [_option(option, place, drawn) for place, option in enumerate(question.options)]
    several = len(drawn) > 1
    return (
        question.id,
        question.text,
        *options,
        question.answer_letters,
        question.subtask,
        question.category,
        question.scene.id,
        repr(coded) if several else coded[0],
        repr(names) if several else names[0],
    )


def _option(option: str, place: int, drawn: Sequence[Image]) -> str:
    """An option's text; a picture is named by where it stands among those that are sent."""
    if not is_picture_option(option):
        return option
    labels = [image.label for image in drawn]
    return f"Picture {labels.index(LETTERS[place]) + 1}"


def _hugging_face(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures, folder: Path
) -> tuple[Path, ...]:
    """A folder for `load_from_disk`, and a Parquet file with pictures inside for `load_dataset`."""
    needs("datasets", "hf", "hf")
    from datasets import Dataset, Features, Value, utils  # type: ignore[import-untyped]
    from datasets import Image as HfImage

    texts = ("id", "subtask", "category", "scene", "wording", "question", "answer", "evidence")
    features = Features(
        {
            **{name: Value("string") for name in texts},
            "options": [Value("string")],
            "levels": [Value("int64")],
            "labels": [Value("string")],
            "images": [HfImage()],
        }
    )
    utils.disable_progress_bars()
    rows = asyncio.run(_rows(tasks, pictures))
    dataset = Dataset.from_list(rows, features=features)
    dataset.save_to_disk(folder / "dataset")
    path = folder / "questions.parquet"
    dataset.to_parquet(path)
    (folder / "README.md").write_text(_CARD, encoding="utf-8")
    return folder / "dataset", path


async def _rows(tasks: Sequence[QuestionTask], pictures: QuestionPictures) -> list[dict[str, Any]]:
    return [
        {
            "id": task.question.id,
            "subtask": task.question.subtask,
            "category": task.question.category,
            "scene": task.question.scene.id,
            "wording": task.question.wording,
            "question": task.question.text,
            "answer": task.question.answer_letters,
            "evidence": json.dumps(task.question.evidence, sort_keys=True),
            "options": list(task.question.options),
            "levels": list(task.question.scene.levels),
            "labels": [image.label for image in drawn],
            "images": [{"bytes": image.data, "path": f"{image.label}.png"} for image in drawn],
        }
        async for task, drawn in _drawn(tasks, pictures)
    ]


async def _drawn(
    tasks: Sequence[QuestionTask], pictures: QuestionPictures
) -> AsyncIterator[_Drawn]:
    """Questions with their pictures in the order in which models get them, a few at a time."""
    for start in range(0, len(tasks), _AT_ONCE):
        some = tasks[start : start + _AT_ONCE]
        drawn = await asyncio.gather(
            *(pictures.of(ShownQuestion(task.question, task.files)) for task in some)
        )
        for task, images in zip(some, drawn, strict=True):
            yield task, images


_CARD = """---
configs:
- config_name: default
  data_files: questions.parquet
---
# Questions about block structures

One row a question: `question`, four `options`, `answer` (a letter; four for ordering), and
`images` in the order sent with their `labels` (`scene`, `block`, or the letter of an option).
"""

_FORMATS: dict[
    str, Callable[[Sequence[QuestionTask], QuestionPictures, Path], tuple[Path, ...]]
] = {"vlmevalkit": _vlmevalkit, "hf": _hugging_face}
"""Formats of questions by the word after `--to`."""


def _write(
    form: str, out: Path, questions: str, scenes: Dataset, limit: int | None, size_px: int
) -> tuple[Path, ...]:
    """As `ItemExport` says; a `limit` is shared over subtasks."""
    asked = open_questions("builtin", find_questions(questions), scenes)
    tasks = select_questions(asked.tasks, SUBTASKS, _LEVELS, None, limit)
    style = PictureStyle(size_px=size_px)
    pictures = QuestionPictures(picture_folder(), style, "images", render_workers())
    try:
        return export_questions(tasks, pictures, form, out)
    finally:
        pictures.close()


QUESTION_EXPORT = ItemExport(tuple(_FORMATS), BUILTIN_QUESTIONS, _write)
"""What `phyblock export --questions` writes."""
