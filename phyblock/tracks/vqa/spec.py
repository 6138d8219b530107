"""What a suite says of the VQA track: the section `vqa`."""

from __future__ import annotations

from pydantic import Field

from phyblock.config.validation import Count, Flag, PictureControls, TemplateName, UniqueSome
from phyblock.domain import LETTERS, SUBTASKS, Subtask
from phyblock.tracks.vqa.pictures import OptionsAs
from phyblock.types import DataFormat

__all__ = ["BUILTIN_QUESTIONS", "VqaSpec"]

BUILTIN_QUESTIONS = "phyblock-vqa"
"""The bundled question set that is used when a suite names none."""


class VqaSpec(PictureControls):
    """The questions of the vqa track and how they are shown."""

    format: DataFormat = Field(
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
    options_as: OptionsAs = Field(
        default="images",
        description="Options that are pictures. images: each sent apart. letters: all on one "
        "sheet, lettered.",
    )
    circular: Flag = Field(
        default=False,
        description="Ask every rotation of the options; a question is right only if all are.",
    )
    prompt: TemplateName = Field(
        default="default", description="default, or the path of a .j2 template."
    )

    @property
    def rotations(self) -> int:
        """How often each question is asked with one seed."""
        return len(LETTERS) if self.circular else 1
