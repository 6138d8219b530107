"""The VQA track of a suite: which questions, asked how."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from phyblock.data import (
    QUESTIONS_FILE,
    Dataset,
    QuestionSet,
    QuestionTask,
    read_official_questions,
    read_questions,
)
from phyblock.domain import SUBTASKS, Subtask
from phyblock.errors import DataError, Problem, SpecError
from phyblock.resources import bundled_sets
from phyblock.tracks.examples import examples_of
from phyblock.tracks.kind import Opening
from phyblock.tracks.opening import (
    picture_folder,
    picture_style,
    template_prompt,
)
from phyblock.tracks.selection import spread, stratified
from phyblock.tracks.vqa.pictures import QuestionPictures
from phyblock.tracks.vqa.rules import VqaRules
from phyblock.tracks.vqa.spec import VqaSpec
from phyblock.tracks.vqa.track import AskedQuestion, Vqa, elsewhere_in

__all__ = ["open_questions", "open_vqa", "select_questions"]


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
    """What a question and its worked examples share."""
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
