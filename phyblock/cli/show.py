"""`phyblock show`: one sample of a run, from its prompt to the verdict of each step."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click
from rich.console import Console

from phyblock.cli.console import make_console, print_path
from phyblock.cli.options import UserPath, data_option, run_argument
from phyblock.errors import DataError, Problem, StoreError
from phyblock.text import counted, one_line, some_of

if TYPE_CHECKING:
    from phyblock.data.base import AssemblyTask
    from phyblock.records.record import Record, Reply

_STYLES = {"plain": "", "good": "green", "bad": "red"}


@click.command()
@run_argument
@click.argument("sample")
@click.option(
    "--gif",
    type=UserPath(dir_okay=False),
    metavar="FILE",
    help="Draw the steps as an animated GIF; needs the data set.",
)
@click.option(
    "--size",
    type=click.IntRange(128, 1024),
    default=256,
    help="Edge of each picture of the GIF [pixels].",
)
@data_option
def show(run: Path, sample: str, gif: Path | None, size: int, data: Path | None) -> None:
    """Show SAMPLE of the folder RUN: prompt, reply, what was parsed, and the verdict of each step.

    SAMPLE is as in records.jsonl (TRACK/MODEL/ITEM/sSEED); a part that only one sample has is
    enough.
    """
    from phyblock.files import write_named
    from phyblock.tracks.base import kind_of

    record = _find(run, sample)
    film = kind_of(record.track).report().film
    console = make_console()
    console.print(record.sample, style="bold")
    facts = [f"scene {record.scene}", f"level {', '.join(map(str, record.levels))}"]
    facts += [counted(record.n_blocks, "block"), record.outcome.replace("_", " ")]
    facts += [f"{factor} {level}" for factor, level in record.variant.items()]
    console.print(" · ".join(facts))
    _print_prompt(console, run, record)
    console.print("\nReply", style="bold")
    if record.error is not None:
        console.print(f"{record.error.kind}: {record.error.message}", style="red")
    turns = [turn.reply for turn in record.asked_turns]
    for number, reply in enumerate(turns or record.replies, 1):
        _print_reply(console, reply, f"{number}. " if turns else "")
    console.print("\nRead", style="bold")
    parser = getattr(record.parse, "rule", None)
    console.print((record.said or "nothing") + (f" (rule {parser})" if parser else ""))
    if record.is_correct is not None:
        verdict = "right" if record.is_correct else f"wrong: the answer is {record.target}"
        console.print(verdict, style="green" if record.is_correct else "red")
    task, frames = None, []
    if film is not None:
        try:
            task = _task(run, record, data)
            blocks = enumerate(task.candidates.candidates, 1)
            names = ", ".join(f"{n} {one.color} {one.type}" for n, one in blocks)
            console.print(f"Candidates: {names}\n", style="dim")
        except DataError as error:
            if gif is not None:
                raise
            console.print(f"Names of blocks are not shown: {error}\n", style="dim")
        frames = list(film(record, task))
    for frame in frames[1:] or frames:
        note = f" ({frame.note})" if frame.note else ""
        console.print(one_line(f"{frame.caption}{note}"), style=_STYLES[frame.tone])
    if gif is None:
        return
    if not frames or task is None:
        raise StoreError(Problem(record.sample, "has no steps to draw", "--gif"))
    from phyblock.sim.film import episode_gif, episode_images
    from phyblock.sim.pictures import PictureStyle

    images = episode_images(task.scene, task.candidates, frames, PictureStyle(size))
    write_named(gif, episode_gif(images))
    print_path(console, gif)


def _find(run: Path, sample: str) -> Record:
    """Return the newest record that `sample` means; StoreError where not one is meant."""
    from phyblock.records.files import RECORDS, newest_starts, run_records

    lines = run_records(run)
    starts = newest_starts(lines)
    matching = [sample] if sample in starts else [name for name in starts if sample in name]
    if len(matching) == 1:
        return next(iter(lines.at([starts[matching[0]]])))
    many = f"holds {counted(len(matching), 'such sample')}"
    message = many if matching else "holds no such sample"
    allowed = some_of(matching or list(starts))
    raise StoreError(Problem(str(run / RECORDS), message, "sample", sample, allowed))


def _print_prompt(console: Console, run: Path, record: Record) -> None:
    """Print what was sent, of an episode with the first turn; pictures by label and size."""
    from phyblock.records.files import PromptLines

    if record.prompt is None:
        return
    console.print(f"\nPrompt ({record.prompt.template})", style="bold")
    sent = (line for _, line in PromptLines(run) if line.sha256 == record.prompt.messages)
    line = next(sent, None)
    if line is None:
        console.print("The text is not in the folder of the run.", style="dim")
    for message in line.messages if line else ():
        for part in message.parts:
            text = part if isinstance(part, str) else f"(picture {part.image})"
            console.print(f"{message.role}: {text}")
    for image in record.prompt.images:
        size = f"{image.width_px} x {image.height_px}"
        console.print(f"picture {image.label}, {size} pixels, {image.sha256[:12]}", style="dim")


def _print_reply(console: Console, reply: Reply, number: str) -> None:
    facts: list[str] = [reply.finish]
    if reply.usage.completion_tokens:
        facts.append(counted(reply.usage.completion_tokens, "token"))
    facts.append("cost unknown" if reply.cost_usd is None else f"${reply.cost_usd:.4f}")
    facts.append("from the cache" if reply.cached else f"{reply.latency_s:.1f} s")
    if reply.reasoning:
        console.print(reply.reasoning, style="dim")
    console.print(f"{number}{reply.text or '(empty)'}")
    console.print(" · ".join(filter(None, facts)), style="dim")


def _task(run: Path, record: Record, data: Path | None) -> AssemblyTask:
    """Return the scene with its candidates as it was shown; DataError where it is not at hand."""
    from phyblock.records.files import read_manifest
    from phyblock.run.rescore import recorded_dataset
    from phyblock.tracks.items import as_recorded

    manifest = read_manifest(run)
    dataset = recorded_dataset(run, manifest, data)
    for task in dataset.tasks:
        if task.scene.id == record.scene:
            return as_recorded(task, record)
    raise DataError(Problem(str(dataset.root), "holds no such scene", "scene", record.scene))
