"""What the candidate sets of a data set give away, as a part of its card."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.making.auditing.tells import Blind, Part, Tells, blind_scores, find_tells
from phyblock.tracks.goal_blind.learning import FREQUENCIES

__all__ = ["MOST_SCENES", "given_away_text", "percent"]

MOST_SCENES = 1000
"""Larger sets are not learned from when their card is made, so that memory stays flat."""
_KNOWN: dict[str, tuple[str, str]] = {
    "places, needed least and most often": ("10.0, 58.8", "27.0, 80.2"),
    "first pose listed of a needed kind is needed": ("70.8", "57.8"),
    "the same by chance": ("37.8", "41.7"),
    "kinds offered in one pose that are needed": ("51.4", "67.4"),
    "kinds offered in several poses that are needed": ("100.0", "100.0"),
    "A: every candidate once": ("24.0", "26.9"),
    "A: learned, each once": ("29.6", "33.4"),
    "A: all equally often": ("25.9", "33.2"),
    "A: learned": ("36.8", "47.7"),
    "B: every candidate once": ("32.1", "41.2"),
    "B: learned, each once": ("42.3", "52.2"),
    "B: all equally often": ("48.7", "56.9"),
    "B: learned": ("47.3", "59.4"),
}
"""What was measured in the same way: version 1 of phyblock-400, and the official 400 scenes."""
_TEXT = """## What the candidates give away

In percent, beside the same of the first version of phyblock-400 and of the official 400 scenes:

| | this set | phyblock-400, version 1 | official |
|---|---|---|---|
{rows}

A and B are settings; their rows are F1 (optimal matcher) of plans made without seeing the goal.
Learned is by tables of frequencies over type, color, pose, place and numbers of poses and kinds,
from scenes that share no base scene. A set gives something away where "learned, each once" is
above "every candidate once", or "learned" above "all equally often"; naming candidates more than
once pays with any set, as goals have blocks that look alike. `phyblock scenes audit` measures it
with gradient boosting as well.

"""


def given_away_text(tasks: Sequence[tuple[Scene, CandidateSet]]) -> str:
    """A section of a card, in Markdown; empty without scenes and for more than `MOST_SCENES`."""
    if not 0 < len(tasks) <= MOST_SCENES:
        return ""
    values = [*_counted(find_tells(tasks)), *_scored(blind_scores(tasks, FREQUENCIES))]
    rows = "\n".join(
        f"| {name} | {value} | {first} | {official} |"
        for (name, (first, official)), value in zip(_KNOWN.items(), values, strict=True)
    )
    return _TEXT.format(rows=rows)


def _counted(tells: Tells) -> Iterator[str]:
    shares = [part.share or 0.0 for part in tells.places.values()]
    yield f"{percent(min(shares))}, {percent(max(shares))}"
    yield percent(tells.first_pose.share)
    yield percent(tells.first_pose.chance if tells.first_pose.whole else None)
    yield percent(_together(part for poses, part in tells.kinds.items() if poses == 1))
    yield percent(_together(part for poses, part in tells.kinds.items() if poses > 1))


def _scored(scores: Iterable[Blind]) -> Iterator[str]:
    for one in scores:
        yield from map(percent, (one.every, one.once, one.evenly, one.learned))


def _together(parts: Iterable[Part]) -> float | None:
    listed = list(parts)
    return Part(sum(part.part for part in listed), sum(part.whole for part in listed)).share


def percent(share: float | None) -> str:
    """A share in percent with one decimal; `n/a` for none."""
    return "n/a" if share is None else f"{100 * share:.1f}"
