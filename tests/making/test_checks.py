"""Checks of scenes: each finds its own fault, in the same words for makers and verifiers."""

import functools
from collections import Counter
from dataclasses import replace

import pytest

from phyblock.domain.scene import CandidateSet, Symmetry
from phyblock.making import checks
from phyblock.making.files import SCENE_FILES, SUMS_FILE, sums_text
from phyblock.making.scenes.production import make_candidates
from phyblock.making.scenes.sketch import make_scene, transformed
from phyblock.sim.contact import GROUND
from phyblock.sim.dynamics import Trial
from phyblock.sim.engine import Physics
from phyblock.workers import open_workers
from tests.shipped import DATA, TASKS, official_tasks
from tests.sim.structures import built, turned

BUILT_IN = DATA / "phyblock-400"
SHORT = Trial(duration_s=1.0, physics=(Physics(),))
GATE = make_scene("l1-gate", (1,), built("arch; cuboid2:flat-y; triangle").blocks)
OFFERED = make_candidates(GATE)


def third(**changes):
    """The gate with its third block changed."""
    return replace(GATE, blocks=(*GATE.blocks[:2], replace(GATE.blocks[2], **changes)))


def lifted(rise_m):
    x, y, z = GATE.blocks[2].position_m
    return third(position_m=(x, y, z + rise_m))


def of_text(name, level, text):
    return make_scene(name, (level,), built(text).blocks)


STRANGE = replace(OFFERED.candidates[0], type="arch", color="red", euler_deg=(45.0, 0.0, 0.0))
OFFERS = {"candidates": (), "distractor": (*OFFERED.candidates, STRANGE)}
# A block of cubes, the inner of which do not show.
CELLAR = "; ".join(f"cube {y},{x}" for x in (-2, 0, 2) for y in (-2, 0, 2) for _ in range(2))
# It stands when finished, and falls before its second weight is there.
BEAM = of_text("beam", 1, "cube; cuboid3:flat-y; 2 cube 2.8")
SPOILED = {
    "size": (replace(GATE, levels=(4,)), "13 to 22 at level 4"),
    "undeclared dependency": (third(depend=()), "blocks[2].depend"),
    "dependency without contact": (third(depend=(1, 2)), "block 3 does not rest on block 1, which"),
    "layer": (third(layer=2), "blocks[2].layer"),
    "order": (replace(GATE, blocks=GATE.blocks[::-1]), "before its support"),
    "overlap": (lifted(-0.004), "block 3 overlaps block 2 by 4.00 mm"),
    "floating": (lifted(0.004), "block 3 floats 4.00 mm"),
    "unstable": (lifted(0.05), "block 3 falls when all is built"),
    "unstable step": (BEAM, "blocks 2, 3 fall at step 3, once block 3 is placed"),
    "hidden": (of_text("cellar", 4, CELLAR), "does not show in the goal picture"),
    "candidates": (GATE, "that block 1 needs"),
    "distractor": (GATE, "no goal has it"),
}


def test_every_check_has_an_example_here_and_is_chosen_somewhere():
    assert set(SPOILED) == set(checks.CHECKS)
    assert set(checks.FOREIGN_CHECKS) <= set(checks.CHECKS)


@pytest.mark.parametrize("name", SPOILED)
def test_a_check_finds_its_own_fault_measured_in_units(name):
    scene, said = SPOILED[name]
    offered = CandidateSet(OFFERS.get(name, OFFERED.candidates))
    sound, findings = (
        list(checks.findings_of(checks.SceneFacts(*one, trial=SHORT), [name]))
        for one in ((GATE, OFFERED), (scene, offered))
    )
    assert sound == []
    assert any(said in str(finding) for finding in findings)
    orders = {GROUND, *(block.order for block in scene.blocks)}
    for finding in findings:
        assert (finding.check, finding.where) == (name, scene.id)
        assert orders.issuperset(finding.blocks)


def test_duplicates_and_orphans_of_a_set_are_found():
    image = turned(transformed(GATE.blocks, Symmetry(1, mirrored=True)), 0.0, (0.2, 0.0))
    copy = replace(GATE, id="copy", blocks=tuple(image), parents=(GATE.id,))
    orphan = replace(TASKS[0].scene, parents=("nowhere",))
    found = [(one.where, one.check) for one in checks.check_set([GATE, copy, orphan])]
    assert found == [("copy", "duplicate"), (orphan.id, "parents")]


def test_the_built_in_set_holds_what_the_paper_holds():
    scenes = [task.scene for task in TASKS]
    count = {(1,): 22, (1, 2): 14, (2,): 107, (3,): 138, (4,): 119}
    assert Counter(scene.levels for scene in scenes) == count
    assert sum(scene.parents == (scene.id,) for scene in scenes) == 150
    assert checks.check_set(scenes) == ()
    assert (BUILT_IN / SUMS_FILE).read_text() == sums_text(BUILT_IN, SCENE_FILES)
    assert all(task.candidates == make_candidates(task.scene) for task in TASKS)


@pytest.mark.parametrize("task", TASKS[::100], ids=lambda task: task.scene.id)
def test_some_of_the_built_in_set_again(task):
    assert checks.verify_scene(task) == ()


OVERLAPPING = {"001", "003", "187", "214", "297", "342"}
FLOATING = {
    *("006", "040", "097", "116", "117", "153", "184", "212", "242", "254", "255"),
    *("274", "288", "290", "292", "307", "313", "318", "325", "327", "333"),
}


@pytest.mark.parametrize("is_whole", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_annotation_errors_of_the_official_data_are_reported(official_checkout, is_whole):
    some = ("000", "001", "040", "069", "187")
    tasks = [t for t in official_tasks(official_checkout) if is_whole or t.scene.id in some]
    verify = functools.partial(checks.verify_foreign, **{} if is_whole else {"trial": SHORT})
    with open_workers(2 if is_whole else 1) as workers:
        every = zip(tasks, workers.map(verify, tasks), strict=True)
        found = {task.scene.id: {one.check for one in findings} for task, findings in every}

    def having(*names):
        return {name for name, checked in found.items() if checked & {*names}}

    assert having("overlap") == OVERLAPPING & found.keys()
    assert having("floating") == having("unstable") == FLOATING & found.keys()
    assert not having("candidates")
    if is_whole:
        assert len(having("layer")) == 70
        assert len(found) - len(having("unstable", "unstable step")) == 356
    else:
        assert having("dependency without contact") == {"040", "069"}
