"""`phyblock models`: the models with prices and keys, and a check that one answers."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Mapping, Sequence

import click
from PIL import Image as PillowImage

from phyblock.cli.console import make_console, may_spend, print_rows, shown_path
from phyblock.cli.options import models_file_option, yes_option
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
from phyblock.models.costs import is_billed, tariff_of
from phyblock.models.keys import api_key_status
from phyblock.models.litellm_client import be_quiet
from phyblock.models.model import RetryPolicy, build_model
from phyblock.models.request import Image, Message, Request
from phyblock.records.record import Reply
from phyblock.registry import baseline_names
from phyblock.run.plan import find_models_file, to_config
from phyblock.text import counted, did_you_mean


@click.group(invoke_without_command=True)
@models_file_option
@click.pass_context
def models(ctx: click.Context, models_file: str | None) -> None:
    """List the models that suites may name, by groups; `check NAME` makes one tiny call."""
    path = find_models_file(models_file, None)
    known = ctx.obj = load_models(path)
    if ctx.invoked_subcommand is not None:
        return
    console = make_console()
    groups: dict[str, Sequence[str]] = {"built in": baseline_names()}
    groups |= {
        f"{GROUP}{one}": with_members([f"{GROUP}{one}"], known) for one in group_names(known)
    }
    if others := [name for name, config in known.items() if not config.groups]:
        groups["in no group" if len(others) < len(known) else "models"] = others
    for title, names in groups.items():
        rows = [_row(name, _config(name, known)) for name in names]
        print_rows(console, (title, "id", "key", "$/M in, out"), rows, numbers=1)
    console.print(f"{counted(len(known), 'model')} in {shown_path(path)}")


def _config(name: str, known: Mapping[str, ModelConfig]) -> ModelConfig:
    model = known.get(name, ModelConfig(name=name))
    return to_config(name, model, Suite(name="models", models=(name,)))


def _row(name: str, config: ModelConfig) -> tuple[str, ...]:
    """Return name, id, state of the key, and the prices of short prompts."""
    if config.kind != "litellm":
        return (name, str(config.recording or config.kind), "", "0, 0")
    status = api_key_status(config)
    if status.fault:
        key = "cannot be sent"
    elif status.is_set:
        key = "set"
    else:
        key = f"needs {status.variables[0]}" if status.is_needed else "not needed"
    tariff = tariff_of(config)
    price = f"{tariff.input:.10g}, {tariff.output:.10g}" if tariff else "unknown"
    return (name, config.id, key, price)


@models.command()
@click.argument("name")
@yes_option
@click.pass_obj
def check(known: Mapping[str, ModelConfig], name: str, yes: bool) -> int:
    """Make one tiny call to each server of the model NAME, and print the answer."""
    names = [*baseline_names(), *known]
    if name not in names:
        hint = did_you_mean(name, names) or "list them: phyblock models"
        raise SpecError(Problem("models check", "is not in the models file", "", name, hint=hint))
    console = make_console()
    config = _config(name, known)
    if config.kind != "litellm":
        console.print(f"{name} is a {config.kind}: it makes no calls.")
        return 0
    addresses = config.addresses or (None,)
    calls = counted(len(addresses), "call")
    billed = [name] if is_billed(config) and not yes else []
    if not may_spend(billed, lambda: console.print(f"{name} may bill {calls} of some 100 tokens.")):
        console.print("Nothing was asked.")
        return 1
    be_quiet()
    code = 0
    for address in addresses:
        server = f"{name} at {host_of(address)}" if address and len(addresses) > 1 else name
        try:
            reply = asyncio.run(_ask_tiny(config.at(address)))
        except ModelError as error:
            console.print(f"{server} failed the check: {error}", style="red")
            code = 1
            continue
        usage = reply.usage
        tokens = f"{usage.prompt_tokens or '?'} + {usage.completion_tokens or '?'} tokens"
        cost = "cost unknown" if reply.cost_usd is None else f"${reply.cost_usd:.6f}"
        answer = repr(reply.text.strip()[:80])
        console.print(f"{server} answers: {answer} in {reply.latency_s:.1f} s, {tokens}, {cost}")
    return code


_SIDE_PX = 64


async def _ask_tiny(config: ModelConfig) -> Reply:
    """Show the model a small red square and ask for its color; one attempt, nothing cached.

    Raises the ModelError that the call met, SpecError or DataError when the model cannot be built.
    """
    buffer = io.BytesIO()
    PillowImage.new("RGB", (_SIDE_PX, _SIDE_PX), (216, 49, 49)).save(buffer, "PNG")
    picture = Image(buffer.getvalue(), "check", _SIDE_PX, _SIDE_PX)
    question = "What color is this picture? Answer with one word."
    request = Request("check", 0, (Message("user", (picture, question)),), {}, "", None)
    alone = config.model_copy(update={"seed": "never", "batch": False})
    model = build_model(alone, cache=None, policy=RetryPolicy(attempts=1, retry_for_s=0.0))
    try:
        reply = await model.ask(request) or Reply(text="")
    finally:
        await model.aclose()
    if not reply.text.strip():
        raise ModelError(f"the reply is empty (it ended by: {reply.finish})")
    return reply
