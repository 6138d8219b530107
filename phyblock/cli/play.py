"""`phyblock play`: a person answers a suite, as models do."""

from __future__ import annotations

import asyncio
import contextlib
import shlex
import sys
import webbrowser
from pathlib import Path
from threading import Thread

import click
from rich.console import Console
from rich.progress import Progress

from phyblock.cli.console import make_console, print_path, shown_path
from phyblock.cli.options import NAME_OR_PATH, UserPath, limit_option, sets_option
from phyblock.cli.results import show_tables
from phyblock.config.suite import load_suite
from phyblock.errors import Problem, SpecError, reason_of
from phyblock.files import read_text
from phyblock.resources import bundled
from phyblock.run.plan import RunPlan
from phyblock.run.preflight import bundled_suites, find_suite, prompt_dirs
from phyblock.run.runner import RunResult, Session
from phyblock.run.store import held_run, run_folder
from phyblock.text import counted
from phyblock.web.answers import (
    FileAnswers,
    check_folder,
    check_offline,
    export_session,
    read_answers,
)
from phyblock.web.report import files_of, report_files
from phyblock.web.server import Server, default_consent
from phyblock.web.session import Person, PersonModel, PlaySession, outcomes, plan_session

_INTERRUPTED = 130
_RUNS = Path("results")
_LARGEST_CONSENT_BYTES = 64 * 1024


@click.command(epilog=f"Bundled suites: {', '.join(bundled_suites())}.")
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
@sets_option
@limit_option
@click.option("--consent", type=UserPath(), metavar="FILE", help="Text that is agreed to first.")
@click.option(
    "--beside",
    type=UserPath(),
    multiple=True,
    metavar="RUN",
    help="Show what the models of this run folder did, after the end.",
)
@click.option(
    "--out", type=UserPath(), metavar="DIR", help="Folder. [default: results/SUITE-DIGEST]"
)
@click.option("--port", type=click.IntRange(0, 65535), default=0, help="[default: any free one]")
@click.option("--no-report", is_flag=True, help="With --import: tables alone, no page.")
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@click.option("--export", type=UserPath(), metavar="DIR", help="Write a page without a server.")
@click.option(
    "--import", "answers", type=UserPath(), metavar="FILE", help="Take answers of such a page."
)
def play(
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
    if consent is not None:
        text = _consent(consent)
    else:
        text = default_consent(offline=export is not None or answers is not None)
    person = Person(name, number, text)
    path = find_suite(suite)
    data, prompts = bundled("benchmarks", "data"), prompt_dirs(path)
    loaded = load_suite(path, sets, data_dir=data, prompt_dirs=prompts)
    plan = plan_session(loaded, person, limit)
    console = make_console()
    if export is not None or answers is not None:
        check_offline(plan)
    if export is not None:
        check_folder(export, _RUNS)
        return _export(console, plan, person, export)
    folder = out or plan.folder_in(_RUNS)
    if held_run(folder, plan.manifest) is not None:
        run_folder(folder).check(files_of(page=True))
    if answers is not None:
        return _import(console, plan, person, folder, answers, page=not no_report)
    return _serve(console, plan, person, folder, beside, port, opens=not no_browser)


def _consent(path: Path) -> str:
    try:
        text = read_text(path, _LARGEST_CONSENT_BYTES).strip()
    except OSError as error:
        message = f"cannot be read: {reason_of(error)}"
        raise SpecError(Problem(str(path), message, "--consent")) from error
    except ValueError as error:
        raise SpecError(Problem(str(path), str(error), "--consent")) from error
    if not text:
        raise SpecError(Problem(str(path), "is empty", "--consent"))
    return text


def _export(console: Console, plan: RunPlan, person: Person, folder: Path) -> int:
    try:
        with Progress(console=console, transient=True, disable=not console.is_terminal) as progress:
            drawing = progress.add_task("Drawing tasks", total=plan.samples_per_model)

            def done(number: int) -> None:
                progress.update(drawing, completed=number)

            page = asyncio.run(export_session(plan, person, folder, done))
    finally:
        plan.close()
    tasks = counted(plan.samples_per_model, "task")
    console.print(f"{tasks} for {person.name}; its answers come into a run with:")
    words, again = iter(sys.argv[1:]), ["phyblock"]
    for word in words:
        if word == "--export":
            next(words)
        elif not word.startswith("--export="):
            again.append(word)
    print_path(console, f"  {shlex.join([*again, '--import', 'FILE'])}")
    print_path(console, page)
    return 0


def _import(
    console: Console, plan: RunPlan, person: Person, folder: Path, file: Path, *, page: bool
) -> int:
    given = read_answers(file, plan, person)
    answers = FileAnswers(given, plan, person.model)
    present = {person.model: PersonModel(person.model, plan.suite, answers.ask)}

    async def run() -> RunResult:
        session = Session(plan, folder, lambda _: None, use_cache=False, present=present)
        async with session as opened:
            return await opened.run()

    result = asyncio.run(run())
    made = show_tables(folder, plan.suite.tables, page=page)
    if known := len(given) - answers.taken:
        text = f"{known:,} of {counted(len(given), 'answer')} of {shown_path(file)} were there"
        console.print(f"{text} already: those in the run stay.")
    console.print(f"{result.settled:,} of {counted(result.samples, 'answer')} are there.")
    print_path(console, made)
    return 1 if result.left else 0


def _serve(
    console: Console,
    plan: RunPlan,
    person: Person,
    folder: Path,
    beside: tuple[Path, ...],
    port: int,
    *,
    opens: bool,
) -> int:
    from phyblock.results.load import load_run

    for other in beside:
        load_run(other, texts=False)

    def begun() -> None:
        print_path(console, f"Open {server.address}")
        console.print("Ctrl-C ends the session; the same command goes on.", style="dim")
        if opens:
            # A browser for terminals would not come back before it is closed.
            Thread(target=webbrowser.open, args=(server.one_time_address,), daemon=True).start()

    session = PlaySession(plan.samples_per_model)
    with Server(session, port) as server:
        result = asyncio.run(session.run(plan, person, folder, begun))
        if result.left:
            console.print(f"{result.settled:,} of {result.samples:,} tasks are answered.")
            console.print("To go on, give the same command again:")
            print_path(console, f"  {shlex.join(['phyblock', *sys.argv[1:]])}")
            return _INTERRUPTED
        made = show_tables(folder, plan.suite.tables, page=True)
        server.show_files(report_files(folder))
        session.finish(outcomes(folder, person.model, beside))
        print_path(console, made)
        console.print("All is answered; the page shows how it went. Ctrl-C ends.", style="dim")
        with contextlib.suppress(KeyboardInterrupt):
            server.finished.wait()
    return 0
