"""What records of plans of blocks have in common: the plan that was read, and its scores."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phyblock.records import Line, ShownScene
from phyblock.scoring.plan import Score

__all__ = ["PLAN_COLUMNS", "PlanParse", "plan_row", "score_fields"]


class PlanParse(Line):
    """The plan that was read in a reply."""

    parser: str
    """How replies are read."""
    rule: str | None
    """The rule that matched; null: nothing could be read."""
    plan: tuple[int, ...]
    """Candidate numbers in order, as they were shown."""
    file_plan: tuple[int, ...] | None = None
    """The same in the numbers of the file; null: those are the ones that were shown."""
    dropped: tuple[int, ...] = ()
    """Numbers that no candidate has."""
    version: int = 1
    """Version of the parser."""
    problem: str | None = None
    """Why nothing could be read."""
    truncated: bool = False
    """True where the text breaks off within the plan."""


PLAN_COLUMNS = dict.fromkeys(("parser", "plan", "file_plan", "dropped", "shown"), "object")


def plan_row(parse: PlanParse | None, shown: ShownScene | None) -> Mapping[str, Any]:
    """The values of `PLAN_COLUMNS`; `shown` is None for what was shown as the file has it."""
    order = None if shown is None else shown.fields()
    if parse is None:
        return {**dict.fromkeys(PLAN_COLUMNS), "shown": order}
    in_file = parse.plan if parse.file_plan is None else parse.file_plan
    return {
        "parser": parse.parser,
        "plan": list(parse.plan),
        "file_plan": list(in_file),
        "dropped": list(parse.dropped),
        "shown": order,
    }


def score_fields(score: Score) -> dict[str, Any]:
    """A score as records hold it."""
    return {
        "criterion": score.criterion,
        "matcher": score.matcher,
        "setting": score.setting,
        "tp": score.counts.tp,
        "fp": score.counts.fp,
        "fn": score.counts.fn,
        "errors": score.errors,
        "placed": None if score.vertices is None else list(score.vertices),
        "why": None if score.step_errors is None else list(score.step_errors),
        "blocks": score.blocks,
        "kept": score.kept,
    }
