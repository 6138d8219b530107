"""Workers: this process, several, a Ray cluster, or programs that share a folder of results."""

from __future__ import annotations

import contextlib
import fcntl
import importlib
import os
import pickle
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import partial
from itertools import islice
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any, TypeVar

from phyblock.errors import InputError, PhyblockError, Problem, StoreError
from phyblock.files import atomic_write, make_folder, read_text, writing
from phyblock.registry import PLUGINS

T = TypeVar("T")
R = TypeVar("R")
_RAY_RETRIES = 5
_BATCH = 16
_AHEAD, _SHARED_AHEAD = 16, 2
"""Batches in progress or waiting for an earlier one, by processor; fewer where each has a lock."""


def open_pool(processes: int) -> ProcessPoolExecutor:
    """Return a pool of processes, which start with the first jobs and end with this process.

    They import the main module of a program, which needs `if __name__ == "__main__"`. If one is
    killed, all jobs of the pool fail with BrokenProcessPool.
    """
    return ProcessPoolExecutor(processes, get_context("spawn"), _begin, (PLUGINS,))


def _begin(plugins: list[str]) -> None:
    """Prepare a worker process, which ends with its parent."""
    parent = parent_process()
    assert parent is not None

    def end_with_parent() -> None:
        parent.join()
        os._exit(0)

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=end_with_parent, daemon=True).start()
    # Threads of BLAS in every process would wait for one another on small matrices.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for plugin in plugins:
        importlib.import_module(plugin)


@dataclass
class Workers:
    """Runs pure functions over tasks in batches of `size`: here, in processes, or on a cluster.

    `submit` starts a job; `ahead` batches are started before the answers of the first are needed.
    With `shards`, batches are kept in files and shared with other programs.
    """

    submit: Callable[..., Future[Any]]
    ahead: int = 0
    size: int = 1
    shards: Shards | None = None
    is_here: bool = False
    _calls: int = 0

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield the answers in the order of the tasks."""
        call, self._calls = self._calls, self._calls + 1
        left = iter(tasks)
        started: deque[Future[list[R]] | _SharedBatch] = deque()
        ahead = self.ahead * (self.shards.count if self.shards else 1)
        try:
            for number, batch in enumerate(iter(lambda: list(islice(left, self.size)), [])):
                job = partial(self.submit, function, batch, PLUGINS)
                started.append(self.shards.batch(call, number, job) if self.shards else job())
                if len(started) > ahead:
                    yield from started.popleft().result()
            while started:
                yield from started.popleft().result()
        except (Exception, GeneratorExit):
            # After Ctrl-C, a pool is killed, and fails with an error of its own for cancelled jobs.
            for waiting in started:
                waiting.cancel()
            raise


class Shards:
    """Batches in a folder that several programs share, each as one shard.

    Each of `count` shards begins with every `count`-th batch, reads what others have computed, and
    computes what nobody does. So shards may run at once or one after another, and be interrupted.
    """

    def __init__(self, folder: Path, number: int, count: int, work: str) -> None:
        """Start or continue the job `work`. Raises StoreError if the folder is another job's."""
        self.number, self.count, self._folder = number, count, folder.absolute()
        make_folder(folder)
        path = folder / "work.txt"
        with writing(folder):
            if not path.exists():
                atomic_write(path, work)
        if (begun := read_text(path)) != work:
            hint = "remove the folder, or give the same arguments"
            raise StoreError(Problem(str(path), "is about other work", "", begun, work, hint))

    @property
    def writes(self) -> bool:
        """True for the first shard, which writes the results of all."""
        return self.number == 1

    def batch(self, call: int, number: int, job: Callable[[Path], Future[Any]]) -> _SharedBatch:
        """Return a batch, which is started if it is this shard's; `job` is given a file to write.

        The start of a batch that another shard computes waits until its answers are needed.
        """
        batch = _SharedBatch(self._folder / f"{call:04d}-{number:06d}.pickle", job)
        if (call + number) % self.count + 1 == self.number:
            batch.start(waits=False)
        return batch


@dataclass
class _SharedBatch:
    """A batch that is computed by the program that holds its lock."""

    path: Path
    job: Callable[[Path], Future[Any]]
    started: Future[Any] | None = None

    def start(self, *, waits: bool) -> None:
        """Start the batch, unless its answers are there or another shard computes them.

        If it `waits`, it starts the batch when that shard has ended without the answers.
        """
        with writing(self.path):
            lock = self.path.with_suffix(".lock").open("ab")
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | (0 if waits else fcntl.LOCK_NB))
            except BlockingIOError:
                lock.close()
                return
        try:
            if not self.path.exists():
                self.started = self.job(self.path)
        finally:
            if self.started is None:
                lock.close()
            else:
                # Released before the answers are needed, or two shards could wait for one another.
                self.started.add_done_callback(lambda _: lock.close())

    def result(self) -> Any:
        if self.started is None:
            self.start(waits=True)
        return self.started.result() if self.started else pickle.loads(self.path.read_bytes())

    def cancel(self) -> None:
        """Do not start the batch, if it has not begun."""
        if self.started is not None:
            self.started.cancel()


def _each(
    function: Callable[[T], R], batch: list[T], plugins: list[str], path: Path | None = None
) -> list[R]:
    """Return the answers to a batch; with `path`, keep them in this file too."""
    for plugin in plugins:
        importlib.import_module(plugin)
    answers = [function(task) for task in batch]
    if path is not None:
        with writing(path):
            atomic_write(path, pickle.dumps(answers))
    return answers


@contextlib.contextmanager
def open_workers(
    jobs: int = 1, ray_address: str | None = None, shards: Shards | None = None, size: int = 1
) -> Iterator[Workers]:
    """Open workers for the duration of a with statement: `jobs` processes, or only this one.

    With `ray_address` they are those of a Ray cluster (HOST:PORT or `auto`), or `jobs` of one on
    this machine (`local`). Batches on a cluster, and those that `shards` share, hold 16 tasks or
    more. Raises InputError when Ray is not installed or not reachable.
    """
    size = max(size, _BATCH if ray_address or shards else 1)
    ahead = _SHARED_AHEAD if shards else _AHEAD
    if ray_address is not None:
        try:
            ray = importlib.import_module("ray")
            options = {"num_cpus": jobs} if ray_address == "local" else {"address": ray_address}
            ray.init(log_to_driver=False, **options)
        except ModuleNotFoundError as error:
            hint = "pip install 'phyblock[ray]'"
            raise InputError(Problem("--ray", "Ray is not installed", hint=hint)) from error
        except (ConnectionError, ValueError, RuntimeError) as error:
            allowed = "local, auto, or the HOST:PORT of a running cluster"
            problem = Problem("--ray", "no such cluster", "", ray_address, allowed)
            raise InputError(problem) from error
        try:
            # A batch whose worker dies is computed again, with the same result: it is pure.
            remote = ray.remote(max_retries=_RAY_RETRIES)(_each).remote
            processors = max(1, int(ray.cluster_resources().get("CPU", 1)))
            yield Workers(lambda *job: remote(*job).future(), ahead * processors, size, shards)
        finally:
            ray.shutdown()
    elif jobs == 1:

        def done_here(*job: Any) -> Future[Any]:
            future: Future[Any] = Future()
            future.set_result(_each(*job))
            return future

        yield Workers(done_here, ahead if shards else 0, size, shards, is_here=True)
    else:
        with open_pool(jobs) as pool:
            try:
                yield Workers(lambda *job: pool.submit(_each, *job), ahead * jobs, size, shards)
            except BrokenProcessPool as error:
                raise PhyblockError("a worker process was killed") from error
            except KeyboardInterrupt:
                # Nobody needs the jobs in progress, and workers ignore Ctrl-C.
                for process in list(pool._processes.values()):
                    process.kill()
                raise
