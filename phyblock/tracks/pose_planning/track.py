"""The pose-planning track: a whole plan that says where every block goes, setting C.

It asks about the same scenes and candidates as full planning, so that one table says what the pose
costs a model.
"""

from __future__ import annotations

import asyncio
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from phyblock.datasets import AssemblyTask
from phyblock.domain import PoseStep
from phyblock.models.base import Image, Request
from phyblock.parsing import POSE_READER_VERSION
from phyblock.records import Record
from phyblock.sim.carry import CarriedStep
from phyblock.sim.placing import upright
from phyblock.sim.registry import REFERENCE_ENGINE, physics_engine
from phyblock.tracks.base import ENGINE, READER
from phyblock.tracks.pose_planning.baselines import PoseSubject
from phyblock.tracks.pose_planning.judging import (
    Earlier,
    Ended,
    PoseJudgement,
    PoseRules,
    judge_poses,
)
from phyblock.tracks.pose_planning.pictures import PosePictures
from phyblock.tracks.pose_planning.record import PoseRecord, kept_rests
from phyblock.tracks.prompts import Prompt, form_facts, response_format
from phyblock.tracks.showing import Showing, ShownTask, TaskShowing, told_of

__all__ = ["PosePlanning"]

_PLAIN = TaskShowing(Showing())


class PosePlanning:
    """Prompt, parse and score of the track; pictures and physics are worked out elsewhere."""

    name = "pose_planning"

    def __init__(
        self,
        rules: PoseRules,
        prompt: Prompt | None = None,
        pictures: PosePictures | None = None,
        items: Sequence[AssemblyTask] = (),
        showing: TaskShowing = _PLAIN,
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording."""
        self.rules = rules
        self.items = items
        self.template = "" if prompt is None else prompt.name
        self._prompt = prompt
        self._pictures = pictures
        self._showing = showing

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """The scene as a seed shows it; where steps bring a rotation, each kind once, upright."""
        shown = self._showing.of(item, seed)
        if not self.rules.is_free:
            return shown
        kit, numbers = upright(shown.candidates)
        if isinstance(shown, ShownTask):
            numbers = tuple(shown.order[number - 1] for number in numbers)
            return replace(shown, candidates=kit, order=numbers)
        return ShownTask(shown.scene, kit, shown.composite, numbers, shown, seed)

    def about(self, item: AssemblyTask) -> dict[str, Any]:
        """How the scene is shown, where not as the file has it."""
        return told_of(item)

    def identity(self) -> dict[str, Any]:
        """Name and version of the prompt, a digest of all that decides the pictures, the
        version of the reader, and the physics engine where it is another one than PyBullet.
        """
        return {**self._asked_as(), READER: POSE_READER_VERSION, **_other_engine()}

    def _asked_as(self) -> dict[str, Any]:
        if self._prompt is None or self._pictures is None:
            return {"prompt": None, "pictures": None}
        shown = [self.shown(task, seed) for seed in self._showing.seeds for task in self.items]
        keys = [self._pictures.keys(task) for task in shown]
        return {
            "prompt": {"name": self._prompt.name, "version": self._prompt.version},
            "pictures": hashlib.sha256(json.dumps(keys).encode()).hexdigest(),
        }

    async def request(
        self, item: AssemblyTask, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """The request of one sample; without messages for models that need none."""
        if not with_messages or self._pictures is None:
            return Request(item.key, seed, (), params, "", self._subject(item))
        return self._request(item, seed, params, await self._pictures.of(item))

    def outlines(self, item: AssemblyTask) -> Iterator[tuple[Request, bool]]:
        """The one request, made without rendering, and whether its pictures are the real ones."""
        shown = item if isinstance(item, ShownTask) else self.shown(item, 0)
        if self._pictures is None:
            yield Request(shown.key, 0, (), {}, "", self._subject(shown)), True
            return
        pictures, real = self._pictures.outline(shown)
        yield self._request(shown, 0, {}, pictures), real

    def _request(
        self,
        item: AssemblyTask,
        seed: int,
        params: Mapping[str, object],
        pictures: tuple[Image, ...],
    ) -> Request:
        assert self._prompt is not None
        messages = self._prompt.messages(pictures, self.facts(item, pictures))
        return Request(
            item.key,
            seed,
            messages,
            params,
            self._prompt.version,
            self._subject(item),
            response_format(self.rules.form(item)),
        )

    def _subject(self, item: AssemblyTask) -> PoseSubject:
        return PoseSubject(item.scene, item.candidates, self.rules.is_free)

    def facts(self, item: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """What templates may use; nothing in it gives an answer away."""
        return {
            "pictures": [picture.label for picture in pictures],
            "n_candidates": len(item.candidates),
            "is_blind": self._showing.how.blind,
            "rotation": self.rules.rotation,
            **form_facts(self.rules.form(item)),
        }

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

    def close(self) -> None:
        """Stop the worker processes."""
        if self._pictures is not None:
            self._pictures.close()


def _other_engine() -> dict[str, Any]:
    """The physics engine with its versions, where it is not the engine of reference."""
    engine = physics_engine()
    if engine.name == REFERENCE_ENGINE:
        return {}
    return {ENGINE: {"engine": engine.name, **engine.versions}}


def _earlier(record: Record | None) -> Earlier | None:
    """A plan that was carried out, as its record holds it; None where it says nothing of it."""
    if not isinstance(record, PoseRecord) or record.pose is None or record.parse is None:
        return None
    given = tuple(PoseStep(s.block, s.center_cm, s.euler_deg) for s in record.parse.steps)
    steps = tuple(
        CarriedStep(s.end, s.moved_cm, s.turned_deg, s.gap_cm, s.overlap_cm, s.knocked)
        for s in record.pose.steps
    )
    rests = tuple(kept_rests(step) for step in record.pose.steps)
    pose = record.pose
    ended = Ended(steps, rests, pose.reached, pose.iou, pose.completed, pose.engine)
    return Earlier(given, pose.limits.fields(), ended)
