"""Scenes and candidate sets made here, with ground truth from geometry and physics."""
