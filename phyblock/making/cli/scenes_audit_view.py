"""Tables of an audit in the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rich.console import Console

from phyblock.cli.console import plain_table
from phyblock.domain import Scene
from phyblock.making.auditing.corrected_copy import Copied
from phyblock.making.auditing.scene_audit import AUDITED, SceneAudit
from phyblock.making.auditing.set_audit import Audit, shown_orders
from phyblock.making.checks.finding import CheckName, Finding
from phyblock.text import counted

__all__ = ["print_audit", "print_changes", "worst_scenes"]

_CHANGED_SHOWN = 12
_BLOCKS_SHOWN = 3
_MOVING: tuple[CheckName, ...] = ("unstable", "unstable step")
_DEPENDING: tuple[CheckName, ...] = ("undeclared dependency", "dependency without contact")


def worst_scenes(audit: Audit, count: int) -> tuple[SceneAudit, ...]:
    """The scenes with most to say against them: what falls, then what floats or overlaps, by mm."""
    guilty = [scene_audit for scene_audit in audit.scenes if scene_audit.findings]
    return tuple(sorted(guilty, key=_badness, reverse=True)[:count])


def print_audit(console: Console, audit: Audit, worst: int) -> None:
    """Disagreements, the worst scenes, totals; the totals last, where a terminal stops."""
    _print_unreadable(console, audit)
    _print_dependencies(console, audit)
    _print_worst(console, audit, worst)
    _print_totals(console, audit)


def print_changes(console: Console, copied: Copied, folder: str) -> None:
    """What a corrected copy changed."""
    fields = Counter(change.field for change in copied.changes)
    scenes = len({change.scene for change in copied.changes})
    rows = [
        (change.scene, str(change.block), change.field, change.before, change.after)
        for change in copied.changes[:_CHANGED_SHOWN]
    ]
    if rows:
        headings = ("scene", "block", "field", "was", "is")
        console.print(plain_table(headings, rows, numbers=0))
    more = len(copied.changes) - len(rows)
    if more > 0:
        console.print(f"... and {more} more in {folder}/changes.csv", markup=False)
    for scene, reason in copied.left_out.items():
        console.print(f"{scene} stays out: {reason}", markup=False)
    console.print(
        f"{counted(copied.scenes, 'scene')} in {folder}, {scenes} of them changed: dependencies of "
        f"{counted(fields['depend'], 'block')}, layers of {fields['layer']}",
        markup=False,
        soft_wrap=True,
    )


def _print_unreadable(console: Console, audit: Audit) -> None:
    rows = [
        (finding.scene, finding.message, str(finding.declared), str(finding.derived))
        for finding in audit.of("unreadable")
    ]
    if rows:
        console.print("What cannot be read")
        console.print(plain_table(("scene", "what", "found", "allowed"), rows, numbers=0))


def _print_dependencies(console: Console, audit: Audit) -> None:
    """One line for each block whose declared and true supports differ."""
    blocks: dict[tuple[str, int], list[Finding]] = {}
    for check in _DEPENDING:
        for finding in audit.of(check):
            blocks.setdefault((finding.scene, finding.blocks[0]), []).append(finding)
    if not blocks:
        return
    scenes = {scene_audit.scene.id: scene_audit.scene for scene_audit in audit.scenes}
    rows = []
    for (name, order), findings in sorted(blocks.items()):
        declared, contacts = (shown_orders(findings[0].declared), shown_orders(findings[0].derived))
        messages = "; ".join(finding.message for finding in findings)
        block = _blocks(scenes[name], (order,))
        rows.append((name, block, declared, contacts or "nothing", messages))
    console.print("Dependencies: declared against contact (0 is the ground)")
    headings = ("scene", "block", "declared", "contact", "findings")
    console.print(plain_table(headings, rows, numbers=0))


def _print_worst(console: Console, audit: Audit, count: int) -> None:
    worst = worst_scenes(audit, count)
    if not worst:
        return
    rows = []
    for scene_audit in worst:
        scene, first = scene_audit.scene, _first(scene_audit)
        facts = (first.check, first.message, _blocks(scene, first.blocks))
        rows.append((scene.id, str(scene.level), *facts, str(len(scene_audit.findings))))
    console.print("The worst scene" if len(rows) == 1 else f"The worst {len(rows)} scenes")
    headings = ("scene", "level", "check", "first finding", "blocks", "findings")
    console.print(plain_table(headings, rows, numbers=1))


def _blocks(scene: Scene, orders: Sequence[int]) -> str:
    """The first few of these blocks with what they are; the ground is none."""
    named = [f"{b.order} {b.color} {b.type}" for b in scene.blocks if b.order in orders]
    return ", ".join(named[:_BLOCKS_SHOWN]) + (", ..." if len(named) > _BLOCKS_SHOWN else "")


def _print_totals(console: Console, audit: Audit) -> None:
    rows = []
    for check in AUDITED:
        findings = audit.of(check)
        scenes = sorted({finding.scene for finding in findings})
        rows.append((check, _some(scenes), str(len(scenes)), str(len(findings))))
    console.print("Totals")
    console.print(plain_table(("check", "in", "scenes", "findings"), rows, numbers=2))
    count = len(audit.scenes)
    steps, exact = audit.without(*_MOVING), _exact(audit)
    totals = [
        f"{counted(count, 'scene')} read; {audit.without(*AUDITED)} with no finding",
        f"{audit.without('unstable')} stand when finished, {steps} at every step as well",
        f"{_share(audit.shared, audit.declared)} dependencies are contacts (precision)",
        f"{_share(audit.shared, audit.contacts)} contacts are declared (recall)",
        f"{exact} declare their contacts and nothing else",
    ]
    for line in totals:
        console.print(line, markup=False, soft_wrap=True)


def _exact(audit: Audit) -> int:
    return audit.without(*_DEPENDING)


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole} ({part / whole:.3f})" if whole else "no"


def _some(scenes: Sequence[str], count: int = 24) -> str:
    more = f" and {len(scenes) - count} more" if len(scenes) > count else ""
    return " ".join(scenes[:count]) + more


def _badness(audit: SceneAudit) -> tuple[float, float, int]:
    falls = 2.0 * audit.has("unstable") + 1.0 * audit.has("unstable step")
    fit = [f.value or 0.0 for f in audit.findings if f.check in ("overlap", "floating")]
    return (falls, max(fit, default=0.0), len(audit.findings))


def _first(audit: SceneAudit) -> Finding:
    """The cause before its effect: what overlaps or floats before what falls."""
    return min(audit.findings, key=lambda finding: AUDITED.index(finding.check))
