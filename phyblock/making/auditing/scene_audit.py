"""Auditing scenes made elsewhere: what geometry and physics say against what was declared.

The tolerant sister of the acceptance test: it takes scenes whose dependencies may be unsound,
measures instead of refusing, and proposes what they should say.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.making.checks.finding import CheckName, Finding
from phyblock.making.checks.scene_checks import findings_of
from phyblock.making.checks.scene_facts import SceneFacts, graph_of
from phyblock.making.checks.tolerances import FOREIGN, Tolerances
from phyblock.sim.support import GROUND

__all__ = ["AUDITED", "SceneAudit", "audit_scene"]

_OF_A_SCENE: tuple[CheckName, ...] = (
    "overlap",
    "floating",
    "undeclared dependency",
    "dependency without contact",
    "layer",
    "order",
    "unstable",
    "unstable step",
)
AUDITED: tuple[CheckName, ...] = ("unreadable", *_OF_A_SCENE, "duplicate", "candidates")
"""What an audit may find, in the order of its tables: causes before their effects."""


@dataclass(frozen=True)
class SceneAudit:
    """What an audit found in one scene.

    `declared`, `contacts` and `shared` count dependencies (the ground is one): those declared,
    those that are contacts, and those that are both. `fixed` is the scene with dependencies from
    contacts and layers from the longest path; `sound` whether it has an order, which it lacks
    when neither contacts nor declared dependencies name one.
    """

    scene: Scene
    findings: tuple[Finding, ...]
    declared: int
    contacts: int
    shared: int
    fixed: Scene
    sound: bool

    def has(self, *checks: CheckName) -> bool:
        """Whether one of these checks found something."""
        return any(finding.check in checks for finding in self.findings)


def audit_scene(
    scene: Scene, candidates: CandidateSet | None, tolerances: Tolerances = FOREIGN
) -> SceneAudit:
    """Check one scene, whose orders are unique; its dependencies need not be sound.

    Without `candidates` they are not checked. Raises SimulationError as the simulator does.
    """
    facts = SceneFacts(scene, candidates, tolerances)
    fixed = _fixed(facts)
    pairs = [(facts.declared[block.order], facts.contacts[block.order]) for block in scene.blocks]
    return SceneAudit(
        scene,
        tuple(findings_of(facts, (*_OF_A_SCENE, "candidates"))),
        declared=sum(len(declared) for declared, _ in pairs),
        contacts=sum(len(contacts) for _, contacts in pairs),
        shared=sum(len(declared & contacts) for declared, contacts in pairs),
        fixed=fixed or scene,
        sound=fixed is not None,
    )


def _fixed(facts: SceneFacts) -> Scene | None:
    """Dependencies from contact, layers from them; what touches nothing keeps what it declares.

    None where neither names an order.
    """
    rests_on: Mapping[int, frozenset[int]] = {
        order: contacts or facts.declared[order] for order, contacts in facts.contacts.items()
    }
    graph = graph_of(rests_on)
    if graph is None:
        rests_on, graph = facts.declared, facts.graph
    if graph is None:
        return None
    blocks = tuple(
        replace(block, depend=tuple(sorted(rests_on[block.order] - {GROUND})), layer=layer)
        for block, layer in zip(facts.scene.blocks, graph.layers, strict=True)
    )
    return replace(facts.scene, blocks=blocks)
