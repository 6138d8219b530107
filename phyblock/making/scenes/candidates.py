"""Candidate sets: the needed blocks, and distractors that other goals need as often.

Nothing may reveal whether a candidate is needed: neither its look, nor the number of poses in which
its kind is offered, nor its place in the list. So distractors are drawn at rates that make every
look needed in the same share of the sets that offer it.
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
"""Mean number of looks of a type and pose, over all its colors, that a goal of the grammar needs,
counted in 1,200 goals. Poses that no goal needs would give themselves away and are not offered."""
_EVEN_SHARE = 0.36
"""Share of the sets that offer a look in which it is needed: 5.76 of 16 on average."""
_RISING: tuple[tuple[BlockType, ...], ...] = (
    *(("arch",), ("cylinder",), ("cuboid2",), ("cuboid3",), ("cube",), ("cuboid1",)),
    ("triangle", "semi_cylinder"),
)
"""Types from those low in goals to those high in them. So naming all candidates as listed is
already a good building order, and a reader gains nothing by finding a better one."""
_TIERS = {block_type: tier for tier, types in enumerate(_RISING) for block_type in types}
_RARER: dict[BlockType, float] = {"triangle": 0.7}
"""Factors on how often a type is drawn as a distractor. Triangles have one color and six poses: in
setting B, where poses do not count, all of them are the same block offered repeatedly, and leaving
some out would pay."""
_MOST_DRAWN = 0.98
"""Upper limit: looks that more than `_EVEN_SHARE` of all goals need are nearly always offered."""


def make_candidates(
    scene: Scene, seed: int = 0, *, palette: tuple[Kind, ...] = KIT_PALETTE
) -> CandidateSet:
    """Return up to `MAX_CANDIDATES` candidates that look different, with all that a scene needs.

    Types that are low in goals come first, else the order is random. The same scene id and seed
    give the same set everywhere. Raises DataError if the scene needs more looks.
    """
    needed: dict[Look, Candidate] = {}
    for block in scene.blocks:
        needed.setdefault(block.look, Candidate(block.type, block.color, block.euler_deg))
    if len(needed) > MAX_CANDIDATES:
        allowed = f"at most {MAX_CANDIDATES}"
        message = "needs more different blocks than a candidate set holds"
        raise DataError(Problem(scene.id, message, "blocks", str(len(needed)), allowed))
    salt = f"{seed}/{scene.id}"
    # The rate per unit of time at which each look that some goal needs is drawn as a distractor:
    # the probability of being drawn within one unit gives the look its even share.
    colors = Counter(block_type for block_type, _ in palette)
    others: dict[Candidate, float] = {}
    for block_type, color in palette:
        added = dict.fromkeys(POSES[block_type], _EVEN_SHARE)
        for pose, count in NEEDED.get(block_type, added).items():
            share = count / colors[block_type]
            drawn = min(share * (1 / _EVEN_SHARE - 1) / (1 - share), _MOST_DRAWN)
            one = Candidate(block_type, color, POSES[block_type][pose])
            if one.look not in needed:
                others[one] = -math.log1p(-drawn) * _RARER.get(block_type, 1.0)

    def waiting(one: Candidate) -> float:
        """Draw a candidate's exponential waiting time (Efraimidis and Spirakis 2006)."""
        return -math.log(_drawn(one, f"{salt}/drawn")) / others[one]

    def place(one: Candidate) -> tuple[int, float]:
        return _TIERS.get(one.type, len(_RISING)), _drawn(one, f"{salt}/place")

    distractors = sorted(others, key=waiting)[: MAX_CANDIDATES - len(needed)]
    return CandidateSet(tuple(sorted([*needed.values(), *distractors], key=place)))


def _drawn(candidate: Candidate, salt: str) -> float:
    """Return a number in (0, 1) from a hash: the same on every platform and Python."""
    digest = drawn_bytes(f"{salt}/{candidate}")
    return (int.from_bytes(digest[:6], "big") + 0.5) / 2**48
