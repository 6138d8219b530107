"""Scenes and candidate sets made here, with ground truth from geometry and physics."""

from phyblock_making.checks.acceptance import accept, form_problems, physics_problems
from phyblock_making.scenes.candidate_sets import make_candidates

__all__ = [
    "accept",
    "form_problems",
    "make_candidates",
    "physics_problems",
]
