"""Where a run lays its question and a person's answer is taken up: one loop, any threads.

The run asks in its loop and waits; the server's threads read what lies there, and put an answer.
Nothing is laid before the answer to what lay there last is on disk, as the run sees to.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from phyblock.models import HaltedError, Image, Request
from phyblock.play.person import Given
from phyblock.play.shown import Place, pictures_of, shown
from phyblock.tracks.by_hand import Pick, Picking

__all__ = ["Desk", "NotNowError", "Stopwatch"]

Phase = Literal["consent", "waiting", "question", "paused", "done", "closed"]


class NotNowError(Exception):
    """What was sent is not what is waited for: another page was faster, or nothing lies there."""


class Stopwatch:
    """Time that runs between `go` and `rest` [s]."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._before_s = 0.0
        self._since: float | None = None

    def go(self) -> None:
        """Run, from now on unless it does already."""
        if self._since is None:
            self._since = self._clock()

    def rest(self) -> None:
        """Stand still."""
        self._before_s, self._since = self.elapsed_s, None

    @property
    def elapsed_s(self) -> float:
        """How long it ran."""
        running = 0.0 if self._since is None else self._clock() - self._since
        return self._before_s + running


@dataclass
class _Laid:
    """A question that lies on the desk, and where its answer goes."""

    request: Request
    picking: Picking
    place: Place
    answer: asyncio.Future[Given]
    loop: asyncio.AbstractEventLoop
    watch: Stopwatch


class Desk:
    """One question at a time; every change has a number, by which a page asks for the next.

    `place` says where a question that comes stands in the sitting.
    """

    def __init__(
        self,
        place: Callable[[], Place],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._place = place
        self._about: Mapping[str, Any] = {}
        self._clock = clock
        self._changed = threading.Condition()
        self._number = 0
        self._phase: Phase = "waiting"
        self._laid: _Laid | None = None
        self._results: Mapping[str, Any] | None = None

    async def ask(self, request: Request, picking: Picking) -> Given:
        """What the person picks; HaltedError where the sitting is closed first."""
        loop = asyncio.get_running_loop()
        answer: asyncio.Future[Given] = loop.create_future()
        watch = Stopwatch(self._clock)
        with self._changed:
            if self._phase == "closed":
                raise HaltedError("the sitting was closed")
            place = self._place()
            self._laid = _Laid(request, picking, place, answer, loop, watch)
            if self._phase == "waiting":
                self._go_to("question")
        return await answer

    def state(self, after: int, wait_s: float = 0.0) -> dict[str, Any]:
        """What a page shows; of a change after number `after` is waited for, this long at most."""
        with self._changed:
            self._changed.wait_for(lambda: self._number != after, wait_s)
            told: dict[str, Any] = {"change": self._number, "phase": self._phase}
            if self._phase == "consent":
                told["about"] = dict(self._about)
            elif self._phase == "done":
                told["results"] = self._results
            elif self._laid is not None and self._phase == "question":
                laid = self._laid
                # The clock starts when the question is first given out.
                laid.watch.go()
                count = len(pictures_of(laid.request))
                addresses = [f"picture/{self._number}/{n}" for n in range(count)]
                told["question"] = shown(laid.request, laid.picking, laid.place, addresses)
                told["elapsed_s"] = laid.watch.elapsed_s
            return told

    def picture(self, change: int, number: int) -> Image | None:
        """A picture of the question that is shown; None for any other."""
        with self._changed:
            if self._laid is None or self._phase != "question" or change != self._number:
                return None
            pictures = pictures_of(self._laid.request)
            return pictures[number] if 0 <= number < len(pictures) else None

    def welcome(self, about: Mapping[str, Any]) -> None:
        """Ask for consent first; `about` is what the page says of the sitting."""
        with self._changed:
            self._about = about
            self._go_to("consent")

    def agree(self) -> None:
        """The text was agreed to: questions may be shown."""
        with self._changed:
            self._expect("consent")
            self._go_to("waiting" if self._laid is None else "question")

    def answer(self, change: int, picks: Sequence[Pick]) -> None:
        """Take the answer to the question that was shown under a number.

        Raises NotNowError for another question than the one that lies there, ValueError for picks
        that make no answer.
        """
        with self._changed:
            self._expect("question", change)
            laid = self._laid
            assert laid is not None
            laid.picking.reply(picks)
            given = Given(tuple(picks), round(laid.watch.elapsed_s, 3))
            self._laid = None
            self._go_to("waiting")
            laid.loop.call_soon_threadsafe(_settle, laid.answer, given)

    def pause(self) -> None:
        """Hide the question and stop the clock."""
        with self._changed:
            self._expect("question")
            assert self._laid is not None
            self._laid.watch.rest()
            self._go_to("paused")

    def resume(self) -> None:
        """Show the question again."""
        with self._changed:
            self._expect("paused")
            self._go_to("question")

    def finish(self, results: Mapping[str, Any]) -> None:
        """Show how it went: the sitting is over."""
        with self._changed:
            self._results = results
            self._go_to("done")

    def close(self) -> None:
        """Take nothing more; what lies there is given up."""
        with self._changed:
            laid, self._laid = self._laid, None
            self._go_to("closed")
        if laid is not None:
            laid.loop.call_soon_threadsafe(_give_up, laid.answer)

    def _expect(self, phase: Phase, change: int | None = None) -> None:
        if self._phase != phase or change not in (None, self._number):
            raise NotNowError

    def _go_to(self, phase: Phase) -> None:
        self._phase = phase
        self._number += 1
        self._changed.notify_all()


def _settle(answer: asyncio.Future[Given], given: Given) -> None:
    if not answer.done():
        answer.set_result(given)


def _give_up(answer: asyncio.Future[Given]) -> None:
    if not answer.done():
        answer.set_exception(HaltedError("the sitting was closed"))
