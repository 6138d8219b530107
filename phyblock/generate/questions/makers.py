"""The makers of questions, one a subtask."""

from __future__ import annotations

from collections.abc import Mapping

from phyblock.domain.question import Subtask
from phyblock.generate.questions.affordance import AffordanceMaker
from phyblock.generate.questions.base import Maker
from phyblock.generate.questions.counterfactual import CounterfactualMaker
from phyblock.generate.questions.counts import CountMaker, LayerMaker, NumberMaker, TypeMaker
from phyblock.generate.questions.dependencies import DependencyMaker
from phyblock.generate.questions.distances import DistanceMaker
from phyblock.generate.questions.ordering import OrderingMaker
from phyblock.generate.questions.positions import PositionMaker
from phyblock.generate.questions.predictive import PredictiveMaker
from phyblock.generate.questions.properties import ColorMaker, ShapeMaker
from phyblock.generate.questions.rotations import RotationMaker
from phyblock.generate.questions.sizes import SizeMaker
from phyblock.generate.questions.viewpoint import ViewpointMaker

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
    CountMaker(),
    LayerMaker(),
    TypeMaker(),
    ViewpointMaker(),
    CounterfactualMaker(),
    PredictiveMaker(),
    OrderingMaker(),
    AffordanceMaker(),
)

MAKERS: Mapping[Subtask, Maker] = {maker.subtask: maker for maker in _MAKERS}
"""By subtask."""
