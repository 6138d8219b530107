"""One file a track: each is a prompt, a parser and a score."""

from phyblock.tasks.full_planning import FullPlanning, PlanJudgement, PlanningRules
from phyblock.tasks.pictures import PicturePolicy, Pictures
from phyblock.tasks.prompts import OfficialPrompt, Prompt, TemplatePrompt
from phyblock.tasks.question_pictures import QuestionPictures, Shown
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
from phyblock.tasks.vqa import AskedQuestion, ChoiceJudgement, Vqa, VqaRules

__all__ = [
    "ENDINGS",
    "AnyTrack",
    "AskedQuestion",
    "ChoiceJudgement",
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
    "QuestionPictures",
    "Shown",
    "SingleTrack",
    "StepLimits",
    "StepPlanning",
    "StepPrompt",
    "StepRules",
    "Studio",
    "TemplatePrompt",
    "Track",
    "Vqa",
    "VqaRules",
]
