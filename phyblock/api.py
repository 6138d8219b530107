"""Public names of `phyblock`, for programs and notebooks: nothing is spent unasked."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import signal
import sys
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from types import NoneType
from typing import Any, Literal, get_args

from phyblock.config.models import load_models
from phyblock.config.suite import Suite as ConfigSuite
from phyblock.config.suite import load_suite as read_suite
from phyblock.data import AssemblyTask
from phyblock.errors import Problem, SpecError
from phyblock.files import write_named
from phyblock.parsing.plan import parse_plan
from phyblock.resources import bundled
from phyblock.results.load import Run, load_run
from phyblock.run.estimate import spending_refused, unlimited_spending
from phyblock.run.events import RunEvent, Stopping
from phyblock.run.plan import find_models_file, find_suite, make_plan, open_dataset, prompt_dirs
from phyblock.run.runner import RunResult, Session, check_ready
from phyblock.scoring.plan import AssemblyScorer, ErrorType
from phyblock.sim.pictures import PictureStyle, candidates_png, composite_png, goal_png, goal_style
from phyblock.text import counted, did_you_mean
from phyblock.tracks.items import select_tasks
from phyblock.types import (
    MATCHERS,
    PLAN_PARSERS,
    SETTINGS,
    Background,
    Matcher,
    PlanParser,
    Setting,
    View,
)

__all__ = [
    "Picture",
    "PlanScore",
    "Run",
    "SceneTask",
    "Scenes",
    "Suite",
    "load_run",
    "load_suite",
    "render",
    "run_suite",
    "score",
]


def _expect(function: str, **given: tuple[object, Any, str]) -> None:
    """Raise SpecError for all arguments that are of another kind; a bool is no number.

    An argument is told by its value, the types that it may have, and these in words.
    """
    problems = [
        Problem(function, "is of another kind", name, f"{type(one).__name__} {one!r:.60}", allowed)
        for name, (one, types, allowed) in given.items()
        if not isinstance(one, types) or isinstance(one, bool)
    ]
    if problems:
        raise SpecError(problems)


Shown = Literal["both", "goal", "candidates"]


@dataclass(frozen=True, repr=False)
class Picture:
    """A picture as PNG; a notebook shows it."""

    png: bytes

    def save(self, path: str | Path) -> Path:
        """Write the PNG in place of what is there; StoreError where that cannot be."""
        write_named(Path(path), self.png)
        return Path(path)

    def _repr_png_(self) -> bytes:
        return self.png

    def __repr__(self) -> str:
        return f"<picture: PNG, {len(self.png):,} bytes>"


def render(
    scene: AssemblyTask,
    *,
    show: Shown = "both",
    view: View = "oblique",
    background: Background = "checkerboard",
    size_px: int = 512,
) -> Picture:
    """Draw a scene as models see it: goal and numbered candidates, or one of the two.

    `size_px` is the side of each square [pixels]. Raises SpecError for a view, background or size
    that there is not and for arguments of another kind, DataError for a scene without blocks.
    """
    texts = {"show": show, "view": view, "background": background}
    _expect(
        "render",
        **{
            "scene": (scene, AssemblyTask, "a scene of a suite: suite.scenes[ID]"),
            "size_px": (size_px, int, "a whole number of pixels"),
            **{name: (text, str, "a word") for name, text in texts.items()},
        },
    )
    if show not in get_args(Shown):
        raise SpecError(
            Problem("render", "is not known", "show", str(show), ", ".join(get_args(Shown)))
        )
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


class Scenes(Mapping[str, SceneTask]):
    """Scenes by id, in the order of the data set."""

    def __init__(self, tasks: Sequence[AssemblyTask]) -> None:
        self._tasks = {
            one.key: SceneTask(one.scene, one.candidates, one.composite) for one in tasks
        }

    def __getitem__(self, key: str) -> SceneTask:
        if key not in self._tasks:
            hint = did_you_mean(str(key), list(self._tasks))
            raise SpecError(Problem("suite.scenes", "has no such scene", "", str(key), hint=hint))
        return self._tasks[key]

    def __contains__(self, key: object) -> bool:
        return key in self._tasks

    def __iter__(self) -> Iterator[str]:
        return iter(self._tasks)

    def __len__(self) -> int:
        return len(self._tasks)

    def __repr__(self) -> str:
        first = ", ".join(list(self._tasks)[:3])
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
        return Scenes(select_tasks(dataset.tasks, suite.levels, suite.limit))

    def __repr__(self) -> str:
        return f"<suite {self.name}: {self._about()}>"

    def _about(self) -> str:
        suite = self.loaded
        levels = ", ".join(map(str, suite.levels))
        return (
            f"{', '.join(suite.tracks)}; levels {levels}; {counted(len(suite.seeds), 'seed')}; "
            f"models {', '.join(self.models)}"
        )

    def _repr_html_(self) -> str:
        """Return what a notebook shows: name, description, what it asks of whom."""
        described = self.loaded.description
        return (
            f"<p><b>{escape(self.name)}</b> {escape(described)}</p><p>{escape(self._about())}</p>"
        )


def load_suite(suite: str | Path, *overrides: str) -> Suite:
    """Read a suite: a YAML file, or the name of a bundled one; `overrides` are `KEY=VALUE` texts,
    as of `--set`.

    Raises SpecError with all that is wrong, each with its file, line and field.
    """
    texts = {f"overrides[{n}]": (text, str, "KEY=VALUE") for n, text in enumerate(overrides)}
    _expect("load_suite", **{"suite": (suite, (str, Path), "a name or a path"), **texts})
    path = find_suite(str(suite))
    data, prompts = bundled("benchmarks", "data"), prompt_dirs(path)
    return Suite(read_suite(path, overrides, data_dir=data, prompt_dirs=prompts))


@dataclass(frozen=True)
class PlanScore:
    """A reply, read and scored.

    `plan` holds the candidates in order as they were read by `rule`, which is None where nothing
    could be read; `problem` says why then. `errors` has the reason of each wrong step, None for a
    right one. `tp`, `fp` and `fn` count right steps, wrong steps and blocks that are missing;
    `precision`, `recall` and `f1` are in [0, 1], None where nothing was counted.
    """

    plan: tuple[int, ...]
    rule: str | None
    problem: str | None
    setting: Setting
    matcher: Matcher
    tp: int
    fp: int
    fn: int
    precision: float | None
    recall: float | None
    f1: float | None
    errors: tuple[ErrorType | None, ...]

    def _repr_html_(self) -> str:
        """Return what a notebook shows: F1, and what became of each step."""
        if self.rule is None:
            return f"<p>Nothing could be read: {escape(str(self.problem))}</p>"
        f1 = "none" if self.f1 is None else f"{100 * self.f1:.1f} %"
        head = f"F1 {f1}, setting {self.setting}, {self.matcher} matcher"
        rows = (
            f"<tr><td>{n}</td><td>{block}</td><td>{(error or 'placed').replace('_', ' ')}</td></tr>"
            for n, (block, error) in enumerate(zip(self.plan, self.errors, strict=True), 1)
        )
        return (
            f"<p><b>{head}</b>: {self.tp} right, {self.fp} wrong, {self.fn} missing</p><table>"
            f"<thead><tr><th>Step</th><th>Block</th><th>Outcome</th></tr></thead>"
            f"<tbody>{''.join(rows)}</tbody></table>"
        )


def score(
    reply: str,
    scene: AssemblyTask,
    *,
    setting: Setting = "A",
    matcher: Matcher = "optimal",
    parser: PlanParser = "steps",
) -> PlanScore:
    """Read a reply to full planning and score its plan against a scene, by the AOV graph.

    Raises SpecError for a setting, matcher or parser that there is not, and for arguments of
    another kind.
    """
    _expect(
        "score",
        **{
            "reply": (reply, str, "text"),
            "scene": (scene, AssemblyTask, "a scene of a suite: suite.scenes[ID]"),
        },
    )
    given = {
        "setting": (setting, SETTINGS),
        "matcher": (matcher, MATCHERS),
        "parser": (parser, PLAN_PARSERS),
    }
    problems = [
        Problem("score", "is not known", name, str(word), ", ".join(words))
        for name, (word, words) in given.items()
        if word not in words
    ]
    if problems:
        raise SpecError(problems)
    parsed = parse_plan(reply, len(scene.candidates), parser)
    (scored,) = AssemblyScorer(scene.scene, scene.candidates, (setting,)).score(
        parsed.plan, (matcher,), None
    )
    counts = scored.counts
    return PlanScore(
        plan=parsed.plan.steps,
        rule=parsed.rule,
        problem=parsed.problem,
        setting=setting,
        matcher=matcher,
        tp=counts.tp,
        fp=counts.fp,
        fn=counts.fn,
        precision=counts.precision,
        recall=counts.recall,
        f1=counts.f1,
        errors=scored.step_errors or (),
    )


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
    _expect(
        "run_suite",
        **{
            "suite": (suite, (Suite, str, Path), "a suite, its name or its path"),
            "models": (models, (list, tuple, NoneType), "a list of names: ['gpt-4o']"),
            "limit": (limit, (int, NoneType), "1..."),
            "out": (out, paths, a_path),
            "models_file": (models_file, paths, a_path),
        },
    )
    names = list(models) if isinstance(models, list | tuple) else None
    if names is not None:
        _expect("run_suite", **{f"models[{n}]": (m, str, "a name") for n, m in enumerate(names)})
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
