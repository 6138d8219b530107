"""Reader of questions: a folder with `questions.jsonl`, one question a line, about known scenes.

Each line is an object with `id`, `subtask`, `category`, `scene_id`, `wording`, `question`,
`options` (four texts, or `<img1>` to `<img4>`), `answer` (a letter; for ordering four), `colors`
where blocks are recolored, `background`, `pictures` (recipes) and `evidence`. docs/vqa.md holds
the schema.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from phyblock.datasets.base import Dataset, QuestionSet, QuestionTask
from phyblock.datasets.builtin import scene_lines
from phyblock.datasets.raw import MISSING, gather, parse_json
from phyblock.datasets.recipes import LABELS, RecipeReader
from phyblock.domain import (
    LETTERS,
    SUBTASKS,
    Question,
    QuestionPicture,
    Scene,
    Subtask,
    category_of,
    is_picture_option,
)
from phyblock.errors import DataError, Problem
from phyblock.words import BACKGROUNDS, Background

__all__ = ["QUESTIONS_FILE", "QuestionReader", "read_question_line", "read_questions"]

QUESTIONS_FILE = "questions.jsonl"
_MOST_OPTIONS = 26
_FIELDS = (
    *("id", "subtask", "category", "scene_id", "wording", "question", "options", "answer"),
    *("colors", "background", "pictures", "evidence"),
)


def read_questions(folder: Path, scenes: Dataset) -> QuestionSet:
    """All questions of a folder, about these scenes; DataError with everything that is wrong."""
    path = folder / QUESTIONS_FILE
    known = {task.scene.id: task.scene for task in scenes.tasks}
    first_line: dict[str, int] = {}
    tasks: list[QuestionTask] = []
    problems: list[Problem] = []
    lines = scene_lines(path, f"a folder with {QUESTIONS_FILE}, or a bundled set of questions")
    for number, line in enumerate(lines, 1):
        try:
            question = read_question_line(path, number, line, known)
        except DataError as error:
            gather(problems, error.problems, path)
            continue
        first = first_line.setdefault(question.id, number)
        if first != number:
            message = f"is used by line {first} already"
            twice = Problem(f"{path}:{number}", message, "id", repr(question.id))
            gather(problems, [twice], path)
        tasks.append(QuestionTask(question))
    if not lines:
        problems.append(Problem(str(path), "holds no questions", allowed="one question a line"))
    if problems:
        raise DataError(problems)
    return QuestionSet(folder.name, folder, tuple(tasks))


def read_question_line(path: Path, number: int, line: str, scenes: Mapping[str, Scene]) -> Question:
    """The question in one line; raises DataError with everything that is wrong with it."""
    reader = QuestionReader(f"{path}:{number}")
    raw = reader.mapping(parse_json(line, path, number))
    reader.check_fields(raw)
    name = reader.name(reader.get(raw, "id"), "id")
    subtask = reader.choice(reader.get(raw, "subtask"), "subtask", SUBTASKS)
    scene = reader.scene(reader.get(raw, "scene_id"), scenes)
    text = reader.text(reader.get(raw, "question"), "question")
    options = reader.options(reader.get(raw, "options"))
    answer = reader.answer(reader.get(raw, "answer"), subtask == "OR")
    entries = reader.items(reader.get(raw, "pictures"), "pictures", len(LABELS))
    pictures: tuple[QuestionPicture, ...] = ()
    if scene is not None:
        scene = reader.recolored(raw.get("colors", {}), scene, "colors")
        background = reader.background(raw.get("background"))
        pictures = reader.pictures(entries, scene, background)
        reader.check_pictures(options, pictures)
    if subtask is not None:
        category = category_of(cast(Subtask, subtask))
        reader.choice(raw.get("category", category), "category", (category,))
    evidence = reader.mapping(raw.get("evidence", {}), "evidence") if raw is not MISSING else {}
    wording = raw.get("wording", "") if raw is not MISSING else ""
    if not isinstance(wording, str):
        reader.complain("wording", "is no text", wording, "the name of a template, or none")
    reader.raise_if_broken()
    assert scene is not None
    return Question(
        name, cast(Subtask, subtask), scene, text, options, answer, pictures, wording, evidence
    )


class QuestionReader(RecipeReader):
    """Reads the fields of a question, and collects what is wrong with them."""

    def check_fields(self, raw: Any) -> None:
        """Complain about fields that are not known: a misspelled `colors` would change pictures."""
        for name in () if raw is MISSING else raw:
            if name not in _FIELDS:
                self.complain(name, "is not known", allowed=", ".join(_FIELDS))

    def scene(self, raw: object, scenes: Mapping[str, Scene]) -> Scene | None:
        """The scene that is named."""
        if raw is MISSING:
            return None
        found = scenes.get(raw) if isinstance(raw, str) else None
        if found is None:
            allowed = f"one of the {len(scenes)} scenes of the data set"
            self.complain("scene_id", "names no scene of the data set", raw, allowed)
        return found

    def background(self, raw: object) -> Background | None:
        """The ground of all pictures of a question; None where it says none."""
        if raw is None:
            return None
        return cast(Background | None, self.choice(raw, "background", BACKGROUNDS))

    def text(self, raw: object, field: str) -> str:
        """A text that is not blank."""
        if isinstance(raw, str) and raw.strip():
            return raw
        if raw is not MISSING:
            self.complain(field, "is no text", raw, "a text that is not blank")
        return ""

    def options(self, raw: object) -> tuple[str, ...]:
        """Four different texts, or the four pictures in order."""
        entries = self.items(raw, "options")
        few = entries[:_MOST_OPTIONS]
        found = [self.text(entry, f"options[{i}]") for i, entry in enumerate(few)]
        if entries and len(found) != len(LETTERS):
            self.complain("options", "are not four", len(entries), "four options")
        for i, option in enumerate(found):
            first = [_plain(other) for other in found].index(_plain(option))
            if option and first != i:
                told = f"is the same as option {LETTERS[first]}" if first < 4 else "stands twice"
                self.complain(f"options[{i}]", told, option, "four options that differ")
        if any(map(is_picture_option, found)):
            wanted = [f"<img{i}>" for i in range(1, len(LETTERS) + 1)]
            if found != wanted:
                self.complain("options", "are not the four pictures", found, " ".join(wanted))
        return tuple(found)

    def answer(self, raw: object, is_order: bool) -> tuple[int, ...]:
        """The index of one option, or of all four in an order."""
        letters = raw if isinstance(raw, str) else ""
        if is_order and sorted(letters) == list(LETTERS):
            return tuple(LETTERS.index(letter) for letter in letters)
        if not is_order and len(letters) == 1 and letters in LETTERS:
            return (LETTERS.index(letters),)
        if raw is not MISSING:
            allowed = "all of A, B, C, D in the right order" if is_order else "A, B, C or D"
            self.complain("answer", "is none of the options", raw, allowed)
        return ()

    def check_pictures(
        self, options: tuple[str, ...], pictures: tuple[QuestionPicture, ...]
    ) -> None:
        """Complain about pictures or marks of options that are missing, and pictures of none."""
        labels = {picture.label for picture in pictures} & set(LETTERS)
        wanted = set(LETTERS) if any(map(is_picture_option, options)) else set()
        if options and labels != wanted:
            missing, spare = sorted(wanted - labels), sorted(labels - wanted)
            told = "is missing for options" if missing else "is there for no option"
            self.complain("pictures", f"a picture {told}", missing or spare)
        if list(options) == [f"place {letter}" for letter in LETTERS]:
            marked = {mark.letter for picture in pictures for mark in picture.marks}
            if unmarked := sorted(set(LETTERS) - marked):
                allowed = "marks A to D where the options are places"
                self.complain("pictures", "no picture marks the places", unmarked, allowed)


def _plain(option: str) -> str:
    """An option as a reader takes it: letter case and spaces do not tell options apart."""
    return " ".join(option.lower().split())
