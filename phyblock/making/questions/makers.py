"""The makers of questions, one a subtask."""

from __future__ import annotations

from collections.abc import Mapping

from phyblock.domain.question import Subtask
from phyblock.making.questions.affordance import AffordanceMaker
from phyblock.making.questions.counterfactual import CounterfactualMaker
from phyblock.making.questions.counts import NumberMaker
from phyblock.making.questions.dependencies import DependencyMaker
from phyblock.making.questions.distances import DistanceMaker
from phyblock.making.questions.ordering import OrderingMaker
from phyblock.making.questions.positions import PositionMaker
from phyblock.making.questions.predictive import PredictiveMaker
from phyblock.making.questions.properties import ColorMaker, ShapeMaker
from phyblock.making.questions.question_draft import Maker
from phyblock.making.questions.rotations import RotationMaker
from phyblock.making.questions.sizes import SizeMaker
from phyblock.making.questions.tallies import TallyMaker
from phyblock.making.questions.viewpoint import ViewpointMaker

__all__ = ["MAKERS"]

_MAKERS: tuple[Maker, ...] = (
    ShapeMaker(),
    ColorMaker(),
    SizeMaker(),
    NumberMaker(),
    PositionMaker(),
    DistanceMaker(),
    DependencyMaker(),
    RotationMaker(),
    TallyMaker("OC"),
    TallyMaker("LC"),
    TallyMaker("TC"),
    ViewpointMaker(),
    CounterfactualMaker(),
    PredictiveMaker(),
    OrderingMaker(),
    AffordanceMaker(),
)

MAKERS: Mapping[Subtask, Maker] = {maker.subtask: maker for maker in _MAKERS}
"""By subtask."""
