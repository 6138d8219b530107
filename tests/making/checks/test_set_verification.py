from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from phyblock.data import read_builtin
from phyblock.domain import CandidateSet, Scene
from phyblock.domain.symmetry import Symmetry
from phyblock.making.checks import find_duplicates, find_orphans
from phyblock.making.poses import transformed
from phyblock.making.scenes.candidate_sets import make_candidates
from phyblock.making.scenes.scene_files import SUMS_FILE, sums_text
from phyblock.making.scenes.sketch import make_scene
from phyblock.making.verification import (
    LAWS,
    check_looks,
    check_sums,
    verify_scenes,
)
from phyblock.making.workers import open_workers
from tests.designs.pad import Pad
from tests.designs.scenes import designed_scene, designed_scenes

BUILT_IN = Path(__file__).parents[3] / "benchmarks" / "data" / "phyblock-400"
TASKS = read_builtin(BUILT_IN).tasks
GATE = designed_scene("l1-gate")


def failed(scene: Scene, candidates: CandidateSet | None = None) -> dict[str, list[str]]:
    """What each failing check says of a scene."""
    chosen = candidates or make_candidates(scene)
    with open_workers() as workers:
        (broken,) = verify_scenes([(scene, chosen)], workers)
    assert tuple(broken) == LAWS
    return {law: [str(one) for one in findings] for law, findings in broken.items() if findings}


def with_block(index: int, **changes: object) -> Scene:
    blocks = list(GATE.blocks)
    blocks[index] = replace(blocks[index], **changes)
    return replace(GATE, blocks=tuple(blocks))


def lifted(index: int, rise_m: float) -> Scene:
    x, y, z = GATE.blocks[index].position_m
    return with_block(index, position_m=(x, y, z + rise_m))


def tower(count: int) -> Scene:
    sketch = Pad()
    for _ in range(count):
        sketch.put("cube")
    return make_scene("tower", (4,), sketch.blocks)


def beam() -> Scene:
    sketch = Pad()
    sketch.put("cube")
    sketch.put("cuboid3", pose="flat-y")
    sketch.pair("cube", 2.8)
    return make_scene("beam", (1,), sketch.blocks)


def hidden() -> Scene:
    sketch = Pad()
    for x in (-2, 0, 2):
        for y in (-2, 0, 2):
            for _ in range(2):
                sketch.put("cube", y, x)
    return make_scene("cellar", (4,), sketch.blocks)


def test_a_sound_scene_passes_every_check() -> None:
    assert failed(GATE) == {}


@pytest.mark.parametrize(
    ("broken", "check", "said"),
    [
        (lambda: lifted(2, 0.004), "no gap", "block 3 floats 4.00 mm"),
        (lambda: lifted(2, -0.004), "no overlap", "block 3 overlaps block 2 by 4.00 mm"),
        (lambda: lifted(2, 0.05), "stands when finished", "block 3 falls when all is built"),
        (lambda: with_block(2, depend=(1,)), "dependencies are contacts", "blocks[2].depend"),
        (lambda: with_block(2, layer=2), "layers are longest paths", "blocks[2].layer"),
        (lambda: replace(GATE, blocks=GATE.blocks[::-1]), "order can be built", "before its"),
        (lambda: tower(23), "limits of its levels", "13 to 22 at level 4"),
        (beam, "stands at every step", "blocks 2, 3 fall at step 3"),
        (hidden, "every block shows", "does not show in the goal picture"),
    ],
)
def test_a_broken_scene_is_named_with_what_and_where(
    broken: Callable[[], Scene], check: str, said: str
) -> None:
    scene = broken()
    found = failed(scene)
    assert any(said in text for text in found[check])
    assert all(text.startswith(scene.id) for texts in found.values() for text in texts)


def test_candidates_that_lack_a_block_or_stand_strangely_are_named() -> None:
    whole = make_candidates(GATE)
    needed = {block.look for block in GATE.blocks}
    lacking = CandidateSet(tuple(c for c in whole.candidates if c.look not in needed))
    assert any("that block 1 needs" in text for text in failed(GATE, lacking)["candidate set"])
    strange = replace(whole.candidates[0], type="arch", color="red", euler_deg=(45.0, 0.0, 0.0))
    (text,) = failed(GATE, CandidateSet((*whole.candidates[:-1], strange)))["candidate set"]
    assert "stands as no block of a goal does" in text


def test_duplicates_are_found_turned_and_mirrored() -> None:
    image = transformed(GATE.blocks, Symmetry(1, mirrored=True))
    copy = replace(GATE, id="copy", blocks=image)
    assert [finding.scene for finding in find_duplicates([GATE, copy])] == ["copy"]
    assert find_duplicates(designed_scenes()) == ()


def test_parents_must_be_base_scenes_of_the_set() -> None:
    orphan = replace(GATE, id="orphan", parents=("nowhere",))
    child = replace(GATE, id="child", parents=(GATE.id,))
    assert [finding.scene for finding in find_orphans([GATE, child, orphan])] == ["orphan"]


def test_pictures_tell_apart_all_looks_in_use() -> None:
    looks, alike = check_looks(task.candidates for task in TASKS)
    assert alike == ()
    assert looks >= 30  # Poses that no goal needs are not offered: they give themselves away.
    candidate = TASKS[0].candidates.candidates[0]
    turned = replace(candidate, euler_deg=(0.0, 0.0, 0.05))
    twins = CandidateSet((replace(candidate, euler_deg=(0.0, 0.0, 0.0)), turned))
    assert len(check_looks([twins])[1]) == 1


def test_a_changed_or_missing_file_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    shutil.copytree(BUILT_IN, folder)
    assert check_sums(folder) == (3, ())
    (folder / "README.md").write_text("changed\n")
    (folder / "scenes.jsonl").unlink()
    _, problems = check_sums(folder)
    assert [problem.message for problem in problems] == [
        f"differs from its checksum in {SUMS_FILE}",
        "is missing",
    ]
    (folder / SUMS_FILE).unlink()
    assert check_sums(folder)[1][0].message == "is missing"


def test_the_built_in_set_holds_what_the_paper_holds() -> None:
    scenes = [task.scene for task in TASKS]
    assert len(scenes) == 400
    count = {level: sum(level in scene.levels for scene in scenes) for level in (1, 2, 3, 4)}
    assert count == {1: 36, 2: 121, 3: 138, 4: 119}
    assert sum(scene.levels == (1, 2) for scene in scenes) == 14
    assert sum(scene.parents == (scene.id,) for scene in scenes) == 150
    assert find_duplicates(scenes) == ()
    assert list(find_orphans(scenes)) == []
    assert (BUILT_IN / SUMS_FILE).read_text() == sums_text(BUILT_IN)


@pytest.mark.parametrize("task", TASKS[::50], ids=lambda task: task.scene.id)
def test_some_of_the_built_in_set_again(task) -> None:
    assert failed(task.scene, task.candidates) == {}
    assert task.candidates == make_candidates(task.scene)
