"""`phyblock run`, `play` and `score`: ask models or a person, rescore stored replies."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import math
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import Any

import click
from rich import progress
from rich.console import Console
from rich.text import Text

from phyblock.cli import console as ui
from phyblock.cli.results import show_tables
from phyblock.config.models import HUMAN, load_models
from phyblock.config.yaml import read_yaml
from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.models.model import ModelEvent
from phyblock.records.files import RECORDS, read_manifest
from phyblock.results.text import NO_VALUE, REPORT_FILE, TABLES, Column, TextTable
from phyblock.run import plan as plans
from phyblock.run.manifest import code_versions
from phyblock.run.plan import Estimate, RunPlan
from phyblock.run.runner import RunEvent, RunResult, RunStarted, Session, completed
from phyblock.run.store import Summary, held_run
from phyblock.scoring.plan import Counts
from phyblock.text import counted, one_line, some_of
from phyblock.tracks.base import kind_of
from phyblock.workers import open_workers

_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_LINE_EVERY_S = 10.0  # Interval of progress lines where no bar is shown [s].
_SHOWN_EVERY_S = 0.1  # Minimum time between two updates of the display [s].


@click.command(epilog=f"Bundled suites: {', '.join(plans.bundled_suites())}.")
@click.argument("suite", type=ui.NAME_OR_PATH)
@ui.sets_option
@ui.models_option(
    "Run these models instead of the suite's: any of models.yaml, group:NAME for all of a group, "
    "or the baselines."
)
@ui.limit_option
@ui.run_out_option
@ui.models_file_option
@click.option("--no-cache", is_flag=True, help="Neither read nor write the reply cache.")
@click.option("--dry-run", is_flag=True, help="Print calls, tokens and dollars; call nothing.")
@click.option("--retry-failed", is_flag=True, help="Ask again for rejected samples.")
@click.option("--no-report", is_flag=True, help="Write only tables, no page.")
@ui.yes_option
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
    console = ui.make_console()
    loaded = plans.read_suite(suite, sets)
    models_path = plans.find_models_file(models_file, loaded.files.path)
    plan = plans.make_plan(loaded, load_models(models_path), only=models, limit=limit)
    check = partial(plans.check_models, plan.models, read_yaml(models_path), needs_keys=True)
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
        from phyblock.web.pages import files_of

        OutFolder(folder).check(files_of(page=not no_report))
    asks: dict[str, Any] = {"use_cache": not no_cache, "retry_failed": retry_failed}
    if dry_run:
        print_estimate(console, plan, plans.estimate(plan, folder, **asks))
        try:
            check()
        except SpecError as error:
            console.print(f"A run would not begin:\n{error}", style="yellow")
        return 0
    check()
    has_limit = plan.suite.limits.max_cost_usd is not None
    is_asked = sys.stdin is not None and sys.stdin.isatty()
    if rows := [] if yes or (has_limit and not is_asked) else plans.may_bill(plan, folder, **asks):
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
        result = completed(Session(plan, folder, view, **asks), _SIGNALS, view.tick)
    gc.freeze()
    is_current = not result.left and is_as_it_was and _is_newest(folder, made)
    if not is_current:
        show_tables(folder, page=not no_report)
    code = _conclude(console, folder, result, view)
    if is_current:
        hint = f"phyblock report {ui.shown_path(folder)} --print shows its tables."
        console.print(hint, style="dim", soft_wrap=True)
    ui.print_path(console, made)
    return code


def _is_newest(folder: Path, made: Path) -> bool:
    """True if phyblock made the tables or page of a run folder after its last record."""
    ends = [path.stat().st_mtime_ns for path in (folder / RECORDS, made) if path.exists()]
    return bool(OutFolder(folder).names(made.name)) and len(ends) == 2 and ends[0] <= ends[1]


def _conclude(console: Console, folder: Path, result: RunResult, view: ProgressView) -> int:
    """Print the result of a run, its cost and how to continue; return the exit code."""
    for remark in result.remarks(ui.shown_path(folder)):
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
        also = f"Kept, but not shown: records of {some_of(others)}. Name them with --models."
        console.print(also, style="dim")
    if result.left:
        ui.print_again(console, "raise limits.max_cost_usd and run" if cause == "cost" else "run")
    if cause == "interrupted" and result.left:
        return ui.INTERRUPTED
    return 1 if result.left or result.failed or result.unjudged else 0


@dataclass
class Tally:
    """The sums over a model's records; `counts` are of the headline matcher and setting."""

    task: progress.Task
    counts: Counts = field(default_factory=lambda: Counts(0, 0, 0))
    cost_usd: float = 0.0
    unpriced: int = 0
    cached: int = 0
    retries: int = 0
    failures: Counter[str] = field(default_factory=Counter)

    def add(self, sample: Summary) -> None:
        """Count one sample."""
        self.failures.update([sample.outcome] if sample.outcome != "ok" else [])
        if sample.counts is not None:
            self.counts += sample.counts
        if sample.cached is not None:
            self.cached += sample.cached
            self.unpriced += sample.paid_usd is None
            self.cost_usd += sample.paid_usd or 0.0

    @property
    def facts(self) -> str:
        """Return the text beside the bar."""
        facts = []
        if self.counts.f1 is not None:
            facts.append(f"F1 {100 * self.counts.f1:.1f} %")
        if self.cost_usd or self.unpriced:
            facts.append(f"${self.cost_usd:,.2f}" + (" + unknown" if self.unpriced else ""))
        numbers = {"cached": self.cached, "failed": self.failures.total()}
        numbers["sent again"] = self.retries
        return ", ".join([*facts, *(f"{n:,} {name}" for name, n in numbers.items() if n)])


class ProgressView(progress.Progress):
    """Shows a bar for each model in a terminal, occasional lines elsewhere; the run's watcher.

    Notices are printed as lines, and so is the first repeated call of each model.
    """

    def __init__(self, console: Console, now: Callable[[], float] = time.monotonic) -> None:
        self._tallies: dict[str, Tally] = {}
        self._started_s = self._last_line_s = now()
        self._has_asked = False
        # Rich reads the environment on every access.
        self._is_terminal = console.is_terminal
        self._shown_s = -math.inf
        super().__init__(
            progress.TextColumn("{task.description}", markup=False),
            progress.BarColumn(complete_style="cyan", finished_style="green"),
            progress.MofNCompleteColumn(),
            progress.TimeRemainingColumn(),
            progress.TextColumn("{task.fields[facts]}", style="dim", markup=False),
            console=console,
            transient=True,
            disable=not self._is_terminal,
            get_time=now,
        )

    def __call__(self, event: RunEvent) -> None:
        """Update the display for an event."""
        of_model = isinstance(event, ModelEvent) and bool(event.model)
        self._has_asked |= of_model or isinstance(event, Summary)
        if isinstance(event, RunStarted):
            for name, known in event.earlier.items():
                number = self.add_task(
                    one_line(name), total=event.expected, completed=len(known), facts=""
                )
                task = next(task for task in self.tasks if task.id == number)
                self._tallies[name] = tally = Tally(task)
                for sample in known:
                    tally.add(sample)
        elif isinstance(event, Summary):
            tally = self._tallies[event.model]
            tally.add(event)
            self.advance(tally.task.id)
        elif isinstance(event, ModelEvent) and event.kind == "retry":
            tally = self._tallies[event.model]
            tally.retries += 1
            if tally.retries == 1:
                wait = f"waiting {round(event.wait_s, 1):g} s; more are counted as sent again"
                self._print(f"{event.model}: {event.message}; {wait}")
        elif isinstance(event, ModelEvent) and event.kind == "stopped":
            task = self._tallies[event.model].task
            # Samples that will not be asked are not part of the total.
            self.update(task.id, total=task.completed)
            self._print(f"{event.model} stopped: {event.message}", style="red")
        elif isinstance(event, ModelEvent):
            self._print(f"{event.model}: {event.message}" if of_model else event.message)
        else:
            self._print(event.text)
        if not isinstance(event, Summary) or self.get_time() - self._shown_s >= _SHOWN_EVERY_S:
            self.tick()

    def tick(self, asks: bool = False) -> None:
        """Print due lines; called several times a second. `asks`: calls are in progress."""
        self._shown_s = now_s = self.get_time()
        self._has_asked |= asks
        lasted = _duration(now_s - self._started_s)
        preparing = "" if self._has_asked else f"Preparing scenes ... ({lasted})"
        for tally in self._tallies.values():
            self.update(tally.task.id, facts=preparing or tally.facts)
        if not self._is_terminal and now_s - self._last_line_s >= _LINE_EVERY_S:
            self._last_line_s = now_s
            tallies = list(self._tallies.values())
            done = sum(int(tally.task.completed) for tally in tallies)
            total = sum(int(tally.task.total or 0) for tally in tallies)
            failures = sum((tally.failures for tally in tallies), Counter[str]())
            numbers = {name.replace("_", " "): n for name, n in sorted(failures.items())}
            numbers["sent again"] = sum(tally.retries for tally in tallies)
            facts = [f"{done:,} of {counted(total, 'sample')} after {lasted}"]
            facts += [f"{n:,} {name}" for name, n in numbers.items() if n]
            self._print(preparing or ", ".join(facts))

    @property
    def cost_text(self) -> str:
        """Return the cost of the run so far, if prices are known."""
        spent = sum(tally.cost_usd for tally in self._tallies.values())
        unknown = any(tally.unpriced for tally in self._tallies.values())
        return f"${spent:,.2f}" + (" and replies whose cost is not known" if unknown else "")

    @property
    def cached(self) -> int:
        """Number of samples whose reply came from the cache."""
        return sum(tally.cached for tally in self._tallies.values())

    def _print(self, line: str, style: str = "") -> None:
        """Print a line; a closed output must not end calls that cost money."""
        with contextlib.suppress(OSError):
            self.console.print(Text(one_line(line), style=style))


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"


def print_estimate(console: Console, plan: RunPlan, rows: Sequence[Estimate]) -> None:
    """Print the calls, tokens and cost of each model, and the sums."""
    items = [counted(len(track.items), kind_of(track.name).item) for track in plan.tracks]
    facts = [f"{', '.join(items)} of {plan.dataset.name}", counted(len(plan.suite.seeds), "seed")]
    if len(plan.variants) > 1:
        facts.append(f"{len(plan.variants):,} conditions")
    facts.append(counted(len(plan.models), "model"))
    title = f"{plan.suite.name}: {', '.join(facts)}"
    if not (asked := [row for row in rows if row.model.kind == "litellm"]):
        console.print(f"{title}. No call is needed.")
        return
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
    cells = {heading: [text(row) for row in asked] for heading, text in columns.items()}
    cells = {heading: texts for heading, texts in cells.items() if set(texts) - {"0"}}
    headings = (Column("model", is_text=True), *map(Column, cells))
    lines = tuple(zip((row.model.name for row in asked), *cells.values(), strict=True))
    left = [row for row in rows if row.calls]
    note = (
        "Tokens are estimates: texts by their words, pictures by the provider's rule, replies of "
        "usual length. At most: every reply is as long as its limit allows."
    )
    ui.print_table(console, TextTable(title, headings, lines, (note,) if left else ()))
    known = [row.cost_usd for row in left if row.cost_usd is not None]
    costs = [f"about {_dollars(sum(known))}"] if known or not left else []
    if unknown := len(left) - len(known):
        costs.append(f"unknown cost of {counted(unknown, 'model')} (give a price in models.yaml)")
    console.print(f"{counted(sum(row.calls for row in left), 'call')}, {' and '.join(costs)}.")


def _dollars(cost_usd: float | None) -> str:
    if cost_usd is None:
        return "unknown"
    return f"${cost_usd:,.4f}" if 0 < cost_usd < 0.01 else f"${cost_usd:,.2f}"


@click.command(epilog=f"Bundled suites: {', '.join(plans.bundled_suites())}.")
@click.argument("suite", type=ui.NAME_OR_PATH)
@click.option(
    "--name",
    required=True,
    metavar="NAME",
    help="Your name, human:NAME in tables: letters, digits, - and _; better not a real one.",
)
@ui.sets_option
@ui.limit_option
@click.option(
    "--beside",
    type=ui.UserPath(),
    multiple=True,
    metavar="RUN",
    help="Compare with the models of this run folder at the end.",
)
@ui.run_out_option
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
    from phyblock.web.pages import files_of, report_files
    from phyblock.web.server import Server
    from phyblock.web.session import Ending, PlaySession, plan_session

    plan = plan_session(plans.read_suite(suite, sets), name, limit, is_exact=exact)
    folder = out or plan.folder_in(Path("results"))
    if held_run(folder, plan.manifest) is not None:
        OutFolder(folder).check(files_of(page=True))
    for other in beside:
        load_run(other)
    console = ui.make_console()

    def begun() -> None:
        ui.print_path(console, f"Open {server.address}")
        console.print("Ctrl-C ends the session; the same command continues it.", style="dim")
        if not no_browser:
            # A terminal browser would block until it is closed.
            Thread(target=webbrowser.open, args=(server.one_time_address,), daemon=True).start()

    session = PlaySession(plan.samples_per_model)
    with Server(session, port) as server:
        result = asyncio.run(session.run(plan, folder, begun))
        if result.left:
            console.print(f"{session.done:,} of {plan.samples_per_model:,} tasks are answered.")
            ui.print_again(console)
            return ui.INTERRUPTED
        made = show_tables(folder, page=True)
        server.files = report_files(folder)
        session.finish(Ending(folder, f"{HUMAN}{name}", beside, plan.dataset.tasks))
        ui.print_path(console, made)
        console.print("All tasks are done; the page shows the results. Ctrl-C ends.", style="dim")
        with contextlib.suppress(KeyboardInterrupt):
            server.finished.wait()
    return 0


@click.command()
@ui.run_argument
@ui.data_option
@ui.worker_options(1)
def score(
    run: Path, data: Path | None, jobs: int, ray_address: str | None, shard: tuple[int, int] | None
) -> None:
    """Parse and score the stored replies of the folder RUN again. Calls no model.

    The new records replace those of RUN in one step.
    """
    from phyblock.run.rescore import rescore

    work = f"score {read_manifest(run).identity}: {code_versions()}\n"
    shards = ui.open_shards(shard, run, work)
    with open_workers(jobs, ray_address, shards, size=64) as workers:
        watch = partial(ui.tracked, total=None, doing="Scoring")
        rescore(run, data, ui.make_console(stderr=True).print, watch, workers)
    if ui.left_to_first(shards, run):
        return
    ui.print_path(ui.make_console(), show_tables(run, data=data))
