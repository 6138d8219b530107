"""`phyblock cache`: which paid replies and files of floors are kept, and clearing them."""

from __future__ import annotations

import contextlib
import os
import re
from pathlib import Path

import click

from phyblock.cli.console import make_console, plain_table
from phyblock.errors import InputError, Problem, reason_of
from phyblock.models import ReplyCache
from phyblock.resources import learned_dir, reply_cache_file
from phyblock.text import counted

__all__ = ["command"]

_LEARNED = re.compile(r"[0-9a-f]{64}\.json")


@click.group("cache")
def command() -> None:
    """Show or clear the reply cache, which all runs of this user share."""


@command.command("stats")
def stats() -> None:
    """Show how many replies the cache holds of each model, and how large its file is."""
    console = make_console()
    with ReplyCache(reply_cache_file()) as cache:
        held = cache.stats()
    rows = [(model, f"{replies:,}") for model, replies in held.by_model.items()]
    console.print(plain_table(("model", "replies"), rows, numbers=1))
    size = f"{held.size_bytes / 1e6:,.1f} MB"
    text = f"{counted(held.replies, 'reply', 'replies')}, {size}, in {held.path}"
    console.print(text, soft_wrap=True, markup=False)
    if sizes := _learned():
        text = f"{_sizes_text(list(sizes.values()))}, in {learned_dir()}"
        console.print(text, soft_wrap=True, markup=False)


@command.command("clear")
@click.option("--model", metavar="ID", help="Delete only the replies of this model id.")
@click.option(
    "--learned",
    is_flag=True,
    help="Delete what floors learned, not replies; it takes seconds to learn again.",
)
@click.option("--yes", is_flag=True, help="Do not ask.")
def clear(model: str | None, learned: bool, yes: bool) -> None:
    """Delete cached replies; repeated calls will be billed."""
    if learned:
        if model is not None:
            raise click.UsageError("--learned deletes nothing of a model: leave --model out")
        _clear_learned()
        return
    which = f"replies of {model}" if model else "all replies"
    if not yes:
        click.confirm(f"Delete {which}? Repeated calls will be billed.", abort=True)
    with ReplyCache(reply_cache_file()) as cache:
        make_console().print(f"Deleted {counted(cache.clear(model), 'reply', 'replies')}.")


def _clear_learned() -> None:
    removed: list[int] = []
    for path, size in _learned().items():
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise InputError(
                Problem(str(path), f"cannot be removed: {reason_of(error)}")
            ) from error
        removed.append(size)
    make_console().print(f"Deleted {_sizes_text(removed)}.")


def _learned() -> dict[Path, int]:
    """Files of floors' plans and values, and sizes [bytes]; others that lie there are not ours."""
    sizes: dict[Path, int] = {}
    with contextlib.suppress(OSError), os.scandir(learned_dir()) as entries:
        for entry in entries:
            if _LEARNED.fullmatch(entry.name) and entry.is_file(follow_symlinks=False):
                sizes[Path(entry.path)] = entry.stat(follow_symlinks=False).st_size
    return sizes


def _sizes_text(sizes: list[int]) -> str:
    return f"{counted(len(sizes), 'file')} of floors' plans and values, {sum(sizes) / 1e6:,.1f} MB"
