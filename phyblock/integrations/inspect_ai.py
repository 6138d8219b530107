"""Tasks for Inspect: `inspect eval phyblock/full_planning --model openai/gpt-4o`.

The entry point `inspect_ai` of phyblock names this module. Samples hold the keys of tasks; prompts
are those of a run and are made when a sample begins, so that a limit draws few pictures.
"""

from __future__ import annotations

import asyncio
from typing import Any

from inspect_ai import Task as InspectTask
from inspect_ai import model, scorer, solver, task
from inspect_ai.dataset import MemoryDataset, Sample

from phyblock.api import Split, Tasks, tasks

_SAMPLING = {"temperature", "top_p", "max_tokens"}


@scorer.metric
def by_part() -> scorer.Metric:
    """Means by level or subtask and over all, with standard errors clustered by base scene."""
    named = {"all_label": "all stderr", "name_template": "{group_name} stderr"}
    means = scorer.grouped(scorer.mean(), "part")
    errors = scorer.grouped(scorer.stderr(cluster="base_scene"), "part", **named)

    def both(scores: list[scorer.SampleScore]) -> Any:
        return {**means(scores), **errors(scores)}

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

    `-T` passes a single value as it is, several with commas as texts: `1,2` is ['1', '2'].
    """
    found = overrides if isinstance(overrides, list | tuple) else [overrides]
    if levels is not None:
        several = levels if isinstance(levels, list | tuple) else [levels]
        levels = [int(one) if str(one).isdecimal() else one for one in several]
    asked = tasks(track, *found, split=split, levels=levels, seed=seed, data=data, limit=items)
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
        config=model.GenerateConfig(**asked.suite.sampling.model_dump(include=_SAMPLING)),
    )


@solver.solver
def prompt_model(asked: Tasks) -> solver.Solver:
    """Ask as in a run; play episodes to their end."""

    async def solve(state: solver.TaskState, generate: solver.Generate) -> solver.TaskState:
        one = asked[str(state.sample_id)]
        if not one.plays:
            sent = await asyncio.to_thread(one.messages)
            state.messages = await model.messages_from_openai(sent)
            return await generate(state)
        replies: list[str] = []
        episode = await asyncio.to_thread(one.episode)
        while not episode.done:
            state.messages = await model.messages_from_openai(episode.messages)
            state = await generate(state)
            replies.append(state.output.completion)
            state.store.set("replies", list(replies))  # A limit may stop the sample at any turn.
            await asyncio.to_thread(episode.step, replies[-1])
        return state

    return solve


@scorer.scorer(metrics={"*": [by_part()]})
def phyblock_scorer(asked: Tasks) -> scorer.Scorer:
    """Score by the track's own judgement; `success` is 1 if everything is right."""

    async def score(state: solver.TaskState, _: scorer.Target) -> scorer.Score:
        one = asked[str(state.sample_id)]
        reply = state.store.get("replies") if one.plays else state.output.completion
        found = await asyncio.to_thread(one.score, reply)
        return scorer.Score(
            value={found.measure: found.value, "success": float(found.success)},
            answer=found.record.parsed_text,
            explanation=found.problem,
            metadata=found.as_json(),
        )

    return score
