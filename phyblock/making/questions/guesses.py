"""Guessing an answer without understanding the question: features, and what they reveal of a set.

Texts have words and numbers, pictures have simple measures. Drafts are dropped until these reveal
nothing (`keeping_odds`). The audit of a set looks at the balance of answers and at repeated
questions, and has two probes that learn from questions about other base scenes and answer the rest:
one reads only the texts (logistic regression over words, numbers and likeness), one measures the
pictures without knowing what is in them (ridge regression): outlines, colors by height, what an
option changes and whether something is below that, where marks are. If either is right much more
often than chance, the set gives its answers away.
"""

from __future__ import annotations

import itertools
import math
import re
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import LETTERS, SUBTASKS, Question, Subtask
from phyblock.errors import Problem, SpecError
from phyblock.making.questions.base import BALANCE, Draft, Floats
from phyblock.sim.pictures import PictureStyle, Shot
from phyblock.sim.question_pictures import SEEN_PX, changed_pixels, mark_pixel, question_key, seen
from phyblock.text import plain_sum
from phyblock.tracks.questions import FOLDS, Folds, Rule, guesses_of, majority_rule

Mask = NDArray[np.bool_]
_BELOW_PX, _BANDS, _CROSSED = 3, 6, 0.25
_WORD = re.compile(r"[a-z]+|\d+(?:\.\d+)?")
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


def measures_of(question: Question) -> Floats:
    """Return measures of options relative to each other, shape (options, measures), or (0, 0).

    These are deviations from the mean of the options in standard deviations, and the absolute
    values of these less their mean; for a block marked X, products of text and place.
    """
    pictures = {picture.label: picture for picture in question.pictures}
    scene = pictures.get("scene")
    shots = [seen(pictures[letter]) for letter in LETTERS if letter in pictures]
    if not shots and not (scene and scene.marks):
        return np.empty((0, 0))
    start = seen(replace(scene, marks=())) if scene else None
    marks = (
        {mark.letter: mark_pixel(scene, mark.position_m) for mark in scene.marks} if scene else {}
    )
    if shots:
        values = np.array(list(_of_pictures(shots, start, marks.get("X"))))
    elif start and marks.keys() >= set(LETTERS):
        values = np.array([_of_place(start, marks[letter]) for letter in LETTERS])
    elif start and "X" in marks:
        # The same texts are always offered: the effect of a place is learned for each of them.
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
            # The share of the change's lower edge with something of the start right below it.
            edge = changed[:-_BELOW_PX] & ~changed[_BELOW_PX:]
            held = edge & (start.block[_BELOW_PX:] >= 0)
            row += [*_extent(changed), float(held.sum() / max(int(edge.sum()), 1))]
            recolored = np.abs(_colors_by_height(shot) - _colors_by_height(start))
            row += [*recolored.sum(axis=1).tolist(), float(recolored.sum())]
            if mark is not None:
                rows, columns = np.nonzero(changed)
                row.append(float(np.hypot(rows - mark[0], columns - mark[1]).min(initial=SEEN_PX)))
                row += [float(np.mean(columns) - mark[1]), float(np.mean(rows) - mark[0])]
        yield row


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
    """Return measures of a mark's place in the structure and in the visible part of its block."""
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
    """Return area, mean row and column, and extents of a mask [pixels]; zeros if it is empty."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return [0.0] * 5
    return [len(rows), *(float(f(line)) for f in (np.mean, np.ptp) for line in (rows, columns))]


def text_features(text: str, options: Sequence[str]) -> list[Mapping[str, float]]:
    """Return each option's features relative to the others and the question, by name, 0 if missing.

    These are the known shortcuts of multiple-choice questions: words that are often right, the
    largest or the middle number, the option that shares most with the others, the longest one.
    Letters are not among them: the share of each is counted, not learned.
    """
    words = [_WORD.findall(option.lower()) for option in options]
    asked = set(_WORD.findall(text.lower()))
    found = [_NUMBER.findall(option) for option in options]
    numbers = [float(one[0]) if len(one) == 1 else None for one in found]
    lengths = [len(option) for option in options]
    shared = [
        plain_sum(_overlap(one, other) for k, other in enumerate(words) if k != j)
        for j, one in enumerate(words)
    ]
    rows: list[Mapping[str, float]] = []
    for i, mine in enumerate(words):
        pairs = [" ".join(pair) for pair in itertools.pairwise(mine)]
        whole = " ".join(mine)
        rows.append(
            {
                **{f"option {word}": 1.0 for word in [*mine, *pairs, whole]},
                **{f"asked {one} option {whole}": _CROSSED for one in asked},
                "likeness": shared[i],
                "most alike": float(shared[i] == max(shared) > min(shared)),
                "least alike": float(shared[i] == min(shared) < max(shared)),
                **_rank("number", numbers, i),
                **_rank("length", lengths, i),
                "asked about": float(len(asked.intersection(mine))),
            }
        )
    return rows


def _rank(name: str, values: Sequence[float | None], i: int) -> dict[str, float]:
    known = [value for value in values if value is not None]
    mine = values[i]
    if mine is None or len(known) < len(values) or len(set(known)) < 2:
        return {}
    return {f"{name} rank {sum(value < mine for value in known)}": 1.0}


def _overlap(one: Sequence[str], other: Sequence[str]) -> float:
    union = set(one) | set(other)
    return len(set(one) & set(other)) / len(union) if union else 0.0


_STEPS, _RATE, _PENALTY = 60, 0.3, 2.0
_FITTED = 2000
"""Maximum number of drafts to learn from, spread over the pool."""


def keeping_odds(drafts: Sequence[Draft]) -> Floats:
    """Return the probability with which each draft is kept; 1 if there is nothing to guess by.

    A logistic regression of maximum penalized likelihood, fitted to half of the base scenes by
    AdaGrad (Duchi et al. 2011), guesses the answers about the other half.
    """
    # SciPy takes a while to import, and only the selection of drafts needs it.
    from scipy import sparse  # type: ignore[import-untyped]

    odds = np.ones(len(drafts))
    telling = [i for i, one in enumerate(drafts) if one.texts or one.looks]
    base_of = {i: (*drafts[i].scene.parents, drafts[i].scene.id)[0] for i in telling}
    half_of = {base: n % 2 for n, base in enumerate(sorted(set(base_of.values())))}
    halves = [[i for i in telling if half_of[base_of[i]] == half] for half in (0, 1)]

    def rows_of(one: Draft) -> Iterator[Mapping[str, float]]:
        """Yield the features of each option; those of texts are also given for its kind alone."""
        if one.looks:
            yield from ({f"{one.wording}: {i}": x for i, x in enumerate(row)} for row in one.looks)
            return
        together = " / ".join(sorted(one.texts))
        for option, features in zip(one.texts, text_features(one.text, one.texts), strict=True):
            own = {f"{one.group}: {name}": value for name, value in features.items()}
            yield {"": 1.0, **features, **own, f"{one.group}: {option} of {together}": 1.0}

    def table(chosen: Sequence[int], names: dict[str, int], grows: bool) -> sparse.csr_matrix:
        """Return the features of options, four rows per draft; new names are added or dropped."""
        values, columns, starts = list[float](), list[int](), [0]
        for features in itertools.chain.from_iterable(rows_of(drafts[i]) for i in chosen):
            known = {name: x for name, x in features.items() if grows or name in names}
            values += known.values()
            columns += (names.setdefault(name, len(names)) for name in known)
            starts.append(len(values))
        return sparse.csr_matrix((values, columns, starts), (len(starts) - 1, len(names)))

    for mine, known in (halves, halves[::-1]) if all(halves) else ():
        names: dict[str, int] = {}
        learned = table(known[:: -(-len(known) // _FITTED)], names, True)
        weights, squares = np.zeros(len(names)), np.full(len(names), 1e-9)
        is_right = np.zeros((learned.shape[0] // len(LETTERS), len(LETTERS)))
        is_right[:, 0] = 1.0
        for _ in range(_STEPS):
            missed = (is_right - _chances(learned @ weights)).ravel()
            slope = learned.T @ missed - _PENALTY * weights
            squares += slope**2
            weights += _RATE * slope / np.sqrt(squares)
        chances = _chances(table(mine, names, False) @ weights)
        odds[mine] = chances.min(axis=1) / chances[:, 0]
    return odds


def _chances(scores: Floats) -> Floats:
    """Return the probability of each of four options, shape (drafts, 4)."""
    by_draft = scores.reshape(-1, len(LETTERS))
    raised = np.exp(by_draft - by_draft.max(axis=1, keepdims=True))
    chances: Floats = raised / raised.sum(axis=1, keepdims=True)
    return chances


# Audit

GUESSABLE = 0.35
"""Accuracy that no probe of a sound set exceeds, unless chance is within its interval."""
_FEWEST, _RIDGE = 12, 4.0
_SEED, _STRENGTH = 0, 0.05


class Probe(NamedTuple):
    """The number of questions that a probe answered correctly, of `n`."""

    right: int
    n: int

    @property
    def accuracy(self) -> float:
        """Share of questions answered correctly."""
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
    and, if options are pictures, places or effects of removing a marked block, `pictures`, which is
    also reported by kind of question.
    """

    subtask: Subtask
    n: int
    letters: tuple[float, ...]
    chance: float
    probes: Mapping[str, Probe]
    repeats: tuple[str, ...]

    def findings(self) -> Iterator[str]:
        """Yield a sentence on each problem."""
        low, high = BALANCE
        if self.subtask != "OR" and not low <= min(self.letters) <= max(self.letters) <= high:
            yield f"{self.subtask}: a letter is right outside {low:.0%} to {high:.0%}"
        for name, probe in self.probes.items():
            if probe.accuracy > GUESSABLE and probe.interval[0] > self.chance:
                yield f"{self.subtask}: the {name} probe reaches {100 * probe.accuracy:.0f} %"
        yield from (f"{name}: asks what an earlier question asks" for name in self.repeats)


def audit_questions(questions: Sequence[Question]) -> Iterator[SubtaskAudit]:
    """Yield subtasks' audits in the paper's order. Raises SpecError without scikit-learn."""
    folds = Folds(questions)
    rules = {"majority": majority_rule, "text": text_rule}
    readers = {name: guesses_of(questions, rule) for name, rule in rules.items()}
    repeated = duplicates_of(questions)
    for subtask in SUBTASKS:
        mine = [question for question in questions if question.subtask == subtask]
        if not mine:
            continue
        n, first = len(mine), Counter(question.answer[0] for question in mine)
        probes = {
            name: Probe(sum(guesses(q) == q.answer for q in mine), n)
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


def text_rule(known: Sequence[Question]) -> Rule:
    """Return the rule that picks the likeliest option by logistic regression over its words.

    For an order, it picks the most frequent one. Raises SpecError without scikit-learn.
    """
    majority = majority_rule(known)
    single = [question for question in known if len(question.answer) == 1]
    if not single:
        return majority
    try:
        from sklearn.feature_extraction import DictVectorizer  # type: ignore[import-untyped]
        from sklearn.linear_model import LogisticRegression  # type: ignore[import-untyped]
    except ImportError as error:
        message = "the text probe needs scikit-learn, which is not installed"
        problem = Problem("text", message, hint="pip install 'phyblock[audit]'")
        raise SpecError(problem) from error
    vectorizer = DictVectorizer()
    regression = LogisticRegression(C=_STRENGTH, max_iter=1000, random_state=_SEED)
    rows = [features for q in single for features in text_features(q.text, q.options)]
    is_right = [index in q.answer for q in single for index in range(len(q.options))]
    regression.fit(vectorizer.fit_transform(rows), is_right)

    def guess(question: Question) -> tuple[int, ...]:
        if question.subtask == "OR":
            return majority(question)
        rows = vectorizer.transform(text_features(question.text, question.options))
        odds: Any = regression.decision_function(rows).tolist()
        return (max(range(len(odds)), key=odds.__getitem__),)

    return guess


def duplicates_of(questions: Sequence[Question]) -> dict[str, str]:
    """Return the ids of questions that repeat an earlier one, each with the id of that one.

    Equal questions look the same but for the background and the order of blocks and options.
    """
    first: dict[Hashable, str] = {}
    found: dict[str, str] = {}
    for question in questions:
        shown: dict[str, str] = {}
        for one in question.pictures:
            blocks, framed = (
                tuple(sorted(some, key=lambda b: (*b.kind, b.position_m, b.euler_deg)))
                for some in (one.blocks, one.framed)
            )
            plain = replace(one, background=None, blocks=blocks, framed=framed)
            shown[one.label] = question_key(plain, PictureStyle())
        options = [shown.pop(a, b) for a, b in zip(LETTERS, question.options, strict=False)]
        seen = (question.subtask, question.text, tuple(sorted(options)), tuple(shown.values()))
        if (twin := first.setdefault(seen, question.id)) != question.id:
            found[question.id] = twin
    return found


def picture_probe(questions: Sequence[Question], folds: Folds) -> dict[str, Probe]:
    """Answer questions by measures of their pictures alone, and return a probe for each kind.

    Ridge regression of being right (ordering: of the place in the order), learned from questions
    of the same kind that share no base scene. Kinds without measures are omitted.
    """
    rows_of = {q.id: measures_of(q) for q in questions}
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
            # Measures and values have a mean of zero over the four options. The right one has the
            # highest value, or in an order the first one.
            rows = np.vstack([rows_of[q.id] for q in known])
            values = np.zeros((len(known), len(LETTERS)))
            for value, q in zip(values, known, strict=True):
                value[list(q.answer)] = np.arange(len(q.answer), 0, -1)
            worth = (values - values.mean(axis=1, keepdims=True)).ravel()
            gram = rows.T @ rows + _RIDGE * np.eye(rows.shape[1])
            weights = np.linalg.solve(gram, rows.T @ worth)
            for question in held_out:
                order = np.argsort(-(rows_of[question.id] @ weights), kind="stable")
                right += tuple(order[: len(question.answer)]) == question.answer
                n += 1
        if n:
            found[kind] = Probe(right, n)
    return found
