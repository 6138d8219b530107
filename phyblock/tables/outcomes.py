"""The outcomes of samples as tables count and call them."""

from __future__ import annotations

from typing import TYPE_CHECKING, get_args

from phyblock.types import Outcome

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["FAILURES", "HEADINGS", "NOT_RUN", "OUTCOMES", "WITHOUT_REPLY", "has_reply"]

OUTCOMES: tuple[Outcome, ...] = get_args(Outcome)
"""Every outcome, in the order of columns."""

FAILURES: tuple[Outcome, ...] = tuple(outcome for outcome in OUTCOMES if outcome != "ok")
"""Every outcome but `ok`."""

WITHOUT_REPLY: tuple[Outcome, ...] = ("api_error", "missing")
"""Outcomes of samples that the model said nothing about; a refusal is an answer."""

HEADINGS: dict[Outcome, str] = {
    "ok": "OK",
    "parse_failure": "Unparsed",
    "refusal": "Refusal",
    "truncated": "Truncated",
    "api_error": "API error",
    "missing": "Missing",
}
"""What heads the column of each outcome."""

NOT_RUN = "Not run"
"""What heads numbers of samples that there are not."""


def has_reply(rows: pd.DataFrame) -> pd.Series[bool]:
    """Whether the model said anything, for each row of samples, by its `outcome`."""
    return ~rows["outcome"].isin(WITHOUT_REPLY)
