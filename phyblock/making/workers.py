"""Workers for tasks: this process, several, or a Ray cluster; the answers are the same."""

from __future__ import annotations

import contextlib
import importlib
import socket
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future
from itertools import islice
from typing import Any, Protocol, TypeVar

from phyblock.errors import InputError, PhyblockError, Problem
from phyblock.workers import WorkerDiedError, WorkerPool

T = TypeVar("T")
R = TypeVar("R")
_AHEAD = 4
"""Tasks under way for each process, so that none waits and memory stays flat."""
_RAY_AHEAD = 64
_RAY_RETRIES = 5
_RAY_PATIENCE_S = 10.0


class Workers(Protocol):
    """Runs pure functions on many inputs."""

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """The answers in the order of the tasks, few tasks ahead of what is taken."""


@contextlib.contextmanager
def open_workers(jobs: int = 1, ray_address: str | None = None) -> Iterator[Workers]:
    """Workers for the time of a with statement.

    `ray_address` is that of a Ray cluster, or `local` for one of `jobs` workers on this machine;
    without it there are `jobs` processes, or this one alone. Raises InputError when Ray is asked
    for and not installed or not reachable.
    """
    if ray_address is not None:
        with _ray(jobs, ray_address) as workers:
            yield workers
    elif jobs == 1:
        yield _Here()
    else:
        with WorkerPool(jobs) as pool:
            try:
                yield _Processes(pool, jobs * _AHEAD)
            except KeyboardInterrupt:
                # Of what is under way nothing is wanted, and a worker hears no Ctrl-C of its own.
                pool.kill()
                raise


class _Here:
    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        return map(function, tasks)


class _Processes:
    def __init__(self, pool: WorkerPool, ahead: int) -> None:
        self._pool, self._ahead = pool, ahead

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        waiting = iter(tasks)
        running = [self._submit(function, task) for task in islice(waiting, self._ahead)]
        try:
            while running:
                yield running.pop(0).result()
                running += [self._submit(function, task) for task in islice(waiting, 1)]
        except WorkerDiedError as error:
            raise PhyblockError("a worker process was killed; nothing was written") from error

    def _submit(self, function: Callable[[T], R], task: T) -> Future[R]:
        return self._pool.submit(function, task)


class _Ray:
    """Tasks on a cluster; one whose worker dies runs again, which changes nothing: it is pure."""

    def __init__(self, ray: Any) -> None:
        self._ray = ray

    def map(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        remote = self._ray.remote(max_retries=_RAY_RETRIES)(function)
        waiting = iter(tasks)
        running = [remote.remote(task) for task in islice(waiting, _RAY_AHEAD)]
        while running:
            yield self._ray.get(running.pop(0))
            running += [remote.remote(task) for task in islice(waiting, 1)]


@contextlib.contextmanager
def _ray(jobs: int, address: str) -> Iterator[Workers]:
    try:
        ray = importlib.import_module("ray")
    except ModuleNotFoundError as error:
        hint = "pip install 'phyblock[ray]'"
        raise InputError(Problem("--ray", "Ray is not installed", hint=hint)) from error
    unreachable = InputError(
        Problem(
            *("--ray", "no such cluster", "", address),
            allowed="local, auto, or the HOST:PORT of a running cluster",
        )
    )
    if address not in ("local", "auto") and not _answers(address):
        raise unreachable
    try:
        if address == "local":
            ray.init(num_cpus=jobs, include_dashboard=False, log_to_driver=False)
        else:
            ray.init(address=address, log_to_driver=False)
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise unreachable from error
    try:
        yield _Ray(ray)
    finally:
        ray.shutdown()


def _answers(address: str) -> bool:
    """True if something listens at HOST:PORT; Ray itself would wait for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not (host and port.isdecimal()):
        return False
    try:
        socket.create_connection((host, int(port)), _RAY_PATIENCE_S).close()
    except (OSError, OverflowError, UnicodeError):
        return False
    return True
