"""Tables of an audit in the terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rich.console import Console

from phyblock.cli.console import counted, plain_table
from phyblock_making.auditing.scene_audit import CHECKS, Check, Finding, SceneAudit
from phyblock_making.auditing.set_audit import Audit, Copied

__all__ = ["print_audit", "print_changes", "worst_scenes"]

_CHANGED_SHOWN = 12
_MOVING: tuple[Check, ...] = ("unstable", "unstable step")


def worst_scenes(audit: Audit, count: int) -> tuple[SceneAudit, ...]:
    """The scenes with most to say against them: what falls, then what floats or overlaps, by mm."""
    guilty = [one for one in audit.scenes if one.findings]
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
    found = audit.of("unreadable")
    if found:
        rows = [(one.scene, one.message, one.declared, one.found) for one in found]
        console.print("What cannot be read")
        console.print(plain_table(("scene", "what", "found", "allowed"), rows, numbers=0))


def _print_dependencies(console: Console, audit: Audit) -> None:
    """One line for each block whose declared and true supports differ."""
    blocks: dict[tuple[str, int], list[Finding]] = {}
    for check in ("undeclared dependency", "dependency without contact"):
        for one in audit.of(check):
            blocks.setdefault((one.scene, one.blocks[0]), []).append(one)
    if not blocks:
        return
    rows = []
    for (scene, order), found in sorted(blocks.items()):
        told = "; ".join(one.message.split(") ", 1)[-1] for one in found)
        rows.append((scene, str(order), found[0].declared, found[0].found or "nothing", told))
    console.print("Dependencies: declared against contact (0 is the ground)")
    headings = ("scene", "block", "declared", "contact", "the block")
    console.print(plain_table(headings, rows, numbers=0))


def _print_worst(console: Console, audit: Audit, count: int) -> None:
    worst = worst_scenes(audit, count)
    if not worst:
        return
    rows = []
    for one in worst:
        first, size = _first(one), str(len(one.findings))
        rows.append((one.scene.id, str(one.scene.level), first.check, first.message, size))
    console.print(f"The worst {len(rows)} scenes")
    headings = ("scene", "level", "check", "first finding", "findings")
    console.print(plain_table(headings, rows, numbers=1))


def _print_totals(console: Console, audit: Audit) -> None:
    rows = []
    for check in CHECKS:
        found = audit.of(check)
        scenes = sorted({one.scene for one in found})
        rows.append((check, _some(scenes), str(len(scenes)), str(len(found))))
    console.print("Totals")
    console.print(plain_table(("check", "in", "scenes", "findings"), rows, numbers=2))
    count = len(audit.scenes)
    steps, exact = audit.without(*_MOVING), _exact(audit)
    told = [
        f"{count} scenes read; {audit.without(*CHECKS)} with no finding",
        f"{audit.without('unstable')} stand when finished, {steps} at every step as well",
        f"{_share(audit.shared, audit.declared)} dependencies are contacts (precision)",
        f"{_share(audit.shared, audit.contacts)} contacts are declared (recall)",
        f"{exact} declare their contacts and nothing else",
    ]
    for line in told:
        console.print(line, markup=False, soft_wrap=True)


def _exact(audit: Audit) -> int:
    return audit.without("undeclared dependency", "dependency without contact")


def _share(part: int, whole: int) -> str:
    return f"{part} of {whole} ({part / whole:.3f})" if whole else "no"


def _some(scenes: Sequence[str], count: int = 24) -> str:
    more = f" and {len(scenes) - count} more" if len(scenes) > count else ""
    return " ".join(scenes[:count]) + more


def _badness(audit: SceneAudit) -> tuple[float, float, int]:
    falls = 2.0 * audit.has("unstable") + 1.0 * audit.has("unstable step")
    fit = [one.size or 0.0 for one in audit.findings if one.check in ("overlap", "floating")]
    return (falls, max(fit, default=0.0), len(audit.findings))


def _first(audit: SceneAudit) -> Finding:
    """The cause before its effect: what overlaps or floats before what falls."""
    return min(audit.findings, key=lambda one: CHECKS.index(one.check))
