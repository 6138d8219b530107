"""`phyblock run`, `play` and `score`: ask models or a person, rescore stored replies."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

import click
from rich.console import Console

from phyblock.cli.console import (
    INTERRUPTED,
    NAME_OR_PATH,
    UserPath,
    data_option,
    left_to_first,
    limit_option,
    make_console,
    models_file_option,
    models_option,
    open_shards,
    print_again,
    print_path,
    print_table,
    run_argument,
    run_out_option,
    sets_option,
    shown_path,
    tracked,
    worker_options,
    yes_option,
)
from phyblock.cli.progress import ProgressView
from phyblock.cli.results import show_tables
from phyblock.config.models import load_models
from phyblock.config.yaml import read_yaml
from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.records.files import RECORDS, read_manifest
from phyblock.results.text import NO_VALUE, REPORT_FILE, TABLES, Column, TextTable
from phyblock.run.manifest import code_versions
from phyblock.run.plan import (
    Estimate,
    RunPlan,
    bundled_suites,
    check_models,
    estimate,
    find_models_file,
    make_plan,
    may_bill,
    read_suite,
)
from phyblock.run.runner import RunResult, Session, completed
from phyblock.run.store import held_run
from phyblock.text import counted, one_line, some_of
from phyblock.tracks.base import kind_of
from phyblock.workers import open_workers

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


@click.command(epilog=f"Bundled suites: {', '.join(bundled_suites())}.")
@click.argument("suite", type=NAME_OR_PATH)
@sets_option
@models_option(
    "Run these models instead of the suite's: any of models.yaml, group:NAME for all of a group, "
    "or the baselines."
)
@limit_option
@run_out_option
@models_file_option
@click.option("--no-cache", is_flag=True, help="Neither read nor write the reply cache.")
@click.option("--dry-run", is_flag=True, help="Print calls, tokens and dollars; call nothing.")
@click.option(
    "--retry-failed", is_flag=True, help="Ask again for samples whose request was rejected."
)
@click.option("--no-report", is_flag=True, help="Write only tables, no page.")
@yes_option
def run(
    suite: str,
    sets: tuple[str, ...],
    models: Sequence[str],
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

    Writes every record as soon as it is complete. Run the same command again to continue where it
    stopped; no call is repeated.
    """
    console = make_console()
    loaded = read_suite(suite, sets)
    models_path = find_models_file(models_file, loaded.files.path)
    plan = make_plan(loaded, load_models(models_path), only=models, limit=limit)
    check = partial(check_models, plan.models, read_yaml(models_path), needs_keys=True)
    folder = out or plan.folder_in(Path("results"))
    made = folder / (TABLES if no_report else REPORT_FILE)
    held = held_run(folder, plan.manifest)
    # Nothing is left to ask, and existing outputs stay.
    is_as_it_was = (
        held is not None
        and not retry_failed
        and held.model_copy(update={"created": plan.manifest.created}) == plan.manifest
        and _is_newest(folder, made)
    )
    if held is not None and not is_as_it_was and not dry_run:
        from phyblock.web.report import files_of

        OutFolder(folder).check(files_of(page=not no_report))
    asks: dict[str, Any] = {"use_cache": not no_cache, "retry_failed": retry_failed}
    if dry_run:
        print_estimate(console, plan, estimate(plan, folder, **asks))
        try:
            check()
        except SpecError as error:
            console.print(f"A run would not begin:\n{error}", style="yellow")
        return 0
    check()
    has_limit = plan.suite.limits.max_cost_usd is not None
    is_asked = sys.stdin is not None and sys.stdin.isatty()
    if rows := [] if yes or (has_limit and not is_asked) else may_bill(plan, folder, **asks):
        print_estimate(console, plan, rows)
        if not is_asked:
            found = ", ".join(row.model.name for row in rows if row.may_cost)
            message = "would cost money, and there is no terminal to ask on"
            hint = "agree with --yes, or give prices and set a limit: --set limits.max_cost_usd=5"
            raise SpecError(Problem("models", message, found=found, hint=hint))
        if not click.confirm("Continue?", default=False):
            console.print("Nothing was asked.")
            return 1
    if any(model.kind == "litellm" for model in plan.models):
        from phyblock.models.litellm_client import be_quiet

        be_quiet()
    # Garbage among what stays is a tenth of a run, imports for tables a third of a second.
    gc.freeze()
    if not is_as_it_was:
        Thread(target=import_module, args=("phyblock.results.tables",)).start()
    with ProgressView(console) as view:
        session = Session(plan, folder, view, **asks)
        result = completed(session, _SIGNALS, view.tick)
    gc.freeze()
    if result.left or not (is_as_it_was and _is_newest(folder, made)):
        show_tables(folder, page=not no_report)
        hint = ""
    else:
        hint = f"phyblock report {shown_path(folder)} --print shows its tables."
    code = _conclude(console, folder, result, view)
    if hint:
        console.print(one_line(hint), style="dim", soft_wrap=True)
    print_path(console, made)
    return code


def _is_newest(folder: Path, made: Path) -> bool:
    """True if phyblock made the tables or page of a run folder after its last record."""
    ends = [path.stat().st_mtime_ns for path in (folder / RECORDS, made) if path.exists()]
    is_own = bool(OutFolder(folder).names(made.name))
    return is_own and len(ends) == 2 and ends[0] <= ends[1]


def _conclude(console: Console, folder: Path, result: RunResult, view: ProgressView) -> int:
    """Print the result of a run, its cost and how to continue; return the exit code."""
    for remark in result.remarks(shown_path(folder)):
        console.print(one_line(remark), style="red")
    done = f"All {result.samples:,} samples are done"
    if result.left:
        reason = f" ({result.stop.reason})" if result.stop else ""
        done = f"{result.settled:,} of {result.samples:,} samples are done{reason}"
    cached = f" {view.cached:,} came from the reply cache (--no-cache asks again)."
    unanswered = f"; {result.unanswered}" if result.unanswered else ""
    console.print(
        f"{done}. Cost so far: {view.cost_text}{unanswered}.{cached if view.cached else ''}"
    )
    cause = result.stop.cause if result.stop else None
    if others := [model.name for model in read_manifest(folder).others]:
        also = f"The run also holds {some_of(others)}: name them with --models to see them again."
        console.print(also, style="dim")
    if result.left:
        print_again(console, "raise limits.max_cost_usd and run" if cause == "cost" else "run")
    if cause == "interrupted" and result.left:
        return INTERRUPTED
    return 1 if result.left or result.failed or result.unjudged else 0


def print_estimate(console: Console, plan: RunPlan, rows: Sequence[Estimate]) -> None:
    """Print the calls, tokens and cost of each model, and the sums."""
    items = [counted(len(track.items), kind_of(track.name).item) for track in plan.tracks]
    facts = [f"{', '.join(items)} of {plan.dataset.name}", counted(len(plan.suite.seeds), "seed")]
    if len(plan.variants) > 1:
        facts.append(f"{len(plan.variants):,} conditions")
    facts.append(counted(len(plan.models), "model"))
    asked = [row for row in rows if row.model.kind == "litellm"]
    columns: dict[str, Callable[[Estimate], str]] = {
        "samples": lambda row: f"{row.samples:,}",
        "done": lambda row: f"{row.done:,}",
        "cached": lambda row: f"{row.cached:,}",
        "in batches": lambda row: f"{row.waiting:,}",
        "calls": lambda row: f"{row.calls:,}",
        "tokens in": lambda row: f"{row.prompt_tokens:,}",
        "tokens out": lambda row: f"{row.reply_tokens:,}",
        "cost": lambda row: _dollars(row.cost_usd) if row.calls else NO_VALUE,
        "at most": lambda row: _dollars(row.most_usd) if row.calls else NO_VALUE,
    }
    if not asked:
        console.print(f"{plan.suite.name}: {', '.join(facts)}. No call is needed.")
        return
    cells = {heading: [text(row) for row in asked] for heading, text in columns.items()}
    cells = {heading: texts for heading, texts in cells.items() if set(texts) - {"0"}}
    headings = (Column("model", is_text=True), *map(Column, cells))
    lines = tuple(zip((row.model.name for row in asked), *cells.values(), strict=True))
    left = [row for row in rows if row.calls]
    note = (
        "Tokens are estimates: texts by their words, pictures by the provider's rule, replies of "
        "usual length. At most: every reply is as long as its limit allows."
    )
    title, notes = f"{plan.suite.name}: {', '.join(facts)}", (note,) if left else ()
    print_table(console, TextTable(title, headings, lines, notes))
    known = [row.cost_usd for row in left if row.cost_usd is not None]
    costs = [f"about {_dollars(sum(known))}"] if known or not left else []
    if unknown := len(left) - len(known):
        costs.append(f"unknown cost of {counted(unknown, 'model')} (give a price in models.yaml)")
    console.print(f"{counted(sum(row.calls for row in left), 'call')}, {' and '.join(costs)}.")


def _dollars(cost_usd: float | None) -> str:
    if cost_usd is None:
        return "unknown"
    return f"${cost_usd:,.4f}" if 0 < cost_usd < 0.01 else f"${cost_usd:,.2f}"


@click.command(epilog=f"Bundled suites: {', '.join(bundled_suites())}.")
@click.argument("suite", type=NAME_OR_PATH)
@click.option(
    "--name",
    required=True,
    metavar="NAME",
    help="Your name, human:NAME in tables: letters, digits, - and _; better not a real one.",
)
@sets_option
@limit_option
@click.option(
    "--beside",
    type=UserPath(),
    multiple=True,
    metavar="RUN",
    help="Compare with the models of this run folder at the end.",
)
@run_out_option
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default="any free one")
@click.option("--exact", is_flag=True, help="Show the models' prompt from the start, for studies.")
@click.option("--no-browser", is_flag=True, help="Print the address; open no browser.")
def play(
    suite: str,
    name: str,
    sets: tuple[str, ...],
    limit: int | None,
    beside: tuple[Path, ...],
    out: Path | None,
    port: int,
    exact: bool,
    no_browser: bool,
) -> int:
    """Answer SUITE yourself, in a browser: the pictures that models get, and clicks for answers.

    Answers are records of the model human:NAME in a run folder. Run the same command again to
    continue where it stopped.
    """
    import webbrowser

    from phyblock.results.load import load_run
    from phyblock.web.report import files_of, report_files
    from phyblock.web.server import Server
    from phyblock.web.session import Ending, Person, PlaySession, plan_session

    person = Person(name, exact)
    plan = plan_session(read_suite(suite, sets), person, limit)
    folder = out or plan.folder_in(Path("results"))
    if held_run(folder, plan.manifest) is not None:
        OutFolder(folder).check(files_of(page=True))
    for other in beside:
        load_run(other)
    console = make_console()

    def begun() -> None:
        print_path(console, f"Open {server.address}")
        console.print("Ctrl-C ends the session; the same command continues it.", style="dim")
        if not no_browser:
            # A terminal browser would block until it is closed.
            Thread(target=webbrowser.open, args=(server.one_time_address,), daemon=True).start()

    session = PlaySession(plan.samples_per_model)
    with Server(session, port) as server:
        result = asyncio.run(session.run(plan, person, folder, begun))
        if result.left:
            console.print(f"{session.done:,} of {plan.samples_per_model:,} tasks are answered.")
            print_again(console)
            return INTERRUPTED
        made = show_tables(folder, page=True)
        server.files = report_files(folder)
        session.finish(Ending(folder, person.model, beside, plan.dataset.tasks))
        print_path(console, made)
        console.print("All tasks are done; the page shows the results. Ctrl-C ends.", style="dim")
        with contextlib.suppress(KeyboardInterrupt):
            server.finished.wait()
    return 0


@click.command()
@run_argument
@data_option
@worker_options(1)
def score(
    run: Path,
    data: Path | None,
    jobs: int,
    ray_address: str | None,
    shard: tuple[int, int] | None,
) -> None:
    """Parse and score the stored replies of the folder RUN again. Calls no model.

    The new records replace those of RUN in one step.
    """
    from phyblock.run.rescore import rescore

    work = f"score {read_manifest(run).identity}: {code_versions()}\n"
    shards = open_shards(shard, run, work)
    with open_workers(jobs, ray_address, shards, size=64) as workers:
        watch = partial(tracked, total=None, doing="Scoring")
        rescore(run, data, make_console(stderr=True).print, watch, workers)
    if left_to_first(shards, run):
        return
    print_path(make_console(), show_tables(run, data=data))
