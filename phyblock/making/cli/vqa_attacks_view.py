"""What attacks reach, as a table, as findings, and as JSON for scripts."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console

from phyblock.cli.console import plain_table
from phyblock.making.attacks.attacks import Attacked, Rate
from phyblock.making.attacks.observed import Observed
from phyblock.making.questions.shortcuts import SubtaskAudit
from phyblock.text import counted

__all__ = ["attack_findings", "audit_json", "cut_findings", "print_attacks"]


def print_attacks(console: Console, attacked: Sequence[Attacked]) -> None:
    """One row an attack and subtask, and one for each kind of question that is frequent enough."""
    rows = [
        (
            one.attack.name,
            one.subtask or "all",
            one.kind,
            one.verdict,
            str(one.n),
            f"{100 * one.chance:.1f}",
            *_side(one.most, one.aim),
            *_side(one.least, one.aim_inverted),
        )
        for one in attacked
    ]
    side = ("95 %", "aim")
    headings = ("attack", "", "kind", "aim is", "n", "chance", "most", *side, "least", *side)
    console.print(plain_table(headings, rows, numbers=8, tight=True))
    names = {one.attack.name: one.attack.rule for one in attacked}
    legend = "; ".join(f"{name}: {what}" for name, what in names.items())
    console.print(
        "Accuracy [%] of picking the option that an attack likes most, and the one that it likes "
        "least, ties at random, with the interval over base scenes; of orderings whole "
        f"orders, the way round that fits their kind better. Attacks go by: {legend}.",
        style="dim",
    )
    console.print()


def attack_findings(attacked: Sequence[Attacked]) -> list[str]:
    """Aims that are missed beyond doubt, in words."""
    return [
        f"{one.subtask or 'all'}: {' '.join((one.attack.name, one.kind)).strip()} reaches "
        f"{100 * one.best[0].value:.1f} %"
        for one in attacked
        if one.verdict == "missed"
    ]


def cut_findings(observed: Sequence[Observed]) -> list[str]:
    """Pictures that are cut open, and those that could not be looked at."""
    cuts = [(one.question.id, cut) for one in observed for cut in one.cuts]
    findings = [f"{one.question.id}: {one.fault}" for one in observed if one.fault]
    if cuts:
        wrong = sum(cut.is_wrong for _, cut in cuts)
        shown = sum(cut.pixels > 0 for _, cut in cuts)
        findings.append(
            f"{counted(len(cuts), 'picture')} in {counted(len({q for q, _ in cuts}), 'question')} "
            f"cut open ({sum(c.at_near for _, c in cuts)} near, {sum(c.at_far for _, c in cuts)} "
            f"far), {shown} of them to be seen, {wrong} of wrong options"
        )
    return findings


def audit_json(
    audits: Sequence[SubtaskAudit], observed: Sequence[Observed], attacked: Sequence[Attacked]
) -> str:
    """Everything that was measured, as JSON."""
    content = {
        "subtasks": [asdict(audit) for audit in audits],
        "attacks": [_entry(one) for one in attacked],
        "cuts": [
            {"question": one.question.id, **cut._asdict()} for one in observed for cut in one.cuts
        ],
        "faults": {one.question.id: one.fault for one in observed if one.fault},
    }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def _entry(one: Attacked) -> dict[str, Any]:
    return {
        "attack": one.attack.name,
        "subtask": one.subtask or None,
        "kind": one.kind or None,
        "n": one.n,
        "chance": one.chance,
        "most": _known(one.most),
        "least": _known(one.least),
        "aim": one.aim,
        "aim_inverted": one.aim_inverted,
        "verdict": one.verdict,
    }


def _known(rate: Rate) -> dict[str, float | None]:
    """A rate with no bounds where there is one base scene only, as JSON knows no NaN."""
    return {k: None if math.isnan(value) else value for k, value in rate._asdict().items()}


def _side(rate: Rate, aim: float | None) -> tuple[str, str, str]:
    interval = "" if math.isnan(rate.low) else f"{100 * rate.low:.0f}-{100 * rate.high:.0f}"
    return f"{100 * rate.value:.1f}", interval, "" if aim is None else f"{100 * aim:.0f}"
