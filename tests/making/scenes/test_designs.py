"""The designs that other tests build on are sound themselves, by every check of the generator."""

from __future__ import annotations

import pytest

from phyblock.sim.contact import find_gaps, find_overlaps
from phyblock.sim.pictures import hidden_blocks
from tests.designs.acceptance import accept, form_problems
from tests.designs.scenes import designed_scene, designed_scenes

RECHECKED = ("l1-boat", "l1-dolmen", "l2-bridge", "l2-rocket", "l3-balance", "l3-robot")


@pytest.mark.parametrize("scene", designed_scenes(), ids=lambda scene: scene.id)
def test_a_scene_is_in_form_fits_together_and_shows(scene) -> None:
    assert form_problems(scene) == ()
    assert find_overlaps(scene.blocks) == ()
    assert find_gaps(scene.blocks) == ()
    assert hidden_blocks(scene) == ()


@pytest.mark.parametrize("name", RECHECKED)
def test_physics_again(name: str) -> None:
    accept(designed_scene(name))
