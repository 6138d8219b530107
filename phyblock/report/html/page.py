"""The page itself: a template filled in, with style and scripts of its own inside."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from phyblock.report.html.headline import Headline
from phyblock.report.html.leads import TableLeads
from phyblock.report.html.shell import fill
from phyblock.results.text import Column, TextTable

__all__ = ["Figure", "render_page"]

_PACKAGE = "phyblock.report.html"
_SCRIPTS = (
    *("dom.js", "chunks.js", "data.js", "solid.js", "filters.js", "search.js", "list.js"),
    *("steps.js", "poses.js", "runs.js", "stage.js", "markdown.js", "quotes.js", "overlay.js"),
    *("why.js", "reply.js", "sent.js", "detail.js", "tracks.js", "matrix.js", "results.js"),
    *("address.js", "app.js"),
)
_STYLES = ("base.css", "results.css", "samples.css", "reply.css", "matrix.css", "print.css")


@dataclass(frozen=True)
class Figure:
    """A picture beside the page: its address seen from there, and what it shows."""

    address: str
    title: str


def render_page(
    *,
    about: Mapping[str, Any],
    cautions: Sequence[str],
    headlines: Sequence[Headline],
    figures: Sequence[Figure],
    tables: Sequence[tuple[TextTable, TableLeads]],
    models: Sequence[str],
    folder: str,
    build: str,
) -> str:
    """HTML of the report; every text is escaped, and only scripts of our own may run.

    `about` says what the run was (title, facts: pairs of name and text), `cautions` what it is
    not; `folder` is where the page finds its data. Names of `models` lead to their samples.
    """
    return fill(
        (_PACKAGE, "page.html.j2"),
        [(_PACKAGE, name) for name in _SCRIPTS],
        [(_PACKAGE, name) for name in _STYLES],
        about=about,
        cautions=cautions,
        models=frozenset(models),
        headlines=headlines,
        figures=figures,
        tables=[(table, leads, _groups(table.columns)) for table, leads in tables],
        folder=folder,
        build=build,
    )


def _groups(columns: Sequence[Column]) -> list[tuple[str, int]]:
    """Group headings with how many neighboring columns each spans; [] where there is none."""
    if not any(column.group for column in columns):
        return []
    spans: list[tuple[str, int]] = []
    for column in columns:
        if spans and spans[-1][0] == column.group:
            spans[-1] = (column.group, spans[-1][1] + 1)
        else:
            spans.append((column.group, 1))
    return spans
