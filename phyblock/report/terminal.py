"""What the terminal shows of a run's tables, as data that can be kept and shown again."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from phyblock.tables.text_table import TextTable

if TYPE_CHECKING:
    from phyblock.report.write import TablesWritten

__all__ = ["Failure", "Terminal", "terminal_of"]


@dataclass(frozen=True)
class Failure:
    """What a provider said where calls to a model failed, and how often."""

    model: str
    message: str
    times: int


@dataclass(frozen=True)
class Terminal:
    """Tables, each in its forms from the widest; failures, the most frequent first; and lines in
    groups, the first of each a headline.
    """

    tables: tuple[tuple[TextTable, ...], ...] = ()
    failures: tuple[Failure, ...] = ()
    lines: tuple[tuple[str, ...], ...] = ()


def terminal_of(written: TablesWritten) -> Terminal:
    """What the makers of the tables that were written have for the terminal."""
    from phyblock.report.write import table_makers

    makers = table_makers(written.run)
    known = {name: makers[name] for name in makers if name in written.frames}
    forms = (
        tuple(maker.in_terminal(written.views[name], written.frames[name]))
        for name, maker in known.items()
        if maker.in_terminal is not None
    )
    lines = (
        tuple(maker.lines(written.frames[name], written.run))
        for name, maker in known.items()
        if maker.lines is not None
    )
    failed = written.run.records.dropna(subset=["error_message"])
    said = Counter(zip(failed["model"], failed["error_message"], strict=True))
    failures = (Failure(model, message, n) for (model, message), n in said.most_common())
    return Terminal(tuple(forms), tuple(failures), tuple(lines))
