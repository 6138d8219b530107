"""A question with its options in another order, everything that names a letter along with them."""

from __future__ import annotations

from dataclasses import replace

from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, is_picture_option

__all__ = ["rotated", "rotated_label"]


def rotated(question: Question, by: int) -> Question:
    """The same question with option `by` as A, the next as B, and so on round.

    What belongs to an option keeps its place in the world and takes the option's new letter: a
    picture that is an option, a lettered place that the options name.
    """
    n = len(question.options)
    moved = tuple(question.options[(i + by) % n] for i in range(n))
    names_letters = all(map(is_picture_option, question.options)) or _names_marks(question)
    pictures = tuple(_relabeled(picture, by, n, question) for picture in question.pictures)
    return replace(
        question,
        options=question.options if names_letters else moved,
        answer=tuple((index - by) % n for index in question.answer),
        pictures=pictures,
    )


def rotated_label(label: str, by: int, n: int) -> str:
    """What a picture's label becomes; those that are no option's stay."""
    if label not in LETTERS[:n]:
        return label
    return LETTERS[(LETTERS.index(label) - by) % n]


def _relabeled(picture: QuestionPicture, by: int, n: int, question: Question) -> QuestionPicture:
    marks = picture.marks
    if _names_marks(question):
        marks = tuple(Mark(rotated_label(m.letter, by, n), m.position_m) for m in marks)
    return replace(picture, label=rotated_label(picture.label, by, n), marks=marks)


def _names_marks(question: Question) -> bool:
    """Whether the options name places lettered in a picture: `place A`, `place B`, ..."""
    marked = {mark.letter for picture in question.pictures for mark in picture.marks}
    letters = LETTERS[: len(question.options)]
    return marked.issuperset(letters) and all(
        option.split()[-1:] == [letter]
        for option, letter in zip(question.options, letters, strict=True)
    )
