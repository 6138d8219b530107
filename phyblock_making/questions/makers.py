"""The makers of questions, one a subtask."""

from __future__ import annotations

from collections.abc import Mapping

from phyblock.domain.question import Subtask
from phyblock_making.questions.affordance import AffordanceMaker
from phyblock_making.questions.counterfactual import CounterfactualMaker
from phyblock_making.questions.counts import NumberMaker
from phyblock_making.questions.dependencies import DependencyMaker
from phyblock_making.questions.distances import DistanceMaker
from phyblock_making.questions.ordering import OrderingMaker
from phyblock_making.questions.positions import PositionMaker
from phyblock_making.questions.predictive import PredictiveMaker
from phyblock_making.questions.properties import ColorMaker, ShapeMaker
from phyblock_making.questions.question_draft import Maker
from phyblock_making.questions.rotations import RotationMaker
from phyblock_making.questions.sizes import SizeMaker
from phyblock_making.questions.tallies import TallyMaker
from phyblock_making.questions.viewpoint import ViewpointMaker

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
