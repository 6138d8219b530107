"""Scenes and block shapes as the page of a report needs them to draw."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from phyblock.domain import BLOCK_TYPES, Block, CandidateSet, Scene
from phyblock.sim.geometry import solid_mesh
from phyblock.sim.pictures import COLOR_RGB

__all__ = ["block_entry", "kit", "rounded", "scene_entry"]

_DECIMALS = 6


def kit() -> dict[str, Any]:
    """Shapes (vertices [m] and triangles in the body frame) and colors of all blocks."""
    meshes = {name: solid_mesh(name) for name in BLOCK_TYPES}
    return {
        "shapes": {
            name: {
                "vertices": [rounded(corner) for corner in mesh.vertices_m.tolist()],
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
                **block_entry(block),
                "order": block.order,
                "depend": sorted(needs[vertex]),
                "candidate": candidates.index_of(block.look),
            }
            for vertex, block in enumerate(scene.blocks)
        ],
        "candidates": [
            {"type": one.type, "color": one.color, "euler": rounded(one.euler_deg)}
            for one in candidates.candidates
        ],
    }


def block_entry(block: Block) -> dict[str, Any]:
    """A block: its kind and pose."""
    return {
        "type": block.type,
        "color": block.color,
        "position": rounded(block.position_m),
        "euler": rounded(block.euler_deg),
    }


def rounded(values: Iterable[float]) -> list[float]:
    """Numbers with as many decimals as a drawing needs."""
    return [round(float(value), _DECIMALS) for value in values]
