"""One file a track: each is a prompt, a parser and a score."""

from phyblock.tasks.full_planning import FullPlanning, Judgement, Outcome, PlanningRules
from phyblock.tasks.pictures import PicturePolicy, Pictures
from phyblock.tasks.prompts import OfficialPrompt, Prompt, TemplatePrompt

__all__ = [
    "FullPlanning",
    "Judgement",
    "OfficialPrompt",
    "Outcome",
    "PicturePolicy",
    "Pictures",
    "PlanningRules",
    "Prompt",
    "TemplatePrompt",
]
