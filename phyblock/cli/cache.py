"""`phyblock cache`: what paid replies are kept, and clearing them."""

from __future__ import annotations

import click

from phyblock.cli.console import make_console, plain_table
from phyblock.models import ReplyCache
from phyblock.resources import reply_cache_file

__all__ = ["command"]


@click.group("cache")
def command() -> None:
    """Show or clear the reply cache, which all runs of this user share."""


@command.command("stats")
def stats() -> None:
    """Replies kept, by model, and the size of the file."""
    console = make_console()
    with ReplyCache(reply_cache_file()) as cache:
        found = cache.stats()
    rows = [(model, f"{replies:,}") for model, replies in found.by_model.items()]
    console.print(plain_table(("model", "replies"), rows, numbers=1))
    size = f"{found.size_bytes / 1e6:,.1f} MB"
    text = f"{found.replies:,} replies, {size}, in {found.path}"
    console.print(text, soft_wrap=True, markup=False)


@command.command("clear")
@click.option("--model", metavar="ID", help="Forget the replies of this model id alone.")
@click.option("--yes", is_flag=True, help="Do not ask.")
def clear(model: str | None, yes: bool) -> None:
    """Forget replies; they cost money again when they are needed again."""
    which = f"replies of {model}" if model else "all replies"
    if not yes:
        click.confirm(f"Forget {which}? Asking again costs money.", abort=True)
    with ReplyCache(reply_cache_file()) as cache:
        make_console().print(f"Forgot {cache.clear(model):,} replies.")
