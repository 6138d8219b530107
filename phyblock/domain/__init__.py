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
    euler_deg_to_matrix,
    euler_deg_to_quat_xyzw,
    orientation_class,
    quat_xyzw_to_matrix,
    symmetries,
    turn_deg,
)
from phyblock.domain.candidates import MAX_CANDIDATES, Candidate, CandidateSet
from phyblock.domain.plan import Plan
from phyblock.domain.pose_plan import PosePlan, PoseStep
from phyblock.domain.question import (
    CATEGORIES,
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Mark,
    Question,
    QuestionPicture,
    Subtask,
    is_picture_option,
)
from phyblock.domain.scene import Block, Kind, Look, Scene

__all__ = [
    "BLOCK_TYPES",
    "CATEGORIES",
    "COLORS",
    "KIT_PALETTE",
    "LETTERS",
    "MAX_CANDIDATES",
    "SHAPES",
    "SUBTASKS",
    "SUBTASK_NAMES",
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
    "Mark",
    "Plan",
    "PosePlan",
    "PoseStep",
    "Question",
    "QuestionPicture",
    "Scene",
    "Subtask",
    "euler_deg_to_matrix",
    "euler_deg_to_quat_xyzw",
    "is_picture_option",
    "orientation_class",
    "quat_xyzw_to_matrix",
    "symmetries",
    "turn_deg",
]
