"""Questions with four options, in 16 subtasks."""

from __future__ import annotations

import functools
import json
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
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
from phyblock.files import read_picture
from phyblock.models.request import Image
from phyblock.parsing.answer import ParsedAnswer, choice_form, parse_answer
from phyblock.parsing.structured import AnswerForm
from phyblock.records.line import Line, Whole
from phyblock.records.manifest import Manifest
from phyblock.records.record import Record
from phyblock.resources import bundled, bundled_sets
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import (
    LETTERED_VERSION,
    lettered_sheet_png,
    question_key,
    question_png,
    sheet_size_px,
)
from phyblock.stable import hex_digest
from phyblock.tracks.asked_once import AskedOnce
from phyblock.tracks.by_hand import Choice, Picking, Spot
from phyblock.tracks.elsewhere import Elsewhere
from phyblock.tracks.examples import Examples, examples_of
from phyblock.tracks.guesses import Guesses
from phyblock.tracks.kind import Opening, TrackKind
from phyblock.tracks.measures import TrackReport
from phyblock.tracks.opening import (
    picture_folder,
    picture_style,
    template_prompt,
)
from phyblock.tracks.pictures import Drawing, Studio, Workshop, to_image
from phyblock.tracks.prompts import Prompt, form_facts
from phyblock.tracks.selection import spread, stratified
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
