"""Annexes: sound blocks, the scene's own untouched, and balance that hangs on something."""

from __future__ import annotations

import numpy as np

from phyblock.data import read_builtin
from phyblock.domain import Block, Scene
from phyblock.making.questions.annexes import with_annex
from phyblock.making.questions.counterfactual import is_sure, resting_on
from phyblock.resources import bundled
from phyblock.sim.contact import find_gaps, find_overlaps

TASKS = read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks
SCENES = [task.scene for task in TASKS if len(task.scene) < 9][::30]


def annexed() -> list[tuple[Scene, tuple[Block, ...]]]:
    rng = np.random.default_rng(3)
    made = [(scene, with_annex(scene, rng)) for scene in SCENES]
    return [(scene, blocks) for scene, blocks in made if blocks]


def test_nothing_overlaps_or_floats_and_what_was_there_is_unchanged() -> None:
    made = annexed()
    assert len(made) > len(SCENES) / 2
    for scene, blocks in made:
        known = {block.order: block for block in scene.blocks}
        assert find_overlaps(blocks) == ()
        assert find_gaps(blocks) == ()
        assert any(block.order not in known for block in blocks)
        assert all(known[block.order] == block for block in blocks if block.order in known)
        assert len({block.order for block in blocks}) == len(blocks)


def test_some_removal_breaks_a_rule_of_thumb() -> None:
    """Somewhere a block is not needed by what rests on it, or holds what it rests on."""
    broken = 0
    for scene, blocks in annexed()[:5]:
        known = {block.order for block in scene.blocks}
        for order in [block.order for block in blocks if block.order not in known]:
            left = [block for block in blocks if block.order != order]
            resting = resting_on(blocks, order)
            assert resting_on(blocks, order, only=True) <= resting
            broken += bool(resting) is is_sure(left, ())
    assert broken
