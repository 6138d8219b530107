"""`phyblock vqa`: make questions about scenes, check them, look at them."""

from __future__ import annotations

import click

from phyblock.cli.verbs import Verbs

__all__ = ["command"]

_VERBS = {
    "generate": "Make questions about a data set's scenes from a seed.",
    "verify": "Derive every answer again and compare.",
    "show": "Show a question, and draw its pictures to a file.",
    "audit": "Look for what could be answered without looking; write a sheet for a human check.",
    "write": "Ask a model for further wordings of the questions.",
    "reword": "Ask questions in further wordings, as a set that a suite can name.",
}


@click.group("vqa", cls=Verbs, verbs=_VERBS, prefix="phyblock.making.cli.vqa_")
def command() -> None:
    """Make multiple-choice questions about scenes, check them, and look at them."""
