"""What an attack stronger than those of `phyblock vqa audit` finds in two kinds of questions.

    python benchmarks/evidence/strong_attack.py [QUESTIONS]

QUESTIONS are a bundled set or a folder; phyblock-vqa unless named. A random forest learns, in five
folds over base scenes, which of four options is right from numbers about pixels: of colored
outcomes of removals (`cf-color`) with and without those that need to know which block is X, and of
marked places (AD). It knows nothing of weights and supports.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from sklearn.ensemble import RandomForestClassifier

from phyblock.domain.question import LETTERS, Question
from phyblock.making.cli.question_sets import read_question_set
from phyblock.making.questions.wording import slots_of
from phyblock.models.guesses import FOLDS, Folds
from phyblock.sim.seeing import SEEN_PX, mark_pixel, seen

Floats = NDArray[np.float64]
Features = Callable[[Question], Floats]
"""A row of numbers for each option."""

TREES, LEAST_LEAF, LEAST_LEARNED = 300, 5, 12
NEAR_PX, ABOVE_PX = 12, 40
DIRECTIONS = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1))
OF_X = (3, 4, 5, 6, 7)
"""Columns of `colored_lots` that tell how many pieces a lot has and how it lies to X."""


def colored_lots(question: Question) -> Floats:
    """How much is colored, in how many pieces, where, how far from X and how scattered."""
    scene = replace(question.pictures[0], marks=())
    (mark,) = (mark for mark in question.pictures[0].marks if mark.letter == "X")
    row, column = mark_pixel(scene, mark.position_m)
    blocks, color = seen(scene).block, slots_of(question)["color"]
    lots = []
    for picture in question.pictures[1:]:
        moved = [place for place, block in enumerate(picture.blocks) if block.color == color]
        mask = np.isin(blocks, moved)
        rows, columns = np.nonzero(mask) if mask.any() else (np.array([row]), np.array([column]))
        far = ndimage.distance_transform_edt(~mask)[row, column] if mask.any() else 0.0
        pieces = ndimage.label(mask)[1]
        to_x = ((rows < row).mean(), abs(columns.mean() - column), rows.mean() - row)
        spread = (rows.min(), columns.mean(), rows.std(), columns.std())
        share = len(moved) / len(picture.blocks)
        lots.append([mask.any(), mask.sum(), len(moved), pieces, far, *to_x, share, *spread])
    return np.array(lots, dtype=np.float64)


def colored_alone(question: Question) -> Floats:
    """The same without what needs to know which block is X, and in how many pieces a lot is."""
    return np.delete(colored_lots(question), OF_X, axis=1)


def marked_places(question: Question) -> Floats:
    """How far the block at a mark reaches on all sides, what is near and above it, and where."""
    scene = replace(question.pictures[0], marks=())
    shot = seen(scene)
    places = []
    for letter in LETTERS:
        (mark,) = (mark for mark in question.pictures[0].marks if mark.letter == letter)
        row, column = mark_pixel(scene, mark.position_m)
        here = shot.block[row, column]
        runs = [_run(shot.block, row, column, *step) for step in DIRECTIONS]
        rows = slice(max(row - NEAR_PX, 0), row + NEAR_PX)
        near = shot.block[rows, max(column - NEAR_PX, 0) : column + NEAR_PX]
        above = shot.block[max(row - ABOVE_PX, 0) : row, column]
        over = (above >= 0).mean() if len(above) else 0.0
        around = ((near < 0).mean(), (near == here).mean(), shot.rgb[row, column].mean(), over)
        where = (column, row, mark.position_m[2])
        places.append([*runs, min(runs), np.mean(runs), *around, *where])
    return np.array(places, dtype=np.float64)


def _run(blocks: NDArray[np.int32], row: int, column: int, down: int, right: int) -> int:
    """Pixels of one block in a direction."""
    count = 0
    while (
        0 <= row + down * count < SEEN_PX
        and 0 <= column + right * count < SEEN_PX
        and blocks[row + down * count, column + right * count] == blocks[row, column]
    ):
        count += 1
    return count


def found_by_forest(questions: Sequence[Question], features: Features) -> tuple[int, float]:
    """How many questions were answered, and the share of right answers."""
    numbers = [_against_each_other(features(question)) for question in questions]
    is_right = [np.arange(len(LETTERS)) == question.answer[0] for question in questions]
    folds, hits = Folds(questions), []
    for fold in range(FOLDS):
        asked = [i for i, question in enumerate(questions) if folds.of(question) == fold]
        known = [i for i, question in enumerate(questions) if folds.is_known(fold, question)]
        if not asked or len(known) < LEAST_LEARNED:
            continue
        forest = RandomForestClassifier(TREES, min_samples_leaf=LEAST_LEAF, random_state=0)
        forest.fit(np.vstack([numbers[i] for i in known]), np.hstack([is_right[i] for i in known]))
        guesses = (forest.predict_proba(numbers[i])[:, 1].argmax() for i in asked)
        hits += [is_right[i][guess] for i, guess in zip(asked, guesses, strict=True)]
    return len(hits), float(np.mean(hits)) if hits else float("nan")


def _against_each_other(options: Floats) -> Floats:
    """Numbers of the options as standard scores, their sizes, and ranks among the four."""
    spread = options.std(axis=0)
    scores = (options - options.mean(axis=0)) / np.where(spread > 0, spread, 1.0)
    return np.hstack([scores, np.abs(scores), options.argsort(axis=0).argsort(axis=0)])


def main() -> None:
    """Print what the forest finds in each kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("questions", nargs="?", default="phyblock-vqa")
    tasks = read_question_set(parser.parse_args().questions).tasks
    questions = [task.question for task in tasks]
    colored = [one for one in questions if one.wording.startswith("cf-color")]
    marked = [one for one in questions if one.subtask == "AD"]
    for name, asked, features in (
        ("cf-color, X known", colored, colored_lots),
        ("cf-color, X not known", colored, colored_alone),
        ("AD", marked, marked_places),
    ):
        count, share = found_by_forest(asked, features)
        print(f"{name}: {100 * share:.0f} % of {count} (chance 25 %)")


if __name__ == "__main__":
    main()
