"""A page out of a template, with style and scripts inside, of which no others may run."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable
from importlib.resources import files
from typing import Any

import jinja2

__all__ = ["Asset", "fill"]

Asset = tuple[str, str]
"""A package, and the name of a file in its folder `assets`."""


def fill(template: Asset, scripts: Iterable[Asset], styles: Iterable[Asset], **facts: Any) -> str:
    """HTML of a template that is given `script`, `style`, the `policy` that lets them run, and
    `facts`; every text in it is escaped.
    """
    environment = jinja2.Environment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    script, style = ("\n".join(map(_text, assets)) for assets in (scripts, styles))
    page = environment.from_string(_text(template))
    return page.render(**facts, script=script, style=style, policy=_policy(script, style))


def _policy(script: str, style: str) -> str:
    """Content security: what is in the page by its digest, data and pictures from beside it.

    `data:` lets the empty icon in that keeps browsers from asking for one.
    """
    return "; ".join(
        [
            "default-src 'none'",
            f"script-src '{_digest(script)}' 'self'",
            f"style-src '{_digest(style)}'",
            "img-src 'self' data:",
            "base-uri 'none'",
            "form-action 'none'",
        ]
    )


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


def _text(asset: Asset) -> str:
    package, name = asset
    return (files(package) / "assets" / name).read_text(encoding="utf-8")
