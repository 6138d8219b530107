"""Worker processes that ignore Ctrl-C, end with the process that started them, and do not import
its main module.

`multiprocessing` would import the main module in each process: a program that calls phyblock
without a guard would run again there. A worker is `python -c` in a session of its own, and takes
its jobs from a pipe.
"""

from __future__ import annotations

import importlib
import os
import pickle
import queue
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, TypeVar

from phyblock.registry import PLUGINS

T = TypeVar("T")


class WorkerDiedError(RuntimeError):
    """The process that did a job was killed, or crashed."""


class WorkerPool(Executor):
    """Runs functions of modules in processes, which start with the first jobs that there are."""

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers, "worker")
        self._workers: list[_Worker] = []
        self._idle: list[_Worker] = []

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Return the job's future; it fails with WorkerDiedError where its process was killed."""
        return self._threads.submit(self._run, (fn, args, kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Take no more jobs; end the processes after those that were taken (if it waits)."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            for worker in self._workers:
                worker.end()

    def kill(self) -> None:
        """End the processes at once, whatever they do; jobs under way fail."""
        self._threads.shutdown(wait=False, cancel_futures=True)
        for worker in list(self._workers):
            worker.process.kill()

    def _run(self, job: object) -> Any:
        data = pickle.dumps(job)
        try:
            worker = self._idle.pop()
        except IndexError:
            worker = _Worker()
            self._workers.append(worker)
        value, trace = worker.run(data)
        self._idle.append(worker)
        if trace is None:
            return value
        raise value from RuntimeError(f"in a worker process\n{trace}")


class _Worker:
    def __init__(self) -> None:
        self.connection, theirs = Pipe()
        code = f"import sys; sys.path[:] = {sys.path!r}; from phyblock.workers import _serve; "
        self.process = subprocess.Popen(
            [sys.executable, "-c", f"{code}_serve({theirs.fileno()}, {PLUGINS!r})"],
            stdin=subprocess.DEVNULL,
            pass_fds=(theirs.fileno(),),
            start_new_session=True,
            # Threads of BLAS in every process would wait for one another on small matrices.
            env={"OPENBLAS_NUM_THREADS": "1", **os.environ},
        )
        theirs.close()

    def run(self, job: bytes) -> tuple[Any, str | None]:
        try:
            self.connection.send_bytes(job)
            answer = self.connection.recv_bytes()
        except (EOFError, OSError) as error:
            self.end()
            raise WorkerDiedError("a worker process was killed") from error
        value, trace = pickle.loads(answer)
        return value, trace

    def end(self) -> None:
        self.connection.close()
        self.process.wait()


def _serve(number: int, plugins: list[str]) -> None:
    """Do the jobs that come through a pipe, until it is closed."""
    for plugin in plugins:
        importlib.import_module(plugin)
    connection = Connection(number)
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def receive() -> None:
        try:
            while True:
                jobs.put(connection.recv_bytes())
        except (EOFError, OSError):
            # The one who asked is gone: nobody wants the answer.
            os._exit(0)

    threading.Thread(target=receive, daemon=True).start()
    while True:
        try:
            function, args, kwargs = pickle.loads(jobs.get())
            answer = pickle.dumps((function(*args, **kwargs), None))
        except Exception as error:
            answer = pickle.dumps((error, traceback.format_exc()))
        connection.send_bytes(answer)
