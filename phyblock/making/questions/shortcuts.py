"""A question set held against shortcuts: balance, guessing, repeats, what the pictures show."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from phyblock.domain.question import LETTERS, SUBTASKS, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Block
from phyblock.making.questions.letters import BALANCE
from phyblock.making.questions.picture_view import shares
from phyblock.making.questions.question_draft import UnfairError
from phyblock.making.questions.referring import resolve
from phyblock.models.guesses import Guesses
from phyblock.stable import plain_sum

__all__ = ["GUESSABLE", "SubtaskAudit", "audit_questions", "duplicates_of", "referents"]

GUESSABLE = 0.32
"""What guessing without a picture may reach: chance plus noise."""
_DIGITS = 6


@dataclass(frozen=True)
class SubtaskAudit:
    """What the questions of one subtask are worth.

    `letters` counts right answers by letter, for ordering by permutation; `majority` and
    `text_only` are the accuracies of the probes, `chance` that of uniform guessing; `ambiguous`
    questions have options that read alike, `duplicates` the words, options and pictures of an
    earlier one. `least_seen` is the least visible share of a block that is named, with its
    question, None where none is named in words; `hidden` counts those of the `named` blocks that
    show less than a quarter of themselves. `scenes` are asked about, `most_of_a_scene` questions
    about the one with most.
    """

    subtask: Subtask
    n: int
    letters: dict[str, int]
    values: int
    majority: float
    text_only: float | None
    chance: float
    ambiguous: tuple[str, ...]
    duplicates: tuple[str, ...]
    least_seen: tuple[float, str] | None
    hidden: int
    named: int
    scenes: int
    most_of_a_scene: int
    bases: int

    @property
    def letter_shares(self) -> tuple[float, float]:
        """The smallest and the largest share of a letter, of an order of a first picture."""
        counts = Counter(dict.fromkeys(LETTERS, 0))
        for answer, count in self.letters.items():
            counts[answer[0]] += count
        return min(counts.values()) / self.n, max(counts.values()) / self.n

    @property
    def is_balanced(self) -> bool:
        """Whether every letter is right about as often as the others; orders are not judged."""
        if self.subtask == "OR":
            return True
        low, high = self.letter_shares
        return BALANCE[0] <= low and high <= BALANCE[1]


def audit_questions(
    questions: Sequence[Question],
    *,
    with_text_probe: bool = True,
) -> Iterator[SubtaskAudit]:
    """An audit of each subtask that has questions, in the paper's order.

    Raises SpecError where the text-only probe is wanted and scikit-learn is not installed.
    """
    guesses = Guesses(questions)
    repeated = duplicates_of(questions)
    for subtask in SUBTASKS:
        mine = [question for question in questions if question.subtask == subtask]
        if mine:
            yield _audit(subtask, mine, guesses, repeated, with_text_probe)


def duplicates_of(questions: Sequence[Question]) -> dict[str, str]:
    """Questions that ask what an earlier one asks, in any order of options, with that one's id."""
    first: dict[str, str] = {}
    repeats = {}
    for question in questions:
        earlier = first.setdefault(_content(question), question.id)
        if earlier != question.id:
            repeats[question.id] = earlier
    return repeats


def referents(question: Question) -> dict[int, float]:
    """Visible share of each block that question or options name in words, by its order.

    Of static questions alone: where marks or pictures say what is meant, nothing is named. An
    option that names a block says "the"; one without is a shape, which no block is meant by.
    """
    picture = question.pictures[0] if question.pictures else None
    if picture is None or picture.label != "scene":
        return {}
    slots = question.evidence.get("slots", {})
    named: set[int] = set()
    blocks = [option for option in question.options if option.startswith("the ")]
    for text in (*(str(slot) for slot in slots.values()), *blocks):
        named.update(_named(text, picture))
    seen = shares(picture) if named else {}
    return {order: seen[order] for order in sorted(named)}


def _audit(
    subtask: Subtask,
    questions: Sequence[Question],
    guesses: Guesses,
    repeated: dict[str, str],
    with_text_probe: bool,
) -> SubtaskAudit:
    seen: list[tuple[float, str]] = []
    for question in questions:
        seen += [(share, question.id) for share in referents(question).values()]
    scenes = Counter(question.scene.id for question in questions)
    chances = [1 / math.factorial(4) if subtask == "OR" else 1 / len(q.options) for q in questions]
    return SubtaskAudit(
        subtask=subtask,
        n=len(questions),
        letters=dict(sorted(Counter(q.answer_letters for q in questions).items())),
        values=len({q.answer if subtask == "OR" else q.options[q.answer[0]] for q in questions}),
        majority=_accuracy("majority", questions, guesses),
        text_only=_accuracy("text-only", questions, guesses) if with_text_probe else None,
        chance=plain_sum(chances) / len(chances),
        ambiguous=tuple(q.id for q in questions if _reads_alike(q)),
        duplicates=tuple(q.id for q in questions if q.id in repeated),
        least_seen=min(seen, default=None),
        hidden=sum(share < _LEAST_SEEN for share, _ in seen),
        named=len(seen),
        scenes=len(scenes),
        most_of_a_scene=max(scenes.values()),
        bases=len({base for q in questions for base in q.scene.parents or (q.scene.id,)}),
    )


_LEAST_SEEN = 0.25


def _accuracy(probe: str, questions: Sequence[Question], guesses: Guesses) -> float:
    right = sum(guesses.guess(probe, question) == question.answer for question in questions)
    return right / len(questions)


def _named(text: str, picture: QuestionPicture) -> tuple[int, ...]:
    """The block that a text names; none where it is no expression, or fits several."""
    try:
        orders = resolve(text.lower(), picture)
    except UnfairError:
        return ()
    return orders if len(orders) == 1 else ()


def _reads_alike(question: Question) -> bool:
    plain = {" ".join(option.lower().split()) for option in question.options}
    return len(plain) < len(question.options)


def _content(question: Question) -> str:
    """What a reader of the question sees, its options in no order."""
    pictures = {
        picture.label: [
            picture.view_deg,
            sorted(_drawn(block) for block in picture.blocks),
            sorted((_rounded(mark.position_m), mark.letter) for mark in picture.marks),
        ]
        for picture in question.pictures
    }
    shown = [json.dumps(part) for label, part in pictures.items() if label not in LETTERS]
    options = [
        json.dumps(pictures[letter]) if letter in pictures else option
        for letter, option in zip(LETTERS, question.options, strict=False)
    ]
    return json.dumps([question.subtask, question.text, shown, sorted(options)])


def _drawn(block: Block) -> tuple[object, ...]:
    return block.type, block.color, _rounded(block.position_m), _rounded(block.euler_deg)


def _rounded(numbers: Sequence[float]) -> tuple[float, ...]:
    return tuple(round(number, _DIGITS) + 0.0 for number in numbers)
