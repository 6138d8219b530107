"""Scenes and candidate sets made here, with ground truth from geometry and physics."""

from phyblock.generate.acceptance import accept, form_problems, physics_problems
from phyblock.generate.candidates import make_candidates
from phyblock.generate.writing import scene_line

__all__ = [
    "accept",
    "form_problems",
    "make_candidates",
    "physics_problems",
    "scene_line",
]
