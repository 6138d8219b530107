"""What a suite says of single tracks: the sections `vqa` and `steps`."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from phyblock.domain import SUBTASKS, Subtask
from phyblock.specs.fields import Count, Section, UniqueSome, refuse

__all__ = ["BUILTIN_QUESTIONS", "SECTIONS", "StepsSpec", "TrackName", "VqaSpec"]

TrackName = Literal["full_planning", "step_planning", "vqa"]
BUILTIN_QUESTIONS = "phyblock-vqa"
"""The bundled question set that is used when a suite names none."""
SECTIONS = {"vqa": "vqa", "step_planning": "steps"}
"""The section of a suite that belongs to a track."""


def _check_prompt(prompt: str) -> str:
    if prompt == "default" or prompt.endswith(".j2"):
        return prompt
    raise refuse(
        "is neither a known prompt nor a template",
        allowed="default, or the path of a .j2 file",
        words=("default",),
    )


TrackPrompt = Annotated[
    str, AfterValidator(_check_prompt), Field(json_schema_extra={"pattern": r"^(default|.*\.j2)$"})
]
Flag = Annotated[bool, Field(strict=True)]
PositiveUsd = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]


class VqaSpec(Section):
    """The questions of the vqa track and how they are shown."""

    format: Literal["builtin", "official"] = Field(
        default="builtin",
        description="builtin: a folder with questions.jsonl. official: a folder with question "
        "files in the official JSON form and their pictures.",
    )
    path: str = Field(
        default=BUILTIN_QUESTIONS,
        min_length=1,
        description="The name of a bundled question set (phyblock-vqa), or a folder; relative "
        "as dataset.path. Its scenes are those of dataset.",
    )
    subtasks: UniqueSome[Subtask] = Field(default=SUBTASKS, description="Subtasks to ask about.")
    per_subtask: Count | None = Field(
        default=None, description="Questions of each subtask at most; null: all."
    )
    options_as: Literal["images", "letters"] = Field(
        default="images",
        description="Options that are pictures. images: each sent apart. letters: all on one "
        "sheet, lettered.",
    )
    circular: Flag = Field(
        default=False,
        description="Ask every rotation of the options; a question is right only if all are.",
    )
    blind: Flag = Field(default=False, description="Send no picture.")
    wrong_image: Flag = Field(default=False, description="Show pictures of another scene.")
    prompt: TrackPrompt = Field(
        default="default", description="default, or the path of a .j2 template."
    )


class StepsSpec(Section):
    """The rules of the step_planning track: the simulator, what is shown, when it ends."""

    setting: Literal["A", "B"] | None = Field(
        default=None,
        description="By which the simulator lets a step succeed; null: by the first of settings. "
        "With B, blocks that are turned wrongly are placed, and count as wrong in A.",
    )
    gating: Literal["aov", "layer"] = Field(
        default="aov",
        description="aov: a block can be placed when all it rests on is. layer: when all lower "
        "layers are complete, as in the official code.",
    )
    physics: Literal["off", "settle", "strict"] = Field(
        default="settle",
        description="off: placed blocks stay where they are. settle: every new state is simulated; "
        "what would fall is recorded and held. strict: a structure that collapses ends the "
        "episode.",
    )
    feedback: Literal["none", "success", "error_type"] = Field(
        default="success", description="What the model is told of each of its steps."
    )
    history: Literal["text", "turns"] = Field(
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
    prompt: TrackPrompt = Field(
        default="default", description="default, or the path of a .j2 template."
    )
