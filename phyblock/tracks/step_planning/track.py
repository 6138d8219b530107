"""The step-planning track: one operation at a time, with the assembly in view (paper section 4.1).

The messages of a step hold the goal, the candidates, the current picture and the history, in this
order.
"""

from __future__ import annotations

import asyncio
import json
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from phyblock.data import AssemblyTask
from phyblock.domain import Block
from phyblock.models.base import Image, Message, Request
from phyblock.records import Record
from phyblock.scoring.steps import Assembly
from phyblock.sim.dynamics import DEFAULT_TRIAL, ONE_SETTING, Settled, settle
from phyblock.sim.engine import described_engine
from phyblock.sim.question_pictures import question_key, question_png, state_picture
from phyblock.stable import hex_digest
from phyblock.tracks.base import engine_identity
from phyblock.tracks.goal_blind.guessing import BlindGuesses
from phyblock.tracks.pictures import Pictures
from phyblock.tracks.prompts import response_format
from phyblock.tracks.showing import Showing, TaskShowing, showing_fields
from phyblock.tracks.step_planning.baselines import StepSubject
from phyblock.tracks.step_planning.episode import Desk, StepEpisode
from phyblock.tracks.step_planning.prompt import PastStep, StepPrompt
from phyblock.tracks.step_planning.record import EpisodeRecord
from phyblock.tracks.step_planning.rules import StepRules
from phyblock.tracks.studio import Drawing

__all__ = ["StepPlanning"]

_KEPT = 4096
"""States whose fall or stand is remembered."""
_LIKELY = PastStep("Move(1)", "placed", "Next plan: Move(1)", None)


@dataclass(frozen=True)
class _Sight:
    """What a model is shown: a prompt and the pictures in it."""

    prompt: StepPrompt
    pictures: Pictures


_PLAIN = TaskShowing(Showing())


class StepPlanning:
    """Episodes of one operation a step; see `StepEpisode`."""

    name = "step_planning"

    def __init__(
        self,
        rules: StepRules,
        prompt: StepPrompt | None = None,
        pictures: Pictures | None = None,
        items: Sequence[AssemblyTask] = (),
        showing: TaskShowing = _PLAIN,
        pool: Sequence[AssemblyTask] = (),
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording; from `pool`, else
        `items`, baselines learn.
        """
        self.rules = rules
        self.items = items
        self.template = "" if prompt is None else prompt.template.name
        self._showing = showing
        self._guesses = BlindGuesses(showing, pool or items, rules.accepts)
        self._sight = _Sight(prompt, pictures) if prompt and pictures else None
        self._settled: OrderedDict[tuple[Block, ...], Settled] = OrderedDict()

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """The scene as a seed shows it."""
        return self._showing.of(item, seed)

    def about(self, item: AssemblyTask) -> dict[str, Any]:
        """The most steps that an episode of it can take, the physics engine, where there is one,
        and how the scene is shown.
        """
        engine = {} if self.rules.physics == "off" else {"engine": described_engine()}
        most = self.rules.limits.max_steps(len(item.scene))
        return {"max_steps": most, **engine, **showing_fields(item)}

    def identity(self) -> dict[str, Any]:
        """Name and version of the prompt, a digest of all that decides the pictures, and the
        physics engine where blocks are let go in another one than PyBullet.
        """
        engine = {} if self.rules.physics == "off" else engine_identity()
        if self._sight is None:
            return {"prompt": None, "pictures": None, **engine}
        template = self._sight.prompt.template
        keys = [self._sight.pictures.keys(task) for task in self._showing.each(self.items)]
        return {
            "prompt": {"name": template.name, "version": template.version},
            "pictures": hex_digest(json.dumps(keys)),
            **engine,
        }

    def start(
        self, item: AssemblyTask, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> StepEpisode:
        """An episode that has not begun."""
        desk = Desk(self._settle, partial(self._guesses.plan, item))
        if with_messages and self._sight is not None:
            version = self._sight.prompt.template.version
            desk = replace(desk, write=partial(self._write, self._sight, item), version=version)
        return StepEpisode(item, seed, params, self.rules, desk)

    def again(self, item: AssemblyTask, record: Record) -> StepEpisode:
        """The episode of a record before its first reply; what falls is what fell then."""
        fell = {
            tuple(item.scene.blocks[vertex] for vertex in turn.world): turn.fallen
            for turn in (record.steps if isinstance(record, EpisodeRecord) else ())
            if turn.outcome == "placed"
        }

        async def settle_again(blocks: Sequence[Block]) -> Settled:
            state = tuple(blocks)
            return Settled(fell.get(state, ()), state)

        return StepEpisode(item, record.seed, {}, self.rules, Desk(settle_again))

    def outlines(self, item: AssemblyTask) -> Iterator[tuple[Request, bool]]:
        """As many requests as an episode can have, made without rendering.

        Each step is taken to have placed a block. Only the first request can be a real one, and
        with several samples none, since their seeds are not those of the run.
        """
        rules = self.rules
        assembly = Assembly(item.scene, item.candidates, rules.accepts, rules.gating)
        guess = partial(self._guesses.plan, item)
        right = assembly.right_moves()
        subject = StepSubject(item.scene, item.candidates, right, (), guess=guess)
        for step in range(rules.limits.max_steps(len(item.scene))):
            for sample in range(rules.samples):
                request = Request(f"{item.key}/{step + 1}", sample, (), {}, "", subject)
                yield self._outline(item, request, [_LIKELY] * step)

    def close(self) -> None:
        """Stop the worker processes."""
        if self._sight is not None:
            self._sight.pictures.close()

    def _outline(
        self, item: AssemblyTask, request: Request, past: Sequence[PastStep]
    ) -> tuple[Request, bool]:
        is_real = not past and self.rules.samples == 1
        if self._sight is None:
            return request, is_real
        pictures = self._sight.pictures
        fixed, is_fixed_real = pictures.outline(item)
        drawing = self._drawing(self._sight, item, ())
        side = pictures.style_of(item).size_px
        (current,), is_current_real = pictures.outlined((drawing,), (side, side))
        messages = self._messages(self._sight, item, fixed, current, past)
        version = self._sight.prompt.template.version
        request = replace(
            request,
            messages=messages,
            prompt_version=version,
            response_format=response_format(self.rules.form(len(item.candidates))),
        )
        return request, is_real and is_fixed_real and is_current_real

    async def _write(
        self,
        sight: _Sight,
        item: AssemblyTask,
        past: Sequence[PastStep],
        blocks: Sequence[Block],
    ) -> tuple[tuple[Message, ...], Image]:
        """The messages of the step after `past`, and the picture of the assembly among them."""
        fixed = await sight.pictures.of(item)
        current = await sight.pictures.image(self._drawing(sight, item, blocks))
        return self._messages(sight, item, fixed, current, past), current

    def _messages(
        self,
        sight: _Sight,
        item: AssemblyTask,
        fixed: Sequence[Image],
        current: Image,
        past: Sequence[PastStep],
    ) -> tuple[Message, ...]:
        most = self.rules.limits.max_steps(len(item.scene))
        scale = sight.pictures.candidate_scale
        return sight.prompt.messages(fixed, current, past, len(item.candidates), most, scale)

    def _drawing(self, sight: _Sight, item: AssemblyTask, blocks: Sequence[Block]) -> Drawing:
        style = sight.pictures.style_of(item)
        recipe = state_picture(item.scene, blocks, style)
        return Drawing(
            recipe.label, question_key(recipe, style), partial(question_png, recipe, style)
        )

    async def _settle(self, blocks: Sequence[Block]) -> Settled:
        """What becomes of blocks, worked out in another process, or in a thread without one."""
        state = tuple(blocks)
        if state not in self._settled:
            trial = DEFAULT_TRIAL if self.rules.physics == "strict" else ONE_SETTING
            work = partial(settle, state, trial)
            self._settled[state] = (
                await asyncio.to_thread(work)
                if self._sight is None
                else await self._sight.pictures.work_out(work)
            )
            if len(self._settled) > _KEPT:
                self._settled.popitem(last=False)
        return self._settled[state]
