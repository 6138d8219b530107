"""Public names of `phyblock`, for programs and notebooks; nothing is spent without consent."""

from __future__ import annotations

import asyncio
import functools
import inspect
import re
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Collection, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal, ParamSpec, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    InstanceOf,
    SkipValidation,
    ValidationError,
    validate_call,
)

from phyblock.config.models import load_models
from phyblock.config.suite import Suite as ConfigSuite
from phyblock.config.suite import load_suite as read_suite
from phyblock.config.validation import problems_of
from phyblock.data.base import AssemblyTask
from phyblock.data.lookup import open_dataset
from phyblock.errors import Problem, SpecError
from phyblock.files import write_named
from phyblock.results.load import Run, load_run
from phyblock.run.estimate import may_bill
from phyblock.run.plan import find_models_file, find_suite, make_plan, prompt_dirs
from phyblock.run.runner import RunEvent, RunResult, Session, Stopping, check_ready
from phyblock.sim.pictures import PictureStyle, candidates_png, composite_png, goal_png, goal_style
from phyblock.text import counted, did_you_mean
from phyblock.tracks.items import select_tasks
from phyblock.types import Background, View

__all__ = [
    "Picture",
    "Run",
    "SceneTask",
    "Scenes",
    "Suite",
    "load_run",
    "load_suite",
    "render",
    "run_suite",
]

_P = ParamSpec("_P")
_T = TypeVar("_T")
_Text = Annotated[str, Field(min_length=1)]
Place = _Text | Path


def checked(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Raise SpecError for all arguments that are not of the types that the function declares."""
    check: Callable[..., _T] = validate_call(config=ConfigDict(strict=True))(function)
    names = list(inspect.signature(function).parameters)

    @functools.wraps(function)
    def checked(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        try:
            return check(*args, **kwargs)
        except ValidationError as error:
            given: dict[Any, Any] = dict(enumerate(args)) | dict(kwargs)
            problems = problems_of(error, BaseModel, given, function.__name__)
            raise SpecError(map(named, problems)) from None

    def named(problem: Problem) -> Problem:
        found = re.match(r"\[(\d+)\](.*)", problem.field)
        if found is None:
            return problem
        return replace(problem, field=names[min(int(found[1]), len(names) - 1)] + found[2])

    return checked


@dataclass(frozen=True, repr=False)
class Picture:
    """A picture as PNG; a notebook shows it."""

    png: bytes

    def save(self, path: str | Path) -> Path:
        """Write the PNG, replacing a file that is there; StoreError if that fails."""
        write_named(Path(path), self.png)
        return Path(path)

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"<picture: PNG, {len(self.png):,} bytes>"


@checked
def render(
    scene: InstanceOf[AssemblyTask],
    *,
    show: Literal["both", "goal", "candidates"] = "both",
    view: View = "oblique",
    background: SkipValidation[Background] = "checkerboard",
    size_px: int = 512,
) -> Picture:
    """Draw a scene as models see it: goal and numbered candidates, or one of the two.

    `size_px` is the side of each square [pixels]. Raises SpecError for an unknown view, background
    or size, and for arguments of another type, DataError for a scene without blocks.
    """
    try:
        style = PictureStyle.from_view(view, size_px, background)
    except ValueError as error:
        raise SpecError(Problem("render", str(error))) from error
    style = style if show == "candidates" else goal_style(scene.scene, style)
    if show == "goal":
        return Picture(goal_png(scene.scene, style))
    candidates = candidates_png(scene.candidates, style)
    if show == "candidates":
        return Picture(candidates)
    return Picture(composite_png(goal_png(scene.scene, style), candidates))


@dataclass(frozen=True, repr=False)
class SceneTask(AssemblyTask):
    """A goal (`scene`) with its numbered `candidates`; a notebook shows both as a picture."""

    def __repr__(self) -> str:
        n_blocks = counted(len(self.scene.blocks), "block")
        n_candidates = counted(len(self.candidates), "candidate")
        return f"<scene {self.key}: level {self.scene.level}, {n_blocks}, {n_candidates}>"

    def _repr_png_(self) -> bytes:
        return render(self).png


class Scenes(dict[str, SceneTask]):
    """Scenes by id, in the order of the data set."""

    def __missing__(self, key: str) -> SceneTask:
        hint = did_you_mean(str(key), list(self))
        raise SpecError(Problem("suite.scenes", "has no such scene", "", str(key), hint=hint))

    def __repr__(self) -> str:
        first = ", ".join(list(self)[:3])
        return f"<{counted(len(self), 'scene')}: {first}{', ...' if len(self) > 3 else ''}>"


@dataclass(frozen=True, repr=False)
class Suite:
    """A suite as it was read: what `run_suite` takes."""

    loaded: ConfigSuite = field(compare=False)

    @property
    def name(self) -> str:
        """Its name."""
        return self.loaded.name

    @property
    def models(self) -> tuple[str, ...]:
        """The models that it names; groups, and the word `recorded`, stand for themselves."""
        named = self.loaded.models
        return (named,) if isinstance(named, str) else tuple(named)

    @functools.cached_property
    def scenes(self) -> Scenes:
        """The scenes of its levels, as many as its limit keeps.

        Raises DataError where the data set cannot be read.
        """
        suite = self.loaded
        dataset = open_dataset(suite.dataset.format, self.loaded.files.dataset)
        tasks = select_tasks(dataset.tasks, suite, suite.limit)
        return Scenes({t.key: SceneTask(t.scene, t.candidates, t.composite) for t in tasks})

    def __repr__(self) -> str:
        suite = self.loaded
        levels, seeds = ", ".join(map(str, suite.levels)), counted(len(suite.seeds), "seed")
        asked = f"{', '.join(suite.tracks)}; levels {levels}; {seeds}"
        return f"<suite {self.name}: {asked}; models {', '.join(self.models)}>"


@checked
def load_suite(suite: Place, *overrides: str) -> Suite:
    """Read a suite: a YAML file, or the name of a bundled one; `overrides` are `KEY=VALUE` texts,
    as for `--set`.

    Raises SpecError with all that is wrong, each with its file, line and field.
    """
    path = find_suite(str(suite))
    return Suite(read_suite(path, overrides, prompt_dirs=prompt_dirs(path)))


@checked
def run_suite(
    suite: Suite | str | Path,
    *,
    models: Annotated[Sequence[str], Field(min_length=1)] | None = None,
    limit: Annotated[int, Field(ge=1)] | None = None,
    out: Place | None = None,
    models_file: Place | None = None,
    use_cache: bool = True,
    retry_failed: bool = False,
    yes: bool = False,
) -> Run:
    """Run a suite, or continue its run where it stopped, and load the run.

    The arguments are the options of `phyblock run`: `models` replaces the suite's, `limit` keeps so
    many scenes, `out` is the run's folder (`results/SUITE-DIGEST`). A model that bills is asked
    with `yes` alone, or under a limit of the suite (`limits.max_cost_usd`). Warns of models that
    were stopped, and of samples that are left, rejected or not judged.

    Raises InputError for what is wrong with the input, before anything is asked. Interrupted, the
    run sends nothing more, waits for calls under way (not after a second interrupt), and raises
    KeyboardInterrupt once what was answered is on disk.
    """
    loaded = (suite if isinstance(suite, Suite) else load_suite(suite)).loaded
    named = None if models_file is None else str(models_file)
    known = load_models(find_models_file(named, loaded.files.path))
    plan = make_plan(loaded, known, only=models or (), limit=limit)
    folder = plan.folder_in(Path("results")) if out is None else Path(out)
    check_ready(plan)
    asks: dict[str, Any] = {"use_cache": use_cache, "retry_failed": retry_failed}
    is_agreed = yes or plan.suite.limits.max_cost_usd is not None
    if costly := [] if is_agreed else may_bill(plan, folder, **asks):
        found = ", ".join(row.model.name for row in costly if row.may_cost)
        hint = "agree with yes=True, or set a limit: load_suite(NAME, 'limits.max_cost_usd=5')"
        where, message = f"suite {plan.suite.name}", "would cost money, and nobody agreed"
        raise SpecError(Problem(where, message, found=found, hint=hint))

    def tell(event: RunEvent) -> None:
        if isinstance(event, Stopping):
            print(event.text, file=sys.stderr, flush=True)

    result = completed(Session(plan, folder, tell, **asks))
    if result.stop is not None and result.stop.cause == "interrupted":
        raise KeyboardInterrupt
    remarks = remarks_on(result, folder)
    if result.left:
        reason = f" ({result.stop.reason})" if result.stop else ""
        counts = f"{result.left:,} of {counted(result.samples, 'sample')} left{reason}"
        remarks.append(f"{counts}: the same call again goes on")
    for remark in remarks:
        warnings.warn(remark, stacklevel=3)
    return load_run(folder)


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
