"""A taskset for verifiers: `vf-eval phyblock --env.taskset.track full_planning`.

Plans, plans with poses and questions take one turn; episodes are conversations, in which the
simulator answers as the user. Rewards follow from the trace alone, which can be scored again.
"""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Iterator
from typing import Any, Literal

import verifiers.v1 as vf
from pydantic import Field
from verifiers.v1.types import content_text

from phyblock.api import Score, Split, Task, Tasks, tasks

__all__ = ["VerifiersEnv", "VerifiersTaskset"]


class VerifiersConfig(vf.TasksetConfig):
    """Arguments of `phyblock.tasks`; without a limit, `train` and `dev` are endless."""

    track: Literal["full_planning", "step_planning", "pose_planning", "vqa"] = "full_planning"
    split: Split = "train"
    levels: list[int] | None = None
    seed: int = 0
    data: str | None = None
    limit: int | None = None
    overrides: list[str] = Field(default_factory=list)

    def read(self) -> Tasks:
        """Return the tasks."""
        kept = {"split", "levels", "seed", "data", "limit"}
        return tasks(self.track, *self.overrides, **self.model_dump(include=kept))


class VerifiersData(vf.TaskData):
    """A task by its place in the configured tasks."""

    place: int
    source: VerifiersConfig


class VerifiersTask(vf.Task[VerifiersData, vf.State, vf.TaskConfig]):
    """A task, with its rewards."""

    @functools.cached_property
    def asked(self) -> Task:
        """The task of phyblock, made again for a stored trace."""
        task: Task = self.data.source.read()[self.data.place]
        return task

    def worth(self, trace: vf.Trace) -> Score:
        """Return the score of the replies in a trace."""
        replies = [content_text(one.content) for one in trace.assistant_messages]
        return self.asked.score(replies if self.asked.plays else replies[-1] if replies else None)

    @vf.reward
    async def value(self, trace: vf.Trace) -> float:
        """The headline measure of the track."""
        return (await asyncio.to_thread(self.worth, trace)).value

    @vf.metric
    async def success(self, trace: vf.Trace) -> float:
        """1 if everything is right."""
        return float((await asyncio.to_thread(self.worth, trace)).success)


class VerifiersTaskset(vf.Taskset[VerifiersTask, VerifiersConfig]):
    """The tasks of a track."""

    def __init__(self, config: VerifiersConfig) -> None:
        super().__init__(config)
        self.INFINITE = config.split != "test" and config.limit is None

    def load(self) -> Iterator[VerifiersTask]:
        """Yield tasks, each made on demand."""
        for place, one in enumerate(self.config.read()):
            system, *messages = one.messages()
            data = VerifiersData(
                name=one.id,
                id=one.key,
                prompt=messages,
                system_prompt=system["content"],
                place=place,
                source=self.config,
            )
            made = VerifiersTask(data, self.config.task)
            made.asked = one
            yield made


class VerifiersEnvConfig(vf.EnvConfig):
    """One model, without tools: it runs no code and needs no sandbox."""

    agent: vf.AgentConfig = vf.AgentConfig(harness={"id": "null"}, runtime={"type": "subprocess"})


class VerifiersEnv(vf.Env[VerifiersEnvConfig]):
    """Asks a single turn, or plays the simulator of an episode."""

    async def run(self, task: VerifiersTask, agents: Any) -> None:
        """Run a task to its end."""
        asked = await asyncio.to_thread(lambda: task.asked)
        if not asked.plays:
            await agents.agent.run(task)
            return
        episode = await asyncio.to_thread(asked.episode)
        async with agents.agent.interaction(task) as interaction:
            segment = await interaction.turn()
            while not segment.terminated:
                turn = await asyncio.to_thread(episode.step, segment.last_reply)
                if turn.done:
                    break
                said = [one for one in turn.messages if one["role"] == "user"]
                segment = await interaction.turn(said)
