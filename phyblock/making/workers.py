"""Workers for tasks: this process, several, or a Ray cluster; the answers are the same."""

from __future__ import annotations

import contextlib
import importlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from typing import Any, TypeVar

from phyblock.errors import InputError, PhyblockError, Problem
from phyblock.workers import WorkerDiedError, WorkerPool

T = TypeVar("T")
R = TypeVar("R")
_RAY_RETRIES = 5


@dataclass(frozen=True)
class Workers:
    """Runs pure functions: `submit(function, task)` starts a job, `result(job)` waits for it.

    At most `ahead` jobs are under way, so that no worker waits and memory stays flat.
    """

    submit: Callable[..., Any]
    result: Callable[[Any], Any]
    ahead: int

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield the answers in the order of the tasks."""
        waiting = iter(tasks)
        running = deque(self.submit(function, task) for task in islice(waiting, self.ahead))
        while running:
            yield self.result(running.popleft())
            running.extend(self.submit(function, task) for task in islice(waiting, 1))


@contextlib.contextmanager
def open_workers(jobs: int = 1, ray_address: str | None = None) -> Iterator[Workers]:
    """Open workers for the time of a with statement: `jobs` processes, or this one alone.

    With `ray_address` they are those of a Ray cluster (HOST:PORT or `auto`), or `jobs` of one on
    this machine (`local`). Raises InputError when Ray is not installed or not reachable.
    """
    if ray_address is not None:
        ray = _started(jobs, ray_address)
        try:
            # A task whose worker dies runs again, which changes nothing: it is pure.
            remote = partial(ray.remote, max_retries=_RAY_RETRIES)
            yield Workers(lambda f, task: remote()(f).remote(task), ray.get, ahead=64)
        finally:
            ray.shutdown()
    elif jobs == 1:
        yield Workers(partial, lambda job: job(), ahead=1)
    else:
        with WorkerPool(jobs) as pool:
            try:
                yield Workers(pool.submit, lambda job: job.result(), ahead=4 * jobs)
            except WorkerDiedError as error:
                raise PhyblockError("a worker process was killed; nothing was written") from error
            except KeyboardInterrupt:
                # Of what is under way nothing is wanted, and a worker hears no Ctrl-C of its own.
                pool.kill()
                raise


def _started(jobs: int, address: str) -> Any:
    """Ray, connected to a cluster."""
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
