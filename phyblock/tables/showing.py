"""What is unusual about how a run showed what it asked about, and in which form it asked, as
captions say it.
"""

from __future__ import annotations

from dataclasses import replace

from phyblock.tables.load import Run
from phyblock.tables.text_table import TextTable

__all__ = ["captioned", "control_words", "marked", "planning_words", "varied_words"]

_CONTROLS = {"blind": "blind", "wrong_image": "pictures of another scene"}
"""What captions say of the controls that sections of tracks may set."""
_ORDERS = {"shuffled": "candidates shuffled"}
_FORMATS = {"json_schema": "answers asked for as JSON"}


def control_words(run: Run, section: str) -> tuple[str, ...]:
    """The controls that a track's section of the suite sets, and a form of answers other than text.

    Older runs have no such section.
    """
    held = run.manifest.suite.get(section) or {}
    form = _FORMATS.get(run.design.suite.answer_format)
    controls = (words for name, words in _CONTROLS.items() if held.get(name))
    return (*controls, *((form,) if form else ()))


def varied_words(run: Run) -> tuple[str, ...]:
    """Number of ways in which each item was asked, where there are several."""
    n = run.design.suite.vary.n_variants
    return (f"asked in {n:,} ways",) if n > 1 else ()


def planning_words(run: Run, section: str) -> tuple[str, ...]:
    """What is unusual about how scenes were shown."""
    suite = run.design.suite
    order = None if "candidate_order" in suite.vary.factors else _ORDERS.get(suite.candidates.order)
    return (*((order,) if order else ()), *control_words(run, section))


def captioned(caption: str, words: tuple[str, ...]) -> str:
    """The caption with the words at its end, in brackets."""
    return f"{caption} [{', '.join(words)}]" if words else caption


def marked(view: TextTable, words: tuple[str, ...]) -> TextTable:
    """The view with the words at the end of its caption."""
    return replace(view, caption=captioned(view.caption, words))
