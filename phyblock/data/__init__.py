"""Readers of the data formats: the project's own and the official PhyBlock layout."""

from phyblock.data.base import AssemblyTask, Dataset, QuestionSet, QuestionTask
from phyblock.data.builtin import SCENES_FILE, read_builtin
from phyblock.data.official import official_prompt, read_official, recorded_models
from phyblock.data.official_questions import read_official_questions
from phyblock.data.questions import QUESTIONS_FILE, read_questions

__all__ = [
    "QUESTIONS_FILE",
    "SCENES_FILE",
    "AssemblyTask",
    "Dataset",
    "QuestionSet",
    "QuestionTask",
    "official_prompt",
    "read_builtin",
    "read_official",
    "read_official_questions",
    "read_questions",
    "recorded_models",
]
