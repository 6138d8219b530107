"""Open the step-planning track of a suite."""

from __future__ import annotations

from phyblock.config.suite import Suite
from phyblock.tracks.kind import Opening
from phyblock.tracks.opening import assembly_pictures, check_drawn, task_showing, template_prompt
from phyblock.tracks.selection import select_tasks
from phyblock.tracks.step_planning.prompt import StepPrompt
from phyblock.tracks.step_planning.rules import StepLimits, StepRules
from phyblock.tracks.step_planning.spec import StepsSpec
from phyblock.tracks.step_planning.track import StepPlanning

__all__ = ["open_step_planning"]


def open_step_planning(opening: Opening) -> StepPlanning:
    """The track; SpecError, DataError or PromptError with what is wrong."""
    suite = opening.suite
    tasks = select_tasks(opening.dataset.tasks, suite.levels, opening.limit)
    rules = _rules(suite)
    pool = opening.dataset.tasks
    showing = task_showing(suite, StepsSpec, "steps", tasks, pool)
    if not opening.with_prompts:
        return StepPlanning(rules, items=tasks, showing=showing, pool=pool)
    check_drawn(suite, "step planning draws every state, so the goal must be drawn as well")
    steps = suite.section(StepsSpec)
    shown = (steps.feedback, steps.history, steps.memory, steps.cot)
    template = template_prompt(suite, StepPlanning.name)
    rules_shown = (rules.gating, rules.accepts, steps.blind, rules.form)
    prompt = StepPrompt(template, *shown, *rules_shown)
    return StepPlanning(rules, prompt, assembly_pictures(suite, opening.shop), tasks, showing, pool)


def _rules(suite: Suite) -> StepRules:
    """How a suite plays episodes."""
    steps = suite.section(StepsSpec)
    limits = StepLimits(
        steps.max_steps,
        steps.max_failures,
        steps.max_repeats,
        steps.max_episode_tokens,
        steps.max_episode_usd,
    )
    accepts = steps.setting or suite.settings[0]
    return StepRules(
        accepts,
        suite.settings,
        steps.gating,
        steps.physics,
        steps.samples,
        limits,
        suite.answer_format,
        steps.cot,
    )
