"""The page of a site: a template filled in, with style and scripts of its own inside."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable
from importlib.resources import files

import jinja2

__all__ = ["render_page"]

_REPORT, _OWN = "phyblock.report.html", "phyblock.site"
_SCRIPTS = (
    *((_REPORT, name) for name in ("dom.js", "solid.js", "steps.js", "poses.js", "stage.js")),
    *((_OWN, name) for name in ("store.js", "table.js", "chart.js", "views.js", "replay.js")),
    (_OWN, "site.js"),
)
"""Blocks, steps and the stage are those of a run's report."""
_STYLES = (
    *((_REPORT, name) for name in ("base.css", "samples.css")),
    (_OWN, "site.css"),
)


def render_page(title: str, folder: str, build: str) -> str:
    """HTML of the site, which finds its data in `folder`; only scripts of our own may run."""
    script, style = _joined(_SCRIPTS), _joined(_STYLES)
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    template = environment.from_string(_asset(_OWN, "site.html.j2"))
    return template.render(
        title=title,
        folder=folder,
        build=build,
        script=script,
        style=style,
        policy=_policy(script, style),
    )


def _policy(script: str, style: str) -> str:
    """Content security: what is in the page by its digest, data from beside it."""
    return "; ".join(
        [
            "default-src 'none'",
            f"script-src '{_digest(script)}' 'self'",
            f"style-src '{_digest(style)}'",
            "img-src 'self'",
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _joined(names: Iterable[tuple[str, str]]) -> str:
    return "\n".join(_asset(package, name) for package, name in names)


def _asset(package: str, name: str) -> str:
    return (files(package) / "assets" / name).read_text(encoding="utf-8")
