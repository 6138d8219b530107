from __future__ import annotations

import csv
import io
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import strategies as st

from phyblock.data import read_official
from phyblock.domain import CandidateSet, Scene
from phyblock.making.checks import FOREIGN, CheckName, find_duplicates
from phyblock.making.scenes.candidate_sets import make_candidates
from phyblock.making.verification import (
    AUDITED,
    SceneAudit,
    audit_scene,
    audit_scenes,
    findings_csv,
)
from phyblock.sim.dynamics import Trial
from phyblock.sim.engine import Physics
from tests.designs.scenes import designed_scenes
from tests.sim.structures import counterweighted_beam, scene_of
from tests.sim.test_support import FLOATING, OVERLAPPING

SHORT = Trial(duration_s=1.0, physics=(Physics(),))
QUICK = replace(FOREIGN, trial=SHORT, step_trial=SHORT)
STILL = replace(
    FOREIGN, trial=replace(SHORT, duration_s=0.0), step_trial=replace(SHORT, duration_s=0.0)
)
SCENES = {scene.id: scene for scene in designed_scenes()}
OFFICIAL_SAMPLE = ("000", "001", "040", "069", "187")
SOUND = ("l1-gate", "l2-rocket", "l3-torii")


def found(audit: SceneAudit) -> set[str]:
    return {finding.check for finding in audit.findings}


def with_block(scene: Scene, order: int, **changes: object) -> Scene:
    blocks = tuple(replace(b, **changes) if b.order == order else b for b in scene.blocks)
    return replace(scene, blocks=blocks)


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_scene_shows_nothing_and_is_its_own_correction(name: str) -> None:
    scene = SCENES[name]
    audit = audit_scene((scene, make_candidates(scene)), QUICK)
    assert audit.findings == ()
    assert audit.declared == audit.contacts == audit.shared


SPOILED = {
    "overlap": lambda s: with_block(s, 3, position_m=(0.0, -0.05, 0.07)),
    "floating": lambda s: with_block(s, 10, position_m=(0.0, -0.05, 0.29)),
    "undeclared dependency": lambda s: with_block(s, 5, depend=(3,)),
    "dependency without contact": lambda s: with_block(s, 6, depend=(3, 5)),
    "layer": lambda s: with_block(s, 11, layer=5),
    "order": lambda s: replace(s, blocks=(*s.blocks[1:], s.blocks[0])),
    "unstable": lambda s: replace(s, blocks=s.blocks[:5] + s.blocks[8:]),
    "unstable step": lambda s: replace(s, blocks=(*s.blocks[:2], *s.blocks[3:], s.blocks[2])),
}


@pytest.mark.parametrize("check", SPOILED)
def test_what_is_spoiled_is_found(check: str) -> None:
    audit = audit_scene((SPOILED[check](SCENES["l3-torii"]), None), QUICK)
    assert check in found(audit)


def test_a_beam_that_waits_for_its_counterweight_falls_midway_alone() -> None:
    audit = audit_scene((scene_of(counterweighted_beam()), None), QUICK)
    steps = [finding for finding in audit.findings if finding.check == "unstable step"]
    assert "unstable" not in found(audit)
    assert [2 in step.blocks and "block 3" in step.message for step in steps] == [True]


def test_a_needed_block_without_a_candidate_is_named() -> None:
    scene = SCENES["l1-gate"]
    offered = make_candidates(scene)
    needed = scene.blocks[0].look
    fewer = CandidateSet(tuple(c for c in offered.candidates if c.look != needed))
    audit = audit_scene((scene, fewer), QUICK)
    assert {order for f in audit.findings for order in f.blocks} == {
        b.order for b in scene.blocks if b.look == needed
    }
    assert found(audit) == {"candidates"}


depends = st.lists(st.sets(st.integers(0, 5)), min_size=5, max_size=5)


def test_duplicates_are_found_by_shape_and_not_by_name() -> None:
    gate, dog = SCENES["l1-gate"], SCENES["l1-dog"]
    shifted = tuple(
        replace(b, position_m=(b.position_m[0] + 0.2, b.position_m[1], b.position_m[2]))
        for b in gate.blocks
    )
    twin = replace(gate, id="twin", blocks=shifted)
    (duplicate,) = find_duplicates([gate, dog, twin])
    assert (duplicate.scene, duplicate.derived) == ("twin", "l1-gate")


def test_the_same_findings_with_two_processes() -> None:
    tasks = [(SPOILED["floating"](SCENES["l3-torii"]), None), (SCENES["l1-gate"], None)]
    alone = list(audit_scenes(tasks, QUICK, 1))
    assert list(audit_scenes(tasks, QUICK, 2)) == alone
    assert [bool(one.findings) for one in alone] == [True, False]


def test_the_csv_holds_every_finding() -> None:
    scene = SPOILED["overlap"](SCENES["l3-torii"])
    audit = audit_scene((scene, None), QUICK)
    rows = list(csv.DictReader(io.StringIO(findings_csv([audit]))))
    assert [row["check"] for row in rows] == [finding.check for finding in audit.findings]
    assert {row["scene"] for row in rows} == {"l3-torii"}
    assert {row["level"] for row in rows} == {"3"}


def test_official_annotation_errors_are_reported(official_checkout: Path) -> None:
    tasks = {task.scene.id: task for task in read_official(official_checkout).tasks}
    for name in OFFICIAL_SAMPLE:
        checks = found(audit_scene((tasks[name].scene, tasks[name].candidates), QUICK))
        assert ("overlap" in checks) == (name in OVERLAPPING)
        assert ("floating" in checks) == (name in FLOATING)
        assert ("unstable" in checks) == (name in FLOATING)
        assert ("dependency without contact" in checks) == (name in {"040", "069"})


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


def test_every_check_has_a_name_of_its_own() -> None:
    assert len(set(AUDITED)) == len(AUDITED) == 10
