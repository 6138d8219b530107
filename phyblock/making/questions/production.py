"""Questions of all subtasks from a seed: drafts, their selection, letters, and answers found again.

Answers are random; what a reader sees beside them is balanced. Drafts of each kind are taken from
all scenes in turn, so that no scene dominates. Some of these are dropped at random until texts
and simple measures of the others reveal nothing (`keeping_odds`). From those, a greedy selection
takes the one of a hundred or so at a time that best balances those taken so far. Where options are
texts, it balances only kinds and sets of options: by scene, it would select answers, since large
scenes have larger numbers; by answer, those often right in some questions would be rare in others.
"""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from operator import attrgetter
from typing import Any

import numpy as np

from phyblock.domain.question import LETTERS, Mark, Question, QuestionPicture, Subtask
from phyblock.domain.scene import Scene
from phyblock.errors import DataError, PhyblockError, Problem
from phyblock.making.questions import dynamics, properties, relations, views
from phyblock.making.questions.base import BALANCE, Draft, Maker, pick, read_again, shuffled
from phyblock.making.questions.guesses import keeping_odds, measures_of
from phyblock.sim.question_pictures import filled
from phyblock.types import BACKGROUNDS, Background
from phyblock.workers import Workers

MAKERS: dict[Subtask, Maker] = {
    maker.subtask: maker
    for maker in (
        *(properties.ShapeMaker(), properties.ColorMaker(), properties.SizeMaker()),
        *(properties.NumberMaker(), relations.PositionMaker(), relations.DistanceMaker()),
        *(relations.DependencyMaker(), relations.RotationMaker()),
        *(properties.TallyMaker("OC"), properties.TallyMaker("LC"), properties.TallyMaker("TC")),
        *(views.ViewpointMaker(), dynamics.CounterfactualMaker(), dynamics.PredictiveMaker()),
        *(views.OrderingMaker(), dynamics.AffordanceMaker()),
    )
}
"""The makers of questions, by subtask; plugins add theirs."""
_LEAST_FILLED = 0.05
"""Minimum share of a picture that its blocks fill."""
_order = attrgetter("order")
_PLACES = range(len(LETTERS))


def make_questions(
    scenes: Sequence[Scene],
    wanted: Mapping[Subtask, int],
    seed: int,
    workers: Workers,
    track: Callable[[Iterable[Any], int, str], Iterable[Any]] = lambda items, *_: items,
) -> list[Question]:
    """Return the questions, subtask by subtask; the same for the same arguments.

    Drafts of a scene depend only on seed, subtask and scene; their selection and the right letters
    are drawn by seed and subtask. `track` may show progress: it gets the items, their number and a
    title. Raises DataError that names every subtask for which the scenes give too few questions.
    """
    questions: list[Question] = []
    short = []
    for subtask, count in wanted.items():
        # In random order, one of each level in turn.
        turns: Counter[int] = Counter()
        ranked = []
        for scene in shuffled(_rng(seed, subtask), scenes):
            turns[scene.level] += 1
            ranked.append((turns[scene.level], scene.level, (subtask, seed, scene)))
        tasks = [task for *_, task in sorted(ranked, key=lambda one: one[:2])]
        pool: list[Draft] = []
        for drafts in track(workers.map(scene_drafts, tasks), len(tasks), f"Drafting {subtask}"):
            pool += drafts
            if len(pool) >= MAKERS[subtask].spare * count:
                break
        rng = _rng(seed, subtask, "choice")
        chosen = select(pool, math.ceil(MAKERS[subtask].doubtful * count), rng)
        asked = (as_question("", subtask, one, _PLACES, BACKGROUNDS[0]) for one in chosen)
        found = zip(chosen, workers.map(problem_of, asked), strict=True)
        sure = (one for one, problem in found if problem is None)
        taken = list(islice(track(sure, count, f"Deriving {subtask}"), count))
        if len(taken) < count:
            message = f"the scenes give no more than {len(taken)} of {count} questions"
            short.append(Problem(subtask, message, hint="ask for fewer, or give more scenes"))
        # In random order, with random letters that are right about equally often.
        width, letters = max(3, len(str(len(taken)))), even_letters(len(taken), rng)
        for number, (one, right) in enumerate(zip(shuffled(rng, taken), letters, strict=True), 1):
            rest = shuffled(rng, [place for place in _PLACES if place != right])
            places = shuffled(rng, _PLACES) if subtask == "OR" else [right, *rest]
            name = f"{subtask.lower()}-{number:0{width}d}"
            questions.append(as_question(name, subtask, one, places, pick(rng, BACKGROUNDS)))
    if short:
        raise DataError(short)
    return questions


def scene_drafts(task: tuple[Subtask, int, Scene]) -> list[Draft]:
    """Return the drafts of a subtask about a scene; they depend only on these and the seed.

    Except for orders, they have measures of pictures by which the right option might stand out.
    """
    subtask, seed, scene = task
    maker, drafts = MAKERS[subtask], list[Draft]()
    for one in islice(maker.drafts(scene, _rng(seed, subtask, scene.id)), maker.drafts_a_scene):
        if subtask != "OR":
            measures = measures_of(as_question("", subtask, one, _PLACES, BACKGROUNDS[0]))
            one = replace(one, looks=tuple(map(tuple, measures.tolist())))
        drafts.append(one)
    return drafts


def _rng(seed: int, *parts: str) -> np.random.Generator:
    return np.random.default_rng(list("/".join((str(seed), *parts)).encode()))


def as_question(
    name: str, subtask: Subtask, draft: Draft, places: Sequence[int], background: Background
) -> Question:
    """Return the question of a draft; `places` are those of its options, in their order."""
    options: list[str] = [""] * len(places)
    pictures = list(draft.pictures)
    for place, option in sorted(zip(places, draft.options, strict=True), key=lambda one: one[0]):
        letter = LETTERS[place]
        if isinstance(option, QuestionPicture):
            options[place] = f"<img{place + 1}>"
            pictures.append(replace(option, label=letter))
        elif isinstance(option, Mark):
            options[place] = f"place {letter}"
            marks = (*pictures[0].marks, replace(option, letter=letter))
            pictures[0] = replace(pictures[0], marks=marks)
        else:
            options[place] = option
    return Question(
        id=name,
        subtask=subtask,
        scene=draft.scene,
        text=draft.text,
        options=tuple(options),
        answer=tuple(places) if subtask == "OR" else (places[0],),
        pictures=tuple(
            replace(one, blocks=tuple(sorted(one.blocks, key=_order)), background=background)
            for one in pictures
        ),
        wording=draft.wording,
        evidence={"slots": dict(draft.slots), **draft.facts},
    )


def problem_of(question: Question) -> str | None:
    """Return the problem of a question in one sentence, or None if its answer was found again."""
    maker = MAKERS.get(question.subtask)
    if maker is None:
        return "its subtask has no maker"
    small = [one.label for one in question.pictures if filled(one) < _LEAST_FILLED]
    if small:
        return f"blocks fill less than {_LEAST_FILLED:.0%} of the pictures {small}"
    try:
        derived = maker.answer(read_again(question))
    except PhyblockError as error:
        return str(error)
    except (LookupError, TypeError, ValueError) as error:
        # A wording, slots, words in them or pictures that are not of this kind of question.
        return f"its wording, slots or pictures cannot be read ({error!r})"
    if derived != question.answer:
        letters = "".join(LETTERS[index] for index in derived)
        return f"the answer is {letters}, not {question.answer_letters}"
    return None


# Selection of drafts

_LOOKED_AT = 100
_SPREAD = 20
"""Number of drafts considered per wanted one of a kind, if the pool has as many."""
_SPARE = 1.2
"""Minimum number of drafts kept per wanted one."""


def select(pool: Sequence[Draft], count: int, rng: np.random.Generator) -> list[Draft]:
    """Return at most `count` drafts, no two with one view or the same question of base scenes."""
    # For each kind, one of each scene in turn, several times as many as wanted.
    turns: dict[str, list[tuple[int, int]]] = defaultdict(list)
    of_scene: Counter[tuple[str, str]] = Counter()
    for i in rng.permutation(len(pool)).tolist():
        about = (pool[i].group, pool[i].scene.id)
        of_scene[about] += 1
        turns[pool[i].group].append((of_scene[about], i))
    spread = -(-_SPREAD * count // max(len(turns), 1))
    ranked = (sorted(group, key=lambda entry: entry[0])[:spread] for group in turns.values())
    every = [pool[i] for group in ranked for _, i in group]
    rank = rng.random(len(every)) / np.maximum(keeping_odds(every), 1e-9)
    most = max(int((rank <= 1).sum()), round(_SPARE * count))
    order = rank.argsort(kind="stable")
    left, rest = ([every[i] for i in some] for some in np.split(order, [most]))
    members: dict[Hashable, set[Hashable]] = defaultdict(set)
    for one in every:
        for group, member, _ in _even(one):
            members[group].add(member)
    counts: Counter[tuple[Hashable, Hashable]] = Counter()

    def cost(one: Draft) -> float:
        """Return the imbalance that a further draft adds to those taken; the lower the better."""
        cost = 0.0
        for group, member, weight in _even(one):
            others = [counts[group, other] for other in members[group]]
            cost += weight * (counts[group, member] - sum(others) / len(others))
        return cost

    taken: list[Draft] = []
    known: set[Hashable] = set()
    while (left or rest) and len(taken) < count:
        left = left or [rest.pop(0)]
        size = min(_LOOKED_AT, len(left))
        drawn = rng.choice(len(left), size=size, replace=False).tolist()
        chosen = left.pop(min(drawn, key=lambda i: cost(left[i])))
        if known.isdisjoint(_identities(chosen)):
            taken.append(chosen)
            known.update(_identities(chosen))
            counts.update((group, member) for group, member, _ in _even(chosen))
    return taken


def _even(draft: Draft) -> Iterator[tuple[Hashable, Hashable, float]]:
    """Yield groups, the draft's member of each, and weights; members should be equally frequent."""
    yield "kind", draft.group, 6.0
    if texts := draft.texts:
        yield ("options", draft.group), frozenset(texts), 0.2
    else:
        yield "scene", draft.scene.id, 3.0
        yield "level", draft.scene.level, 0.3


def _identities(draft: Draft) -> list[Hashable]:
    """Return keys that no two questions share: scene and view, or base scenes and content."""
    asked = (draft.scene.parents, draft.wording, tuple(sorted(draft.slots.items())), draft.about)
    views = [("view", draft.scene.id, one.view_deg) for one in draft.pictures[:1]]
    return [asked, *views]


def even_letters(count: int, rng: np.random.Generator) -> list[int]:
    """Return indices of the letters that are right, each share within `BALANCE`.

    Few questions may be just outside. If all shares were equal, some letters would reveal others.
    """
    # Rounded, since 0.28 of 150 is a little more than 42 in floating point.
    low, high = (round(share * count, 6) for share in BALANCE)
    while True:
        drawn = rng.integers(len(LETTERS), size=count)
        shares = np.bincount(drawn, minlength=len(LETTERS))
        if math.floor(low) <= shares.min() and shares.max() <= math.ceil(high):
            return [int(letter) for letter in drawn]
