"""What the candidate sets of a data set give away: where needed candidates stand, which pose comes
first, how many are offered, and how far plans get that never see the goal.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.plan import Plan
from phyblock.domain.scene import Scene
from phyblock.making.auditing.boosting import boosted, can_boost
from phyblock.scoring import Goal, match_plan, micro
from phyblock.stable import plain_sum
from phyblock.tracks.goal_blind.learning import (
    CONSTANT,
    FREQUENCIES,
    Learner,
    goal_blind_plans,
)
from phyblock.types import SETTINGS, Setting

__all__ = ["Blind", "Part", "Tells", "blind_scores", "find_tells", "learners"]


@dataclass(frozen=True)
class Part:
    """`part` of `whole`, and what chance would give of it on average."""

    part: int
    whole: int
    chance: float = 0.0

    @property
    def share(self) -> float | None:
        """The part over the whole, None where there is nothing."""
        return self.part / self.whole if self.whole else None


@dataclass(frozen=True)
class Tells:
    """Needed candidates by place, from 1, by chance the share of all candidates; needed kinds by
    how many poses are offered; and, of needed kinds that are offered in several poses, how often
    the one listed first is needed, by chance the share of needed poses of such a kind.
    """

    places: Mapping[int, Part]
    kinds: Mapping[int, Part]
    first_pose: Part


@dataclass(frozen=True)
class Blind:
    """F1 in [0, 1] under a setting with the optimal matcher, None where there is no scene.

    `every` names each candidate once as it is listed; `once` is the best that was learned without
    naming a candidate twice. `evenly` names all equally often, as often as it pays, and `learned`
    as often as was learned.
    """

    setting: Setting
    every: float | None
    once: float | None
    evenly: float | None
    learned: float | None


def learners() -> tuple[Learner, ...]:
    """The tables of frequencies, and gradient boosting where scikit-learn is installed."""
    return (*FREQUENCIES, boosted) if can_boost() else FREQUENCIES


def find_tells(tasks: Iterable[tuple[Scene, CandidateSet]]) -> Tells:
    """Count needed candidates by what shows before the goal is seen."""
    by_place: dict[int, list[bool]] = defaultdict(list)
    by_poses: dict[int, list[bool]] = defaultdict(list)
    firsts: list[tuple[bool, float]] = []
    for scene, offered in tasks:
        looks = {block.look for block in scene.blocks}
        needed = [candidate.look in looks for candidate in offered.candidates]
        kinds: dict[object, list[bool]] = defaultdict(list)
        for place, (candidate, is_needed) in enumerate(
            zip(offered.candidates, needed, strict=True), 1
        ):
            by_place[place].append(is_needed)
            kinds[candidate.kind].append(is_needed)
        for poses in kinds.values():
            by_poses[len(poses)].append(any(poses))
            if any(poses) and len(poses) > 1:
                firsts.append((poses[0], sum(poses) / len(poses)))
    every = [one for flags in by_place.values() for one in flags]
    chance = sum(every) / max(len(every), 1)
    chance_first = plain_sum(one for _, one in firsts) / max(len(firsts), 1)
    return Tells(
        {place: Part(sum(flags), len(flags), chance) for place, flags in sorted(by_place.items())},
        {poses: Part(sum(flags), len(flags)) for poses, flags in sorted(by_poses.items())},
        Part(sum(first for first, _ in firsts), len(firsts), chance_first),
    )


def blind_scores(
    tasks: Sequence[tuple[Scene, CandidateSet]], believed: Sequence[Learner]
) -> list[Blind]:
    """How far plans get in A and in B that were learned without seeing any goal of their own."""
    scenes = [scene for scene, _ in tasks]
    sets = {scene.id: offered for scene, offered in tasks}
    every = {name: Plan(tuple(range(1, len(one) + 1))) for name, one in sets.items()}
    scores = []
    for setting in SETTINGS:

        def f1(plans: Mapping[str, Plan], setting: Setting = setting) -> float | None:
            return _f1(tasks, plans, setting)

        once = goal_blind_plans(scenes, sets, setting, believed, repeats=False)
        evenly = goal_blind_plans(scenes, sets, setting, [CONSTANT])
        learned = goal_blind_plans(scenes, sets, setting, believed)
        scores.append(Blind(setting, f1(every), f1(once), f1(evenly), f1(learned)))
    return scores


def _f1(
    tasks: Iterable[tuple[Scene, CandidateSet]], plans: Mapping[str, Plan], setting: Setting
) -> float | None:
    return micro(
        match_plan(Goal(scene, offered, setting), plans[scene.id], "optimal").counts
        for scene, offered in tasks
    ).f1
