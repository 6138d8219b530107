"""Plans with poses that baselines answer, and what came of them; `pose` makes its tables of it."""

from __future__ import annotations

import os
import resource
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from phyblock.datasets import AssemblyTask
from phyblock.domain import Block, PoseStep
from phyblock.parsing import parse_poses
from phyblock.sim.carry import CarriedStep, CarryLimits, carry_out
from phyblock.sim.placing import put
from phyblock.sim.registry import PHYSICS_VARIABLE, installed_engines
from phyblock.sim.site import settle
from phyblock.tracks.pose_planning.baselines import POSE_RULES, PoseSubject
from phyblock.tracks.pose_planning.judging import (
    Earlier,
    PoseJudgement,
    PoseRules,
    judge_poses,
)
from phyblock.tracks.pose_planning.track import PosePlanning
from phyblock.types import PoseRotation

ROTATIONS: tuple[PoseRotation, ...] = ("candidate", "free")
LEAST_IOU = 0.98


@dataclass(frozen=True)
class Answer:
    """A scene as it is shown, what a baseline answers, and by which rules it is judged."""

    item: AssemblyTask
    text: str
    rules: PoseRules

    @classmethod
    def of(cls, task: AssemblyTask, baseline: str, seed: int, rotation: PoseRotation) -> Answer:
        """What a baseline answers for a seed."""
        rules = PoseRules(rotation, ("A",), ("optimal",), CarryLimits(), 1.0, 10.0)
        item = PosePlanning(rules).shown(task, seed)
        subject = PoseSubject(item.scene, item.candidates, rules.is_free)
        text = POSE_RULES[baseline](subject, np.random.default_rng(seed))
        return cls(item, text, rules)

    def judged(self, earlier: Earlier | None = None) -> PoseJudgement:
        """What it is worth."""
        return judge_poses(self.item, self.text, self.rules, earlier)

    @property
    def steps(self) -> tuple[PoseStep, ...]:
        """The plan."""
        n = len(self.item.candidates)
        return parse_poses(self.text, n, free=self.rules.is_free).plan.steps

    @property
    def blocks(self) -> tuple[Block | None, ...]:
        """The blocks where its steps put them."""
        return tuple(put(step, self.item.candidates) for step in self.steps)

    def ended_as(self, other: PoseJudgement, blocks: Sequence[Block | None]) -> Earlier | None:
        """What became of another plan, where this one puts the same blocks at the same poses."""
        if self.blocks != blocks:
            return None
        return Earlier(self.steps, self.rules.told, other.ended)


@dataclass(frozen=True)
class Verdict:
    """What came of a plan; `judge_s` is what judging it took of the processor."""

    scene: str
    seed: int
    n_blocks: int
    ends: tuple[str, ...]
    iou: float
    right: tuple[int, ...]
    aligned: tuple[int, ...]
    judge_s: float
    cpu_s: float
    peak_mb: float
    is_anew: bool = True

    @classmethod
    def of(
        cls, found: PoseJudgement, item: AssemblyTask, seed: int, times_s: tuple[float, float]
    ) -> Verdict:
        """What a judgement says, and the times when the plan and the judging were begun."""
        absolute, aligned = found.poses
        ends = tuple(step.end for step in found.ended.steps)
        peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        now_s = time.process_time()
        judge_s, cpu_s = now_s - times_s[1], now_s - times_s[0]
        outcome = (ends, found.ended.iou, absolute.right, aligned.right)
        return cls(item.key, seed, len(item.scene), *outcome, judge_s, cpu_s, peak_mb)

    @property
    def stands(self) -> bool:
        """Whether every step does."""
        return set(self.ends) == {"stands"}

    @property
    def is_near(self) -> bool:
        """Whether what stands in the end is where the goal is."""
        return self.iou >= LEAST_IOU

    @property
    def is_right(self) -> bool:
        """Whether F1 is 100 at every tolerance."""
        return set(self.right) == {self.n_blocks} == {len(self.ends)}

    @property
    def faults(self) -> str:
        """Why it is not as it should be; empty where it is."""
        wrong = [f"step {n} {end}" for n, end in enumerate(self.ends, 1) if end != "stands"]
        wrong += [] if self.is_near else [f"IoU {self.iou:.4f}"]
        wrong += [] if self.is_right else [f"{min(self.right)} right of {self.n_blocks}"]
        return ", ".join(wrong)


Plan = tuple[AssemblyTask, str, int, PoseRotation]
"""A scene, the baseline that answers it, the seed of its order, and `pose.rotation`."""


def judged(plan: Plan) -> Verdict:
    """Judge one plan."""
    task, baseline, seed, rotation = plan
    begun_s = time.process_time()
    answer = Answer.of(task, baseline, seed, rotation)
    made_s = time.process_time()
    return Verdict.of(answer.judged(), answer.item, seed, (begun_s, made_s))


def oracles(task: AssemblyTask, seeds: range) -> tuple[bool, list[tuple[Verdict, Verdict]]]:
    """Whether a scene stands when it is finished, and its true poses under both rotations."""
    verdicts = []
    for seed in seeds:
        begun_s = time.process_time()
        shown, free = (Answer.of(task, "oracle", seed, rotation) for rotation in ROTATIONS)
        made_s = time.process_time()
        first = shown.judged()
        one = Verdict.of(first, shown.item, seed, (begun_s, made_s))
        again_s = time.process_time()
        earlier = free.ended_as(first, shown.blocks)
        other = Verdict.of(free.judged(earlier), free.item, seed, (again_s, again_s))
        verdicts.append((one, replace(other, is_anew=earlier is None)))
    return settle(task.scene.blocks).stands, verdicts


def ends_by_engine(plan: Plan) -> tuple[tuple[CarriedStep, ...], ...]:
    """How the steps of a plan end in every engine that is installed.

    The plan is the same for all: its order is sought in the first of them.
    """
    engines = installed_engines()
    os.environ[PHYSICS_VARIABLE] = engines[0]
    blocks = Answer.of(*plan).blocks
    ends = []
    for engine in engines:
        os.environ[PHYSICS_VARIABLE] = engine
        ends.append(carry_out(blocks).steps)
    return tuple(ends)
