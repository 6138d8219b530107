"""The pose-planning track: a whole plan that says where every block goes, setting C.

It asks about the same scenes and candidates as full planning, so that one table says what the pose
costs a model.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from phyblock.data import AssemblyTask
from phyblock.domain import PoseStep
from phyblock.models.base import Image, Request
from phyblock.parsing.text import READER_VERSION
from phyblock.records import Record
from phyblock.sim.dynamics import ExecutedStep
from phyblock.sim.geometry import upright
from phyblock.tracks.base import CARRYING, READER, engine_identity
from phyblock.tracks.pose_planning.baselines import PoseSubject
from phyblock.tracks.pose_planning.ended import Ended
from phyblock.tracks.pose_planning.judging import (
    CARRY_VERSION,
    Earlier,
    PoseJudgement,
    PoseRules,
    judge_poses,
)
from phyblock.tracks.pose_planning.pictures import PosePictures
from phyblock.tracks.pose_planning.record import PoseRecord, kept_rests
from phyblock.tracks.prompts import Prompt
from phyblock.tracks.showing import ShownTask, TaskShowing
from phyblock.tracks.whole_plans import AS_IN_FILE, WholePlanTrack

__all__ = ["PosePlanning"]


class PosePlanning(WholePlanTrack[PoseRules, PosePictures]):
    """Prompt, parse and score of the track; pictures and physics are worked out elsewhere."""

    name = "pose_planning"

    def __init__(
        self,
        rules: PoseRules,
        prompt: Prompt | None = None,
        pictures: PosePictures | None = None,
        items: Sequence[AssemblyTask] = (),
        showing: TaskShowing = AS_IN_FILE,
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording."""
        super().__init__(rules, prompt, pictures, items, showing)

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """The scene as a seed shows it; where steps bring a rotation, each kind once, upright."""
        shown = super().shown(item, seed)
        if not self.rules.is_free:
            return shown
        kit, numbers = upright(shown.candidates)
        if isinstance(shown, ShownTask):
            numbers = tuple(shown.order[number - 1] for number in numbers)
            return replace(shown, candidates=kit, order=numbers)
        return ShownTask(shown.scene, kit, shown.composite, numbers, shown, seed)

    def identity(self) -> dict[str, Any]:
        """Name and version of the prompt, a digest of all that decides the pictures, the
        versions of the reader and of how plans are carried out, and the physics engine where it is
        another one than PyBullet.
        """
        return {
            **super().identity(),
            READER: READER_VERSION,
            CARRYING: CARRY_VERSION,
            **engine_identity(),
        }

    def outlines(self, item: AssemblyTask) -> Iterator[tuple[Request, bool]]:
        """The one request, made without rendering, and whether its pictures are the real ones."""
        yield from super().outlines(item if isinstance(item, ShownTask) else self.shown(item, 0))

    def facts(self, item: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """What templates may use; nothing in it gives an answer away."""
        return {**super().facts(item, pictures), "rotation": self.rules.rotation}

    def _subject(self, item: AssemblyTask) -> PoseSubject:
        return PoseSubject(item.scene, item.candidates, self.rules.is_free)

    def judge(self, item: AssemblyTask, text: str | None) -> PoseJudgement:
        """Read, score and carry out a reply; None, where there is none, is an empty plan."""
        return judge_poses(item, text, self.rules)

    async def judge_apart(
        self, item: AssemblyTask, text: str | None, earlier: Record | None
    ) -> PoseJudgement:
        """What `judge` gives, worked out in another process, or in a thread without one.

        A plan that an earlier record holds is not carried out again.
        """
        work = partial(judge_poses, item, text, self.rules, _earlier(earlier))
        if self._pictures is None:
            return await asyncio.to_thread(work)
        return await self._pictures.work_out(work)


def _earlier(record: Record | None) -> Earlier | None:
    """A plan that was carried out, as its record holds it; None where it says nothing of it."""
    if not isinstance(record, PoseRecord) or record.pose is None or record.parse is None:
        return None
    given = tuple(PoseStep(s.block, s.center_cm, s.euler_deg) for s in record.parse.steps)
    steps = tuple(
        ExecutedStep(s.end, s.moved_cm, s.turned_deg, s.gap_cm, s.overlap_cm, s.knocked)
        for s in record.pose.steps
    )
    rests = tuple(kept_rests(step) for step in record.pose.steps)
    pose = record.pose
    ended = Ended(steps, rests, pose.reached, pose.iou, pose.completed, pose.engine)
    return Earlier(given, pose.limits.fields(), ended)
