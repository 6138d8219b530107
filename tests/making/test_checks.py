"""Checks of scenes: each finds its own fault, in the same words for makers, verifiers, auditors."""

from __future__ import annotations

import csv
import io
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from phyblock.data import read_builtin, read_official
from phyblock.domain import Block, CandidateSet, Scene
from phyblock.domain.symmetry import Symmetry
from phyblock.errors import DataError
from phyblock.making.checks import (
    AUDITED,
    CHECKS,
    FOREIGN,
    LAWS,
    OURS,
    CheckName,
    SceneFacts,
    audit_scene,
    audit_scenes,
    check_looks,
    find_duplicates,
    find_orphans,
    findings_csv,
    findings_of,
    verify_scene,
)
from phyblock.making.scenes.candidates import make_candidates
from phyblock.making.scenes.files import SUMS_FILE, check_sums, sums_text
from phyblock.making.scenes.sketch import make_scene, transformed
from phyblock.sim.contact import GROUND
from phyblock.sim.dynamics import Trial
from phyblock.sim.engine import Physics
from tests.designs.acceptance import accept, form_problems, physics_problems
from tests.designs.pad import Pad
from tests.designs.scenes import designed_scene, designed_scenes
from tests.sim.test_support import FLOATING, OVERLAPPING

BUILT_IN = Path(__file__).parents[2] / "benchmarks" / "data" / "phyblock-400"
TASKS = read_builtin(BUILT_IN).tasks
SHORT = Trial(duration_s=1.0, physics=(Physics(),))
QUICK = replace(OURS, trial=SHORT, step_trial=SHORT)
QUICK_FOREIGN = replace(FOREIGN, trial=SHORT, step_trial=SHORT)
GATE = designed_scene("l1-gate")
OFFERED = make_candidates(GATE)


def with_block(order: int, **changes: object) -> Scene:
    blocks = tuple(replace(b, **changes) if b.order == order else b for b in GATE.blocks)
    return replace(GATE, blocks=blocks)


def lifted(rise_m: float) -> Scene:
    x, y, z = GATE.blocks[2].position_m
    return with_block(3, position_m=(x, y, z + rise_m))


def cellar() -> Scene:
    """A block of cubes, the inner of which do not show."""
    pad = Pad()
    for x in (-2, 0, 2):
        for y in (-2, 0, 2):
            for _ in range(2):
                pad.put("cube", y, x)
    return make_scene("cellar", (4,), pad.blocks)


def beam() -> Scene:
    """It stands when finished, and falls before its second weight is there."""
    pad = Pad()
    pad.put("cube")
    pad.put("cuboid3", pose="flat-y")
    pad.pair("cube", 2.8)
    return make_scene("beam", (1,), pad.blocks)


def offering(change: object) -> SceneFacts:
    assert callable(change)
    return SceneFacts(GATE, CandidateSet(change(OFFERED.candidates)), QUICK)


STRANGE = replace(OFFERED.candidates[0], type="arch", color="red", euler_deg=(45.0, 0.0, 0.0))
SPOILED = {
    "size": (lambda: SceneFacts(replace(GATE, levels=(4,))), "13 to 22 at level 4"),
    "palette": (lambda: SceneFacts(with_block(3, color="green")), "not in the palette"),
    "undeclared dependency": (lambda: SceneFacts(with_block(3, depend=())), "blocks[2].depend"),
    "dependency without contact": (
        lambda: SceneFacts(with_block(3, depend=(1, 2))),
        "block 3 does not rest on block 1, which is declared",
    ),
    "layer": (lambda: SceneFacts(with_block(3, layer=2)), "blocks[2].layer"),
    "order": (lambda: SceneFacts(replace(GATE, blocks=GATE.blocks[::-1])), "before its support"),
    "overlap": (lambda: SceneFacts(lifted(-0.004)), "block 3 overlaps block 2 by 4.00 mm"),
    "floating": (lambda: SceneFacts(lifted(0.004)), "block 3 floats 4.00 mm"),
    "unstable": (
        lambda: SceneFacts(lifted(0.05), tolerances=QUICK),
        "block 3 falls when all is built",
    ),
    "unstable step": (
        lambda: SceneFacts(beam(), tolerances=QUICK),
        "blocks 2, 3 fall at step 3, once block 3 is placed",
    ),
    "hidden": (lambda: SceneFacts(cellar()), "does not show in the goal picture"),
    "too many candidates": (lambda: offering(lambda offered: offered * 3), "16"),
    "candidates": (lambda: offering(lambda _: ()), "that block 1 needs"),
    "distractor": (lambda: offering(lambda offered: (*offered, STRANGE)), "stands as no block"),
}


def test_every_check_has_an_example_here_and_is_chosen_somewhere() -> None:
    assert set(SPOILED) == set(CHECKS)
    assert {check.law for name, check in CHECKS.items() if name != "palette"} == set(LAWS)
    assert set(AUDITED) - {"duplicate"} <= set(CHECKS)
    assert len(set(AUDITED)) == len(AUDITED) == 10


@pytest.mark.parametrize("name", SPOILED)
def test_a_check_finds_its_own_fault_measured_in_units(name: CheckName) -> None:
    assert list(findings_of(SceneFacts(GATE, OFFERED, QUICK), [name])) == []
    make, said = SPOILED[name]
    facts = make()
    findings = list(findings_of(facts, [name]))
    assert {finding.check for finding in findings} == {name}
    assert any(said in str(finding) for finding in findings)
    orders = {GROUND, *(block.order for block in facts.scene.blocks)}
    for finding in findings:
        assert str(finding).startswith(facts.scene.id)
        assert orders.issuperset(finding.blocks)
        assert (finding.value is None) == (finding.tolerance is None) == (finding.unit == "")
        if finding.value is not None and finding.tolerance is not None:
            assert finding.value > finding.tolerance


@pytest.mark.parametrize(
    "scene",
    [lifted(0.004), lifted(-0.004), with_block(3, depend=(1,)), with_block(3, layer=2)],
    ids=["floating", "overlap", "dependency", "layer"],
)
def test_accepting_verifying_and_auditing_say_the_same_words(scene: Scene) -> None:
    audited = {finding.message for finding in audit_scene((scene, OFFERED), FOREIGN).findings}
    verified = {f.message for found in verify_scene((scene, OFFERED)).values() for f in found}
    refused = {p.message for p in (*form_problems(scene), *physics_problems(scene))}
    assert audited
    assert audited <= verified
    assert audited <= refused
    with pytest.raises(DataError):
        accept(scene)


def test_the_same_findings_with_two_processes_and_in_the_csv() -> None:
    tasks = [(lifted(0.004), None), (GATE, OFFERED)]
    alone = list(audit_scenes(tasks, QUICK_FOREIGN, 1))
    assert list(audit_scenes(tasks, QUICK_FOREIGN, 2)) == alone
    assert [bool(one.findings) for one in alone] == [True, False]
    assert alone[1].declared == alone[1].contacts == alone[1].shared
    rows = list(csv.DictReader(io.StringIO(findings_csv(alone))))
    assert [row["check"] for row in rows] == [finding.check for finding in alone[0].findings]
    assert {(row["scene"], row["level"]) for row in rows} == {("l1-gate", "1")}


def test_duplicates_and_orphans_of_a_set_are_found() -> None:
    def moved(block: Block) -> Block:
        x, y, z = block.position_m
        return replace(block, position_m=(x + 0.2, y, z))

    image = transformed(GATE.blocks, Symmetry(1, mirrored=True))
    copy = replace(GATE, id="copy", blocks=tuple(map(moved, image)), parents=(GATE.id,))
    (duplicate,) = find_duplicates([GATE, designed_scene("l1-dog"), copy])
    assert (duplicate.scene, duplicate.derived) == ("copy", "l1-gate")
    assert find_duplicates(designed_scenes()) == ()
    orphan = replace(GATE, id="orphan", parents=("nowhere",))
    assert [finding.scene for finding in find_orphans([GATE, copy, orphan])] == ["orphan"]


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
    changed = f"differs from its checksum in {SUMS_FILE}"
    assert [problem.message for problem in check_sums(folder)[1]] == [changed, "is missing"]
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
    assert all(task.candidates == make_candidates(task.scene) for task in TASKS)


@pytest.mark.parametrize("task", TASKS[::100], ids=lambda task: task.scene.id)
def test_some_of_the_built_in_set_again(task) -> None:
    assert not any(verify_scene((task.scene, task.candidates)).values())


def test_official_annotation_errors_are_reported(official_checkout: Path) -> None:
    tasks = {task.scene.id: task for task in read_official(official_checkout).tasks}
    for name in ("000", "001", "040", "069", "187"):
        audit = audit_scene((tasks[name].scene, tasks[name].candidates), QUICK_FOREIGN)
        assert audit.has("overlap") == (name in OVERLAPPING)
        assert audit.has("floating") == audit.has("unstable") == (name in FLOATING)
        assert audit.has("dependency without contact") == (name in {"040", "069"})


@pytest.mark.slow
def test_the_whole_official_data(official_checkout: Path) -> None:
    tasks = [(task.scene, task.candidates) for task in read_official(official_checkout).tasks]
    audits = list(audit_scenes(tasks, FOREIGN, 2))

    def having(*checks: CheckName) -> set[str]:
        return {audit.scene.id for audit in audits if audit.has(*checks)}

    assert having("overlap") == OVERLAPPING
    assert having("floating") == having("unstable") == FLOATING
    shared = sum(audit.shared for audit in audits)
    assert shared / sum(audit.declared for audit in audits) == pytest.approx(0.982, abs=0.001)
    assert shared / sum(audit.contacts for audit in audits) == pytest.approx(0.987, abs=0.004)
    assert len(having("layer")) == 70
    assert len(audits) - len(having("unstable", "unstable step")) == 356
    assert not having("candidates")
