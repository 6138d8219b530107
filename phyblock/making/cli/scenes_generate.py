"""`phyblock scenes generate`: a data set from a seed."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import click

from phyblock.cli.console import shown_path
from phyblock.cli.options import UserPath
from phyblock.making.cli.working import (
    jobs_option,
    ray_option,
    seed_option,
    tell_simulators,
    tracked,
)
from phyblock.making.scenes.files import card, open_writer
from phyblock.making.scenes.production import Order, produce, shares
from phyblock.making.scenes.sketch import PALETTES, Palette
from phyblock.making.workers import open_workers
from phyblock.text import counted

__all__ = ["command"]

_PALETTE_TEXT: dict[Palette, str] = {
    "kit": f"the official kit's {len(PALETTES['kit'])} pairs of type and color",
    "full": f"all {len(PALETTES['full'])} pairs of type and color",
}


def _levels(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, ...]:
    words = value.split(",")
    if not all(word in ("1", "2", "3", "4") for word in words) or len(set(words)) < len(words):
        raise click.BadParameter(f"{value!r}: give levels like 1,2,3,4", ctx, param)
    return tuple(sorted(int(word) for word in words))


@click.command("generate")
@click.option(
    "--count",
    type=click.IntRange(1),
    default=400,
    show_default=True,
    metavar="N",
    help="How many scenes.",
)
@seed_option("Another seed gives other scenes.")
@click.option(
    "--levels",
    default="1,2,3,4",
    show_default=True,
    callback=_levels,
    metavar="LEVELS",
    help="Levels to make, in the proportions of the built-in set.",
)
@click.option(
    "--palette",
    type=click.Choice(["kit", "full"]),
    default="kit",
    show_default=True,
    help=f"The kit's {len(PALETTES['kit'])} pairs of type and color, or all that there are.",
)
@jobs_option
@ray_option
@click.option(
    *("--out", "-o"),
    type=UserPath(),
    required=True,
    metavar="DIR",
    help="Folder to write.",
)
@click.option("--replace", is_flag=True, help="Replace a data set that is in the folder.")
def command(
    count: int,
    seed: int,
    levels: tuple[int, ...],
    palette: str,
    jobs: int,
    ray_address: str | None,
    out: Path,
    replace: bool,
) -> None:
    """Make N scenes with candidate sets, each checked by physics, and their data card.

    The same N, seed, levels and palette give the same files with the same
    physics engine, on any Python, any number of processes or a cluster.
    """
    kind = cast(Palette, palette)
    order = Order(seed, kind, shares(count, levels))
    with (
        open_workers(jobs, ray_address) as workers,
        open_writer(out, kind, replace, "give another --out, or --replace") as writer,
    ):
        for scene in tracked(produce(order, workers), count, "Making"):
            writer.add(scene)
        chosen = ",".join(map(str, levels))
        made_by = f"phyblock scenes generate --count {count} --seed {seed} --levels {chosen}"
        made_by += f" --palette {palette} --out {out.name}"
        writer.finish(card(out.name, writer, made_by, _PALETTE_TEXT[kind]))
    click.echo(f"{counted(count, 'scene')}, all checks passed: {shown_path(out)}")
    tell_simulators()
