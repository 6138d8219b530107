"""One file a track: each is a prompt, a parser and a score."""

from phyblock.tasks.full_planning import FullPlanning, PlanJudgement, PlanningRules
from phyblock.tasks.pictures import PicturePolicy, Pictures
from phyblock.tasks.prompts import OfficialPrompt, Prompt, TemplatePrompt
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
    "AnyTrack",
    "Drawing",
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
    "Studio",
    "TemplatePrompt",
    "Track",
]
