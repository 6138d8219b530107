"""The field's nouns as frozen dataclasses and pure functions: no files, clock or network."""

from phyblock.domain.aov import AOVGraph, CycleError
from phyblock.domain.blocks import (
    BLOCK_TYPES,
    COLORS,
    KIT_PALETTE,
    SHAPES,
    BlockType,
    Color,
    Euler,
    euler_deg_to_quat_xyzw,
    orientation_class,
    quat_xyzw_to_matrix,
)
from phyblock.domain.candidates import MAX_CANDIDATES, Candidate, CandidateSet
from phyblock.domain.plan import Plan
from phyblock.domain.scene import Block, Kind, Look, Scene

__all__ = [
    "BLOCK_TYPES",
    "COLORS",
    "KIT_PALETTE",
    "MAX_CANDIDATES",
    "SHAPES",
    "AOVGraph",
    "Block",
    "BlockType",
    "Candidate",
    "CandidateSet",
    "Color",
    "CycleError",
    "Euler",
    "Kind",
    "Look",
    "Plan",
    "Scene",
    "euler_deg_to_quat_xyzw",
    "orientation_class",
    "quat_xyzw_to_matrix",
]
