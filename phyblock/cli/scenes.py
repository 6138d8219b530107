"""`phyblock scenes`: everything that is done with scenes and without models."""

from __future__ import annotations

import click

from phyblock.cli.verbs import Verbs

__all__ = ["command"]

_VERBS = {
    "audit": "Hold a data set against geometry and physics; write a corrected copy.",
}


@click.group("scenes", cls=Verbs, verbs=_VERBS, prefix="phyblock.cli.scenes_")
def command() -> None:
    """Make, check, show and draw scenes."""
