"""Every answer derived again: from the words, the scene, the pictures and the simulator."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain

from phyblock.domain.question import LETTERS, Question
from phyblock.errors import PhyblockError
from phyblock.making.questions.makers import MAKERS
from phyblock.making.questions.question_draft import UnfairError
from phyblock.making.workers import Workers

__all__ = ["problem_of", "verify_questions"]

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
