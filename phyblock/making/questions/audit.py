"""Audit of a question set: balance of answers, repeats, and probes that answer blindly.

Two probes learn from questions about other base scenes and answer the rest: one reads only the
texts (logistic regression over words, numbers and likeness), one measures the pictures without
knowing what is in them (ridge regression): outlines, colors by height, what an option changes and
whether something is below that, where marks are. Where either is right much more often than chance,
the set gives its answers away.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import LETTERS, SUBTASKS, Question, QuestionPicture, Subtask
from phyblock.making.questions.production import BALANCE
from phyblock.making.questions.text_probe import text_rule
from phyblock.sim.pictures import Shot
from phyblock.sim.question_pictures import SEEN_PX, changed_pixels, mark_pixel, seen
from phyblock.tracks.baselines import FOLDS, Folds, Guesses, majority_rule

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
GUESSABLE = 0.35
"""Accuracy that no probe of a sound set exceeds, unless chance is within its interval."""
_FEWEST = 12
_RIDGE = 4.0
_BELOW_PX, _BANDS = 3, 6


class Probe(NamedTuple):
    """The number of questions that a probe answered rightly, of `n`."""

    right: int
    n: int

    @property
    def accuracy(self) -> float:
        """Share of questions answered rightly."""
        return self.right / self.n

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson score interval of 95 %."""
        z, n, p = 1.96, self.n, self.accuracy
        middle = (p + z * z / (2 * n)) / (1 + z * z / n)
        half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
        return middle - half, middle + half


@dataclass(frozen=True)
class SubtaskAudit:
    """Facts about the questions of one subtask.

    `letters` are shares of right answers by letter (ordering: by the letter that comes first),
    `repeats` the questions that ask the same as an earlier one. `probes` are `majority`, `text`
    and, where options are pictures, places or what follows from a mark, `pictures`, which is told
    by kind of question as well.
    """

    subtask: Subtask
    n: int
    letters: tuple[float, ...]
    chance: float
    probes: Mapping[str, Probe]
    repeats: tuple[str, ...]

    def findings(self) -> Iterator[str]:
        """Yield what is wrong, a sentence each."""
        low, high = BALANCE
        if self.subtask != "OR" and not low <= min(self.letters) <= max(self.letters) <= high:
            yield f"{self.subtask}: a letter is right outside {low:.0%} to {high:.0%}"
        for name, probe in self.probes.items():
            if probe.accuracy > GUESSABLE and probe.interval[0] > self.chance:
                yield f"{self.subtask}: the {name} probe reaches {100 * probe.accuracy:.0f} %"
        yield from (f"{name}: asks what an earlier question asks" for name in self.repeats)


def audit_questions(questions: Sequence[Question]) -> Iterator[SubtaskAudit]:
    """Yield an audit of each subtask that has questions, in the paper's order.

    Raises SpecError where scikit-learn, which the text probe uses, is not installed.
    """
    folds = Folds(questions)
    readers = {"majority": Guesses(questions, majority_rule), "text": Guesses(questions, text_rule)}
    repeated = duplicates_of(questions)
    for subtask in SUBTASKS:
        mine = [question for question in questions if question.subtask == subtask]
        if not mine:
            continue
        n, first = len(mine), Counter(question.answer[0] for question in mine)
        probes = {
            name: Probe(sum(guesses.guess(q) == q.answer for q in mine), n)
            for name, guesses in readers.items()
        }
        by_kind = picture_probe(mine, folds)
        if by_kind:
            right, shown = (sum(counts) for counts in zip(*by_kind.values(), strict=True))
            probes["pictures"] = Probe(right, shown)
        if len(by_kind) > 1:
            probes |= {f"pictures, {kind}": probe for kind, probe in by_kind.items()}
        chances = [1 / math.factorial(4) if subtask == "OR" else 1 / len(q.options) for q in mine]
        yield SubtaskAudit(
            subtask=subtask,
            n=n,
            letters=tuple(first[i] / n for i in range(len(LETTERS))),
            chance=math.fsum(chances) / n,
            probes=probes,
            repeats=tuple(q.id for q in mine if q.id in repeated),
        )


def duplicates_of(questions: Sequence[Question]) -> dict[str, str]:
    """Return questions that ask what an earlier one asks, whatever the order of options, with the
    id of that one.
    """
    first: dict[str, str] = {}
    earlier = {one.id: first.setdefault(_content(one), one.id) for one in questions}
    return {name: twin for name, twin in earlier.items() if twin != name}


def _content(question: Question) -> str:
    """Everything that a reader of the question sees, its options in no order, as JSON."""

    def rounded(numbers: Sequence[float]) -> tuple[float, ...]:
        return tuple(round(number, 6) + 0.0 for number in numbers)

    def recipe(picture: QuestionPicture) -> str:
        blocks = sorted(
            (b.type, b.color, rounded(b.position_m), rounded(b.euler_deg)) for b in picture.blocks
        )
        marks = sorted((rounded(mark.position_m), mark.letter) for mark in picture.marks)
        return json.dumps([picture.view_deg, blocks, marks])

    pictures = {picture.label: recipe(picture) for picture in question.pictures}
    shown = [recipe for label, recipe in pictures.items() if label not in LETTERS]
    options = [pictures.get(a, b) for a, b in zip(LETTERS, question.options, strict=False)]
    return json.dumps([question.subtask, question.text, shown, sorted(options)])


def picture_probe(questions: Sequence[Question], folds: Folds) -> dict[str, Probe]:
    """Answer questions by measures of their pictures alone, and return a probe for each kind.

    Ridge regression of being right (ordering: of the place in the order), learned from questions
    of the same kind that share no base scene. Kinds whose options are not seen are left out.
    """
    rows_of = {q.id: _measures(q) for q in questions}
    kinds: dict[str, list[Question]] = {}
    for question in questions:
        if len(rows_of[question.id]):
            kinds.setdefault(question.wording.rstrip("-0123456789"), []).append(question)
    found: dict[str, Probe] = {}
    for kind, members in kinds.items():
        right = n = 0
        for fold in range(FOLDS):
            held_out = [q for q in members if folds.of(q) == fold]
            known = [q for q in members if folds.is_known(fold, q)]
            if not held_out or len(known) < _FEWEST:
                continue
            # The means over the four options are zero, and so is that of what each is worth.
            rows = np.vstack([rows_of[q.id] for q in known])
            worth = np.concatenate([_worth(q) for q in known])
            gram = rows.T @ rows + _RIDGE * np.eye(rows.shape[1])
            weights = np.linalg.solve(gram, rows.T @ worth)
            for question in held_out:
                order = np.argsort(-(rows_of[question.id] @ weights), kind="stable")
                right += tuple(order[: len(question.answer)]) == question.answer
                n += 1
        if n:
            found[kind] = Probe(right, n)
    return found


def _worth(question: Question) -> Floats:
    """1 for the right option and 0 for others, less the mean; in an order, the first most."""
    worth = np.zeros(len(question.options))
    worth[list(question.answer)] = np.arange(len(question.answer), 0, -1)
    return np.asarray(worth - worth.mean())


def _measures(question: Question) -> Floats:
    """Measures of each option beside the others, shape (options, measures); empty without any.

    Deviations from the mean of the options in standard deviations, and the absolute values of
    these less their mean.
    """
    pictures = {picture.label: picture for picture in question.pictures}
    scene = pictures.get("scene")
    start = seen(replace(scene, marks=())) if scene else None
    marks = (
        {mark.letter: mark_pixel(scene, mark.position_m) for mark in scene.marks} if scene else {}
    )
    shots = [seen(pictures[letter]) for letter in LETTERS if letter in pictures]
    if shots:
        values = np.array(list(_of_pictures(shots, start, marks.get("X"))))
    elif start and marks.keys() >= set(LETTERS):
        values = np.array([_of_place(start, marks[letter]) for letter in LETTERS])
    elif start and "X" in marks:
        # The same texts are offered each time: what a place says is learned for each text.
        about = np.array([1.0, *_of_place(start, marks["X"])])
        offered = sorted(question.options)
        each = [np.eye(len(offered))[offered.index(option)] for option in question.options]
        crossed = np.array([np.outer(one, about).ravel() for one in each])
        return np.asarray(crossed - crossed.mean(axis=0))
    else:
        return np.empty((0, 0))
    spread = values.std(axis=0)
    steps = (values - values.mean(axis=0)) / np.where(spread > 1e-9, spread, 1.0)
    return np.hstack([steps, np.abs(steps) - np.abs(steps).mean(axis=0)])


def _of_pictures(
    shots: Sequence[Shot], start: Shot | None, mark: tuple[int, int] | None
) -> Iterator[list[float]]:
    """Yield measures of each picture that is an option."""
    for i, shot in enumerate(shots):
        others = [changed_pixels(shot, other) for k, other in enumerate(shots) if k != i]
        mask, alone = shot.block >= 0, np.sum(others, axis=0) >= len(others) - 1
        color = shot.rgb[mask].mean(axis=0) if mask.any() else np.zeros(3)
        row = [*_extent(mask), *color, float(np.sum(others)), *_extent(alone)]
        if start is not None:
            changed = changed_pixels(start, shot)
            row += [*_extent(changed), _share_held(start, changed)]
            row += np.abs(_colors_by_height(shot) - _colors_by_height(start)).sum(axis=1).tolist()
            row.append(float(np.abs(_colors_by_height(shot) - _colors_by_height(start)).sum()))
            if mark is not None:
                rows, columns = np.nonzero(changed)
                row.append(float(np.hypot(rows - mark[0], columns - mark[1]).min(initial=SEEN_PX)))
                row += [float(np.mean(columns) - mark[1]), float(np.mean(rows) - mark[0])]
        yield row


def _share_held(start: Shot, changed: Mask) -> float:
    """Return the share of a change's lower edge with something of the start right below it."""
    edge = changed[:-_BELOW_PX] & ~changed[_BELOW_PX:]
    held = edge & (start.block[_BELOW_PX:] >= 0)
    return float(held.sum() / max(int(edge.sum()), 1))


def _colors_by_height(shot: Shot) -> Floats:
    """Return the mean color of the blocks in each of six bands from top to bottom, shape (6, 3)."""
    rows = np.nonzero(shot.block >= 0)[0]
    ends = np.linspace(rows.min(initial=SEEN_PX), rows.max(initial=0) + 1, _BANDS + 1).astype(int)
    bands = np.zeros((_BANDS, 3))
    for band, low, high in zip(bands, ends[:-1], ends[1:], strict=True):
        mask = shot.block[low:high] >= 0
        if mask.any():
            band += shot.rgb[low:high][mask].mean(axis=0) / 255
    return bands


def _of_place(start: Shot, at: tuple[int, int]) -> list[float]:
    """Return where a mark is in the structure, and how much shows of its block and around it."""
    rows, columns = np.nonzero(start.block >= 0)
    mine = start.block == start.block[at]
    room = np.hypot(*(np.argwhere(~mine) - at).T).min(initial=SEEN_PX) / SEEN_PX
    block_rows, block_columns = np.nonzero(mine)
    area = max(len(rows), 1)
    return [
        float((at[0] - rows.mean()) / max(np.ptp(rows), 1)),
        float((at[1] - columns.mean()) / max(np.ptp(columns), 1)),
        float((rows < at[0]).sum() / area),
        float(mine.sum() / area),
        float(room),
        float(len(np.unique(start.block)) / 20),
        float((at[1] - block_columns.mean()) / SEEN_PX),
        float((at[0] - block_rows.mean()) / SEEN_PX),
    ]


def _extent(mask: Mask) -> list[float]:
    """Area, mean row and column, and extents of a mask [pixels]; zeros where it is empty."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return [0.0] * 5
    return [len(rows), *(float(f(line)) for f in (np.mean, np.ptp) for line in (rows, columns))]
