"""What attacks reach on a set, for its data card, beside earlier versions of phyblock-vqa."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from phyblock.making.attacks.attacks import UNSEEN_TEXT, Attacked
from phyblock.making.attacks.observed import Observed

__all__ = ["attack_card"]

VERSION_1: Mapping[str, Mapping[str, int]] = {
    "area": {"VP": 25, "CF": 26, "PD": 21, "OR": 100},
    "colors": {"VP": 54, "CF": 25, "PD": 33},
    "change": {"VP": 41, "CF": 32, "PD": 35},
    "odd one out": {"VP": 26, "CF": 40, "PD": 23, "OR": 0},
    "central": {"CF": 42, "AD": 70},
    "central and flat": {"CF": 36, "AD": 100},
    "linear probe": {"VP": 60, "CF": 77, "PD": 63, "OR": 100, "AD": 100},
    "boosted probe": {"VP": 56, "CF": 71, "PD": 63, "OR": 95, "AD": 100},
    "support": {"CF": 99},
    "sole support": {"CF": 97},
    "text, within the set": {
        **{"": 41, "SH": 49, "CO": 49, "SI": 53, "NU": 39, "RP": 43, "AP": 45, "RD": 45, "RR": 37},
        **{"OC": 39, "LC": 37, "TC": 39, "VP": 29, "CF": 36, "PD": 39, "AD": 26},
    },
}
"""What each attack reached [%] on the questions that came before there were attacks."""
VERSION_2: Mapping[str, Mapping[str, int]] = {
    "area": {"VP": 26, "CF": 39, "PD": 19, "OR": 4},
    "colors": {"VP": 28, "CF": 24, "PD": 27},
    "change": {"VP": 26, "CF": 25, "PD": 30},
    "odd one out": {"VP": 27, "CF": 64, "PD": 33, "OR": 0},
    "central": {"CF": 41, "AD": 40},
    "central and flat": {"CF": 42, "AD": 40},
    "alone": {"AD": 50},
    "linear probe": {"VP": 27, "CF": 78, "PD": 49, "OR": 4, "AD": 48},
    "boosted probe": {"VP": 25, "CF": 71, "PD": 45, "OR": 8, "AD": 58},
    "support": {"CF": 36},
    "sole support": {"CF": 46},
    "text, within the set": {
        **{"": 26, "SH": 26, "CO": 26, "SI": 20, "NU": 28, "RP": 30, "AP": 25, "RD": 23, "RR": 29},
        **{"OC": 26, "LC": 31, "TC": 37, "VP": 28, "CF": 25, "PD": 29, "AD": 32},
    },
}
"""The same on the second version, which was held against them."""
VERSION_3: Mapping[str, Mapping[str, int]] = {
    "area": {"VP": 26, "CF": 25, "PD": 19, "OR": 4},
    "colors": {"VP": 26, "CF": 27, "PD": 27},
    "change": {"VP": 24, "CF": 31, "PD": 30},
    "odd one out": {"VP": 25, "CF": 28, "PD": 33, "OR": 0},
    "central": {"AD": 28},
    "central and flat": {"AD": 28},
    "alone": {"AD": 38},
    "linear probe": {"VP": 27, "CF": 25, "PD": 49, "OR": 4, "AD": 26},
    "boosted probe": {"VP": 25, "CF": 38, "PD": 45, "OR": 8, "AD": 34},
    "support": {"CF": 38},
    "sole support": {"CF": 43},
    "text, within the set": {
        **{"": 26, "SH": 26, "CO": 26, "SI": 20, "NU": 28, "RP": 30, "AP": 25, "RD": 23, "RR": 29},
        **{"OC": 26, "LC": 31, "TC": 37, "VP": 26, "CF": 29, "PD": 29, "AD": 42},
    },
}
"""The same on the third version, whose next steps, outcomes and places could hang on an edge."""
_UNSEEN = f""" What is called
`{UNSEEN_TEXT}` has learned from the texts of the set after `--unseen` above, and no others."""
_BEFORE = (VERSION_1, VERSION_2, VERSION_3)
_CUTS_1 = "59 in 47 questions, 47 of them to be seen"

_TEXT = """
## Attacks

From `phyblock vqa audit`; docs/vqa.md says what each goes by, and why aims of the built-in set are
missed. Accuracy [%] of the better of both ways to read an attack, with a 95 % interval; the last
columns are what it reached on earlier versions of `phyblock-vqa`.{unseen}

| attack | subtask | n | chance | reached | 95 % | aim | aim is | {versions} |
|---|---|---|---|---|---|---|---|{rules}|
{rows}

Pictures with a block before the camera's near plane or beyond its far one: {cuts} (version 1:
{cuts_1}).
"""


def attack_card(attacked: Sequence[Attacked], observed: Sequence[Observed]) -> str:
    """A section of Markdown, kinds of questions left out; empty where nothing was attacked."""
    rows = [_row(one) for one in attacked if not one.kind]
    if not rows:
        return ""
    unseen = _UNSEEN if any(one.attack.name == UNSEEN_TEXT for one in attacked) else ""
    versions = " | ".join(f"version {number}" for number in range(1, len(_BEFORE) + 1))
    rules = "|".join(["---"] * len(_BEFORE))
    cuts = [cut for one in observed for cut in one.cuts]
    cut_text = "none"
    if cuts:
        questions = sum(bool(one.cuts) for one in observed)
        shown = sum(cut.pixels > 0 for cut in cuts)
        cut_text = f"{len(cuts)} in {questions} questions, {shown} of them to be seen"
    return _TEXT.format(
        rows="\n".join(rows),
        cuts=cut_text,
        cuts_1=_CUTS_1,
        versions=versions,
        rules=rules,
        unseen=unseen,
    )


def _row(one: Attacked) -> str:
    rate, aim = one.best
    interval = "" if math.isnan(rate.low) else f"{100 * rate.low:.0f} to {100 * rate.high:.0f}"
    cells = [
        *(one.attack.name, one.subtask or "all", one.n, f"{100 * one.chance:.0f}"),
        *(f"{100 * rate.value:.0f}", interval, f"{100 * aim:.0f}", one.verdict),
        *(old.get(one.attack.name, {}).get(one.subtask, "") for old in _BEFORE),
    ]
    return f"| {' | '.join(map(str, cells))} |"
