"""`phyblock play`: a person answers a suite, as models do."""

from __future__ import annotations

import asyncio
import contextlib
import webbrowser
from pathlib import Path
from threading import Thread

import click

from phyblock.cli.console import make_console, print_again, print_path
from phyblock.cli.options import (
    INTERRUPTED,
    NAME_OR_PATH,
    UserPath,
    limit_option,
    run_out_option,
    sets_option,
)
from phyblock.cli.results import show_tables
from phyblock.files import OutFolder
from phyblock.run.plan import bundled_suites, read_suite
from phyblock.run.store import held_run
from phyblock.web.ending import Ending
from phyblock.web.report import files_of, report_files
from phyblock.web.server import Server
from phyblock.web.session import Person, PlaySession, plan_session


@click.command(epilog=f"Bundled suites: {', '.join(bundled_suites())}.")
@click.argument("suite", type=NAME_OR_PATH)
@click.option(
    "--name",
    required=True,
    metavar="NAME",
    help="Who answers, as human:NAME in all tables: letters, digits, - and _; better no real name.",
)
@sets_option
@limit_option
@click.option(
    "--beside",
    type=UserPath(),
    multiple=True,
    metavar="RUN",
    help="Show after the end how the models of this run folder did.",
)
@run_out_option
@click.option("--port", type=click.IntRange(0, 65535), default=0, show_default="any free one")
@click.option("--exact", is_flag=True, help="Show the models' prompt unfolded, as for a study.")
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
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

    Answers are records of the model human:NAME in a run folder. Give the same command again to
    continue where it stopped.
    """
    from phyblock.results.load import load_run

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
            # A browser for terminals would not come back before it is closed.
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
        console.print("All is answered; the page shows how it went. Ctrl-C ends.", style="dim")
        with contextlib.suppress(KeyboardInterrupt):
            server.finished.wait()
    return 0
