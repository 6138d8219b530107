"""Running a suite from a program or notebook: nothing is spent that nobody agreed to."""

from __future__ import annotations

import asyncio
import warnings
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from phyblock.api.suites import Suite, load_suite
from phyblock.errors import Problem, SpecError
from phyblock.plain_text import counted
from phyblock.report.notebook import LoadedRun, load_run
from phyblock.run.consent import spending_refused, unlimited_spending
from phyblock.run.events import RunEvent
from phyblock.run.execute import RunResult
from phyblock.run.finding import check_commands, find_models_file
from phyblock.run.plan import RunPlan, make_plan
from phyblock.run.session import Session, check_ready
from phyblock.specs import load_models

__all__ = ["run_suite"]


def run_suite(
    suite: Suite | str | Path,
    *,
    models: Sequence[str] = (),
    limit: int | None = None,
    out: str | Path | None = None,
    models_file: str | Path | None = None,
    use_cache: bool = True,
    retry_failed: bool = False,
    yes: bool = False,
) -> LoadedRun:
    """Run a suite, or go on with its run where it stopped, and load the run.

    The arguments are the options of `phyblock run`: `models` replaces the suite's, `limit` keeps so
    many scenes, `out` is the run's folder (`results/SUITE-DIGEST`). A model that bills is asked
    with `yes` alone, or under a limit of the suite (`limits.max_cost_usd`). Interrupted, the run
    stops and keeps what it has. Warns of models that were stopped and of samples that are left.
    Raises InputError for what is wrong with the input, before anything is asked.
    """
    if limit is not None and (isinstance(limit, bool) or limit < 1):
        raise SpecError(Problem("run_suite", "is no number of scenes", "limit", str(limit), "1..."))
    if isinstance(models, str):
        hint = f"give a list: models=[{models!r}]"
        raise SpecError(Problem("run_suite", "is no list of names", "models", models, hint=hint))
    loaded = (suite if isinstance(suite, Suite) else load_suite(suite)).loaded
    named = None if models_file is None else str(models_file)
    known_in = find_models_file(named, loaded.path)
    plan = make_plan(loaded, load_models(known_in), only=models, limit=limit)
    check_commands(plan.models, known_in, named)
    folder = Path(out) if out is not None else Path("results") / plan.folder_name
    plan = check_ready(plan)
    costly = () if yes else unlimited_spending(plan, folder, use_cache=use_cache)
    if costly:
        hint = "agree with yes=True, or set a limit: load_suite(NAME, 'limits.max_cost_usd=5')"
        raise spending_refused(plan, costly, "would cost money, and nobody agreed", hint)
    _tell(_completed(plan, folder, use_cache=use_cache, retry_failed=retry_failed))
    return load_run(folder)


def _completed(plan: RunPlan, folder: Path, *, use_cache: bool, retry_failed: bool) -> RunResult:
    """Run in a thread of its own: a notebook's has a loop already."""
    begun: list[tuple[asyncio.AbstractEventLoop, Session]] = []

    async def run() -> RunResult:
        opened = Session(plan, folder, _unseen, use_cache=use_cache, retry_failed=retry_failed)
        async with opened as session:
            begun.append((asyncio.get_running_loop(), session))
            return await session.run()

    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(asyncio.run, run())
        try:
            return done.result()
        except KeyboardInterrupt:
            for loop, session in begun:
                loop.call_soon_threadsafe(session.executor.interrupt)
            return done.result()


def _unseen(_: RunEvent) -> None:
    """Nobody watches."""


def _tell(result: RunResult) -> None:
    for model, reason in result.stopped.items():
        warnings.warn(f"{model} was stopped: {reason}", stacklevel=3)
    if result.left:
        reason = f" ({result.stop.reason})" if result.stop else ""
        said = f"{result.left:,} of {counted(result.samples, 'sample')} left{reason}"
        warnings.warn(f"{said}: the same call again goes on", stacklevel=3)
    if result.failed:
        said = f"{counted(result.failed, 'request')} rejected for good"
        warnings.warn(f"{said}: ask again with retry_failed=True", stacklevel=3)
