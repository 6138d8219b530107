"""Progress of a run: a bar for each model in a terminal, occasional lines elsewhere."""

from __future__ import annotations

import contextlib
import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    Task,
    TextColumn,
    TimeRemainingColumn,
)
from rich.text import Text

from phyblock.models.model import ModelEvent
from phyblock.run.runner import RunEvent, RunStarted, SampleDone
from phyblock.run.store import Summary
from phyblock.scoring.plan import Counts
from phyblock.text import counted, one_line

_LINE_EVERY_S = 10.0
"""Interval of progress lines where no bar is shown [s]."""
_SHOWN_EVERY_S = 0.1
"""Minimum time between two updates of the display [s]."""


@dataclass
class Tally:
    """The sums over a model's records; `counts` are of the headline matcher and setting."""

    task: Task
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


class ProgressView:
    """Shows the progress of a run; use it as a context manager and as the run's watcher.

    Notices are printed as lines, and so is the first repeated call of each model.
    """

    def __init__(self, console: Console, now: Callable[[], float] = time.monotonic) -> None:
        self._now = now
        self._console = console
        self._tallies: dict[str, Tally] = {}
        self._started_s = self._last_line_s = now()
        self._has_asked = False
        # Rich reads the environment on every access.
        self._is_terminal = console.is_terminal
        self._shown_s = -math.inf
        self._progress = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(complete_style="cyan", finished_style="green"),
            MofNCompleteColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[facts]}", style="dim", markup=False),
            console=console,
            transient=True,
            disable=not self._is_terminal,
            get_time=now,
        )

    def __enter__(self) -> ProgressView:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def __call__(self, event: RunEvent) -> None:
        """Update the display for an event."""
        if isinstance(event, RunStarted):
            for name, known in event.earlier.items():
                number = self._progress.add_task(
                    one_line(name), total=event.expected, completed=len(known), facts=""
                )
                task = next(task for task in self._progress.tasks if task.id == number)
                self._tallies[name] = tally = Tally(task)
                for sample in known:
                    tally.add(sample)
        elif isinstance(event, SampleDone):
            self._has_asked = True
            tally = self._tallies[event.sample.model]
            tally.add(event.sample)
            self._progress.advance(tally.task.id)
        elif isinstance(event, ModelEvent) and event.kind == "retry":
            self._has_asked = True
            tally = self._tallies[event.model]
            tally.retries += 1
            if tally.retries == 1:
                wait = f"waiting {round(event.wait_s, 1):g} s; more are counted as sent again"
                self._print(f"{event.model}: {event.message}; {wait}")
        elif isinstance(event, ModelEvent) and event.kind == "stopped":
            task = self._tallies[event.model].task
            # Samples that will not be asked are not part of the total.
            self._progress.update(task.id, total=task.completed)
            self._print(f"{event.model} stopped: {event.message}", style="red")
        elif isinstance(event, ModelEvent):
            self._has_asked |= bool(event.model)
            self._print(f"{event.model}: {event.message}" if event.model else event.message)
        else:
            self._print(event.text)
        if not isinstance(event, SampleDone) or self._now() - self._shown_s >= _SHOWN_EVERY_S:
            self.tick()

    def tick(self, asks: bool = False) -> None:
        """Print due lines; called several times a second. `asks`: calls are in progress."""
        self._shown_s = now_s = self._now()
        self._has_asked |= asks
        lasted = _duration(now_s - self._started_s)
        preparing = "" if self._has_asked else f"Preparing scenes ... ({lasted})"
        for tally in self._tallies.values():
            self._progress.update(tally.task.id, facts=preparing or tally.facts)
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
            self._console.print(Text(one_line(line), style=style))


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
