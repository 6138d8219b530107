"""Workers: this process, several, a Ray cluster, or programs that share a folder of results.

Worker processes ignore Ctrl-C, end with the process that started them, and do not import its main
module. `multiprocessing` would import it in each process: a program that calls phyblock without a
guard would run again there. A worker is `python -c` in a session of its own, and takes its jobs
from a pipe.
"""

from __future__ import annotations

import contextlib
import importlib
import os
import pickle
import queue
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import dataclass
from functools import partial
from itertools import islice
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, TypeVar

from phyblock.errors import InputError, PhyblockError, Problem, StoreError
from phyblock.files import atomic_write, make_folder, read_text, writing
from phyblock.registry import PLUGINS

T = TypeVar("T")
R = TypeVar("R")
_RAY_RETRIES = 5
_BATCH = 16
_WAITING = 4
"""Batches that may wait for an earlier one, as a multiple of those in progress."""
_BEAT_S, _GONE_S, _LOOK_S = 2.0, 30.0, 0.1
"""Intervals at which a shard signals that it runs, after which a silent one counts as stopped, and
at which others look for its results.
"""


class WorkerDiedError(RuntimeError):
    """The process of a job was killed, or crashed."""


class WorkerPool(Executor):
    """Runs module-level functions in processes, which start with the first jobs."""

    def __init__(self, workers: int) -> None:
        self._threads = ThreadPoolExecutor(workers, "worker")
        self._workers: list[_Worker] = []
        self._idle: list[_Worker] = []

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """Return the job's future, which fails with WorkerDiedError if its process is killed."""
        return self._threads.submit(self._run, (fn, args, kwargs))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Accept no more jobs; with `wait`, end the processes after the accepted ones."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        if wait:
            for worker in self._workers:
                worker.end()

    def kill(self) -> None:
        """End the processes at once; jobs in progress fail."""
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
    """Run the jobs that come through a pipe until it is closed."""
    for plugin in plugins:
        importlib.import_module(plugin)
    connection = Connection(number)
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()

    def receive() -> None:
        try:
            while True:
                jobs.put(connection.recv_bytes())
        except (EOFError, OSError):
            # The parent is gone: nobody reads the answer.
            os._exit(0)

    threading.Thread(target=receive, daemon=True).start()
    while True:
        try:
            function, args, kwargs = pickle.loads(jobs.get())
            answer = pickle.dumps((function(*args, **kwargs), None))
        except Exception as error:
            answer = pickle.dumps((error, traceback.format_exc()))
        connection.send_bytes(answer)


@dataclass
class Workers:
    """Runs pure functions over tasks in batches of `size`: here, in processes, or on a cluster.

    `submit` starts a job. At most `ahead` are in progress, and a few more wait for an earlier one.
    With `shards`, batches are kept in files and shared with other programs.
    """

    submit: Callable[..., Future[Any]]
    ahead: int = 1
    size: int = 1
    shards: Shards | None = None
    is_here: bool = False
    _calls: int = 0

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield the answers in the order of the tasks."""
        call, self._calls = self._calls, self._calls + 1
        return self._mapped(call, function, iter(tasks))

    def _mapped(self, call: int, function: Callable[[T], R], tasks: Iterator[T]) -> Iterator[R]:
        shards, number, following = self.shards, 0, 0
        most = _WAITING * self.ahead * (shards.count if shards else 1)
        running: dict[Future[list[R]], int] = {}
        others: dict[int, list[T]] = {}
        done: dict[int, list[R]] = {}

        def start(number: int, batch: list[T]) -> None:
            running[self.submit(function, batch, PLUGINS)] = number

        try:
            while True:
                while following in done:
                    yield from done.pop(following)
                    following += 1
                while len(running) < self.ahead and len(running) + len(others) + len(done) < most:
                    if not (batch := list(islice(tasks, self.size))):
                        break
                    if shards is not None and not shards.is_mine(call, number):
                        others[number] = batch
                    elif shards is not None and shards.has(call, number):
                        done[number] = shards.read(call, number)
                    else:
                        start(number, batch)
                    number += 1
                if following in done:
                    continue
                if shards is not None and following in others and shards.has(call, following):
                    del others[following]
                    done[following] = shards.read(call, following)
                elif running:
                    for job in wait(running, return_when=FIRST_COMPLETED).done:
                        at = running.pop(job)
                        done[at] = job.result()
                        if shards is not None:
                            shards.keep(call, at, done[at])
                elif shards is not None and following in others:
                    if shards.is_left(call, following):
                        start(following, others.pop(following))
                    else:
                        time.sleep(_LOOK_S)
                else:
                    return
        finally:
            for job in running:
                job.cancel()


class Shards:
    """Batches in a folder that several programs share, each as one shard.

    Of `count` shards, each computes every `count`-th batch and reads the others. It also computes
    the batches of a shard that is not running. So shards end whether they run at once or one after
    another, and continue where they were interrupted.
    """

    def __init__(self, folder: Path, number: int, count: int, work: str) -> None:
        """Start or continue; `work` describes the job, and must be the same in all shards.

        Raises StoreError if the folder belongs to another job.
        """
        self.number, self.count, self._folder = number, count, folder
        make_folder(folder)
        path = folder / "work.txt"
        with writing(folder):
            if not path.exists():
                atomic_write(path, work)
        if (begun := read_text(path)) != work:
            hint = "remove the folder, or give the same arguments"
            raise StoreError(Problem(str(path), "is about other work", "", begun, work, hint))
        self._stop = threading.Event()
        self._beating = threading.Thread(target=self._beat, daemon=True)

    def __enter__(self) -> Shards:
        self._mark(self.number).touch()
        self._beating.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._beating.join()
        self._mark(self.number).unlink(missing_ok=True)

    @property
    def writes(self) -> bool:
        """True for the first shard, which writes the results of all."""
        return self.number == 1

    def is_mine(self, call: int, number: int) -> bool:
        """True if a batch is this shard's."""
        return self._owner(call, number) == self.number

    def has(self, call: int, number: int) -> bool:
        """True if a batch is done."""
        return self._file(call, number).exists()

    def is_left(self, call: int, number: int) -> bool:
        """True if a batch belongs to another shard that is not running."""
        try:
            seen_s = self._mark(self._owner(call, number)).stat().st_mtime
        except FileNotFoundError:
            return True
        # By the clock of the folder, which may be another machine's.
        return self._mark(self.number).stat().st_mtime - seen_s > _GONE_S

    def read(self, call: int, number: int) -> Any:
        """Return the answers of a batch that is done."""
        return pickle.loads(self._file(call, number).read_bytes())

    def keep(self, call: int, number: int, answers: object) -> None:
        """Keep the answers of a batch."""
        with writing(self._folder):
            atomic_write(self._file(call, number), pickle.dumps(answers))

    def _owner(self, call: int, number: int) -> int:
        return (call + number) % self.count + 1

    def _file(self, call: int, number: int) -> Path:
        return self._folder / f"{call:04d}-{number:06d}.pickle"

    def _mark(self, number: int) -> Path:
        return self._folder / f"shard-{number}"

    def _beat(self) -> None:
        # A shard that cannot signal counts as stopped: others compute its batches too, the same.
        while not self._stop.wait(_BEAT_S):
            with contextlib.suppress(OSError):
                self._mark(self.number).touch()


def _each(function: Callable[[T], R], batch: list[T], plugins: list[str]) -> list[R]:
    for plugin in plugins:
        importlib.import_module(plugin)
    return [function(task) for task in batch]


def _done_here(*job: Any) -> Future[Any]:
    future: Future[Any] = Future()
    future.set_result(_each(*job))
    return future


@contextlib.contextmanager
def open_workers(
    jobs: int = 1,
    ray_address: str | None = None,
    shards: Shards | None = None,
    size: int = 1,
) -> Iterator[Workers]:
    """Open workers for the duration of a with statement: `jobs` processes, or only this one.

    With `ray_address` they are those of a Ray cluster (HOST:PORT or `auto`), or `jobs` of one on
    this machine (`local`). Batches on a cluster, and those that `shards` share, hold 16 tasks or
    more. Raises InputError when Ray is not installed or not reachable.
    """
    size = max(size, _BATCH if ray_address or shards else 1)
    with shards or contextlib.nullcontext():
        if ray_address is not None:
            ray = _connected_ray(jobs, ray_address)
            try:
                # A batch whose worker dies is computed again, with the same result: it is pure.
                remote = ray.remote(max_retries=_RAY_RETRIES)(_each).remote
                ahead = 2 * max(1, int(ray.cluster_resources().get("CPU", 1)))
                yield Workers(lambda *job: remote(*job).future(), ahead, size, shards)
            finally:
                ray.shutdown()
        elif jobs == 1:
            yield Workers(_done_here, 1, size, shards, is_here=True)
        else:
            with WorkerPool(jobs) as pool:
                try:
                    yield Workers(partial(pool.submit, _each), 4 * jobs, size, shards)
                except WorkerDiedError as error:
                    raise PhyblockError("a worker process was killed") from error
                except KeyboardInterrupt:
                    # Nobody needs the jobs in progress, and workers ignore Ctrl-C.
                    pool.kill()
                    raise


def _connected_ray(jobs: int, address: str) -> Any:
    try:
        ray = importlib.import_module("ray")
        options = {"num_cpus": jobs} if address == "local" else {"address": address}
        ray.init(log_to_driver=False, **options)
    except ModuleNotFoundError as error:
        hint = "pip install 'phyblock[ray]'"
        raise InputError(Problem("--ray", "Ray is not installed", hint=hint)) from error
    except (ConnectionError, ValueError, RuntimeError) as error:
        allowed = "local, auto, or the HOST:PORT of a running cluster"
        raise InputError(Problem("--ray", "no such cluster", "", address, allowed)) from error
    return ray
