"""Questions of all subtasks: sound, even, derived again, found when spoiled; the built-in set."""

import itertools
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from phyblock.data.questions import StoredQuestion, read_questions
from phyblock.domain.blocks import COLORS
from phyblock.domain.question import LETTERS, SUBTASKS, rotated
from phyblock.errors import DataError
from phyblock.making.files import check_sums, question_card
from phyblock.making.questions.dynamics import OUTCOME_TEXTS
from phyblock.making.questions.guesses import audit_questions, duplicates_of
from phyblock.making.questions.production import MAKERS, make_questions, problem_of
from phyblock.making.questions.sight import LEAST_PIXELS, palette
from phyblock.sim.contact import find_gaps
from phyblock.sim.engine import other_engine
from phyblock.sim.pictures import COLOR_RGB
from phyblock.sim.question_pictures import is_inside, least_difference, seen
from phyblock.workers import open_workers
from tests.shipped import DATA, TASKS, built_in_questions
from tests.workspace import questions as asked_questions
from tests.workspace import write_questions as write_asked

FOLDER = DATA / "phyblock-vqa"
SCENES = {task.scene.id: task.scene for task in TASKS}
SOME = list(SCENES.values())[3::40]
STATIC = ("SH", "CO", "SI", "NU", "RP", "AP", "RD", "RR", "OC", "LC", "TC")
ASKED = {
    "VP": (2, ("l3-061-house", "l4-051-combined", "l4-073-combined")),
    "CF": (5, ("l1-001-animal", "l1-025-bridge", "l2-001-animal", "l2-021-slide")),
    "PD": (2, ("l2-010-stair", "l2-028-gate", "l3-011-stair")),
    "OR": (2, ("l3-023-stair", "l3-028-arcade", "l3-029-bridge")),
}
"""Scenes that are quick to ask about."""
COUNT = 3


def made(scenes, wanted, seed=0, jobs=1):
    with open_workers(jobs) as workers:
        return make_questions([*scenes], wanted, seed, workers)


def wrong_answer(question, by=1):
    turned = question.answer[1:] + question.answer[:1]
    wrong = turned if len(turned) > 1 else ((turned[0] + by) % len(LETTERS),)
    return replace(question, answer=wrong)


@pytest.fixture(scope="module")
def static():
    return made(SOME, dict.fromkeys(STATIC, COUNT))


@pytest.fixture(scope="module")
def pictured():
    return [q for s, (n, names) in ASKED.items() for q in made(map(SCENES.get, names), {s: n})]


def test_every_answer_is_derived_again_and_every_other_is_found_out(static, pictured):
    assert Counter(q.subtask for q in static) == dict.fromkeys(STATIC, COUNT)
    assert Counter(q.subtask for q in pictured) == {s: n for s, (n, _) in ASKED.items()}
    for number, question in enumerate((*static, *pictured)):
        assert problem_of(question) is None, question.id
        assert "the answer is" in problem_of(wrong_answer(question, 1 + number % 3))


def test_what_was_changed_is_found(static):
    for question in static:
        options = list(question.options)
        options[question.answer[0]] = "the purple ball"
        changed = [{"text": question.text.replace("the ", "a ")}, {"options": tuple(options)}]
        if question.wording.endswith("-all"):
            picture = replace(question.pictures[0], blocks=question.scene.blocks[:1])
            changed.append({"pictures": (picture,)})
        for change in changed:
            other = replace(question, **change)
            assert other == question or problem_of(other) is not None


def test_pictures_of_options_are_whole_and_told_apart(pictured):
    for question in pictured:
        options = [picture for picture in question.pictures if picture.label in LETTERS]
        assert all(map(is_inside, question.pictures))
        if options:
            assert len(options) == len(LETTERS)
            assert least_difference([seen(option) for option in options]) >= LEAST_PIXELS
        if question.subtask == "VP":
            # No color and no height tells the right one.
            held = [
                sorted((round(100 * b.position_m[2]), b.color) for b in one.blocks)
                for one in options
            ]
            assert held == [held[0]] * len(LETTERS)
        if question.wording in ("cf-color", "pd-next"):
            assert not any(find_gaps(picture.blocks, 0.004) for picture in question.pictures)
        if question.wording == "cf-count":
            assert sorted(question.options) == sorted(OUTCOME_TEXTS)
        if question.subtask == "OR":
            # Nothing is larger or smaller for being early: one outline, two colors.
            shots = [seen(picture).block >= 0 for picture in question.pictures]
            assert all((shot == shots[0]).all() for shot in shots)
            assert all(len({b.color for b in one.blocks}) == 2 for one in question.pictures)


def test_pictures_that_were_changed_are_found_out(pictured):
    colored = next(q for q in pictured if q.wording == "cf-color")
    gray = {tuple(replace(b, color="red") for b in one.blocks) for one in colored.pictures}
    assert (len(gray), len({one.blocks for one in colored.pictures})) == (1, 5)
    unnamed = next(color for color in COLORS if color not in colored.evidence["slots"].values())
    shown, first, *rest = colored.pictures
    kept = next(b for b in first.blocks if b.order != colored.evidence["removed"])
    blocks = tuple(replace(b, color=unnamed) if b is kept else b for b in first.blocks)
    spoiled = replace(colored, pictures=(shown, replace(first, blocks=blocks), *rest))
    assert problem_of(spoiled) == (
        "picture A does not show the whole structure in the colors of the text"
    )
    matching = next(q for q in pictured if q.wording == "vp-match")
    shown, *options = matching.pictures
    right = options[matching.answer[0]]
    copied = (replace(right, label=one.label) for one in options)
    spoiled = replace(matching, pictures=(shown, *copied))
    assert problem_of(spoiled) == "4 of 4 options are right"


def test_processes_and_other_subtasks_change_nothing_and_the_seed_does():
    def lines(seed, jobs, *subtasks):
        found = made(SOME[:4], dict.fromkeys(subtasks, COUNT), seed, jobs)
        return [StoredQuestion.of(q, SCENES[q.scene.id]).as_json() for q in found]

    both = lines(1, 1, "CO", "RP")
    assert both == lines(1, 2, "CO", "RP") != lines(2, 1, "CO", "RP")
    assert both == lines(1, 1, "CO") + lines(1, 1, "RP")


def test_too_few_scenes_are_told_for_all_subtasks_at_once():
    with pytest.raises(DataError, match="the scenes give no more than") as told:
        made(SOME[:1], {"OC": 99, "NU": 99})
    assert [problem.where for problem in told.value.problems] == ["OC", "NU"]


@pytest.fixture(scope="module")
def built_in():
    return [task.question for task in built_in_questions().tasks]


def test_the_built_in_set_is_whole_and_even(built_in):
    counts = {s: MAKERS[s].count for s in SUBTASKS}
    assert Counter(q.subtask for q in built_in) == counts
    assert not duplicates_of(built_in)
    for subtask in SUBTASKS:
        answers = [question.answer for question in built_in if question.subtask == subtask]
        if subtask == "OR":
            assert len(set(answers)) > 12
            continue
        shares = [answers.count((index,)) / len(answers) for index in range(len(LETTERS))]
        assert 0.22 <= min(shares) <= max(shares) <= 0.28
    n_summed, wrong = check_sums(FOLDER)
    assert n_summed
    assert wrong == ()
    shipped = (FOLDER / "CARD.md").read_text(encoding="utf-8")
    made_by = shipped.split("\n\n    ", 1)[1].splitlines()[0]
    if not other_engine():
        assert question_card(FOLDER.name, "phyblock-400", built_in, made_by) == shipped


@pytest.mark.parametrize("every", [37, pytest.param(1, marks=pytest.mark.slow)])
def test_answers_of_the_built_in_set_are_derived_again(built_in, every):
    by_subtask = itertools.groupby(built_in, lambda question: question.subtask)
    some = [question for _, of in by_subtask for question in list(of)[7 % every :: every]]
    assert {q.id: problem for q in some if (problem := problem_of(q))} == {}
    if every == 1:
        assert all(problem_of(wrong_answer(question)) is not None for question in built_in[3::44])


def test_places_that_no_mark_shows_are_found_out(built_in):
    first = next(question for question in built_in if question.subtask == "AD")
    scene, block = first.pictures
    bare = replace(first, pictures=(replace(scene, marks=scene.marks[1:]), block))
    assert problem_of(bare) == "no block is marked A"


def lab(rgb, seen_as):
    """CIELAB (D65) of a color as it is seen, by a matrix of linear sRGB."""
    linear = np.clip(seen_as @ ((np.array(rgb) / 255 + 0.055) / 1.055) ** 2.4, 0, 1)
    x, y, z = np.cbrt(TO_XYZ @ linear / (0.9505, 1.0, 1.0888))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


TO_XYZ = np.array([(0.4125, 0.3576, 0.1804), (0.2127, 0.7152, 0.0722), (0.0193, 0.1192, 0.9503)])
SEEN_AS = {
    "all": np.eye(3),
    "no red": np.array([(0.1124, 0.8876, 0), (0.1124, 0.8876, 0), (0.0040, -0.0040, 1)]),
    "no green": np.array([(0.2928, 0.7072, 0), (0.2928, 0.7072, 0), (-0.0223, 0.0223, 1)]),
}
"""Red and green blindness in linear sRGB (Vienot, Brettel and Mollon 1999)."""


@pytest.mark.parametrize("seen_as", SEEN_AS.values(), ids=SEEN_AS)
def test_colors_of_a_question_are_told_apart_by_everybody(seen_as):
    drawn = {frozenset(palette(np.random.default_rng(seed))) for seed in range(20)}
    assert [len(colors) for colors in drawn] == [3, 3]
    for colors in drawn:
        for one, other in itertools.combinations(colors, 2):
            apart = np.linalg.norm(lab(COLOR_RGB[one], seen_as) - lab(COLOR_RGB[other], seen_as))
            assert apart >= 20


@pytest.fixture(scope="module")
def asked(tmp_path_factory, towers):
    """Eight questions of each subtask, to be audited."""
    folder = tmp_path_factory.mktemp("audited") / "questions"
    found = read_questions(write_asked(folder, asked_questions(per_subtask=8)), towers)
    every = [task.question for task in found.tasks]
    return {subtask: [one for one in every if one.subtask == subtask] for subtask in SUBTASKS}


def audit_of(questions):
    pytest.importorskip("sklearn")
    (audit,) = audit_questions(questions)
    return audit


def test_letters_are_counted_and_balance_is_judged(asked):
    for step, letters in ((1, (0.25,) * 4), (4, (1, 0, 0, 0))):
        audit = audit_of([replace(q, answer=(step * n % 4,)) for n, q in enumerate(asked["SH"])])
        assert audit.letters == letters
        assert any("a letter is right" in one for one in audit.findings()) == (step == 4)


def test_a_repeat_is_found_in_any_order_of_its_options_and_blocks(asked):
    for subtask in ("SH", "VP", "AD"):
        first = asked[subtask][0]
        found = duplicates_of([first, replace(rotated(first, 1), id="again")])
        assert found == ({} if subtask == "AD" else {"again": first.id})
        pictures = tuple(replace(one, blocks=one.blocks[::-1]) for one in first.pictures)
        listed = replace(first, id="again", pictures=pictures)
        assert duplicates_of([first, listed]) == {"again": first.id}
    assert duplicates_of(itertools.chain(*asked.values())) == {}


def test_a_text_or_a_picture_that_gives_the_answer_away_is_a_finding(asked):
    cubes = [
        replace(q, id=f"sh-{n}", answer=(q.options.index("cube"),))
        for n, q in enumerate(5 * asked["SH"])
    ]
    lacking = []
    for number, first in enumerate(5 * asked["VP"]):
        scene, option, *_ = first.pictures
        shown = [replace(option, label=letter) for letter in LETTERS]
        right = number % 4
        shown[right] = replace(shown[right], blocks=option.blocks[:-1])
        lacking.append(replace(first, id=f"vp-{number}", pictures=(scene, *shown), answer=(right,)))
    for probe, given_away in (("text", cubes), ("pictures", lacking)):
        audit = audit_of(given_away)
        assert audit.probes[probe] == (40, 40)
        assert any(f"{probe} probe" in finding for finding in audit.findings())
