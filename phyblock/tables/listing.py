"""Scores by which the page of a run lists the samples of a track."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

from phyblock.scoring.plan import ERROR_TYPES

if TYPE_CHECKING:
    from phyblock.records.record import Record
    from phyblock.tables.design import Design

__all__ = ["ListedScore", "Listing", "by_settings"]


class ListedScore(NamedTuple):
    """What F1 of a sample is made of, and the types of its wrong steps."""

    tp: float
    fp: float
    fn: float
    errors: Collection[str] = ()


@dataclass(frozen=True)
class Listing:
    """A score that samples of a track can be listed by.

    `name` is what people choose, as the name of a setting. `errors` are the types that its wrong
    steps may have. `score` is of a record, None where it was not scored so. Its parts are counts of
    steps that people read, unless it is not `is_counted`.
    """

    name: str
    errors: tuple[str, ...]
    score: Callable[[Record], ListedScore | None]
    is_counted: bool = True


def by_settings(design: Design) -> tuple[Listing, ...]:
    """The settings of a suite, the headline's first, each by the headline matcher."""
    return tuple(
        Listing(setting, ERROR_TYPES, partial(_scored, setting, design.matcher))
        for setting in design.suite.settings
    )


def _scored(setting: str, matcher: str, record: Record) -> ListedScore | None:
    scores = [score for score in record.scores if score.setting == setting]
    headline = [score for score in scores if score.matcher == matcher]
    for score in headline or scores:
        errors = [name for name, count in (score.errors or {}).items() if count]
        return ListedScore(score.tp, score.fp, score.fn, errors)
    return None
