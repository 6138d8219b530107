"""The option that names subtasks."""

from __future__ import annotations

from typing import cast

import click

from phyblock.domain import SUBTASKS, Subtask

__all__ = ["subtasks_option"]


def _subtasks(ctx: click.Context, param: click.Parameter, value: str) -> tuple[Subtask, ...]:
    words = SUBTASKS if value == "all" else tuple(value.upper().split(","))
    unknown = [word for word in words if word not in SUBTASKS]
    if unknown or len(set(words)) < len(words):
        known = ",".join(SUBTASKS)
        raise click.BadParameter(f"{value!r}: give all, or some of {known}", ctx, param)
    return cast(tuple[Subtask, ...], words)


subtasks_option = click.option(
    "--subtasks",
    default="all",
    show_default=True,
    callback=_subtasks,
    metavar="NAMES",
    help="Subtasks like SH,CO,VP.",
)
