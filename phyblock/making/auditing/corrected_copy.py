"""A copy of an audited data set with the dependencies and layers that its contacts say."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from phyblock.domain.candidates import CandidateSet
from phyblock.files import atomic_write, check_free, writing
from phyblock.making.auditing.scene_audit import SceneAudit
from phyblock.making.auditing.set_audit import csv_text, shown_orders
from phyblock.making.checks.scene_facts import declared_orders
from phyblock.making.scenes.scene_files import SCENES_FILE
from phyblock.records.scene import StoredScene

__all__ = ["CHANGES_FILE", "Change", "Copied", "changes_of", "write_fixed"]

CHANGES_FILE = "changes.csv"


@dataclass(frozen=True)
class Change:
    """One correction: a block's `field`, `depend` or `layer`, as it was and as it is now."""

    scene: str
    block: int
    field: str
    before: str
    after: str


@dataclass(frozen=True)
class Copied:
    """What a corrected copy holds: scenes written, changes made, and scenes that had to stay out.

    `left_out` says why, by scene.
    """

    scenes: int
    changes: tuple[Change, ...]
    left_out: Mapping[str, str]


def changes_of(audit: SceneAudit) -> tuple[Change, ...]:
    """What the corrected scene says differently."""
    changes: list[Change] = []
    for before, after in zip(audit.scene.blocks, audit.fixed.blocks, strict=True):
        orders = [tuple(sorted(declared_orders(block))) for block in (before, after)]
        if orders[0] != orders[1]:
            changes.append(
                Change(audit.scene.id, before.order, "depend", *map(shown_orders, orders))
            )
        if before.layer != after.layer:
            layers = (str(before.layer), str(after.layer))
            changes.append(Change(audit.scene.id, before.order, "layer", *layers))
    return tuple(changes)


def write_fixed(
    folder: Path, audits: Iterable[SceneAudit], candidates: Mapping[str, CandidateSet | None]
) -> Copied:
    """Write `scenes.jsonl` with corrected dependencies and layers, and `changes.csv`.

    Scenes that the project's own format cannot hold stay out. Positions are as they were: an
    overlap or a gap is told, not mended. Raises StoreError when the folder holds a data set
    already or cannot be written.
    """
    lines: list[str] = []
    changes: list[Change] = []
    left_out: dict[str, str] = {}
    for audit in audits:
        offered = candidates[audit.scene.id]
        reason = _why_not(audit, offered)
        if offered is None or reason:
            left_out[audit.scene.id] = reason
            continue
        lines.append(StoredScene.of(audit.fixed, offered).as_json())
        changes += changes_of(audit)
    rows = [(c.scene, str(c.block), c.field, c.before, c.after) for c in changes]
    texts = {
        SCENES_FILE: "".join(f"{line}\n" for line in lines),
        CHANGES_FILE: csv_text(("scene", "block", "field", "before", "after"), rows),
    }
    _write_new(folder, texts)
    return Copied(len(lines), tuple(changes), left_out)


def _why_not(audit: SceneAudit, candidates: CandidateSet | None) -> str:
    """Why a scene cannot be in a data set; empty when it can."""
    if candidates is None:
        return "its candidate set cannot be read"
    if audit.has("candidates"):
        return "its candidate set lacks a block that it needs"
    if not audit.sound:
        return "neither its declared dependencies nor its contacts name an order"
    return ""


def _write_new(folder: Path, texts: Mapping[str, str]) -> None:
    check_free([folder / name for name in texts], "choose another folder")
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            atomic_write(folder / name, text)
