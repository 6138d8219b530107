"""One file a track: each is a prompt, a parser and a score."""

from phyblock.tasks.full_planning import FullPlanning, PlanJudgement, PlanningRules
from phyblock.tasks.pictures import PicturePolicy, Pictures
from phyblock.tasks.prompts import OfficialPrompt, Prompt, TemplatePrompt
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
    "AnyTrack",
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
    "TemplatePrompt",
    "Track",
]
