"""A run while it goes on: a live panel in a terminal, a line now and then elsewhere."""

from __future__ import annotations

import contextlib
import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

from rich.console import Console, Group, RenderableType
from rich.live import Live
from rich.padding import Padding
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from phyblock.models import ModelEvent
from phyblock.run.events import (
    ModelStopped,
    RunEvent,
    RunNotice,
    RunStarted,
    SampleDone,
    Stopping,
    Summary,
)
from phyblock.scoring.counts import Counts
from phyblock.text import counted, one_line
from phyblock.types import FAILURES

_LINE_EVERY_S = 10.0
_NOTICES = 6
"""Models whose last notice the panel shows."""
_ENOUGH = 20
"""Answers of a model, or all of fewer, from which the time that is left is told."""
_STATUS = {
    429: "HTTP 429 (too many requests)",
    200: "unreadable replies",
    None: "no answer",
}


@dataclass
class Tally:
    """The sums of a model's records; `counts` are of the headline matcher and setting.

    `answered` samples were answered in this command, from `since_s` on.
    """

    expected: int
    done: int = 0
    fresh: int = 0
    answered: int = 0
    since_s: float = math.inf
    is_stopped: bool = False
    counts: Counts | None = None
    tokens: int = 0
    cost_usd: float = 0.0
    unpriced: int = 0
    cached: int = 0
    retries: int = 0
    failures: Counter[str] = field(default_factory=Counter)
    notice: str = ""

    def add(self, sample: Summary) -> None:
        """Count one sample."""
        self.done += 1
        self.failures.update([sample.outcome] if sample.outcome in FAILURES else [])
        if sample.counts is not None:
            self.counts = sample.counts if self.counts is None else self.counts + sample.counts
        if sample.cached is not None:
            self.cached += sample.cached
            self.tokens += sample.tokens
            self.unpriced += sample.paid_usd is None
            self.cost_usd += sample.paid_usd or 0.0

    def add_fresh(self, sample: Summary, began_s: float) -> None:
        """Count one that was asked about in this command, at `began_s`."""
        self.add(sample)
        self.fresh += 1
        self.answered += sample.is_answered
        self.since_s = min(self.since_s, began_s)

    @property
    def total(self) -> int:
        """Samples that this run can still come to."""
        return self.done if self.is_stopped else self.expected

    def left_s(self, now_s: float) -> float | None:
        """Seconds that what is left takes at the rate of answers so far; None while unknown."""
        left = self.total - self.done
        if left and self.answered < _ENOUGH:
            return None
        return left * (now_s - self.since_s) / self.answered if left else 0.0

    @property
    def cost_text(self) -> str:
        """Dollars spent on this model, or that the price is not known."""
        if self.unpriced and self.unpriced == self.done:
            return "unknown"
        return f"${self.cost_usd:,.2f}" + (" + unknown" if self.unpriced else "")


@dataclass
class _Trouble:
    """Repeated calls of one model since the log last told of them."""

    retries: Counter[int | None] = field(default_factory=Counter)
    longest_wait_s: float = 0.0
    last: str = ""
    told_s: float = -math.inf

    def line(self, model: str) -> str:
        total = sum(self.retries.values())
        kinds = ", ".join(
            f"{number} for {_STATUS.get(status, f'HTTP {status}')}"
            for status, number in self.retries.most_common()
        )
        times = "once" if total == 1 else f"{total} times"
        wait = f"waiting up to {self.longest_wait_s:.0f} s"
        return f"{model}: asking again {times} ({kinds}), {wait}; last: {self.last}"


class ProgressView:
    """Watches a run; use as a context manager and pass it as the run's watcher."""

    def __init__(
        self, console: Console, title: str, now: Callable[[], float] = time.monotonic
    ) -> None:
        self._now = now
        self._console = console
        self._title = one_line(title)
        self._tallies: dict[str, Tally] = {}
        self._troubles: dict[str, _Trouble] = {}
        self._started_s = self._last_line_s = now()
        self._status = ""
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
        self._log_troubles(math.inf)

    def __call__(self, event: RunEvent) -> None:
        """Take note of an event."""
        if isinstance(event, SampleDone):
            reply = event.record.reply
            began_s = self._now() - (reply.latency_s if reply and not reply.cached else 0.0)
            self._tallies[event.record.model].add_fresh(Summary.of(event.record), began_s)
        elif isinstance(event, RunStarted):
            self._tallies = {name: Tally(n) for name, n in event.expected.items()}
            for name, samples in event.earlier.items():
                for sample in samples:
                    self._tallies[name].add(sample)
        elif isinstance(event, ModelEvent):
            tally = self._tallies[event.model]
            tally.retries += event.kind == "retry"
            tally.notice = event.message
            if event.kind == "retry":
                trouble = self._troubles.setdefault(event.model, _Trouble())
                trouble.retries[event.status] += 1
                trouble.longest_wait_s = max(trouble.longest_wait_s, event.wait_s)
                trouble.last = event.message
            # Where it ends for a model, another event says so.
            elif self._live is None and event.kind != "unavailable":
                self._print(f"{event.model}: {event.message}")
        elif isinstance(event, RunNotice):
            self._print(event.text)
        elif isinstance(event, ModelStopped):
            tally = self._tallies[event.model]
            tally.is_stopped, tally.notice = True, f"stopped: {event.reason}"
            self._print(f"{one_line(event.model)} stopped: {event.reason}", style="red")
        elif isinstance(event, Stopping):
            self._status = event.text
            if self._live is None:
                self._print(self._status)
        self.tick()

    def tick(self) -> None:
        """Print what is due where there is no panel; called every second."""
        if self._live is None:
            now_s = self._now()
            self._log_troubles(now_s)
            if now_s - self._last_line_s >= _LINE_EVERY_S:
                self._last_line_s = now_s
                self._print(self._progress())

    def hear(self) -> None:
        """Answer Ctrl-C in the panel at once, before what is computed now has ended."""
        again = "Stopping ... (Ctrl-C again gives up calls under way)"
        self._status = "Giving up calls under way ..." if self._status else again

    @property
    def cost_text(self) -> str:
        """Return the cost of the run so far, as far as prices are known."""
        spent = sum(tally.cost_usd for tally in self._tallies.values())
        unknown = any(tally.unpriced for tally in self._tallies.values())
        return f"${spent:,.2f}" + (" and replies whose cost is not known" if unknown else "")

    @property
    def cached(self) -> int:
        """Samples whose reply came from the cache."""
        return sum(tally.cached for tally in self._tallies.values())

    def _print(self, line: str, style: str = "") -> None:
        """Print a line; one that nobody can read any more must not end calls that cost money."""
        with contextlib.suppress(OSError):
            self._console.print(Text(line, style=style))

    def _log_troubles(self, now_s: float) -> None:
        """Log repeated calls: the first at once, then at most a line a model every ten seconds."""
        for model, trouble in self._troubles.items() if self._live is None else ():
            if trouble.retries and now_s - trouble.told_s >= _LINE_EVERY_S:
                self._print(trouble.line(model))
                self._troubles[model] = _Trouble(told_s=now_s)

    def _progress(self) -> str:
        """Return the progress of the run in a line."""
        tallies, now_s = self._tallies.values(), self._now()
        done, total = sum(t.done for t in tallies), sum(t.total for t in tallies)
        fresh = sum(t.fresh for t in tallies)
        if not fresh and done < max(total, 1):
            doing = "Waiting for the first answer" if tallies else "Preparing scenes"
            text = f"{doing} ... ({_duration(now_s - self._started_s)})"
        else:
            text = f"{done:,} of {counted(total, 'sample')}"
        # The slowest model decides.
        left_s = [t.left_s(now_s) for t in tallies]
        known_s = [seconds for seconds in left_s if seconds is not None]
        if done < total and len(known_s) == len(left_s):
            text += f" · {_duration(max(known_s))} left"
        failures = sum((t.failures for t in tallies), Counter[str]())
        text += f" · {_failure_text(failures)}" if failures else ""
        retries = sum(t.retries for t in tallies)
        return f"{text} · {retries:,} sent again" if retries else text

    def _panel(self) -> RenderableType:
        done = sum(tally.done for tally in self._tallies.values())
        total = sum(tally.total for tally in self._tallies.values()) or 1
        bar = ProgressBar(
            total=total, completed=done, width=None, complete_style="cyan", finished_style="green"
        )
        # The bar alone would not end its line, and what follows would be cut off.
        parts: list[RenderableType] = [Padding(bar, 0), Text(self._progress())]
        # Above the table: a screen that is too low for all models shows it all the same.
        if self._status:
            parts.append(Text(self._status, style="yellow"))
        parts.append(self._table())
        notices = [
            f"{name}: {tally.notice}"
            for name, tally in self._tallies.items()
            if tally.notice and tally.done < tally.expected
        ]
        for notice in notices[:_NOTICES]:
            parts.append(Text(one_line(notice), style="yellow", no_wrap=True, overflow="ellipsis"))
        return Panel(
            Group(*parts),
            title=Text(self._title),
            title_align="left",
            border_style="dim",
            # The terminal writes ^C behind the last column and would wrap a full line.
            width=self._console.width - 3,
        )

    def _table(self) -> Table:
        tallies = self._tallies
        columns: dict[str, Callable[[Tally], str]] = {
            "done": lambda t: f"{t.done:,}/{t.expected:,}",
            "F1 %": lambda t: (
                "" if t.counts is None or t.counts.f1 is None else f"{100 * t.counts.f1:.1f}"
            ),
            "cost": lambda t: t.cost_text,
            "tokens": lambda t: f"{t.tokens:,}",
            "cached": lambda t: f"{t.cached:,}",
            "sent again": lambda t: f"{t.retries:,}",
            "failed": lambda t: f"{sum(t.failures.values()):,}",
        }
        table = Table(box=None, pad_edge=False, header_style="dim", padding=(0, 2, 0, 0))
        table.add_column("model", no_wrap=True, overflow="ellipsis", min_width=8)
        shown = {
            heading: cells
            for heading, text in columns.items()
            if set(cells := [text(tally) for tally in tallies.values()]) - {"", "0"}
        }
        for heading in shown:
            table.add_column(heading, justify="right", no_wrap=True)
        for name, *cells in zip(tallies, *shown.values(), strict=True):
            table.add_row(one_line(name), *cells)
        return table


def _failure_text(counts: Counter[str]) -> str:
    """Failures by outcome: `2 api error, 1 truncated`."""
    return ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in sorted(counts.items()))


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    if hours:
        return f"{hours} h {minutes:02d} min"
    return f"{minutes} min {rest:02d} s" if minutes else f"{rest} s"
