"""A shape and a background are one row each: added from outside, they stand, score and show."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from phyblock.domain import SHAPES, Candidate, CandidateSet, Plan, Scene, orientation_class
from phyblock.domain.blocks import Shape, polygon
from phyblock.scoring.plan import AssemblyScorer
from phyblock.sim.backgrounds import GROUNDS, Ground
from phyblock.sim.contact import support_graph
from phyblock.sim.dynamics import check
from phyblock.sim.engine import installed_engines
from phyblock.sim.geometry import collision_pieces, solid_mesh
from phyblock.sim.pictures import PictureStyle, candidates_png, goal_png
from tests.sim.structures import block

SIDE_M = 0.03


def hexagon() -> Shape:
    angles = np.radians(np.arange(6) * 60)
    return Shape(
        profile=polygon(SIDE_M * np.stack([np.cos(angles), np.sin(angles)], axis=1)),
        axis="z",
        length_m=0.04,
        fold=6,
        flips=True,
        kit_colors=("green",),
        word="hexagonal prism",
        poses={"flat": (0.0, 0.0, 0.0)},
    )


@pytest.fixture
def towers(monkeypatch: pytest.MonkeyPatch) -> Scene:
    monkeypatch.setitem(SHAPES, "hexagon", hexagon())
    lower = block(1, "hexagon", (0.0, 0.0, 0.02), color="green")
    upper = block(2, "hexagon", (0.01, 0.0, 0.06), (0.0, 0.0, 30.0), "green")
    return Scene("towers", (2,), (lower, replace(upper, depend=(1,))), ("towers",))


def test_a_shape_has_mass_mesh_pieces_and_symmetries(towers: Scene) -> None:
    shape, mesh = SHAPES["hexagon"], solid_mesh("hexagon")
    assert shape.volume_m3 == pytest.approx(1.5 * 3**0.5 * SIDE_M**2 * 0.04)
    assert mesh.volume_m3 == pytest.approx(shape.volume_m3)
    assert shape.center_of_mass_m == pytest.approx((0, 0, 0), abs=1e-12)
    assert len(collision_pieces("hexagon")) == 1
    assert orientation_class("hexagon", (0, 0, 60)) == orientation_class("hexagon", (180, 0, 0))
    assert towers.blocks[0].look != towers.blocks[1].look


@pytest.mark.parametrize("engine", installed_engines())
def test_a_shape_stands_and_is_scored(
    towers: Scene, engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PHYBLOCK_PHYSICS", engine)
    assert support_graph(towers.blocks) == {1: frozenset({0}), 2: frozenset({1})}
    assert check(towers.blocks).stable
    candidates = CandidateSet(tuple(Candidate(b.type, b.color, b.euler_deg) for b in towers.blocks))
    scorer = AssemblyScorer(towers, candidates, ("A",))
    assert [scorer.score(Plan(p), ("optimal",), None)[0].counts.tp for p in ((1, 2), (2, 1))] == [
        2,
        1,
    ]


def test_a_shape_is_drawn_on_a_background_of_its_own(
    towers: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    def sand(_camera: object, size_px: int) -> np.ndarray:
        return np.full((size_px, size_px, 3), (230, 210, 160), dtype=np.float32)

    ink = GROUNDS["white"]
    monkeypatch.setitem(GROUNDS, "sand", Ground(0.3, ink.ink, ink.line, ink.rim, sand))
    monkeypatch.setattr("phyblock.sim.pictures.BACKGROUNDS", tuple(GROUNDS))
    style = PictureStyle(128, "sand")
    candidates = CandidateSet((Candidate("hexagon", "green", (0.0, 0.0, 0.0)),))
    for png in (goal_png(towers, style), candidates_png(candidates, style)):
        pixels = np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).reshape(-1, 3)
        assert (pixels == (230, 210, 160)).all(axis=1).any()
        assert (pixels[:, 1].astype(int) - pixels[:, 0] > 40).any()
