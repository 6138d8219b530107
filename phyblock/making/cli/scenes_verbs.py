"""`phyblock scenes`: make data sets, check them, look at them; verbs are loaded when called."""

from __future__ import annotations

import click

from phyblock.cli.options import Verbs

_VERBS = {
    "generate": "Make a data set from a seed.",
    "complete": "Make a data set from positions written by hand.",
    "verify": "Derive everything in a data set again and compare.",
    "audit": "Check any data set against geometry and physics.",
    "show": "Show the facts of one scene.",
    "render": "Draw scenes: views, backgrounds, exploded, filmstrips, animations.",
    "stats": "Count sizes, types, colors, layers and candidates by level.",
}


@click.group(
    cls=Verbs,
    sections={
        "Commands": {
            name: (f"phyblock.making.cli.scenes_{name}:command", about)
            for name, about in _VERBS.items()
        }
    },
)
def command() -> None:
    """Make data sets of scenes, check them against physics, and look at them."""
