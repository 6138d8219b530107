"""`phyblock questions`: make questions about scenes, check them, look at them."""

from __future__ import annotations

import click

from phyblock.cli.options import Verbs

_VERBS = {
    "generate": "Make questions about a data set's scenes from a seed.",
    "verify": "Derive every answer again and compare.",
    "show": "Show a question, and draw its pictures to a file.",
    "audit": "Look for what could be answered without looking; write a sheet for a human check.",
    "write": "Ask a model for further wordings of the questions.",
    "reword": "Ask questions in further wordings, as a set that a suite can name.",
}


@click.group(
    cls=Verbs,
    sections={
        "Commands": {
            name: (f"phyblock.making.cli.vqa_{name}:command", about)
            for name, about in _VERBS.items()
        }
    },
)
def command() -> None:
    """Make multiple-choice questions about scenes, check them, and look at them."""
