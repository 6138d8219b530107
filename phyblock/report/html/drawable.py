"""Scenes, questions and block shapes as the page needs them to draw."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from phyblock.domain import (
    BLOCK_TYPES,
    Block,
    CandidateSet,
    Question,
    QuestionPicture,
    Scene,
)
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.render import COLOR_RGB

__all__ = ["kit", "question_entry", "scene_entry"]

_DECIMALS = 6


def kit() -> dict[str, Any]:
    """Shapes (vertices [m] and triangles in the body frame) and colors of all blocks."""
    meshes = {name: solid_mesh(name) for name in BLOCK_TYPES}
    return {
        "shapes": {
            name: {
                "vertices": [_rounded(corner) for corner in mesh.vertices_m.tolist()],
                "triangles": mesh.triangles.tolist(),
            }
            for name, mesh in meshes.items()
        },
        "colors": COLOR_RGB,
    }


def scene_entry(scene: Scene, candidates: CandidateSet) -> dict[str, Any]:
    """A scene with its candidates.

    `depend` holds positions of blocks in the list, from 0; `candidate` is the number of the
    candidate that stands for the block in setting A, null where there is none.
    """
    needs = scene.graph.depends_on
    return {
        "blocks": [
            {
                **_block(block),
                "order": block.order,
                "depend": sorted(needs[vertex]),
                "candidate": candidates.index_of(block.look),
            }
            for vertex, block in enumerate(scene.blocks)
        ],
        "candidates": [
            {"type": one.type, "color": one.color, "euler": _rounded(one.euler_deg)}
            for one in candidates.candidates
        ],
    }


def question_entry(question: Question) -> dict[str, Any]:
    """A question with the recipes of its pictures."""
    return {
        "id": question.id,
        "subtask": question.subtask,
        "text": question.text,
        "options": list(question.options),
        "answer": question.answer_letters,
        "pictures": [_picture(picture) for picture in question.pictures],
        "evidence": dict(question.evidence),
    }


def _picture(picture: QuestionPicture) -> dict[str, Any]:
    return {
        "label": picture.label,
        "view": list(picture.view_deg),
        "blocks": [_block(block) for block in picture.blocks],
        "framed": [_block(block) for block in picture.framed],
        "marks": [
            {"letter": mark.letter, "position": _rounded(mark.position_m)} for mark in picture.marks
        ],
    }


def _block(block: Block) -> dict[str, Any]:
    return {
        "type": block.type,
        "color": block.color,
        "position": _rounded(block.position_m),
        "euler": _rounded(block.euler_deg),
    }


def _rounded(values: Iterable[float]) -> list[float]:
    return [round(float(value), _DECIMALS) for value in values]
