"""Guessing an answer without understanding the question: features, and what they reveal of a set.

Texts have words and numbers, pictures have simple measures. Drafts are dropped until these reveal
nothing (`keeping_odds`). The audit of a set looks at the balance of answers and at repeated
questions, and has two probes that learn from questions about other base scenes and answer the rest:
one reads only texts (logistic regression over words, numbers and likeness), one measures pictures
(ridge regression): outlines, colors by height, what an option changes and whether something is
below that, where marks are. If either is much better than chance, the set gives answers away.
"""

from __future__ import annotations

import functools
import itertools
import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
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
from phyblock.tracks.questions import Rule, guesses_of, majority_rule

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
                **{f"asked {one} option {whole}": _CROSSED for one in sorted(asked)},
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
        from scipy.stats import binomtest  # type: ignore[import-untyped]

        low, high = binomtest(self.right, self.n).proportion_ci(method="wilson")
        return float(low), float(high)

    def __str__(self) -> str:
        low, high = self.interval
        return f"{100 * self.accuracy:.0f} [{100 * low:.0f}, {100 * high:.0f}]"


@dataclass(frozen=True)
class SubtaskAudit:
    """Facts about the questions of one subtask.

    `letters` are shares of right answers by letter (ordering: by the letter that comes first),
    `repeats` the questions that ask the same as an earlier one. `probes` are `majority`, `text`
    and, for questions whose pictures have measures, `pictures`, also by kind if there are several.
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
    by_id = {question.id: question for question in questions}
    measures = functools.cache(lambda name: measures_of(by_id[name]))
    learned_by = {"majority": majority_rule, "text": text_rule}
    learned_by["pictures"] = functools.partial(picture_rule, measures=measures)
    rules = {name: guesses_of(questions, learn) for name, learn in learned_by.items()}
    repeated = duplicates_of(questions)
    for subtask in SUBTASKS:
        mine = [question for question in questions if question.subtask == subtask]
        if not mine:
            continue
        n, first = len(mine), Counter(question.answer[0] for question in mine)
        asked = [(name, name, mine) for name in rules]
        for kind in dict.fromkeys(question.wording for question in mine):
            some = [question for question in mine if question.wording == kind]
            if len(some) < n:
                asked.append(("pictures", f"pictures, {kind}", some))
        probes = {}
        for rule, name, some in asked:
            guesses = [(rules[rule](question), question.answer) for question in some]
            if answered := [guess == answer for guess, answer in guesses if guess]:
                probes[name] = Probe(sum(answered), len(answered))
        letters = tuple(first[i] / n for i in range(len(LETTERS)))
        chance = 1 / 24 if subtask == "OR" else 1 / len(LETTERS)
        repeats = tuple(question.id for question in mine if question.id in repeated)
        yield SubtaskAudit(subtask, n, letters, chance, probes, repeats)


def text_rule(known: Sequence[Question]) -> Rule:
    """Return the rule that picks the likeliest option by logistic regression over its words, or the
    most frequent order. Raises SpecError without scikit-learn.
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


def picture_rule(known: Sequence[Question], measures: Callable[[str], Floats]) -> Rule:
    """Return the rule that ranks options by measures of their pictures, which it gets by id.

    Ridge regression of being right (ordering: of the place in the order), learned from questions
    with the same wording. Without measures, or with few known questions, the guess is empty.
    """

    @functools.cache
    def weights(wording: str) -> Floats | None:
        alike = [q for q in known if q.wording == wording and len(measures(q.id))]
        if len(alike) < _FEWEST:
            return None
        # Measures and values have a mean of zero over the four options. The right one has the
        # highest value, or in an order the first one.
        rows, values = np.vstack([measures(q.id) for q in alike]), np.zeros((len(alike), 4))
        for value, q in zip(values, alike, strict=True):
            value[list(q.answer)] = np.arange(len(q.answer), 0, -1)
        worth = (values - values.mean(axis=1, keepdims=True)).ravel()
        gram = rows.T @ rows + _RIDGE * np.eye(rows.shape[1])
        return np.asarray(np.linalg.solve(gram, rows.T @ worth))

    def guess(question: Question) -> tuple[int, ...]:
        rows = measures(question.id)
        learned = weights(question.wording) if len(rows) else None
        if learned is None:
            return ()
        order = np.argsort(-(rows @ learned), kind="stable")
        return tuple(order[: len(question.answer)].tolist())

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
