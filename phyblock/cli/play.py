"""`phyblock play`: a person answers a suite, as models do."""

from __future__ import annotations

import asyncio
import contextlib
import shlex
import sys
import webbrowser
from collections.abc import Sequence
from pathlib import Path
from threading import Thread

import click
from rich.console import Console
from rich.progress import Progress

from phyblock.cli.console import make_console, shown_path
from phyblock.cli.paths import NAME_OR_PATH, UserPath
from phyblock.cli.report import show_made
from phyblock.config.suite import load_suite
from phyblock.errors import Problem, SpecError, reason_of
from phyblock.files import read_text
from phyblock.play.answers import FileAnswers, default_text, read_answers
from phyblock.play.export import check_folder, check_offline, export_sitting
from phyblock.play.page import default_consent
from phyblock.play.person import Person, PersonModel, plan_sitting
from phyblock.play.server import Server
from phyblock.play.sitting import Sitting, report_files
from phyblock.report.made import names_to_write
from phyblock.resources import bundled
from phyblock.run.execute import RunResult
from phyblock.run.plan import RunPlan
from phyblock.run.preflight import bundled_suites, find_suite, prompt_dirs
from phyblock.run.session import Session
from phyblock.run.store import held_run, run_folder
from phyblock.text import counted

__all__ = ["command"]

_INTERRUPTED = 130
_RUNS = Path("results")
_LARGEST_CONSENT_BYTES = 64 * 1024


@click.command("play", epilog=f"Bundled suites: {', '.join(bundled_suites())}.")
@click.argument("suite", type=NAME_OR_PATH)
@click.option(
    "--name",
    required=True,
    metavar="NAME",
    help="Who answers, as human:NAME in all tables: letters, digits, - and _; better no real name.",
)
@click.option(
    "--number",
    type=click.IntRange(min=1),
    metavar="N",
    help="Number of the person in a study, from 1: balances the order of scenes over people. "
    "[default: an order by the name]",
)
@click.option(
    "--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a value of the suite."
)
@click.option(
    "--limit", type=click.IntRange(min=1), metavar="N", help="N scenes, spread over levels."
)
@click.option("--consent", type=UserPath(), metavar="FILE", help="Text that is agreed to first.")
@click.option(
    "--beside",
    type=UserPath(),
    multiple=True,
    metavar="RUN",
    help="Show what the models of this run folder did, after the end.",
)
@click.option("--out", type=UserPath(), help="Folder of the run. [default: results/SUITE-DIGEST]")
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="[default: any free one]")
@click.option("--no-report", is_flag=True, help="With --import: tables alone, no page.")
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@click.option("--export", type=UserPath(), metavar="DIR", help="Write a page without a server.")
@click.option(
    "--import", "answers", type=UserPath(), metavar="FILE", help="Take answers of such a page."
)
def command(
    suite: str,
    name: str,
    number: int | None,
    sets: tuple[str, ...],
    limit: int | None,
    consent: Path | None,
    beside: tuple[Path, ...],
    out: Path | None,
    port: int,
    no_report: bool,
    no_browser: bool,
    export: Path | None,
    answers: Path | None,
) -> int:
    """Answer SUITE yourself, in a browser: what a model is sent, with a click for a word.

    Answers are records of the model human:NAME in a run folder. The same command again goes on
    where it stopped.
    """
    if export is not None and answers is not None:
        raise SpecError(Problem("--export", "cannot be given with --import"))
    person = Person(name, number, _consent(consent, answers, offline=export is not None))
    path = find_suite(suite)
    data, prompts = bundled("benchmarks", "data"), prompt_dirs(path)
    loaded = load_suite(path, sets, data_dir=data, prompt_dirs=prompts)
    plan = plan_sitting(loaded, person, limit)
    console = make_console()
    if export is not None or answers is not None:
        check_offline(plan)
    if export is not None:
        check_folder(export, _RUNS)
        return _export(console, plan, person, export)
    folder = out or plan.folder_in(_RUNS)
    if held_run(folder, plan.manifest) is not None:
        run_folder(folder).check(names_to_write(folder, page=True))
    if answers is not None:
        return _import(console, plan, person, folder, answers, page=not no_report)
    return _sit(console, plan, person, folder, beside, port, opens=not no_browser)


def _consent(own: Path | None, answers: Path | None, *, offline: bool) -> str:
    """The text that is agreed to, or was where there is a file of answers."""
    if own is not None:
        return _text(own)
    return default_consent(offline=offline) if answers is None else default_text(answers)


def _text(path: Path) -> str:
    try:
        text = read_text(path, _LARGEST_CONSENT_BYTES).strip()
    except OSError as error:
        raise SpecError(
            Problem(str(path), f"cannot be read: {reason_of(error)}", "--consent")
        ) from error
    except ValueError as error:
        raise SpecError(Problem(str(path), str(error), "--consent")) from error
    if not text:
        raise SpecError(Problem(str(path), "says nothing", "--consent"))
    return text


def _export(console: Console, plan: RunPlan, person: Person, folder: Path) -> int:
    try:
        with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
            drawing = progress.add_task("Drawing tasks", total=plan.samples_per_model)

            def done(number: int) -> None:
                progress.update(drawing, completed=number)

            page = asyncio.run(export_sitting(plan, person, folder, done))
    finally:
        plan.close()
    tasks = counted(plan.samples_per_model, "task")
    console.print(f"{tasks} for {person.name}: open {shown_path(page)}", soft_wrap=True)
    again = shlex.join(["phyblock", *_without(sys.argv[1:], "--export"), "--import", "FILE"])
    console.print(f"Its answers come into a run with: {again}", soft_wrap=True, markup=False)
    return 0


def _without(words: Sequence[str], option: str) -> list[str]:
    """The words of a command without an option and its value."""
    kept: list[str] = []
    skips = False
    for word in words:
        if not skips and not word.startswith(f"{option}="):
            skips = word == option
            kept += [] if skips else [word]
        else:
            skips = False
    return kept


def _import(
    console: Console, plan: RunPlan, person: Person, folder: Path, file: Path, *, page: bool
) -> int:
    given = read_answers(file, plan, person)
    answers = FileAnswers(given, plan, person.model)
    model = PersonModel(person.model, plan.suite, answers.ask)

    async def run() -> RunResult:
        present = {model.name: model}
        async with Session(
            plan, folder, lambda _: None, use_cache=False, present=present
        ) as session:
            return await session.run()

    result = asyncio.run(run())
    show_made(folder, plan.suite.tables, page=page)
    if known := len(given) - answers.taken:
        text = f"{known:,} of {counted(len(given), 'answer')} of {shown_path(file)} were there"
        console.print(f"{text} already: those in the run stay.", soft_wrap=True)
    done = f"{result.settled:,} of {counted(result.samples, 'answer')} are there"
    console.print(f"{done}. The run is in {shown_path(folder)}", soft_wrap=True)
    return 1 if result.left else 0


def _sit(
    console: Console,
    plan: RunPlan,
    person: Person,
    folder: Path,
    beside: Sequence[Path],
    port: int,
    *,
    opens: bool,
) -> int:
    # Tables are made of pandas, which a sitting does without until its end.
    from phyblock.play.outcomes import outcomes
    from phyblock.tables.load import load_run

    for other in beside:
        load_run(other, texts=False)

    def begun() -> None:
        console.print(f"Open {server.address}", soft_wrap=True, markup=False, highlight=False)
        console.print("Ctrl-C ends the sitting; the same command goes on.", style="dim")
        if opens:
            # A browser for terminals would not come back before it is closed.
            Thread(target=webbrowser.open, args=(server.one_time_address,), daemon=True).start()

    sitting = Sitting(plan, person, folder, begun)
    with Server(sitting.desk, port) as server:
        result = asyncio.run(sitting.run())
        if result.left:
            where = shown_path(folder)
            done = f"{result.settled:,} of {result.samples:,} tasks are answered"
            console.print(f"{done}. The run is in {where}", soft_wrap=True)
            again = shlex.join(["phyblock", *sys.argv[1:]])
            console.print(f"To go on, give the same command again: {again}", soft_wrap=True)
            return _INTERRUPTED
        show_made(folder, plan.suite.tables, page=True)
        server.show_files(report_files(folder))
        sitting.desk.finish(outcomes(folder, person.model, beside))
        console.print("All is answered; the page shows how it went. Ctrl-C ends.", style="dim")
        with contextlib.suppress(KeyboardInterrupt):
            server.finished.wait()
    return 0
