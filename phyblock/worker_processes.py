"""Worker processes that leave Ctrl-C to the process that started them, end with it, and do not run
its program again.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context, parent_process
from types import ModuleType

__all__ = ["end_workers", "starting_workers", "worker_pool"]

_ONE_STARTS = threading.Lock()
"""Held while the main module is out of sight: who looks then must not take its stand-in for it."""


def worker_pool(workers: int) -> ProcessPoolExecutor:
    """A pool of processes that start afresh; submit to it while `starting_workers`."""
    return ProcessPoolExecutor(workers, get_context("spawn"), initializer=_start_worker)


def end_workers(pool: ProcessPoolExecutor) -> None:
    """End the processes of a pool at once, whatever they do."""
    for process in list((pool._processes or {}).values()):
        process.terminate()


@contextlib.contextmanager
def starting_workers() -> Iterator[None]:
    """Processes that start here never see Ctrl-C, not even while they import, and do not import the
    main module of the program: one that calls phyblock without a guard would call it again in each.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        with _ONE_STARTS:
            main = sys.modules["__main__"]
            sys.modules["__main__"] = ModuleType("__main__")
            try:
                yield
            finally:
                sys.modules["__main__"] = main
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_worker() -> None:
    # Ctrl-C reaches the whole process group; only the process that started it decides what to do.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """A process that is killed tells its workers nothing: without this they would stay for ever."""
    parent = parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
