"""The page of a site, with style and scripts of its own inside."""

from __future__ import annotations

from phyblock.report.html.shell import fill

__all__ = ["render_page"]

_REPORT, _OWN = "phyblock.report.html", "phyblock.site"
_SCRIPTS = (
    *((_REPORT, name) for name in ("dom.js", "chunks.js", "solid.js", "steps.js", "poses.js")),
    *((_REPORT, name) for name in ("runs.js", "stage.js", "quotes.js", "overlay.js", "why.js")),
    *((_OWN, name) for name in ("store.js", "table.js", "chart.js", "views.js", "replay.js")),
    (_OWN, "site.js"),
)
"""Loading of data, blocks, steps and the stage are those of a run's report."""
_STYLES = (
    *((_REPORT, name) for name in ("base.css", "samples.css", "reply.css")),
    (_OWN, "site.css"),
)


def render_page(title: str, folder: str, build: str) -> str:
    """HTML of the site, which finds its data in `folder`; only scripts of our own may run."""
    facts = {"title": title, "folder": folder, "build": build}
    return fill((_OWN, "site.html.j2"), _SCRIPTS, _STYLES, **facts)
