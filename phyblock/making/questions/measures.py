"""Simple measures of a question's pictures, by which someone might guess without understanding.

Makers drop drafts until these tell nothing, and the audit learns from them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from phyblock.domain.question import LETTERS, Question
from phyblock.making.questions.base import Floats
from phyblock.sim.pictures import Shot
from phyblock.sim.question_pictures import SEEN_PX, changed_pixels, mark_pixel, seen

Mask = NDArray[np.bool_]
_BELOW_PX, _BANDS = 3, 6


def measures_of(question: Question) -> Floats:
    """Measures of each option beside the others, shape (options, measures); empty without any.

    Deviations from the mean of the options in standard deviations, and the absolute values of
    these less their mean.
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
