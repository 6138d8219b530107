"""Public names of `phyblock`: tasks and their scores, scenes, suites and runs.

Tasks make requests and score replies with the functions of runs, so scores equal those of a run to
the last bit. Pictures are drawn in the calling process and kept in the cache on disk. Tasks may be
used from several threads; each process opens its own. Nothing is spent without consent.
"""

from __future__ import annotations

import functools
import inspect
import io
import json
import math
import re
import sys
import warnings
from collections import Counter
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, ParamSpec, TypeVar, overload

import numpy as np
import pydantic
from PIL import Image
from pydantic import Field, InstanceOf, SkipValidation

from phyblock.config.models import load_models
from phyblock.config.suite import Suite
from phyblock.config.validation import problems_of
from phyblock.config.yaml import read_yaml
from phyblock.data.base import Dataset
from phyblock.data.lookup import find_data_set, open_dataset
from phyblock.data.scenes import SCENES_FILE
from phyblock.domain.scene import AssemblyTask
from phyblock.errors import Problem, SpecError
from phyblock.making.checks import Finding, verify_scene
from phyblock.making.scenes import production
from phyblock.making.scenes.sketch import Palette
from phyblock.models.request import Request, wire_messages
from phyblock.records.record import Record, Reply
from phyblock.registry import added_measures, known_track
from phyblock.results.load import Run, load_run
from phyblock.run.plan import check_models, find_models_file, make_plan, may_bill, read_suite
from phyblock.run.runner import RunEvent, Session, Stopping, completed
from phyblock.run.store import begun, judge_episode, judge_reply
from phyblock.sim.pictures import PictureStyle, candidates_png, composite_png, goal_png, goal_style
from phyblock.text import counted, did_you_mean, well_formed
from phyblock.tracks.base import Track, open_tracks
from phyblock.tracks.measures import LayoutColumn, Measure, SampleCounts, TrackReport
from phyblock.tracks.pictures import LocalShop
from phyblock.types import Background, View
from phyblock.workers import open_workers

_P = ParamSpec("_P")
_T = TypeVar("_T")
_Text = Annotated[str, Field(min_length=1)]
Place = _Text | Path
Split = Literal["test", "train", "dev"]
_SUITES = {"step_planning": "steps", "vqa": "vqa", "pose_planning": "pose"}
"""Bundled suites with the settings of a track; all other tracks use `full`."""
_MOST_REPEATS = 50  # Repeated scenes in a row after which a split is taken to be exhausted.


def checked(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Decorate a function to raise SpecError for arguments that do not have the declared types."""
    check: Callable[..., _T] = pydantic.validate_call(config={"strict": True})(function)
    declared = inspect.signature(function).parameters.values()
    names = [one.name for one in declared if one.kind is not one.KEYWORD_ONLY]

    def named(problem: Problem) -> Problem:
        """Return the problem with the name of a positional argument in place of its number."""
        field = re.sub(
            r"^\[(\d+)\]", lambda at: names[min(int(at[1]), len(names) - 1)], problem.field
        )
        return replace(problem, field=field)

    @functools.wraps(function)
    def checked(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        try:
            return check(*args, **kwargs)
        except pydantic.ValidationError as error:
            given: dict[Any, Any] = dict(enumerate(args)) | dict(kwargs)
            problems = problems_of(error, pydantic.BaseModel, given, function.__name__)
            raise SpecError(map(named, problems)) from None

    return checked


def _result(work: Coroutine[Any, Any, _T]) -> _T:
    """Return the result of a coroutine that never waits, as in tracks with a LocalShop."""
    try:
        work.send(None)
    except StopIteration as end:
        result: _T = end.value
        return result
    work.close()
    raise RuntimeError("the coroutine waits for an event loop")


@dataclass(frozen=True, repr=False)
class Score:
    """The score of a reply: its record, as a run would keep it, under one setting and matcher."""

    record: Record
    setting: str
    matcher: str

    def __repr__(self) -> str:
        return f"<score: {self.measure} {self.value:.3f}, {self.problem or self.outcome}>"

    @property
    def measure(self) -> str:
        """The name of the track's headline measure, which models are ranked by."""
        return [*self._headline.headings][-1]

    @property
    def value(self) -> float:
        """The headline measure in [0, 1]: 1 or 0 for an answer, else F1, or 0 if it is not defined.

        F1 is in setting C for a plan with poses, and over all attempts for an episode.
        """
        return self._value(self.measure) or 0.0

    @property
    def f1(self) -> float | None:
        """The headline measure if it is an F1, else None."""
        return self.value if self.measure.startswith("f1") else None

    @property
    def success(self) -> bool:
        """True if everything is right."""
        return self._value(self._report.success or self.measure) == 1.0

    @property
    def outcome(self) -> str:
        """The outcome of the reply, as in records."""
        return self.record.outcome

    @property
    def problem(self) -> str | None:
        """The reason why the reply could not be parsed, or None."""
        if self.record.error is not None:
            return self.record.error.message
        missing = "there is no reply" if self.outcome == "missing" else None
        return missing or getattr(self.record.parse, "problem", None)

    @property
    def counts(self) -> dict[str, float]:
        """The counts that `value` is computed from, by name."""
        counted = self._measures[self.measure].counted
        return dict(zip(counted.columns, self._numbers(counted) or (), strict=False))

    @property
    def errors(self) -> dict[str, int]:
        """The wrong steps by type of error."""
        course = self.record.course(self.matcher)
        return dict(Counter(why for _, why in course.steps if why is not None)) if course else {}

    @property
    def measures(self) -> dict[str, float]:
        """All measures of the track that have a value, by name."""
        values = {name: self._value(name) for name in self._measures}
        return {name: value for name, value in values.items() if value is not None}

    def as_json(self) -> dict[str, Any]:
        """Return the score as JSON data, for the logs of other tools."""
        names = ("value", "measure", "success", "outcome", "problem", "counts", "errors")
        return {name: getattr(self, name) for name in names}

    @property
    def _report(self) -> TrackReport:
        return known_track(self.record.track).report()

    @property
    def _headline(self) -> LayoutColumn:
        headline = self._report.headline
        return next((column for column in headline if column.main), headline[-1])

    @property
    def _measures(self) -> dict[str, Measure]:
        added = added_measures(self.record.track)
        return {one.name: one for one in (*self._report.measures, *added)}

    def _value(self, name: str) -> float | None:
        measure = self._measures[name]
        if (numbers := self._numbers(measure.counted)) is None:
            return None
        value = float(measure.value(np.asarray(numbers, dtype=np.float64)))
        return None if math.isnan(value) else value

    def _numbers(self, counted: SampleCounts) -> Sequence[float] | None:
        if counted.sample is not None:
            return self.record.counts.get(counted.name) or None
        criterion = self._headline.criterion or "aov"
        ways = [("", "", ""), *((self.setting, by, criterion) for by in (self.matcher, ""))]
        return next((numbers for way, numbers in counted.of(self.record) if way in ways), None)


@dataclass(frozen=True, repr=False)
class Task:
    """One item of a track, as presented under a seed."""

    track: Track
    item: Any
    """The scene with its candidates, or the question."""
    seed: int = 0

    @property
    def key(self) -> str:
        """Its name in the track: that of the scene, or of the question."""
        return str(self.item.key)

    @property
    def id(self) -> str:
        """Its name among the tasks of all tracks."""
        return f"{self.track.name}/{self.key}"

    @property
    def level(self) -> int:
        """The highest level that its scene counts in."""
        return int(self.item.scene.level)

    @property
    def part(self) -> str:
        """Its part of the track: the level, or the subtask of a question."""
        question = self.track.about(self.item).get("question")
        return question["subtask"] if question else f"level {self.level}"

    @property
    def base_scene(self) -> str:
        """The first base scene of its scene, by which standard errors cluster."""
        return str((self.item.scene.parents or (self.item.scene.id,))[0])

    @property
    def plays(self) -> bool:
        """True if it is an episode of several turns."""
        return self.track.plays

    def request(self) -> Request:
        """Return the request as a run makes it; for an episode, the first one."""
        if self.plays:
            first = Episode(self).request
            assert first is not None, "an episode begins with a request"
            return first
        return _result(self.track.request(self.item, self.seed, {}, with_messages=True))

    def messages(self) -> list[dict[str, Any]]:
        """Return the messages in OpenAI's form, with pictures as data URLs."""
        return wire_messages(self.request().messages, None)

    @property
    def pictures(self) -> dict[str, Image.Image]:
        """The pictures by their labels, in the order sent."""
        return {one.label: Image.open(io.BytesIO(one.data)) for one in self.request().images}

    @property
    def answer_schema(self) -> Mapping[str, Any] | None:
        """The JSON schema of an answer, or None for answers as text."""
        form = self.track.form(self.item)
        return None if form is None else form.schema

    def score(self, reply: str | Sequence[str] | None) -> Score:
        """Return the score of a reply, of an episode's replies in order, or of no reply (None).

        Raises SpecError for anything else.
        """
        if self.plays and (reply is None or isinstance(reply, Sequence)):
            episode = Episode(self, shows=False)
            for one in [reply] if isinstance(reply, str) else reply or ():
                if not episode.done:
                    episode._take(one)
            return episode.score()
        if not (reply is None or isinstance(reply, str)):
            allowed = "a text, None" + (", a list of texts" if self.plays else "")
            raise SpecError(Problem(self.id, "cannot be scored", "reply", repr(reply), allowed))
        return self._scored(_result(judge_reply(self.track, self.item, self._begun(reply))))

    def episode(self) -> Episode:
        """Return a new episode. Raises SpecError for a track without episodes."""
        return Episode(self)

    def _begun(self, reply: str | None) -> dict[str, Any]:
        answer = None if reply is None else Reply(text=well_formed(reply))
        sample = f"{self.track.name}/reply/{self.key}/s{self.seed}"
        return begun(sample, self.track, "reply", self.item, self.seed, answer)

    def _scored(self, record: Record) -> Score:
        suite = self.track.suite
        return Score(record, suite.settings[0], suite.scoring.matchers[0])

    def __deepcopy__(self, _: object) -> Task:
        return self

    def __repr__(self) -> str:
        return f"<task {self.id}: level {self.level}>"


class Turn(NamedTuple):
    """A step of an episode: the next messages, what it added to the score, and its outcome."""

    messages: list[dict[str, Any]]
    reward: float
    done: bool
    outcome: str


class Episode:
    """A task of several turns, driven by replies. Use it from one thread.

    Rewards are differences of `Score.value`, so they sum to it. `request` is None at the end.
    """

    def __init__(self, task: Task, *, shows: bool = True) -> None:
        """Begin. Without `shows`, messages are empty. Raises SpecError if `task` has one turn."""
        if not task.plays:
            raise SpecError(Problem(task.id, "is asked once and has no episode"))
        self.task, self._shows = task, shows
        self.reset()

    def reset(self) -> list[dict[str, Any]]:
        """Start again; return the first messages."""
        track, item, seed = self.task.track, self.task.item, self.task.seed
        self._episode = track.start(item, seed, {}, with_messages=self._shows)
        self._replies: list[Reply] = []
        self._value = 0.0
        self.request: Request | None = _result(self._episode.request())
        return self.messages

    @property
    def messages(self) -> list[dict[str, Any]]:
        """The messages of the pending turn; empty at the end."""
        return [] if self.request is None else wire_messages(self.request.messages, None)

    @property
    def done(self) -> bool:
        """True if it has ended."""
        return self.request is None

    def step(self, reply: str) -> Turn:
        """Take a step with a reply. Raises SpecError after the end, or if it is not a text."""
        if self.request is None:
            raise SpecError(Problem(self.task.id, "has ended", hint="call reset() before step()"))
        self._take(reply)
        score, before = self.score(), self._value
        self._value = score.value
        outcomes = getattr(score.record, "outcomes", None) or (score.outcome,)
        return Turn(self.messages, self._value - before, self.done, str(outcomes[-1]))

    def _take(self, reply: str) -> None:
        if not isinstance(reply, str):
            raise SpecError(Problem(self.task.id, "takes texts", "reply", repr(reply)))
        self._replies.append(Reply(text=well_formed(reply)).storable())
        self._episode.take(self._replies[-1])
        self.request = _result(self._episode.request())

    def score(self) -> Score:
        """Return the score of the episode so far."""
        fields = self.task._begun(None)
        track, item = self.task.track, self.task.item
        return self.task._scored(judge_episode(track, item, fields, self._episode, self._replies))


@dataclass(frozen=True, repr=False)
class Tasks:
    """The tasks of a track in one split: a finite set, by place or key, or an endless stream.

    Each iteration of a stream starts at its beginning; its tasks are made on demand and not kept.
    """

    suite: Suite
    name: str
    source: Callable[..., Iterator[AssemblyTask]] | None
    found: Mapping[str, Task]
    first: int = 0

    @property
    def is_endless(self) -> bool:
        """True if it is a stream."""
        return self.source is not None

    def __iter__(self) -> Iterator[Task]:
        yield from self._streamed(0) if self.is_endless else self.found.values()

    def _streamed(self, place: int) -> Iterator[Task]:
        assert self.source is not None, "a stream has a source"
        shop = LocalShop()
        for scene in self.source(first=self.first + place):
            yield from _opened(self.suite, Dataset(self.name, Path(self.name), (scene,)), shop)

    def __len__(self) -> int:
        if self.is_endless:
            raise TypeError(f"{self!r} has no length: give a limit")
        return len(self.found)

    @overload
    def __getitem__(self, key: int | str) -> Task: ...
    @overload
    def __getitem__(self, key: slice) -> Tasks: ...
    def __getitem__(self, key: int | str | slice) -> Task | Tasks:
        """Return a task by its place or its key, or a finite set's tasks by a slice.

        Raises SpecError for an unknown key, IndexError for a place past the end.
        """
        if isinstance(key, slice) and not self.is_endless:
            return replace(self, found=dict(list(self.found.items())[key]))
        if isinstance(key, int) and not self.is_endless:
            return list(self.found.values())[key]
        if isinstance(key, int) and key >= 0:
            return next(self._streamed(key))
        if not isinstance(key, str) or key not in self.found:
            hint = did_you_mean(str(key), list(self.found))
            hint = "a stream has tasks by place: 0, 1, ..." if self.is_endless else hint
            raise SpecError(Problem(repr(self), "has no such task", "", str(key), hint=hint))
        return self.found[key]

    def __repr__(self) -> str:
        size = "endless" if self.is_endless else len(self.found)
        return f"<tasks of {self.suite.tracks[0]}, {self.name}: {size}>"


def _opened(
    suite: Suite, dataset: Dataset, shop: LocalShop, limit: int | None = None
) -> Iterator[Task]:
    (track,) = open_tracks(suite, dataset, limit, shop)
    seed = suite.seeds[0]
    return (Task(track, track.shown(item, seed), seed) for item in track.items)


@checked
def tasks(
    track: str,
    *overrides: str,
    split: Split = "test",
    levels: Sequence[Annotated[int, Field(ge=1)]] | None = None,
    seed: Annotated[int, Field(ge=0)] = 0,
    data: SkipValidation[str | Path | Dataset | Iterable[AssemblyTask] | None] = None,
    limit: Annotated[int, Field(ge=1)] | None = None,
    first: Annotated[int, Field(ge=0)] = 0,
) -> Tasks:
    """Return the tasks of a track: `full_planning`, `step_planning`, `pose_planning` or `vqa`.

    The split `test` is the built-in set, or `data`: the name or folder of a data set, or scenes;
    `limit` keeps that many of its items, spread over levels or subtasks. `train` and `dev` are made
    from the seed and share no structure with the test set or with one another; they are endless and
    begin at place `first`, unless `limit` makes them a finite set of that many scenes. `overrides`
    are `KEY=VALUE` texts for the track's bundled suite. Raises SpecError, DataError or PromptError.
    """
    if split != "test" and (data is not None or track == "vqa"):
        message = "takes no data" if data is not None else "has no questions"
        hint = 'make a set with phyblock questions generate; give split="test", vqa.path=FOLDER'
        raise SpecError(Problem("tasks", message, "split", split, hint="" if data else hint))
    said = [f"tracks={json.dumps([track])}", f"seeds=[{seed}]"]
    said += [] if levels is None else [f"levels={list(levels)}"]
    if isinstance(data, str | Path):
        folder = find_data_set(str(data)).absolute()
        form = "builtin" if (folder / SCENES_FILE).is_file() else "official"
        said += [f"dataset.format={form}", f"dataset.path={json.dumps(str(folder))}"]
    suite = load_suite(_SUITES.get(track, "full"), *said, *overrides)
    if suite.tracks != (track,):
        message = "does not go with the track that is asked for"
        raise SpecError(Problem("tasks", message, "tracks", ", ".join(suite.tracks), track))
    limit = suite.limit if limit is None else limit
    if first and (split == "test" or limit is not None):
        message = "is the place where a stream begins; this is a finite set"
        raise SpecError(Problem("tasks", message, "first", str(first), hint="use a slice"))
    dataset = None
    if split != "test":
        stream = partial(production.split_tasks, split, seed, levels=suite.levels)
        if limit is None:
            return Tasks(suite, split, stream, {}, first)
        dataset = Dataset(split, Path(split), _distinct(stream(), limit))
    elif data is not None and not isinstance(data, str | Path):
        dataset = _given(data)
    dataset = dataset or open_dataset(suite.dataset.format, suite.files.dataset)
    found = _opened(suite, dataset, LocalShop(), limit)
    return Tasks(suite, dataset.name, None, {task.key: task for task in found})


def _distinct(scenes: Iterator[AssemblyTask], limit: int) -> tuple[AssemblyTask, ...]:
    """Return the first `limit` distinct scenes. Raises SpecError if there are fewer."""
    found: dict[str, AssemblyTask] = {}
    repeats = 0
    while len(found) < limit:
        scene = next(scenes)
        repeats = repeats + 1 if scene.key in found else 0
        found.setdefault(scene.key, scene)
        if repeats == _MOST_REPEATS:
            message = f"the rules seem to give {len(found)} scenes in these levels, and no more"
            raise SpecError(Problem("tasks", message, "limit", str(limit)))
    return tuple(found.values())


def _given(data: Any) -> Dataset:
    """Return a caller's scenes as a data set. Raises SpecError for anything else, and repeats."""
    allowed = "the name or folder of a data set, a Dataset, or scenes"
    if not isinstance(data, Dataset | Iterable):
        raise SpecError(Problem("tasks", "is not a data set", "data", repr(data), allowed))
    dataset = data if isinstance(data, Dataset) else Dataset("data", Path("data"), tuple(data))
    known: set[str] = set()
    for place, one in enumerate(dataset.tasks):
        is_scene = isinstance(one, AssemblyTask)
        if not is_scene or one.key in known:
            message = "comes a second time" if is_scene else "is not a scene"
            raise SpecError(Problem("tasks", message, f"data[{place}]", repr(one), allowed))
        known.add(one.key)
    return dataset


@checked
def generate(
    count: Annotated[int, Field(ge=1)],
    *,
    levels: Sequence[Annotated[int, Field(ge=1, le=5)]] = (1, 2, 3, 4),
    seed: Annotated[int, Field(ge=0)] = 0,
    palette: Palette = "kit",
) -> dict[str, AssemblyTask]:
    """Return new scenes with candidates, by id, made as by `phyblock scenes generate`.

    All stand, and none has the structure of a built-in one. Raises DataError if there are too few.
    """
    excluded = production.builtin_forms()
    with open_workers() as workers:
        made = production.Production(seed, palette, workers, excluded)
        return {task.key: task for task in made.tasks(production.shares(count, levels))}


@checked
def verify(scene: InstanceOf[AssemblyTask]) -> tuple[Finding, ...]:
    """Return the findings about a scene and its candidates, by geometry and physics."""
    return verify_scene(scene)


@checked
def render(
    scene: InstanceOf[AssemblyTask],
    *,
    show: Literal["both", "goal", "candidates"] = "both",
    view: View = "oblique",
    background: SkipValidation[Background] = "checkerboard",
    size_px: int = 512,
) -> Image.Image:
    """Draw a scene as models see it: goal and numbered candidates, or one of the two.

    `size_px` is the side of each square [pixels]. Raises SpecError for an unknown view, background
    or size, and for arguments of another type, DataError for a scene without blocks.
    """
    try:
        style = PictureStyle.from_view(view, size_px, background)
    except ValueError as error:
        raise SpecError(Problem("render", str(error))) from error
    style = style if show == "candidates" else goal_style(scene.scene, style)
    parts = []
    if show != "candidates":
        parts.append(goal_png(scene.scene, style))
    if show != "goal":
        parts.append(candidates_png(scene.candidates, style))
    return Image.open(io.BytesIO(composite_png(*parts) if show == "both" else parts[0]))


@checked
def load_suite(suite: Place, *overrides: str) -> Suite:
    """Read a suite from a YAML file, or a bundled one by its name, with `KEY=VALUE` overrides.

    Raises SpecError with all problems, each with its file, line and field.
    """
    return read_suite(str(suite), overrides)


@checked
def run_suite(
    suite: InstanceOf[Suite] | str | Path,
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

    The arguments are the options of `phyblock run`: `models` replaces the suite's, `limit` keeps
    that many scenes, `out` is the run's folder (`results/SUITE-DIGEST`). A model that may bill is
    called only with `yes`, or under a limit of the suite (`limits.max_cost_usd`). Warns of models
    that were stopped, and of samples that are left, rejected or not judged.

    Raises InputError for invalid input before any call. An interrupt stops new calls, waits for
    those in progress unless it comes twice, and raises KeyboardInterrupt with all replies on disk.
    """
    loaded = suite if isinstance(suite, Suite) else load_suite(suite)
    named = None if models_file is None else str(models_file)
    models_path = find_models_file(named, loaded.files.path)
    plan = make_plan(loaded, load_models(models_path), only=models or (), limit=limit)
    folder = plan.folder_in(Path("results")) if out is None else Path(out)
    check_models(plan.models, read_yaml(models_path), needs_keys=True)
    asks: dict[str, Any] = {"use_cache": use_cache, "retry_failed": retry_failed}
    is_agreed = yes or plan.suite.limits.max_cost_usd is not None
    if costly := [] if is_agreed else may_bill(plan, folder, **asks):
        found = ", ".join(row.model.name for row in costly if row.may_cost)
        hint = "agree with yes=True, or give prices and load_suite(NAME, 'limits.max_cost_usd=5')"
        where, message = f"suite {plan.suite.name}", "would cost money, and was not confirmed"
        raise SpecError(Problem(where, message, found=found, hint=hint))

    def report(event: RunEvent) -> None:
        if isinstance(event, Stopping):
            print(event.text, file=sys.stderr, flush=True)

    result = completed(Session(plan, folder, report, **asks))
    if result.stop is not None and result.stop.cause == "interrupted":
        raise KeyboardInterrupt
    remarks = result.remarks(folder)
    if result.left:
        reason = f" ({result.stop.reason})" if result.stop else ""
        counts = f"{result.left:,} of {counted(result.samples, 'sample')} left{reason}"
        remarks.append(f"{counts}: call run_suite again to continue")
    for remark in remarks:
        warnings.warn(remark, stacklevel=3)
    return load_run(folder)
