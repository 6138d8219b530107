"""Tracks: what each declares, and its requests and judgements in a suite.

A track is one class. Its class attributes declare it; an instance is the track opened for a suite.
Most tracks send one request per sample (`request`, `judge`); one that `plays` starts an episode of
several turns instead (`start`). `SceneTrack` holds what tracks about scenes share.
"""

from __future__ import annotations

import asyncio
import functools
import json
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, TypeVar

from pydantic import BaseModel, create_model

from phyblock.config.suite import Suite
from phyblock.config.validation import PictureControls
from phyblock.data.base import Dataset
from phyblock.domain.scene import AOVGraph, AssemblyTask, CandidateSet, Oriented, Plan, Scene
from phyblock.errors import DataError, Problem, SpecError
from phyblock.models.request import Image, Message, Request
from phyblock.parsing.text import AnswerForm
from phyblock.records.record import Record, Reply, SentPrompt
from phyblock.registry import added_measures, known_track, known_tracks
from phyblock.scoring.plan import Goal, match_plan
from phyblock.sim.engine import REFERENCE_ENGINE, engine_version, physics_engine
from phyblock.sim.pictures import GRID_COLUMNS
from phyblock.text import drawn_bytes, hex_digest
from phyblock.tracks.measures import SampleCounts, TrackReport, read_report
from phyblock.tracks.pictures import Drawing, Workshop, scene_drawings
from phyblock.tracks.prompts import Prompt, TemplatePrompt
from phyblock.types import AnswerFormat, CandidateOrder

ENGINE = "physics"
"""Key in a track's identity of the physics engine, unless that is the reference engine."""
EXECUTION = "execution"
"""Key of the version of plan execution and its measurements."""


class Item(Protocol):
    """The subject of a sample: a scene with its candidates, or a question."""

    @property
    def key(self) -> str:
        """Its name inside the track."""

    @property
    def scene(self) -> Scene:
        """The scene it is about, by whose parents statistics cluster."""


ItemT = TypeVar("ItemT", bound=Item)
_T = TypeVar("_T")


class Judgement(NamedTuple):
    """A parsed and scored reply: `fields` of its record, such as `parse` and `scores`."""

    is_read: bool
    fields: Mapping[str, Any]


class Episode(Protocol):
    """One sample of several turns, as a state machine driven only by replies.

    The same replies lead to the same requests, so that a killed run continues within an episode.
    """

    async def request(self) -> Request | None:
        """Return the next request, or None when the episode has ended."""

    def take(self, reply: Reply, prompt: SentPrompt | None = None) -> None:
        """Advance by the reply to the last request, which was sent with this prompt."""

    def judgement(self) -> Judgement:
        """Return the judgement of the replies; its fields hold `turns`, one mapping per reply."""


class Choice(NamedTuple):
    """One thing to pick: its name in the prompt, and its text if it has one.

    It is in the last picture of each label: all of it, or `cell`, from 0, of the grid at its right.
    """

    name: str
    text: str = ""
    labels: tuple[str, ...] = ()
    cell: int | None = None

    def box(self, width_px: int, height_px: int) -> tuple[float, float, float, float]:
        """Return left, top, width and height in a picture of this size, as shares of its sides."""
        if self.cell is None:
            return (0.0, 0.0, 1.0, 1.0)
        row, column = divmod(self.cell, GRID_COLUMNS)
        side = min(width_px, height_px) / width_px
        width = side / GRID_COLUMNS
        return (1 - side + column * width, row / GRID_COLUMNS, width, 1 / GRID_COLUMNS)


@dataclass(frozen=True)
class NumberField:
    """A number that goes with every pick: its name and unit, from `-most` to `most` with at most
    `decimals` decimals. Keys change it by `step`, or by `leap`.
    """

    name: str
    unit: str
    most: float
    decimals: int
    step: float
    leap: float


class Pick(NamedTuple):
    """A choice, by its place among them from 0, and the numbers that go with it."""

    place: int
    numbers: tuple[float, ...] = ()


@dataclass(frozen=True)
class Picking:
    """An answer made of choices that are picked one after another.

    `least` to `most` are picked, with `repeats` any of them repeatedly; `noun` is one pick's name,
    `fields` are its numbers. `write` makes the reply; `task` says in one line what to do.
    """

    choices: tuple[Choice, ...]
    write: Callable[[Sequence[Pick]], str]
    task: str = ""
    noun: str = "step"
    least: int = 1
    most: int = 1
    repeats: bool = False
    fields: tuple[NumberField, ...] = ()

    def without_cells(self) -> Picking:
        """Return the same with choices that are whole pictures."""
        plain = (one if one.cell is None else Choice(one.name, one.text) for one in self.choices)
        return replace(self, choices=tuple(plain))

    def reply(self, picks: Sequence[Pick]) -> str:
        """Return the reply made of picks.

        Raises ValueError for too few or many, wrong places or repeats, and numbers not allowed.
        """
        places = [pick.place for pick in picks]
        is_answer = (
            self.least <= len(picks) <= self.most
            and all(0 <= place < len(self.choices) for place in places)
            and (self.repeats or len(set(places)) == len(places))
            and all(len(pick.numbers) == len(self.fields) for pick in picks)
            and all(
                # NaN is refused.
                abs(value) <= field.most and abs(value - round(value, field.decimals)) <= 1e-9
                for pick in picks
                for field, value in zip(self.fields, pick.numbers, strict=True)
            )
        )
        if not is_answer:
            raise ValueError("holds picks that make no answer")
        return self.write(picks)


def candidate_choices(
    n_candidates: int, labels: tuple[str, ...] = ("composite", "candidates")
) -> tuple[Choice, ...]:
    """Return the numbered candidates of a scene as choices in the pictures with these labels."""
    return tuple(Choice(str(n + 1), "", labels, n) for n in range(n_candidates))


class Track(ABC):
    """A track: its declaration, and its items in one suite, which every seed repeats."""

    name: ClassVar[str]
    """Its name in suites and records."""
    title: ClassVar[str]
    """Its name for people."""
    item: ClassVar[str] = "scene"
    """The noun for its items."""
    section: ClassVar[str] = ""
    """The key of its own section of a suite, if it has one."""
    options: ClassVar[type[BaseModel] | None] = None
    """The model of that section."""
    template: ClassVar[Path]
    """The bundled prompt; the one that asks for JSON is beside it and ends in _json.j2."""
    baselines: ClassVar[Mapping[str, Callable[..., str]]] = {}
    """Rules by name, which answer from the subject of a request and a random generator."""
    by_hand: ClassVar[Callable[..., Picking] | None] = None
    """The choices of a person who answers about a subject; None if people cannot answer."""
    record: ClassVar[type[Record] | None] = None
    """The model of its records; None if it adds no fields."""
    counted: ClassVar[tuple[SampleCounts, ...]] = ()
    """The counts that its YAML file names."""
    results: ClassVar[Mapping[str, Any]] = {}
    """The fields of its report that are code."""
    varies: ClassVar[tuple[str, ...]] = ("repeats",)
    """Factors of a suite's section `vary` that change its requests."""
    plays: ClassVar[bool] = False
    """True if a sample is an episode of several turns."""
    simulates: ClassVar[bool] = False
    """True if blocks are released in a physics engine, unless its section says otherwise."""

    items: Sequence[Any]

    def __init__(
        self, suite: Suite, dataset: Dataset, limit: int | None = None, shop: Workshop | None = None
    ) -> None:
        """Open on at most `limit` items; without a shop it makes no requests. Raises InputError."""
        self.suite, self.dataset, self.limit, self.shop = suite, dataset, limit, shop
        self.spec: Any = None if self.options is None else suite.section(self.options)
        self.is_blind = isinstance(self.spec, PictureControls) and self.spec.blind
        self.prompt = None if shop is None else self.open_prompt()
        self._drawings: dict[tuple[object, ...], tuple[Drawing, ...]] = {}
        measures = (*self.report().measures, *added_measures(self.name))
        self._counted = dict.fromkeys(measure.counted for measure in measures)
        self.open()

    @abstractmethod
    def open(self) -> None:
        """Select its items."""

    @classmethod
    @functools.cache
    def report(cls) -> TrackReport:
        """Return its measures, with the layout of tables and figures."""
        return read_report(cls.name, cls.counted, **cls.results)

    @classmethod
    @functools.cache
    def record_type(cls) -> type[Record]:
        """Return the model of its records."""
        tag: Any = Literal[cls.name]
        return cls.record or create_model("Record", __base__=Record, track=(tag, ...))

    @classmethod
    def prompt_field(cls) -> tuple[str, ...]:
        """Return the keys that lead to its prompt in a suite."""
        is_own = cls.options is not None and "prompt" in cls.options.model_fields
        return (cls.section, "prompt") if is_own else ("prompt",)

    @classmethod
    def lets_go(cls, suite: Mapping[str, Any]) -> bool:
        """True if a suite in a manifest releases blocks in a physics engine."""
        return cls.simulates and (suite.get(cls.section) or {}).get("physics") != "off"

    @classmethod
    def has_own_data(cls) -> bool:
        """True if its section names its own data, by `path` and `format`."""
        return cls.options is not None and {"path", "format"} <= cls.options.model_fields.keys()

    @classmethod
    def template_for(cls, form: AnswerFormat) -> Path | None:
        """Return the bundled prompt for an answer format, or None."""
        path = cls.template
        if form != "text":
            path = path.with_name(f"{path.stem}_json.j2")
        return path if path.is_file() else None

    def open_prompt(self) -> Prompt:
        """Return the suite's own template, else the bundled one for its answer format.

        Raises PromptError for a broken one, SpecError if the track has none for the format.
        """
        suite, field = self.suite, "answer_format"
        path, bundled = suite.template(self.name), self.template_for(suite.answer_format)
        if bundled is None:
            message, hint = f"{self.name} cannot be asked for as JSON", "use answer_format: text"
            raise SpecError(Problem(suite.where(field), message, field, "json_schema", hint=hint))
        return TemplatePrompt(path or bundled, "default" if path is None else path.stem)

    def shown(self, item: Any, _seed: int) -> Any:
        """Return the item as presented under a seed, used for requests, judgements and counts."""
        return item

    def about(self, _item: Any) -> dict[str, Any]:
        """Return the fields of records about an item, besides its scene."""
        return {}

    @abstractmethod
    def draw(self, item: Any) -> tuple[Drawing, ...]:
        """Return the pictures of a presented item, in the order sent."""

    def drawings(self, item: Any) -> tuple[Drawing, ...]:
        """Return the result of `draw`, computed once for each presentation of an item."""
        name = item.key, getattr(item, "order", ())
        if name not in self._drawings:
            self._drawings[name] = self.draw(item)
        return self._drawings[name]

    def facts(self, item: Any, pictures: Sequence[Image]) -> dict[str, object]:
        """Return the variables of templates; none of them reveals the answer."""
        form = self.form(item)
        return {
            "pictures": [picture.label for picture in pictures],
            "is_blind": self.is_blind,
            "answer_format": self.suite.answer_format,
            "answer_schema": None if form is None else json.dumps(form.schema),
            "answer_example": None if form is None else form.example,
        }

    def json_form(self, item: Any) -> AnswerForm[Any]:
        """Return the JSON form of an answer, if a prompt asks for it."""
        raise NotImplementedError

    def form(self, item: Any) -> AnswerForm[Any] | None:
        """Return the requested form of an answer; None for text."""
        return None if self.suite.answer_format == "text" else self.json_form(item)

    def subject_of(self, item: Any) -> object:
        """Return what baselines and people answer about."""
        return item

    def judge(self, item: Any, text: str | None) -> Judgement:
        """Parse and score a reply; a missing reply (None) is scored as an empty one."""
        raise NotImplementedError

    def counts(self, item: Any, record: Record) -> dict[str, tuple[float, ...]]:
        """Return the counts of a sample besides its scores, by name; empty if it does not count."""
        return {
            one.name: tuple(map(float, one.sample(item, record) or ()))
            for one in self._counted
            if one.sample is not None
        }

    async def judge_apart(self, item: Any, text: str | None, _earlier: Record | None) -> Judgement:
        """Return the result of `judge`, computed in another process if it takes long.

        Results that replies alone do not determine may come from an earlier record of the sample.
        """
        return self.judge(item, text)

    def start(
        self,
        item: Any,
        seed: int,
        params: Mapping[str, object],
        *,
        with_messages: bool,
        earlier: Record | None = None,
    ) -> Episode:
        """Return a new episode; results such as falls come from an `earlier` record, if given."""
        raise NotImplementedError

    def identity(self) -> dict[str, Any]:
        """Return everything that determines its results as JSON: prompt, pictures, engine.

        The pictures are those of seed 0: a run keeps its identity with more seeds, or fewer.
        """
        identity: dict[str, Any] = {"prompt": None, "pictures": None}
        if self.prompt is not None:
            shown = [self.shown(item, 0) for item in self.items]
            keys = [[one.key for one in found] for found in map(self.drawings, shown) if found]
            version = {"name": self.prompt.name, "version": self.prompt.version}
            identity = {"prompt": version, "pictures": hex_digest(json.dumps(keys))}
        is_simulated = self.simulates and getattr(self.spec, "physics", "") != "off"
        if is_simulated and (engine := physics_engine().name) != REFERENCE_ENGINE:
            identity[ENGINE] = {"engine": engine, engine: engine_version(engine)}
        return identity

    async def request(
        self, item: Any, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """Return the request of one sample; without messages for models that need none."""
        messages: tuple[Message, ...] = ()
        if with_messages and self.shop is not None:
            messages = self.messages(item, await self.shop.images(self.drawings(item)))
        return self.asked(item, seed, params, messages)

    def outlines(self, item: Any) -> Iterator[Request]:
        """Yield the requests of an item as far as they are known before any reply.

        They have seed 0 and no parameters. Pictures that are unknown or not in the cache are empty.
        """
        pictures = () if self.shop is None else self.shop.outlines(self.drawings(item))
        yield self.asked(item, 0, {}, () if self.shop is None else self.messages(item, pictures))

    def messages(self, item: Any, pictures: Sequence[Image]) -> tuple[Message, ...]:
        """Return the messages about an item with these pictures."""
        assert self.prompt is not None
        return self.prompt.messages(pictures, self.facts(item, pictures))

    def asked(
        self,
        item: Any,
        seed: int,
        params: Mapping[str, object],
        messages: tuple[Message, ...] = (),
        subject: object = None,
        turn: int = 0,
    ) -> Request:
        """Return the request with these messages; in an episode, for a turn counted from 1."""
        key, form = f"{item.key}/{turn}" if turn else item.key, self.form(item)
        version = self.prompt.version if messages and self.prompt is not None else ""
        about = subject or self.subject_of(item)
        wanted = None if form is None else form.response_format
        return Request(key, seed, messages, params, version, about, wanted, self.name)

    async def compute(self, work: Callable[[], Any]) -> Any:
        """Return the result of `work`, a `partial`, from another process, else from a thread."""
        if self.shop is None:
            return await asyncio.to_thread(work)
        return await self.shop.compute(work)

    def close(self) -> None:
        """Stop the worker processes."""
        if self.shop is not None:
            self.shop.close()


class SceneTrack(Track):
    """A track about scenes; its section may hold `PictureControls`."""

    draws: ClassVar[bool] = False
    """True if it draws its own pictures and cannot use those of a data set."""

    def open(self) -> None:
        """Select scenes evenly over levels."""
        suite = self.suite
        self.items = select_tasks(self.dataset.tasks, suite, self.limit)
        if self.draws and self.shop is not None and suite.images.source == "dataset":
            where, message = suite.where("images", "source"), f"{self.name} draws its own pictures"
            hint = "render the pictures: --set images.source=render"
            raise SpecError(Problem(where, message, "images.source", "dataset", hint=hint))

    def draw(self, item: AssemblyTask) -> tuple[Drawing, ...]:
        """Return the pictures of goal and candidates in the style of the suite."""
        return scene_drawings(item, self.suite.images)

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """Return the scene as presented under a seed."""
        return presented(item, seed, self.suite.candidates.order, is_blind=self.is_blind)

    def about(self, item: AssemblyTask) -> dict[str, Any]:
        """Return the presentation of the scene, if it differs from the file's."""
        if not item.order:
            return {}
        return {"shown": {"order": list(item.order), "blind": item.is_blind}}

    def facts(self, item: AssemblyTask, pictures: Sequence[Image]) -> dict[str, object]:
        """Return the variables of templates; none of them reveals the answer."""
        images = self.suite.images
        return {
            **super().facts(item, pictures),
            "n_candidates": len(item.candidates),
            "candidate_scale": None if images.source == "dataset" else "common",
        }


def log_orders(graph: AOVGraph) -> float:
    """Return the decimal logarithm of a lower bound on the number of valid orders.

    The bound is n! divided, for each block, by the number of blocks that need it (or that it
    needs), itself included: exact if no block rests on two others, or no two rest on one.
    """
    sizes = ([mask.bit_count() for mask in masks] for masks in (graph.below, graph.above))
    most = max(-math.log10(math.prod(of_blocks)) for of_blocks in sizes)
    return math.log10(math.factorial(len(graph))) + most


def distractor_distance(task: AssemblyTask) -> float:
    """Return in how many of type, color and orientation the nearest distractor differs from a
    needed look, averaged over needed looks; 3 without distractors.
    """
    needed = {block.look: block for block in task.scene.blocks}
    others = [one for one in task.candidates.candidates if one.look not in needed]

    def apart(one: Oriented, other: Oriented) -> int:
        is_turned = one.look[2] != other.look[2] or one.type != other.type
        return (one.type != other.type) + (one.color != other.color) + is_turned

    nearest = [min((apart(one, other) for other in others), default=3) for one in needed.values()]
    return sum(nearest) / len(nearest)


def _blind_f1(task: AssemblyTask) -> float:
    plan = Plan(tuple(range(1, len(task.candidates) + 1)))
    return match_plan(Goal(task.scene, task.candidates, "A"), plan, "optimal").counts.f1 or 0.0


DIFFICULTY: Mapping[str, Callable[[AssemblyTask], float]] = {
    "blocks": lambda task: len(task.scene),
    "depth": lambda task: max(task.scene.graph.layers),
    "orders": lambda task: log_orders(task.scene.graph),
    "blind": _blind_f1,
    "distractor": distractor_distance,
}
"""Measures of the difficulty of a scene, by the names in `DifficultySpec`."""


def select_tasks(
    tasks: Sequence[AssemblyTask], suite: Suite, limit: int | None
) -> tuple[AssemblyTask, ...]:
    """Return the tasks of a suite's levels and difficulty, at most `limit`, in their order."""
    chosen = [task for task in tasks if set(suite.levels) & set(task.scene.levels)]
    for name, (low, high) in suite.dataset.difficulty.ranges.items():
        chosen = [task for task in chosen if low <= DIFFICULTY[name](task) <= high]
    return limited(chosen, [task.scene.level for task in chosen], limit)


def limited(items: Sequence[_T], strata: Sequence[int], limit: int | None) -> tuple[_T, ...]:
    """Return at most `limit` items in order, spread evenly over strata; higher limits keep them."""
    kept = set(fair_order(strata)[:limit])
    return tuple(item for position, item in enumerate(items) if position in kept)


def interleaved(items: Sequence[ItemT]) -> list[ItemT]:
    """Return items in an order whose first few are always a fair sample of levels and scenes."""
    return [items[position] for position in fair_order([item.scene.level for item in items])]


def spread(size: int) -> list[int]:
    """Return the positions 0 to `size` - 1 in an order whose first few are always evenly spread.

    They are at 0, 1/2, 1/4, 3/4, 1/8, ... of the size: the sequence of van der Corput (1935).
    """
    digits = max(1, (size - 1).bit_length())
    parts = (int(f"{i:0{digits}b}"[::-1], 2) for i in range(2**digits))
    return list(dict.fromkeys(part * size // 2**digits for part in parts))


def fair_order(strata: Sequence[int]) -> list[int]:
    """Return all positions, alternating between strata by size and evenly spread in each.

    Every stratum gets one place before any gets two; then each place goes to the stratum with the
    fewest for its size (Webster's method, which is monotone in the number of places).
    """
    members: dict[int, list[int]] = {}
    for position, stratum in enumerate(strata):
        members.setdefault(stratum, []).append(position)
    places = sorted(
        (rank > 0, Fraction(2 * rank + 1, len(of_stratum)), stratum, of_stratum[place])
        for stratum, of_stratum in members.items()
        for rank, place in enumerate(spread(len(of_stratum)))
    )
    return [position for *_, position in places]


def presented(
    task: AssemblyTask, seed: int, order: CandidateOrder, *, is_blind: bool = False
) -> AssemblyTask:
    """Return the task as presented under a seed; the task itself if nothing differs.

    A shuffled order is a sort by digests, so that it is the same on every machine.
    """
    numbers = range(1, len(task.candidates) + 1)
    if order == "shuffled":
        place = functools.partial(drawn_bytes, "candidate order", seed, task.scene.id)
        return in_order(task, sorted(numbers, key=place), seed, is_blind=is_blind)
    return in_order(task, numbers, is_blind=True) if is_blind else task


def in_order(
    task: AssemblyTask, numbers: Sequence[int], seed: int = 0, *, is_blind: bool = False
) -> AssemblyTask:
    """Return the task with the candidates of these numbers in the file, in this order.

    Raises DataError for a number that no candidate has, and for a repeated one.
    """
    n = len(task.candidates)
    if len(set(numbers)) < len(numbers) or not set(numbers) <= set(range(1, n + 1)):
        where, message = f"scene {task.key}", "is not an order of its candidates"
        found, allowed = ", ".join(map(str, numbers)), f"the numbers 1 to {n}, each once"
        raise DataError(Problem(where, message, "shown.order", found, allowed))
    shown = CandidateSet(tuple(task.candidates[number] for number in numbers))
    return AssemblyTask(task.scene, shown, task.composite, tuple(numbers), is_blind, seed)


def as_recorded(task: AssemblyTask, record: Record) -> AssemblyTask:
    """Return the task with the candidates that a record says were shown, in their order."""
    return task if record.shown is None else in_order(task, record.shown.order)


kinds, kind_of = known_tracks, known_track
"""Lookups of all tracks by name, and of one."""


def simulating(suite: Mapping[str, Any]) -> tuple[type[Track], ...]:
    """Return the tracks of a suite in a manifest that use a physics engine."""
    asked = [kind for name, kind in kinds().items() if name in (suite.get("tracks") or ())]
    return tuple(kind for kind in asked if kind.lets_go(suite))


def open_tracks(
    suite: Suite, dataset: Dataset, limit: int | None = None, shop: Workshop | None = None
) -> tuple[Track, ...]:
    """Return the tracks of a suite, in its order; raises as `Track`."""
    return tuple(kind_of(name)(suite, dataset, limit, shop) for name in suite.tracks)
