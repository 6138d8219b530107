"""What a suite says of the step-planning track: the section `steps`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from phyblock.config.validation import Count, Flag, PictureControls, TemplateName
from phyblock.tracks.step_planning.prompt import Feedback, History
from phyblock.types import Gating, Physics, Setting

__all__ = ["StepsSpec"]

PositiveUsd = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]


class StepsSpec(PictureControls):
    """The rules of the step_planning track: the simulator, what is shown, when it ends."""

    setting: Setting | None = Field(
        default=None,
        description="By which the simulator lets a step succeed; null: by the first of settings. "
        "With B, blocks that are turned wrongly are placed, and count as wrong in A.",
    )
    gating: Gating = Field(
        default="aov",
        description="aov: a block can be placed when all it rests on is. layer: when all lower "
        "layers are complete, as in the official code.",
    )
    physics: Physics = Field(
        default="settle",
        description="off: placed blocks stay where they are. settle: every new state is simulated; "
        "what would fall is recorded and held. strict: a structure that collapses ends the "
        "episode.",
    )
    feedback: Feedback = Field(
        default="success", description="What the model is told of each of its steps."
    )
    history: History = Field(
        default="text",
        description="Earlier steps as a text in one message, or as the turns of a conversation.",
    )
    memory: Count | None = Field(
        default=None, description="Earlier steps that are shown; null: all."
    )
    cot: Flag = Field(default=True, description="Ask for reasoning before the step.")
    samples: Count = Field(default=1, description="Replies asked for each step.")
    vote: Literal["majority"] = Field(
        default="majority", description="How several replies become one step."
    )
    max_steps: Count | None = Field(
        default=None, description="Steps at most; null: twice the number of blocks."
    )
    max_failures: Count | None = Field(
        default=5, description="Failed steps in a row that end an episode; null: no bound."
    )
    max_repeats: Count | None = Field(
        default=3,
        description="Failures in a row of one and the same step that end an episode; null: no "
        "bound.",
    )
    max_episode_tokens: Count | None = Field(
        default=None, description="Tokens of an episode, prompts included; null: no bound."
    )
    max_episode_usd: PositiveUsd | None = Field(
        default=None, description="Dollars of an episode; null: no bound."
    )
    prompt: TemplateName = Field(
        default="default", description="default, or the path of a .j2 template."
    )
