"""`phyblock cache`: which paid replies and files of floors are kept, and clearing them."""

from __future__ import annotations

import click

from phyblock.cli.console import make_console, plain_table
from phyblock.models import ReplyCache
from phyblock.resources import reply_cache_file
from phyblock.text import counted

__all__ = ["command"]


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


@command.command("clear")
@click.option("--model", metavar="ID", help="Delete only the replies of this model id.")
@click.option("--yes", is_flag=True, help="Do not ask.")
def clear(model: str | None, yes: bool) -> None:
    """Delete cached replies; repeated calls will be billed."""
    which = f"replies of {model}" if model else "all replies"
    if not yes:
        click.confirm(f"Delete {which}? Repeated calls will be billed.", abort=True)
    with ReplyCache(reply_cache_file()) as cache:
        make_console().print(f"Deleted {counted(cache.clear(model), 'reply', 'replies')}.")
