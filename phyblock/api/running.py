"""Running a suite from a program or notebook: nothing is spent that nobody agreed to."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from types import NoneType

from phyblock.api.given import expect
from phyblock.api.suites import Suite, load_suite
from phyblock.config.models import load_models
from phyblock.errors import Problem, SpecError
from phyblock.results.load import Run, load_run
from phyblock.run.estimate import spending_refused, unlimited_spending
from phyblock.run.events import RunEvent, Stopping
from phyblock.run.plan import make_plan
from phyblock.run.preflight import find_models_file
from phyblock.run.runner import RunResult, Session, check_ready
from phyblock.text import counted

__all__ = ["run_suite"]

_NAP_S = 0.2
"""How long an interrupt may wait to be noticed."""


def run_suite(
    suite: Suite | str | Path,
    *,
    models: Sequence[str] | None = None,
    limit: int | None = None,
    out: str | Path | None = None,
    models_file: str | Path | None = None,
    use_cache: bool = True,
    retry_failed: bool = False,
    yes: bool = False,
) -> Run:
    """Run a suite, or go on with its run where it stopped, and load the run.

    The arguments are the options of `phyblock run`: `models` replaces the suite's, `limit` keeps so
    many scenes, `out` is the run's folder (`results/SUITE-DIGEST`). A model that bills is asked
    with `yes` alone, or under a limit of the suite (`limits.max_cost_usd`). Warns of models that
    were stopped, and of samples that are left, rejected or not judged.

    Raises InputError for what is wrong with the input, before anything is asked. Interrupted, the
    run sends nothing more, waits for calls under way (not after a second interrupt), and raises
    KeyboardInterrupt once what was answered is on disk.
    """
    _check(suite, models, limit, out, models_file)
    loaded = (suite if isinstance(suite, Suite) else load_suite(suite)).loaded
    named = None if models_file is None else str(models_file)
    known_in = find_models_file(named, loaded.files.path)
    plan = make_plan(loaded, load_models(known_in), only=models or (), limit=limit)
    folder = Path(out) if out is not None else plan.folder_in(Path("results"))
    check_ready(plan)
    costly = (
        ()
        if yes
        else unlimited_spending(plan, folder, use_cache=use_cache, retry_failed=retry_failed)
    )
    if costly:
        hint = "agree with yes=True, or set a limit: load_suite(NAME, 'limits.max_cost_usd=5')"
        raise spending_refused(plan, costly, "would cost money, and nobody agreed", hint)
    session = Session(plan, folder, _hear, use_cache=use_cache, retry_failed=retry_failed)
    _tell(folder, _RunApart(session).completed())
    return load_run(folder)


def _check(suite: object, models: object, limit: object, out: object, models_file: object) -> None:
    paths, a_path = (str, Path, NoneType), "a path"
    expect(
        "run_suite",
        {
            "suite": (suite, (Suite, str, Path), "a suite, its name or its path"),
            "models": (models, (list, tuple, NoneType), "a list of names: ['gpt-4o']"),
            "limit": (limit, (int, NoneType), "1..."),
            "out": (out, paths, a_path),
            "models_file": (models_file, paths, a_path),
        },
    )
    names = list(models) if isinstance(models, list | tuple) else None
    if names is not None:
        expect("run_suite", {f"models[{n}]": (m, str, "a name") for n, m in enumerate(names)})
    if names == []:
        hint = "leave it out for the suite's own models"
        raise SpecError(Problem("run_suite", "names no model", "models", "[]", hint=hint))
    if isinstance(limit, int) and limit < 1:
        raise SpecError(Problem("run_suite", "is no number of scenes", "limit", str(limit), "1..."))
    if out == "":
        raise SpecError(Problem("run_suite", "is empty: is a variable not set?", "out"))


class _RunApart:
    """A run in a thread of its own, since a notebook's has a loop already, and how it is stopped.

    As for `phyblock run`, the first interrupt lets it send nothing more, the second gives up calls
    under way.
    """

    def __init__(self, opening: Session) -> None:
        self._opening = opening
        self._is_interrupted = False
        self._stops = 0
        self._loop: asyncio.AbstractEventLoop | None = None
        self._whole: asyncio.Task[RunResult] | None = None
        self._session: Session | None = None

    def completed(self) -> RunResult:
        """Run to the end; KeyboardInterrupt, once all is written, where it was interrupted."""
        try:
            with self._interruptible(), ThreadPoolExecutor(1) as pool:
                try:
                    running = pool.submit(asyncio.run, self._run())
                    # A signal that the system gives to another thread wakes nobody here.
                    while not wait((running,), _NAP_S).done:
                        continue
                    return running.result()
                except BaseException:
                    # A program's handlers of other signals may raise what they like.
                    self._stop()
                    raise
        finally:
            if self._is_interrupted:
                raise KeyboardInterrupt

    async def _run(self) -> RunResult:
        self._whole, self._loop = asyncio.current_task(), asyncio.get_running_loop()
        async with self._opening as session:
            self._session = session
            self._heed()
            return await session.run()

    @contextlib.contextmanager
    def _interruptible(self) -> Iterator[None]:
        """Note Ctrl-C in the place of being torn from waiting by it, unless it is ignored."""
        is_main = threading.current_thread() is threading.main_thread()
        before = signal.getsignal(signal.SIGINT)
        if not is_main or not callable(before):
            yield
            return
        signal.signal(signal.SIGINT, self._on_interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)

    def _on_interrupt(self, *_: object) -> None:
        self._is_interrupted = True
        self._stop()

    def _stop(self) -> None:
        self._stops += 1
        if self._loop is not None:
            # A loop that is closed has nothing to stop.
            with contextlib.suppress(RuntimeError):
                self._loop.call_soon_threadsafe(self._heed)

    def _heed(self) -> None:
        """Do in the run's thread what was asked for; at the latest when the run is open."""
        if self._stops and self._session is not None:
            self._session.interrupt()
        if self._stops > 1 and self._whole is not None:
            self._whole.cancel()
            # Once, as what is answered must be written.
            self._whole = None


def _hear(event: RunEvent) -> None:
    """Say what an interrupted run waits for; of all else a program hears at the end."""
    if isinstance(event, Stopping):
        print(event.text, file=sys.stderr, flush=True)


def _tell(folder: Path, result: RunResult) -> None:
    for model, reason in result.stopped.items():
        warnings.warn(f"{model} was stopped: {reason}", stacklevel=3)
    if result.left:
        reason = f" ({result.stop.reason})" if result.stop else ""
        counts = f"{result.left:,} of {counted(result.samples, 'sample')} left{reason}"
        warnings.warn(f"{counts}: the same call again goes on", stacklevel=3)
    if result.failed:
        counts = f"{counted(result.failed, 'request')} rejected for good"
        warnings.warn(f"{counts}: ask again with retry_failed=True", stacklevel=3)
    if result.unjudged:
        counts = f"{counted(result.unjudged, 'answer')} could not be judged"
        warnings.warn(
            f"{counts}: phyblock score {folder} tries again, without a call", stacklevel=3
        )
