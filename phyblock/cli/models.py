"""`phyblock models`: what can be asked, at what price, and whether it answers."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator, Sequence
from datetime import date, timedelta
from importlib.metadata import version
from pathlib import Path

import click
from rich.console import Console

from phyblock.cli.console import make_console, plain_table, shown_path
from phyblock.cli.paths import models_file_option
from phyblock.config.models import (
    GROUP,
    ModelConfig,
    group_names,
    host_of,
    load_models,
    with_members,
)
from phyblock.config.suite import Suite
from phyblock.errors import ModelError, Problem, SpecError
from phyblock.models import (
    Reply,
    api_key_status,
    ends_on,
    is_unlisted,
    prices_of,
    today,
)
from phyblock.models.litellm_client import be_quiet
from phyblock.registry import baseline_names
from phyblock.report import NO_VALUE
from phyblock.run.check import check_model
from phyblock.run.models import to_config
from phyblock.run.preflight import find_models_file
from phyblock.text import counted, did_you_mean

__all__ = ["command"]

_SOON_DAYS = 180
_TIERS = " .. "
_WIDE = 130
"""Characters from which kinds and prices fit beside names, ids and keys."""


_retiring_option = click.option(
    "--retiring",
    is_flag=True,
    help=f"List only those that their providers end within {_SOON_DAYS} days, or have ended.",
)


@click.group("models", invoke_without_command=True)
@models_file_option
@_retiring_option
@click.pass_context
def command(ctx: click.Context, models_file: str | None, retiring: bool) -> None:
    """List the models that suites may name, by groups; `check NAME` makes one tiny call."""
    path = find_models_file(models_file, None)
    ctx.obj = load_models(path)
    if ctx.invoked_subcommand is None:
        _list(path, ctx.obj, is_retiring=retiring)


@command.command("list")
@_retiring_option
@click.pass_context
def list_models(ctx: click.Context, retiring: bool) -> None:
    """List the models, as without a command."""
    assert ctx.parent is not None
    given = ctx.parent.params
    path = find_models_file(given["models_file"], None)
    _list(path, ctx.obj, is_retiring=retiring or given["retiring"])


def _list(path: Path, known: dict[str, ModelConfig], *, is_retiring: bool) -> None:
    console = make_console()
    if is_retiring:
        _show_retiring(console, [_config(name, known) for name in known])
        return
    groups = {
        title: [_row(name, _config(name, known)) for name in names]
        for title, names in _by_group(known)
    }
    for title, rows in groups.items():
        _show(console, title, rows)
    console.print(
        f"{counted(len(known), 'model')} in {shown_path(path)}", soft_wrap=True, markup=False
    )
    if console.width < _WIDE:
        console.print(f"Kinds and prices need a window of {_WIDE} columns.", soft_wrap=True)
    elif any(_TIERS in cell for rows in groups.values() for row in rows for cell in row[-2:]):
        console.print(f"a{_TIERS}b: a for short prompts, b for the longest.", soft_wrap=True)


def _by_group(known: dict[str, ModelConfig]) -> Iterator[tuple[str, Sequence[str]]]:
    """Baselines, then the models of each group, then those of none; one of several groups stands in
    each.
    """
    yield "built in", baseline_names()
    for group in group_names(known):
        yield f"{GROUP}{group}", with_members([f"{GROUP}{group}"], known)
    if others := [name for name, spec in known.items() if not spec.groups]:
        yield "in no group" if len(others) < len(known) else "models", others


def _show(console: Console, title: str, rows: Sequence[tuple[str, ...]]) -> None:
    if console.width < _WIDE:
        rows = [(name, model_id, key) for name, _, model_id, key, *_ in rows]
        console.print(plain_table((title, "id", "key"), rows, numbers=0))
    else:
        headings = (title, "kind", "id", "key", "$/M in", "$/M out")
        console.print(plain_table(headings, rows, numbers=2))


@command.command("check")
@click.argument("name")
@click.pass_obj
def check(known: dict[str, ModelConfig], name: str) -> int:
    """Make one tiny call to the model NAME, to each of its servers, and say what came back."""
    names = [*baseline_names(), *known]
    if name not in names:
        hint = did_you_mean(name, names) or "list them: phyblock models"
        raise SpecError(Problem("models check", "is not in the models file", "", name, hint=hint))
    console = make_console()
    config = _config(name, known)
    if config.kind != "litellm":
        console.print(f"{name} is a {config.kind}: it makes no calls.", markup=False)
        return 0
    code = 0
    for server, one in _servers(name, config):
        try:
            be_quiet()
            reply = asyncio.run(check_model(one))
        except ModelError as error:
            console.print(f"{server} does not answer:", style="red", end=" ")
            console.print(str(error))
            code = 1
            continue
        if reply.text.strip():
            console.print(_answered(server, reply), markup=False, soft_wrap=True)
        else:
            nothing = f"{server} answered with nothing (it ended by: {reply.finish})"
            console.print(nothing, style="red")
            code = 1
    return code


def _servers(name: str, config: ModelConfig) -> Iterator[tuple[str, ModelConfig]]:
    """Each server of a model by what it is called, and the model as it serves it."""
    addresses = config.addresses or (None,)
    for address in addresses:
        is_alone = address is None or len(addresses) == 1
        yield name if is_alone else f"{name} at {host_of(address or '')}", config.at(address)


def _answered(server: str, reply: Reply) -> str:
    tokens = f"{reply.usage.prompt_tokens or '?'} + {reply.usage.completion_tokens or '?'} tokens"
    cost = "cost unknown" if reply.cost_usd is None else f"${reply.cost_usd:.6f}"
    answer = reply.text.strip()[:80]
    return f"{server} answers: {answer!r} in {reply.latency_s:.1f} s, {tokens}, {cost}"


def _show_retiring(console: Console, configs: Sequence[ModelConfig]) -> None:
    soon = date.today() + timedelta(days=_SOON_DAYS)
    dated = sorted((day, c.name, c.id) for c in configs if (day := ends_on(c)) is not None)
    rows = [(name, model_id, day.isoformat()) for day, name, model_id in dated if day <= soon]
    rows += [(c.name, c.id, "not listed") for c in configs if is_unlisted(c)]
    if not rows:
        console.print(f"No model here is known to end within {_SOON_DAYS} days.")
        return
    console.print(plain_table(("model", "id", "ends"), rows, numbers=0))
    console.print(
        f"By litellm {version('litellm')}, which may be behind. Not listed: retired already, or "
        "newer than it.",
        style="dim",
        soft_wrap=True,
    )


def _config(name: str, known: dict[str, ModelConfig]) -> ModelConfig:
    return to_config(
        name, known.get(name, ModelConfig(name=name)), Suite(name="models", models=(name,))
    )


def _row(name: str, config: ModelConfig) -> tuple[str, ...]:
    if config.kind != "litellm":
        return (name, config.kind, str(config.recording or "built in"), NO_VALUE, "0", "0")
    status = api_key_status(config)
    if status.fault:
        key = "cannot be sent"
    elif status.is_set:
        key = "set"
    else:
        key = f"needs {status.variables[0]}" if status.is_needed else "not needed"
    known = prices_of(config)
    tariff = None if known is None else known.on(today())
    prices = ("unknown", "unknown")
    if tariff is not None:
        tiers = [rate.price for rate in tariff.rates]
        prices = (_usd(*(p.input_usd for p in tiers)), _usd(*(p.output_usd for p in tiers)))
    kind = "direct" if config.is_direct else "litellm"
    return (name, kind, config.id, key, *prices)


def _usd(*dollars: float) -> str:
    """The price of short prompts, and that of the longest where it is another."""
    shown = [f"{usd:.3f}".rstrip("0").rstrip(".") for usd in (dollars[0], dollars[-1])]
    return _TIERS.join(dict.fromkeys(shown))
