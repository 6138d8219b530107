from __future__ import annotations

from dataclasses import replace

import pytest

from phyblock.domain import CandidateSet, Scene
from phyblock.errors import Problem
from phyblock.making.checks import CHECKS, FOREIGN, OURS, Finding, SceneFacts, findings_of
from phyblock.making.scenes.candidate_sets import make_candidates
from phyblock.making.scenes.sketch import make_scene
from phyblock.making.verification import AUDITED, LAWS, audit_scene, verify_scene
from phyblock.sim.contact import GROUND
from phyblock.sim.dynamics import Trial
from phyblock.sim.engine import Physics
from tests.designs.acceptance import form_problems, physics_problems
from tests.designs.pad import Pad
from tests.designs.scenes import designed_scene

SHORT = Trial(duration_s=1.0, physics=(Physics(),))
QUICK = replace(OURS, trial=SHORT, step_trial=SHORT)
GATE = designed_scene("l1-gate")
OFFERED = make_candidates(GATE)


def with_block(order: int, **changes: object) -> Scene:
    blocks = tuple(replace(b, **changes) if b.order == order else b for b in GATE.blocks)
    return replace(GATE, blocks=blocks)


def lifted(rise_m: float) -> Scene:
    x, y, z = GATE.blocks[2].position_m
    return with_block(3, position_m=(x, y, z + rise_m))


def cellar() -> Scene:
    pad = Pad()
    for x in (-2, 0, 2):
        for y in (-2, 0, 2):
            for _ in range(2):
                pad.put("cube", y, x)
    return make_scene("cellar", (4,), pad.blocks)


def offering(scene: Scene, change: object) -> SceneFacts:
    assert callable(change)
    return SceneFacts(scene, CandidateSet(change(OFFERED.candidates)), QUICK)


STRANGE = replace(OFFERED.candidates[0], type="arch", color="red", euler_deg=(45.0, 0.0, 0.0))
SPOILED = {
    "size": lambda: SceneFacts(replace(GATE, levels=(4,))),
    "palette": lambda: SceneFacts(with_block(3, color="green")),
    "undeclared dependency": lambda: SceneFacts(with_block(3, depend=())),
    "dependency without contact": lambda: SceneFacts(with_block(3, depend=(1, 2))),
    "layer": lambda: SceneFacts(with_block(3, layer=2)),
    "order": lambda: SceneFacts(replace(GATE, blocks=GATE.blocks[::-1])),
    "overlap": lambda: SceneFacts(lifted(-0.004)),
    "floating": lambda: SceneFacts(lifted(0.004)),
    "unstable": lambda: SceneFacts(lifted(0.05), tolerances=QUICK),
    "unstable step": lambda: SceneFacts(lifted(0.05), tolerances=QUICK),
    "hidden": lambda: SceneFacts(cellar()),
    "too many candidates": lambda: offering(GATE, lambda offered: offered * 3),
    "candidates": lambda: offering(GATE, lambda _: ()),
    "distractor": lambda: offering(GATE, lambda offered: (*offered, STRANGE)),
}


def test_every_check_has_an_example_here_and_is_chosen_somewhere() -> None:
    assert set(SPOILED) == set(CHECKS)
    assert {check.law for name, check in CHECKS.items() if name != "palette"} == set(LAWS)
    assert set(AUDITED) - {"duplicate"} <= set(CHECKS)


@pytest.mark.parametrize("name", SPOILED)
def test_a_check_finds_its_own_fault_measured_in_units(name: str) -> None:
    assert list(findings_of(SceneFacts(GATE, OFFERED, QUICK), [name])) == []
    facts = SPOILED[name]()
    findings = list(findings_of(facts, [name]))
    assert {finding.check for finding in findings} == {name}
    orders = {GROUND, *(block.order for block in facts.scene.blocks)}
    for finding in findings:
        assert finding.scene == facts.scene.id
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


def test_nothing_is_worked_out_before_it_is_asked_for() -> None:
    facts = SceneFacts(lifted(-0.004))
    names = ("size", "overlap", "unstable", "unstable step", "hidden")
    assert next(findings_of(facts, names)).check == "overlap"
    assert not {"finished", "steps", "hidden"} & set(vars(facts))


def test_dependencies_that_name_no_block_leave_layers_and_order_unjudged() -> None:
    facts = SceneFacts(with_block(3, depend=(9,)))
    assert list(findings_of(facts, ["size", "layer", "order"])) == []


def test_a_finding_reads_as_a_problem_with_orders_as_a_list() -> None:
    finding = Finding("s1", "order", "said", (2,), field="f", declared=(1, 3), derived=())
    assert finding.problem == Problem("s1", "said", "f", "[1, 3]", "")
