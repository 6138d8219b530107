"""One file a track: each is a prompt, a parser and a score."""

from phyblock.tasks.full_planning import FullPlanning, PlanJudgement, PlanningRules
from phyblock.tasks.pictures import PicturePolicy, Pictures
from phyblock.tasks.prompts import OfficialPrompt, Prompt, TemplatePrompt
from phyblock.tasks.step_planning import StepPlanning
from phyblock.tasks.step_prompt import StepPrompt
from phyblock.tasks.step_rules import ENDINGS, Ending, StepLimits, StepRules
from phyblock.tasks.studio import Drawing, Studio
from phyblock.tasks.track import (
    AnyTrack,
    Episode,
    EpisodeTrack,
    Item,
    Judgement,
    Outcome,
    SingleTrack,
    Track,
)

__all__ = [
    "ENDINGS",
    "AnyTrack",
    "Drawing",
    "Ending",
    "Episode",
    "EpisodeTrack",
    "FullPlanning",
    "Item",
    "Judgement",
    "OfficialPrompt",
    "Outcome",
    "PicturePolicy",
    "Pictures",
    "PlanJudgement",
    "PlanningRules",
    "Prompt",
    "SingleTrack",
    "StepLimits",
    "StepPlanning",
    "StepPrompt",
    "StepRules",
    "Studio",
    "TemplatePrompt",
    "Track",
]
