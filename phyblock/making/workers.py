"""Workers for tasks: this process, several, or a Ray cluster; the answers are the same."""

from __future__ import annotations

import contextlib
import importlib
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import islice
from typing import Any, TypeVar

from phyblock.errors import InputError, PhyblockError, Problem
from phyblock.workers import WorkerDiedError, WorkerPool

T = TypeVar("T")
R = TypeVar("R")
_AHEAD, _RAY_AHEAD = 4, 64
"""Tasks under way, for each process and on a cluster, so that none waits and memory stays flat."""
_RAY_RETRIES = 5


class Workers:
    """Runs pure functions on many inputs, at most `ahead` of them at a time."""

    def __init__(
        self, submit: Callable[..., Any], result: Callable[[Any], Any], ahead: int
    ) -> None:
        """`submit(function, task)` starts a job, `result(job)` waits for its answer."""
        self._submit, self._result, self._ahead = submit, result, ahead

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Yield the answers in the order of the tasks."""
        waiting = iter(tasks)
        running = deque(self._submit(function, task) for task in islice(waiting, self._ahead))
        while running:
            yield self._result(running.popleft())
            running.extend(self._submit(function, task) for task in islice(waiting, 1))


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
            yield Workers(lambda f, task: remote()(f).remote(task), ray.get, _RAY_AHEAD)
        finally:
            ray.shutdown()
    elif jobs == 1:
        yield Workers(partial, lambda job: job(), 1)
    else:
        with WorkerPool(jobs) as pool:
            try:
                yield Workers(pool.submit, lambda job: job.result(), jobs * _AHEAD)
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
