"""A sitting at the page: the run asks, the desk waits for the person, the run writes."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from phyblock.play.desk import Desk
from phyblock.play.person import Person, PersonModel
from phyblock.play.shown import Place
from phyblock.report.html.write import REPORT_FILE as PAGE
from phyblock.report.html.write import page_files
from phyblock.run.events import RunEvent, RunStarted, SampleDone
from phyblock.run.execute import RunResult
from phyblock.run.plan import RunPlan
from phyblock.run.session import Session

__all__ = ["Sitting", "report_files"]

_FIGURES = "figures"


class Sitting:
    """One person's run, asked at a desk."""

    def __init__(
        self, plan: RunPlan, person: Person, folder: Path, begun: Callable[[], None]
    ) -> None:
        """`begun` is called when the run is open and the page can be shown."""
        self._plan = plan
        self._person = person
        self._folder = folder
        self._begun = begun
        self._done = 0
        self._turns = 0
        self.desk = Desk(self._place)

    async def run(self) -> RunResult:
        """Ask what is left; a signal closes the sitting, and what was answered is written.

        Raises what the run meets.
        """
        model = PersonModel(self._person.model, self._plan.suite, self.desk.ask)
        session = Session(
            self._plan, self._folder, self._watch, use_cache=False, present={model.name: model}
        )
        async with session as opened:

            def interrupted() -> None:
                opened.executor.interrupt()
                self.desk.close()

            with _on_signals(interrupted):
                try:
                    return await opened.run()
                except BaseException:
                    self.desk.close()
                    raise

    def _watch(self, event: RunEvent) -> None:
        if isinstance(event, RunStarted):
            self._done = len(event.earlier[self._person.model])
            of = self._plan.samples_per_model
            if self._done < of:
                person = {"name": self._person.name, "consent": self._person.consent}
                self.desk.welcome({**person, "done": self._done, "of": of})
            self._begun()
        elif isinstance(event, SampleDone):
            self._done += event.record.is_final
            self._turns = 0

    def _place(self) -> Place:
        self._turns += 1
        return Place(self._done + 1, self._plan.samples_per_model, self._turns)


def report_files(folder: Path) -> Mapping[str, Path]:
    """The report's page and what it loads, by their names below the run folder."""
    below = (name.rstrip("/") for name in page_files() if name.endswith("/"))
    found = {PAGE: folder / PAGE}
    for place in (*below, _FIGURES):
        for path in sorted((folder / place).rglob("*")):
            if path.is_file() and not path.is_symlink():
                found[path.relative_to(folder).as_posix()] = path
    return found


@contextmanager
def _on_signals(act: Callable[[], None]) -> Iterator[None]:
    loop = asyncio.get_running_loop()
    for name in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(name, act)
    try:
        yield
    finally:
        for name in (signal.SIGINT, signal.SIGTERM):
            loop.remove_signal_handler(name)
