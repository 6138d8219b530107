"""A run driven to its end from any thread, with the signals that stop it, and what to say then."""

from __future__ import annotations

import asyncio
import signal
import threading
from collections.abc import Callable, Collection
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from pathlib import Path

from phyblock.run.runner import RunResult, Session
from phyblock.text import counted

_NAP_S = 0.1
"""Longest delay until a signal that the system gives to another thread is noticed [s]."""


def completed(
    session: Session,
    signals: Collection[signal.Signals] = (signal.SIGINT,),
    tick: Callable[[bool], object] = lambda _: None,
) -> RunResult:
    """Run a session to its end in a thread of its own, since a notebook's has a loop already.

    The first signal lets it send nothing more, the second gives up calls under way; what was
    answered is on disk when this returns. `tick` is called several times a second, with True while
    calls are under way.
    """
    loop, stops = asyncio.new_event_loop(), 0
    whole: asyncio.Task[RunResult] | None = None

    async def run() -> RunResult:
        nonlocal whole
        whole = asyncio.current_task()
        try:
            return await session.run()
        except asyncio.CancelledError:
            return session.result

    def in_thread() -> RunResult:
        with asyncio.Runner(loop_factory=lambda: loop) as runner:
            return runner.run(run())

    def stop(*_: object) -> None:
        nonlocal stops
        stops += 1
        # Once, as what is answered must be written; a loop that is closed has nothing to stop.
        give_up = whole.cancel if stops == 2 and whole is not None else session.interrupt
        with suppress(RuntimeError):
            loop.call_soon_threadsafe(give_up)

    is_main = threading.current_thread() is threading.main_thread()
    before = {name: signal.getsignal(name) for name in signals if is_main}
    heard = {name: was for name, was in before.items() if was not in (None, signal.SIG_IGN)}
    for name in heard:
        signal.signal(name, stop)
    try:
        with ThreadPoolExecutor(1) as pool:
            running = pool.submit(in_thread)
            try:
                while not wait((running,), _NAP_S).done:
                    tick(session.under_way > 0)
            except BaseException:
                # A program's handlers of other signals may raise what they like.
                stop()
                raise
        return running.result()
    finally:
        for name, was in heard.items():
            signal.signal(name, was)


def remarks_on(result: RunResult, folder: Path | str) -> list[str]:
    """Return a sentence on each model that was stopped, and on samples that need a person."""
    remarks = [f"{model} was stopped: {reason}" for model, reason in result.stopped.items()]
    if result.failed:
        rejected = f"{counted(result.failed, 'request')} rejected for good"
        how = "when the cause is fixed, ask again with --retry-failed, retry_failed=True"
        remarks.append(f"{rejected}: {how}")
    if result.unjudged:
        unjudged = f"{counted(result.unjudged, 'answer')} could not be judged"
        remarks.append(f"{unjudged}: phyblock score {folder} tries again, without a call")
    return remarks
