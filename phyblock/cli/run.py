"""`phyblock run`: a suite from start to tables, or on from where it stopped."""

from __future__ import annotations

import asyncio
import shlex
import signal
import sys
from pathlib import Path

import click
from rich.console import Console

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.estimate_view import show_estimate
from phyblock.cli.names import split_names
from phyblock.cli.paths import NAME_OR_PATH, UserPath, models_file_option
from phyblock.cli.progress import ProgressView
from phyblock.cli.report import show_made
from phyblock.config.models import load_models
from phyblock.config.suite import load_suite
from phyblock.models.litellm_client import be_quiet
from phyblock.report.made import names_to_write
from phyblock.resources import bundled
from phyblock.run.estimate import estimate, spending_refused, unlimited_spending
from phyblock.run.execute import Cause, RunResult
from phyblock.run.plan import RunPlan, make_plan
from phyblock.run.preflight import (
    asking_remarks,
    bundled_suites,
    find_models_file,
    find_suite,
    moved_remarks,
    prompt_dirs,
)
from phyblock.run.session import Session, check_ready
from phyblock.run.store import held_run, run_folder
from phyblock.text import counted, one_line

__all__ = ["command"]

_INTERRUPTED = 130


@click.command("run", epilog=f"Bundled suites: {', '.join(bundled_suites())}.")
@click.argument("suite", type=NAME_OR_PATH)
@click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a value of the suite."
)
@click.option(
    "--models",
    metavar="A,B",
    help="Run these models in place of the suite's: any of models.yaml, group:NAME for all of a "
    "group, or the baselines.",
)
@click.option(
    "--limit", type=click.IntRange(min=1), metavar="N", help="Run N scenes, spread over levels."
)
@click.option(
    "--out",
    type=UserPath(),
    help="Folder of the run. [default: results/SUITE-DIGEST]",
)
@models_file_option
@click.option("--no-cache", is_flag=True, help="Neither read nor write the reply cache.")
@click.option("--dry-run", is_flag=True, help="Print calls, tokens and dollars; call nothing.")
@click.option(
    "--retry-failed", is_flag=True, help="Ask again for samples whose request was rejected."
)
@click.option("--no-report", is_flag=True, help="Write only tables: no figures, no page.")
@click.option("--yes", is_flag=True, help="Spend money without asking.")
def command(
    suite: str,
    sets: tuple[str, ...],
    models: str | None,
    limit: int | None,
    out: Path | None,
    models_file: str | None,
    no_cache: bool,
    dry_run: bool,
    retry_failed: bool,
    no_report: bool,
    yes: bool,
) -> int:
    """Run SUITE: a YAML file, or the name of a bundled suite.

    Keeps every record as it comes. Give the same command again to continue where it stopped;
    nothing is asked twice.
    """
    console = make_console()
    path = find_suite(suite)
    data, prompts = bundled("benchmarks", "data"), prompt_dirs(path)
    loaded = load_suite(path, sets, data_dir=data, prompt_dirs=prompts)
    known_in = find_models_file(models_file, path)
    only, known = split_names(models), load_models(known_in)
    plan = make_plan(loaded, known, only=only, limit=limit)
    folder = out or plan.folder_in(Path("results"))
    asks = {"use_cache": not no_cache, "retry_failed": retry_failed}
    moved: list[str] = []
    found = held_run(folder, plan.manifest)
    if found is not None:
        moved = moved_remarks(found, plan)
        names = () if dry_run else names_to_write(folder, page=not no_report)
        run_folder(folder).check(names)
    if dry_run:
        show_estimate(console, plan, estimate(plan, folder, **asks))
    for remark in (*moved, *asking_remarks(loaded, plan)):
        console.print(remark, style="dim", markup=False, soft_wrap=True)
    if dry_run:
        return 0
    check_ready(plan)
    if not yes and not _agreed(console, plan, folder, **asks):
        console.print("Nothing was asked.")
        return 1
    view = ProgressView(console, plan.suite.name)
    be_quiet()
    session = Session(plan, folder, view, use_cache=not no_cache, retry_failed=retry_failed)
    result = asyncio.run(_run(session, view))
    show_made(folder, plan.suite.tables, page=not no_report)
    return _conclude(console, folder, result, view)


async def _run(opened: Session, view: ProgressView) -> RunResult:
    loop = asyncio.get_running_loop()
    whole = asyncio.current_task()
    assert whole is not None
    with view:
        async with opened as session:

            def interrupted() -> None:
                if session.executor.stopping:
                    whole.cancel()
                session.executor.interrupt()

            for name in (signal.SIGINT, signal.SIGTERM):
                loop.add_signal_handler(name, interrupted)
            try:
                return await session.run()
            except asyncio.CancelledError:
                return session.executor.result
            finally:
                for name in (signal.SIGINT, signal.SIGTERM):
                    loop.remove_signal_handler(name)


def _agreed(console: Console, plan: RunPlan, folder: Path, **asks: bool) -> bool:
    """Ask before money is spent; nothing is asked when nothing costs anything.

    Where nobody can answer, a cost limit is the answer. Raises SpecError where there is none.
    """
    if sys.stdin.isatty():
        estimated = estimate(plan, folder, **asks)
        if not any(row.may_cost for row in estimated):
            return True
        show_estimate(console, plan, estimated)
        return click.confirm("Go on?", default=True)
    costly = unlimited_spending(plan, folder, **asks)
    if not costly:
        return True
    show_estimate(console, plan, costly)
    message = "would cost money, and there is no terminal to ask on"
    hint = "agree with --yes, or set a limit: --set limits.max_cost_usd=5"
    raise spending_refused(plan, costly, message, hint)


def _conclude(console: Console, folder: Path, result: RunResult, view: ProgressView) -> int:
    where = shown_path(folder)
    for name, reason in result.stopped.items():
        console.print(f"{one_line(name)} was stopped:", style="red", end=" ")
        console.print(reason, soft_wrap=True)
    done = (
        f"{result.settled:,} of {result.samples:,} samples are done"
        if result.left
        else f"All {result.samples:,} samples are done"
        if result.samples != 1
        else "The one sample is done"
    )
    cause = result.stop.cause if result.stop else None
    reason = f" ({result.stop.reason})" if result.stop else ""
    console.print(
        f"{done}{reason}. Cost so far: {view.cost_text}. The run is in {where}",
        soft_wrap=True,
    )
    if view.cached_text:
        console.print(f"{view.cached_text} (--no-cache asks anew)", soft_wrap=True, markup=False)
    if result.failed:
        rejected = (
            f"{counted(result.failed, 'request')} rejected for good; when the cause is mended,"
        )
        console.print(f"{rejected} ask again with --retry-failed", style="red", soft_wrap=True)
    if result.unjudged:
        unjudged = f"{counted(result.unjudged, 'answer')} could not be judged:"
        console.print(
            f"{unjudged} phyblock score {where} tries again, without a call",
            style="red",
            soft_wrap=True,
        )
    if result.left:
        again = shlex.join(["phyblock", *sys.argv[1:]])
        how = "raise limits.max_cost_usd and give" if cause is Cause.COST else "give"
        console.print(f"To go on, {how} the same command again: {again}", soft_wrap=True)
    if cause is Cause.INTERRUPTED and result.left:
        return _INTERRUPTED
    return 1 if result.left or result.failed or result.unjudged else 0
