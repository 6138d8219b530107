"""Tasks for Inspect: `inspect eval phyblock/full_planning --model openai/gpt-4o`.

The entry point `inspect_ai` of phyblock names this module. Samples hold the keys of tasks; prompts
are those of a run and are made when a sample begins, so that a limit draws few pictures.
"""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from typing import Any

from inspect_ai import Task as InspectTask
from inspect_ai import model, task
from inspect_ai.dataset import MemoryDataset, Sample
from inspect_ai.scorer import (
    Metric,
    SampleScore,
    Score,
    Scorer,
    Target,
    grouped,
    mean,
    metric,
    scorer,
    stderr,
)
from inspect_ai.solver import Generate, Solver, TaskState, solver

from phyblock.api import Split, Tasks, tasks

_ROLES = {
    "system": model.ChatMessageSystem,
    "user": model.ChatMessageUser,
    "assistant": model.ChatMessageAssistant,
}


@metric
def by_part() -> Metric:
    """Means by level or subtask and over all, with standard errors clustered by base scene."""
    error = stderr(cluster="base_scene")
    found = (
        grouped(mean(), "part"),
        grouped(error, "part", all_label="all stderr", name_template="{group_name} stderr"),
    )

    def both(scores: list[SampleScore]) -> Any:
        return {name: value for one in found for name, value in one(scores).items()}

    return both


@task
def full_planning(**options: Any) -> InspectTask:
    """Full planning: a whole plan in one reply."""
    return _task("full_planning", **options)


@task
def step_planning(**options: Any) -> InspectTask:
    """Step planning: one block per reply, in the simulator."""
    return _task("step_planning", **options)


@task
def pose_planning(**options: Any) -> InspectTask:
    """Pose planning: plans with the position of every block, executed by physics."""
    return _task("pose_planning", **options)


@task
def vqa(**options: Any) -> InspectTask:
    """Questions: four options each, on physical understanding."""
    return _task("vqa", **options)


def _task(
    track: str,
    split: Split = "test",
    levels: Any = None,
    seed: int = 0,
    data: str | None = None,
    items: int | None = None,
    overrides: Any = (),
) -> InspectTask:
    """Return the task of a track; `items` is the limit of `phyblock.tasks`, spread over levels.

    `-T` passes a single value as it is, and several separated by commas as texts: `1,2` is
    ['1', '2'].
    """
    found = overrides if isinstance(overrides, list | tuple) else [overrides]
    if levels is not None:
        several = levels if isinstance(levels, list | tuple) else [levels]
        levels = [int(one) if str(one).isdecimal() else one for one in several]
    asked = tasks(track, *found, split=split, levels=levels, seed=seed, data=data, limit=items)
    sampling = asked.suite.sampling
    samples = [
        Sample(
            input=one.id,
            id=one.key,
            metadata={"part": one.part, "scene": one.item.scene.id, "base_scene": one.base_scene},
        )
        for one in asked
    ]
    return InspectTask(
        dataset=MemoryDataset(samples, name=asked.name),
        solver=prompt_model(asked),
        scorer=phyblock_scorer(asked),
        config=model.GenerateConfig(
            temperature=sampling.temperature, top_p=sampling.top_p, max_tokens=sampling.max_tokens
        ),
    )


def _chat(messages: Sequence[dict[str, Any]]) -> list[model.ChatMessage]:
    """Return messages in OpenAI's form as messages of Inspect."""

    def content(parts: Any) -> Any:
        if isinstance(parts, str):
            return parts
        return [
            model.ContentText(text=part["text"])
            if part["type"] == "text"
            else model.ContentImage(image=part["image_url"]["url"])
            for part in parts
        ]

    return [_ROLES[one["role"]](content=content(one["content"])) for one in messages]


@solver
def prompt_model(asked: Tasks) -> Solver:
    """Ask as in a run; play episodes to their end."""

    async def solve(state: TaskState, generate: Generate) -> TaskState:
        one = asked[str(state.sample_id)]
        if not one.plays:
            state.messages = _chat(await asyncio.to_thread(one.messages))
            return await generate(state)
        replies: list[str] = []
        episode = await asyncio.to_thread(one.episode)
        while not episode.done:
            state.messages = _chat(episode.messages)
            state = await generate(state)
            replies.append(state.output.completion)
            state.store.set("replies", list(replies))  # A limit may stop the sample at any turn.
            await asyncio.to_thread(episode.step, replies[-1])
        return state

    return solve


@scorer(metrics={"*": [by_part()]})
def phyblock_scorer(asked: Tasks) -> Scorer:
    """Score by the track's own judgement; `success` is 1 if everything is right."""

    async def score(state: TaskState, target: Target) -> Score:
        del target
        one = asked[str(state.sample_id)]
        reply = state.store.get("replies") if one.plays else state.output.completion
        found = await asyncio.to_thread(one.score, reply)
        return Score(
            value={found.measure: found.value, "success": float(found.success)},
            answer=found.record.said,
            explanation=found.problem,
            metadata=found.as_json(),
        )

    return score
