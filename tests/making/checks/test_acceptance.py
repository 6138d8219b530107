from __future__ import annotations

from dataclasses import replace

import pytest

from phyblock.domain import Block, Scene
from phyblock.errors import DataError
from phyblock.making.scenes.sketch import make_scene
from tests.designs.acceptance import accept, form_problems, physics_problems
from tests.designs.pad import Pad
from tests.designs.scenes import designed_scene


def gate() -> Scene:
    return designed_scene("l1-gate")


def with_block(scene: Scene, index: int, **changes: object) -> Scene:
    blocks = list(scene.blocks)
    blocks[index] = replace(blocks[index], **changes)
    return replace(scene, blocks=tuple(blocks))


def moved(block: Block, rise_m: float) -> tuple[float, float, float]:
    x, y, z = block.position_m
    return (x, y, z + rise_m)


def test_a_sound_scene_is_accepted() -> None:
    accept(gate())


@pytest.mark.parametrize(
    ("rise_m", "said"),
    [
        (0.004, "floats 4.00 mm"),
        (-0.004, "block 3 overlaps block 2 by 4.00 mm"),
        (0.05, "block 3 falls at step 3"),
    ],
)
def test_a_block_out_of_its_place_is_refused(rise_m: float, said: str) -> None:
    scene = gate()
    broken = with_block(scene, 2, position_m=moved(scene.blocks[2], rise_m))
    with pytest.raises(DataError, match=said):
        accept(broken)


def test_a_wrong_dependency_is_named_with_the_right_one() -> None:
    (problem,) = physics_problems(with_block(gate(), 2, depend=(1, 2)))
    assert problem.field == "blocks[2].depend"
    assert problem.allowed == "[2]"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"layer": 2}, "longest path"),
        ({"color": "green"}, "not in the palette"),
        ({"depend": ()}, "longest path"),
    ],
)
def test_a_wrong_declaration_is_refused(changes: dict[str, object], said: str) -> None:
    problems = form_problems(with_block(gate(), 2, **changes))
    assert any(said in problem.message for problem in problems)


def test_an_order_that_cannot_be_built_is_refused() -> None:
    scene = gate()
    backwards = replace(scene, blocks=scene.blocks[::-1])
    assert any("before its support" in problem.message for problem in form_problems(backwards))


def test_levels_limit_blocks_and_layers() -> None:
    tower = Pad()
    for _ in range(5):
        tower.put("cube")
    scene = make_scene("tower", (1, 2), tower.blocks)
    found = [(problem.message, problem.found, problem.allowed) for problem in form_problems(scene)]
    assert ("wrong size", "5", "1 to 4 at level 1") in found
    assert ("too high", "5", "at most 3 at level 2") in found


def test_what_falls_midway_is_refused_though_it_stands_in_the_end() -> None:
    sketch = Pad()
    sketch.put("cube")
    sketch.put("cuboid3", pose="flat-y")
    sketch.pair("cube", 2.8)
    problems = physics_problems(make_scene("beam", (1,), sketch.blocks))
    messages = [problem.message for problem in problems]
    assert messages == ["blocks 2, 3 fall at step 3, once block 3 is placed"]


def test_a_block_that_touches_nothing_is_refused_though_it_declares_nothing() -> None:
    scene = gate()
    x, y, _ = scene.blocks[2].position_m
    lifted = with_block(scene, 2, position_m=(x, y, 0.5), depend=(), layer=1)
    fields = [problem.field for problem in physics_problems(lifted)]
    assert "blocks[2].depend" in fields
