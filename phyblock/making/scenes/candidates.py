"""Candidate sets: the needed blocks among distractors that other goals need as often.

Whether a candidate is needed shall not show in what it is, in which pose, in how many poses its
kind is offered, or in where it stands. So a distractor is drawn as often as makes every look
needed in the same share of the sets that offer it.
"""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path

from phyblock.domain.blocks import KIT_PALETTE, BlockType
from phyblock.domain.scene import MAX_CANDIDATES, Candidate, CandidateSet, Kind, Look, Scene
from phyblock.errors import DataError, Problem
from phyblock.files import read_own_yaml
from phyblock.making.scenes.sketch import POSES
from phyblock.text import drawn_bytes

NEEDED: dict[BlockType, dict[str, float]] = read_own_yaml(Path(__file__).with_name("needed.yaml"))
"""Looks of a type and pose that a goal of the grammar needs on average, over its colors:
counted in 1,200 goals. Poses that no goal needs give themselves away and are not offered.
"""
_EVEN_SHARE = 0.36
"""A look is to be needed in this share of the sets that offer it: 5.76 of 16 on average."""
_RISING: tuple[tuple[BlockType, ...], ...] = (
    *(("arch",), ("cylinder",), ("cuboid2",), ("cuboid3",), ("cube",), ("cuboid1",)),
    ("triangle", "semi_cylinder"),
)
"""From the types that goals have low to those that they have high: whoever names all candidates as
they are listed names them in a good order to build in, and wins nothing by finding a better one.
"""
_TIERS = {block_type: tier for tier, types in enumerate(_RISING) for block_type in types}
_RARER: dict[BlockType, float] = {"triangle": 0.7}
"""Factors on how often a type is drawn as a distractor. Triangles are of one color in six poses: to
setting B, where a pose does not count, all of them are one block offered again and again, and
leaving some out would pay.
"""
_MOST_DRAWN = 0.98
"""The most: looks that more than `_EVEN_SHARE` of all goals need are offered nearly always."""


def make_candidates(
    scene: Scene, seed: int = 0, *, palette: tuple[Kind, ...] = KIT_PALETTE
) -> CandidateSet:
    """Return up to `MAX_CANDIDATES` candidates that look different, with all that a scene needs.

    Distractors come from `palette`. Types that goals have low stand first, candidates of one type
    in an order that is drawn. The same scene id and seed give the same set everywhere. Raises
    DataError when the scene needs more looks than that.
    """
    needed: dict[Look, Candidate] = {}
    for block in scene.blocks:
        needed.setdefault(block.look, Candidate(block.type, block.color, block.euler_deg))
    if len(needed) > MAX_CANDIDATES:
        allowed = f"at most {MAX_CANDIDATES}"
        message = "needs more different blocks than a candidate set holds"
        raise DataError(Problem(scene.id, message, "blocks", str(len(needed)), allowed))
    salt = f"{seed}/{scene.id}"
    others = {one: rate for one, rate in _rates(palette).items() if one.look not in needed}

    def waiting(one: Candidate) -> float:
        """Draw a candidate's exponential waiting time (Efraimidis and Spirakis 2006)."""
        return -math.log(_drawn(one, f"{salt}/drawn")) / others[one]

    def place(one: Candidate) -> tuple[int, float]:
        return _TIERS.get(one.type, len(_RISING)), _drawn(one, f"{salt}/place")

    distractors = sorted(others, key=waiting)[: MAX_CANDIDATES - len(needed)]
    return CandidateSet(tuple(sorted([*needed.values(), *distractors], key=place)))


def _rates(palette: tuple[Kind, ...]) -> dict[Candidate, float]:
    """Rate at which each look that some goal needs is drawn as a distractor, over one unit of
    time: one is drawn within it where it is not needed as often as its even share asks.
    """
    colors = Counter(block_type for block_type, _ in palette)
    rates = {}
    for block_type, color in palette:
        added = dict.fromkeys(POSES[block_type], _EVEN_SHARE)
        for pose, needed in NEEDED.get(block_type, added).items():
            share = needed / colors[block_type]
            drawn = min(share * (1 / _EVEN_SHARE - 1) / (1 - share), _MOST_DRAWN)
            one = Candidate(block_type, color, POSES[block_type][pose])
            rates[one] = -math.log1p(-drawn) * _RARER.get(block_type, 1.0)
    return rates


def _drawn(candidate: Candidate, salt: str) -> float:
    """A number in (0, 1) by a hash: the same on every platform and Python."""
    digest = drawn_bytes(f"{salt}/{candidate}")
    return (int.from_bytes(digest[:6], "big") + 0.5) / 2**48
