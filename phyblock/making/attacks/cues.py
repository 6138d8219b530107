"""Cues: a number for each option of a question, by its pixels alone.

A cue knows neither the question nor the rules of blocks. Whoever picks the option with the most of
it, or the least, must not be right much more often than one who guesses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from phyblock.making.attacks.looks import Look, Spot
from phyblock.sim.render import COLOR_RGB, Shot
from phyblock.sim.seeing import SEEN_PX, changed_pixels

__all__ = ["CUES", "MARK_CUES", "PICTURE_CUES", "SCENE_CUES", "Cue", "Floats", "cues_of"]

Floats = NDArray[np.float64]
Cue = Callable[[Look], Sequence[float]]
"""From a look at a question to a number for each option, in their order."""

_DARKEST_FACE = 60
_EDGE_STEP = 40
_FLAT_RISE = 0.99
_NOT_FLAT_M = 1.0
_NOWHERE_M = 2.0


def cues_of(look: Look) -> dict[str, Floats]:
    """All cues that a question has, by name: a number for each option, shape (options,)."""
    groups: list[Mapping[str, Cue]] = []
    if look.options:
        groups.append(PICTURE_CUES)
        groups += [SCENE_CUES] if look.scene is not None else []
    if look.spots:
        groups.append(MARK_CUES)
    return {
        name: np.asarray(cue(look), dtype=np.float64)
        for group in groups
        for name, cue in group.items()
    }


def _area(look: Look) -> list[float]:
    return [float(_shows(shot).sum()) for shot in look.options]


def _middle(axis: int) -> Cue:
    return lambda look: [_center(_shows(shot))[axis] for shot in look.options]


def _extent(axis: int) -> Cue:
    """Pixels from the first to the last row, or column, that shows a block."""

    def extents(look: Look) -> list[float]:
        lines = [np.flatnonzero(_shows(shot).any(axis=1 - axis)) for shot in look.options]
        return [float(np.ptp(line)) if len(line) else 0.0 for line in lines]

    return extents


def _brightness(look: Look) -> list[float]:
    return [
        float(shot.rgb[_shows(shot)].mean()) if _shows(shot).any() else 0.0 for shot in look.options
    ]


def _edges(look: Look) -> list[float]:
    """Pixels of blocks that differ much from the one to their right or below."""
    counts = []
    for shot in look.options:
        gray = np.where(_shows(shot), shot.rgb.mean(axis=2), 255.0)
        steps = [np.abs(np.diff(gray, axis=axis)) > _EDGE_STEP for axis in (0, 1)]
        counts.append(float(sum(step.sum() for step in steps)))
    return counts


def _oddness(look: Look) -> list[float]:
    """Pixels that differ from the other options, summed over them."""
    return [
        float(sum(changed_pixels(one, other).sum() for other in look.options if other is not one))
        for one in look.options
    ]


def _odd_colors(look: Look) -> list[float]:
    """How far the colors are from those of the other options, summed over them."""
    colors = [_colors(shot) for shot in look.options]
    return [sum(_apart(one, other) for other in colors) for one in colors]


def _changed(look: Look) -> list[float]:
    return [float(_changes(look, shot).sum()) for shot in look.options]


def _changed_middle(axis: int) -> Cue:
    return lambda look: [_center(_changes(look, shot))[axis] for shot in look.options]


def _other_colors(look: Look) -> list[float]:
    assert look.scene is not None
    colors = _colors(look.scene)
    return [_apart(colors, _colors(shot)) for shot in look.options]


PICTURE_CUES: Mapping[str, Cue] = {
    "colored area": _area,
    "row of the middle": _middle(0),
    "column of the middle": _middle(1),
    "height": _extent(0),
    "width": _extent(1),
    "brightness": _brightness,
    "edges": _edges,
    "unlike the others": _oddness,
    "colors unlike the others": _odd_colors,
}
"""Cues of options that are pictures."""
SCENE_CUES: Mapping[str, Cue] = {
    "unlike the scene": _changed,
    "row of the change": _changed_middle(0),
    "column of the change": _changed_middle(1),
    "colors unlike the scene": _other_colors,
}
"""Cues of options that are pictures and stand beside one of the scene."""


def _of_marks(measure: Callable[[Spot, Look], float]) -> Cue:
    return lambda look: [measure(spot, look) for spot in look.spots]


def _off_center(spot: Spot, look: Look) -> float:
    """Distance from the middle of the block under the mark [m], seen from above."""
    del look
    return _NOWHERE_M if spot.surface is None else spot.surface.off_center_m


def _off_center_of_flat(spot: Spot, look: Look) -> float:
    """The same, marks on faces that are not level behind all others."""
    is_flat = spot.surface is not None and spot.surface.rise >= _FLAT_RISE
    return _off_center(spot, look) + (0.0 if is_flat else _NOT_FLAT_M)


def _rise(spot: Spot, look: Look) -> float:
    del look
    return 0.0 if spot.surface is None else spot.surface.rise


def _height_m(spot: Spot, look: Look) -> float:
    del look
    return 0.0 if spot.surface is None else spot.surface.position_m[2]


def _from_middle(spot: Spot, look: Look) -> float:
    """Columns between the mark and the middle of all blocks."""
    assert look.scene is not None
    return abs(spot.pixel[1] - _center(_shows(look.scene))[1])


def _room(spot: Spot, look: Look) -> float:
    """Pixels from the mark to the nearest one that shows another block or the floor."""
    assert look.scene is not None
    others = np.argwhere(look.scene.block != look.scene.block[spot.pixel])
    return float(np.linalg.norm(others - np.array(spot.pixel), axis=1).min(initial=SEEN_PX))


def _size(spot: Spot, look: Look) -> float:
    """Pixels that show the block under the mark."""
    assert look.scene is not None
    vertex = look.scene.block[spot.pixel]
    return float((look.scene.block == vertex).sum()) if vertex >= 0 else 0.0


def _alone(spot: Spot, look: Look) -> float:
    """Pixels to the marks of the other options together."""
    places = [np.subtract(spot.pixel, other.pixel) for other in look.spots]
    return float(np.linalg.norm(places, axis=1).sum())


def _from_others(spot: Spot, look: Look) -> float:
    """Pixels to the nearest further mark, such as X; 0 where there is none."""
    places = [np.subtract(spot.pixel, other.pixel) for other in look.other_spots]
    return min((float(np.linalg.norm(place)) for place in places), default=0.0)


MARK_CUES: Mapping[str, Cue] = {
    "off center": _of_marks(_off_center),
    "off center or not level": _of_marks(_off_center_of_flat),
    "levelness": _of_marks(_rise),
    "height of the mark": _of_marks(_height_m),
    "row of the mark": _of_marks(lambda spot, _: float(spot.pixel[0])),
    "off the middle": _of_marks(_from_middle),
    "room round the mark": _of_marks(_room),
    "size of the marked block": _of_marks(_size),
    "apart from the others": _of_marks(_alone),
    "from other marks": _of_marks(_from_others),
}
"""Cues of options that are marks in the scene's picture."""
CUES = (*PICTURE_CUES, *SCENE_CUES, *MARK_CUES)
"""The names of all cues."""


def _shows(shot: Shot) -> NDArray[np.bool_]:
    shows: NDArray[np.bool_] = shot.block >= 0
    return shows


def _center(mask: NDArray[np.bool_]) -> tuple[float, float]:
    """Mean row and column of the pixels of a mask, the picture's middle where it is empty."""
    rows, columns = np.nonzero(mask)
    if not len(rows):
        return SEEN_PX / 2, SEEN_PX / 2
    return float(rows.mean()), float(columns.mean())


def _changes(look: Look, shot: Shot) -> NDArray[np.bool_]:
    assert look.scene is not None
    return changed_pixels(look.scene, shot)


def _colors(shot: Shot) -> Floats:
    """Shares of the pixels of faces by the block color that is nearest in hue, shape (colors,)."""
    pixels = shot.rgb[_shows(shot)].astype(np.float64)
    faces = pixels[pixels.max(axis=1) > _DARKEST_FACE]
    hues = np.array(list(COLOR_RGB.values()), dtype=np.float64)
    hues /= np.linalg.norm(hues, axis=1, keepdims=True)
    counts = np.bincount((faces @ hues.T).argmax(axis=1), minlength=len(hues)).astype(np.float64)
    return np.asarray(counts / max(counts.sum(), 1.0))


def _apart(one: Floats, other: Floats) -> float:
    return float(np.abs(one - other).sum())
