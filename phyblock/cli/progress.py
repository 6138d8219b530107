"""Showing a run while it goes on: a live panel in a terminal, plain lines elsewhere."""

from __future__ import annotations

import contextlib
import math
import time
from collections import Counter
from collections.abc import Callable

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.padding import Padding
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from phyblock.cli.remarks import Remarks
from phyblock.cli.tally import Tally, failure_text
from phyblock.run.events import (
    ModelNotice,
    ModelStopped,
    RunEvent,
    RunNotice,
    RunStarted,
    SampleDone,
    Stopping,
    Summary,
)
from phyblock.text import counted, one_line

__all__ = ["ProgressView"]

_LINE_EVERY_S = 10.0
_REMARKS = 6


class ProgressView:
    """Watches a run; use as a context manager and pass it as the run's watcher."""

    def __init__(
        self, console: Console, title: str, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._now = now
        self._console = console
        self._title = one_line(title)
        self._tallies: dict[str, Tally] = {}
        self._started = now()
        self._last_line = self._started
        self._status = ""
        self._remarked = Remarks(_LINE_EVERY_S)
        self._live = (
            Live(console=console, refresh_per_second=4, get_renderable=self._panel, transient=True)
            if console.is_terminal
            else None
        )

    def __enter__(self) -> ProgressView:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._live is not None:
            self._live.stop()
        for line in self._remarked.due(math.inf):
            self._say(line)

    def __call__(self, event: RunEvent) -> None:
        """Take note of an event."""
        if isinstance(event, SampleDone):
            self._tallies[event.record.model].add(Summary.of(event.record), fresh=True)
            self._plain_line()
        elif isinstance(event, RunStarted):
            self._tallies = {name: Tally(n) for name, n in event.expected.items()}
            for name, samples in event.earlier.items():
                for sample in samples:
                    self._tallies[name].add(sample, fresh=False)
        elif isinstance(event, ModelNotice):
            self._take_note(event)
        elif isinstance(event, RunNotice):
            self._say(event.text)
            self._plain_line()
        elif isinstance(event, ModelStopped):
            tally = self._tallies[event.model]
            tally.is_stopped, tally.notice = True, f"stopped: {event.reason}"
            self._say(f"{one_line(event.model)} stopped: {event.reason}", style="red")
        elif isinstance(event, Stopping):
            self._status = event.text
            if self._live is None:
                self._say(self._status)

    def _take_note(self, event: ModelNotice) -> None:
        tally = self._tallies[event.model]
        tally.retries += event.kind == "retry"
        tally.notice = event.text
        # Where it ends for a model, another event says so.
        if self._live is None and event.kind != "unavailable":
            for line in self._remarked.add(event, self._now()):
                self._say(line)
            self._plain_line()

    def _say(self, line: str, style: str = "") -> None:
        """Print a line; one that nobody can read any more must not end calls that cost money."""
        with contextlib.suppress(OSError):
            self._console.print(Text(line, style=style), soft_wrap=True)

    @property
    def cost_text(self) -> str:
        """What the whole run cost so far, as far as prices are known."""
        spent = sum(tally.cost_usd for tally in self._tallies.values())
        unknown = any(tally.unpriced for tally in self._tallies.values())
        return f"${spent:,.2f}" + (" and replies whose cost is not known" if unknown else "")

    @property
    def cached_text(self) -> str:
        """How many samples were answered from the reply cache; "" where none was."""
        cached = {name: tally.cached for name, tally in self._tallies.items() if tally.cached}
        if not cached:
            return ""
        names = ", ".join(map(one_line, cached))
        answers = counted(sum(cached.values()), "sample")
        return f"Nobody was asked about {answers} of {names}: the replies were in the cache"

    def _plain_line(self) -> None:
        now = self._now()
        if self._live is None and now - self._last_line >= _LINE_EVERY_S:
            self._last_line = now
            for line in self._remarked.due(now):
                self._say(line)
            self._say(f"{self._summary()}{self._failures()}")

    def _failures(self) -> str:
        """Failures of all models, and calls that were sent again, for a line of the log."""
        counts: Counter[str] = Counter()
        for tally in self._tallies.values():
            counts.update(tally.failures)
        failed = f" · {failure_text(counts)}" if counts else ""
        retries = sum(tally.retries for tally in self._tallies.values())
        return f"{failed} · {retries:,} sent again" if retries else failed

    def _summary(self) -> str:
        done = sum(tally.done for tally in self._tallies.values())
        total = sum(tally.total for tally in self._tallies.values())
        fresh = sum(tally.fresh for tally in self._tallies.values())
        elapsed_s = self._now() - self._started
        text = f"{done:,} of {counted(total, 'sample')}"
        if fresh and elapsed_s > 0:
            text += f" · {fresh / elapsed_s:.1f} a second"
            # The slowest model decides; of one that has answered nothing no time is known.
            left_s = [tally.left_s(elapsed_s) for tally in self._tallies.values()]
            known_s = [seconds for seconds in left_s if seconds is not None]
            if done < total and len(known_s) == len(left_s):
                text += f" · {_duration(max(known_s))} left"
        return text

    def _panel(self) -> RenderableType:
        done = sum(tally.done for tally in self._tallies.values())
        total = sum(tally.total for tally in self._tallies.values()) or 1
        parts: list[RenderableType] = [
            # The bar alone would not end its line, and what follows would be cut off.
            Padding(ProgressBar(total=total, completed=done, width=None), 0),
            Text(self._summary()),
        ]
        # Above the table: a screen that is too low for all models shows it all the same.
        if self._status:
            parts.append(Text(self._status, style="yellow"))
        parts += [self._table(), *self._remarks()]
        return Panel(
            Group(*parts),
            title=Text(self._title),
            title_align="left",
            border_style="dim",
            # The terminal writes ^C behind the last column and would wrap a full line.
            width=self._console.width - 3,
        )

    def _remarks(self) -> list[Text]:
        """A cut line for each model that has something to say: failures, the last notice."""
        lines = []
        for name, tally in self._tallies.items():
            remarks = [tally.failure_text] if tally.failures else []
            remarks += [tally.notice] if tally.notice and tally.done < tally.expected else []
            if remarks:
                text = one_line(f"{name}: {'; '.join(remarks)}")
                lines.append(Text(text, style="yellow", no_wrap=True, overflow="ellipsis"))
        return lines[:_REMARKS]

    def _table(self) -> Table:
        table = Table(box=None, pad_edge=False, header_style="dim", padding=(0, 2, 0, 0))
        table.add_column("model", no_wrap=True, min_width=max(map(len, self._tallies), default=0))
        for name in ("done", "F1 %", "tokens", "cost", "cached", "retries"):
            table.add_column(name, justify="right", no_wrap=True)
        for name, tally in self._tallies.items():
            table.add_row(
                one_line(name),
                f"{tally.done:,}/{tally.expected:,}",
                tally.f1_text,
                f"{tally.tokens:,}",
                tally.cost_text,
                f"{tally.cached:,}",
                f"{tally.retries:,}",
            )
        return table


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
