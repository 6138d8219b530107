"""Tracks: what each declares, and how it asks and judges in a suite.

A track is one class. Its class attributes declare it; an instance is the track as a suite opens
it. Most tracks ask once a sample (`SingleTrack`), step planning plays episodes (`EpisodeTrack`);
what those about scenes share is in `SceneTrack`.
"""

from __future__ import annotations

import asyncio
import importlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol

from pydantic import BaseModel

from phyblock.config.suite import Suite
from phyblock.config.validation import PictureControls
from phyblock.data import AssemblyTask, Dataset
from phyblock.errors import Problem, SpecError
from phyblock.models.request import Image, Message, Request
from phyblock.parsing.structured import AnswerForm
from phyblock.records.manifest import Manifest
from phyblock.records.record import Record, Reply
from phyblock.registry import added_measures, known_track, known_tracks
from phyblock.sim.engine import REFERENCE_ENGINE, engine_version, physics_engine
from phyblock.stable import hex_digest
from phyblock.tracks.baselines import Picking
from phyblock.tracks.items import (
    Examples,
    ItemT,
    Presentation,
    other_goals,
    presentation_fields,
    select_tasks,
)
from phyblock.tracks.measures import SampleCounts, TrackReport
from phyblock.tracks.pictures import Pictures, ScenePictures, Workshop
from phyblock.tracks.prompts import Prompt, TemplatePrompt, form_facts

ENGINE = "physics"
"""Key in a track's identity of the physics engine that decides its results, where that is not the
engine of reference. Its results stand in the records.
"""
CARRYING = "carrying"
"""The same of the version of how plans are carried out and what stands is measured."""


def engine_identity() -> dict[str, Any]:
    """Return the part of a track's identity that names the physics engine, if not the reference."""
    engine = physics_engine()
    if engine.name == REFERENCE_ENGINE:
        return {}
    return {ENGINE: {"engine": engine.name, engine.name: engine_version(engine.name)}}


class Judgement(Protocol):
    """A reply as it was read, with its scores."""

    @property
    def is_read(self) -> bool:
        """True if anything could be read."""

    def fields(self) -> dict[str, Any]:
        """Return `parse`, `scores` and what else the record says of it."""


class Episode(Judgement, Protocol):
    """One sample of several turns, as a state machine that replies alone drive.

    The same replies lead to the same requests, so that a killed run goes on in the middle of it.
    `fields` holds `turns` too, a mapping for each reply taken.
    """

    async def request(self) -> Request | None:
        """Return the next request, or None when the episode has ended."""

    def take(self, request: Request, reply: Reply) -> None:
        """Go on with the reply to the last request."""


@dataclass(frozen=True)
class Opening:
    """The arguments that a track is opened with; without `with_prompts` nothing is asked of anyone.

    `limit` is how many items the user wants at most, None for all. `shop` is where pictures
    of all tracks are drawn.
    """

    suite: Suite
    dataset: Dataset
    limit: int | None
    with_prompts: bool
    shop: Workshop = field(default_factory=Workshop)


class Track(ABC, Generic[ItemT]):
    """A track: its declaration, and its items in one suite, all of which every seed repeats."""

    name: ClassVar[str]
    """Its name in suites and records."""
    title: ClassVar[str]
    """Its name for people."""
    item: ClassVar[str] = "scene"
    """The noun for what it asks about."""
    asks: ClassVar[str]
    """A clause on what it asks, for the documentation of suites."""
    section: ClassVar[tuple[str, type[BaseModel], str] | None] = None
    """Key, model and description of the section of a suite that is its own."""
    template: ClassVar[Path | None] = None
    """The bundled prompt, None where it has none."""
    json_template: ClassVar[Path | None] = None
    """The prompt that asks for JSON, None where it asks for text alone."""
    prompt_field: ClassVar[tuple[str, ...]] = ("prompt",)
    """Path of keys to the prompt in a suite."""
    subject: ClassVar[type[object]]
    """The subject of its requests: the first argument of its rules."""
    baselines: ClassVar[Mapping[str, Callable[..., str]]] = {}
    """Rules that answer, given a subject and a random generator, by name of the baseline."""
    by_hand: ClassVar[Callable[..., Picking] | None] = None
    """How a person answers about a subject; None where nothing can be picked."""
    record: ClassVar[type[Record] | None] = None
    """The model of its records; None for one that adds nothing to them."""
    results: ClassVar[str] = ""
    """The module that holds its `REPORT`, for tracks that do not override `report`."""
    counted: ClassVar[tuple[SampleCounts, ...]] = ()
    """What its measures count of every sample as it is judged."""
    varies: ClassVar[tuple[str, ...]] = ("repeats",)
    """Factors of a suite's section `vary` that change what it asks."""
    no_examples: ClassVar[str] = "it declares none"
    """The reason why it shows no worked examples; "" where it does."""
    plays: ClassVar[bool] = False
    """True if a sample is an episode of several turns."""

    items: Sequence[ItemT]

    def __init__(self, opening: Opening) -> None:
        """Open the track; subclasses select its items.

        Raises SpecError, DataError or PromptError with what is wrong.
        """
        self.suite = opening.suite
        self.shop = opening.shop if opening.with_prompts else None
        self.prompt: Prompt | None = None
        self.pictures: Pictures | None = None
        self.examples: Examples[ItemT] = Examples((), 0)
        if self.shop is not None:
            self.prompt = self.open_prompt()
            self.pictures = self.open_pictures(self.shop)

    @classmethod
    def report(cls) -> TrackReport:
        """Import and return what tables and figures are made by, which takes long."""
        report: TrackReport = importlib.import_module(cls.results).REPORT
        return report

    @classmethod
    def data_folder(cls, _suite: Any) -> tuple[str, tuple[str, ...], bool] | None:
        """Return the folder of its own data: text, path of keys, True if it may be bundled."""
        return None

    @classmethod
    def data_root(cls, _manifest: Manifest) -> str | None:
        """Return where a run found the data of its own."""
        return None

    @classmethod
    def manifest(cls, _suite: Suite) -> Mapping[str, Any]:
        """Return what the manifest of a run holds beyond what all tracks have."""
        return {}

    @classmethod
    def physics(cls, _suite: Mapping[str, Any]) -> bool:
        """True if a suite, as a manifest holds it, lets blocks go in a physics engine."""
        return False

    def open_prompt(self) -> Prompt:
        """Return the prompt of the suite; PromptError for a broken one."""
        return template_prompt(self.suite, self.name)

    @abstractmethod
    def open_pictures(self, shop: Workshop) -> Pictures:
        """Return the pictures of its items, drawn in a shop."""

    @property
    def prompt_name(self) -> str:
        """Name of the prompt; "" where every model is a recording."""
        return "" if self.prompt is None else self.prompt.name

    def shown(self, item: ItemT, _seed: int) -> ItemT:
        """Return the item as a seed shows it, by which it is asked, judged and counted."""
        return item

    def each_shown(self) -> Sequence[ItemT]:
        """Return all items, in every form in which they are shown."""
        return self.items

    def about(self, _item: ItemT) -> dict[str, Any]:
        """Return the fields of records about an item besides its scene."""
        return {}

    def drawn(self, item: ItemT, _seed: int | None = None) -> object | None:
        """Return what its pictures are of, as a seed sends them; None where none is sent."""
        return item

    def form(self, _item: ItemT) -> AnswerForm[Any] | None:
        """Return the form in which an answer is asked for; None where that is text."""
        return None

    def identity(self) -> dict[str, Any]:
        """Return what decides its results as JSON: the prompt, a digest of pictures, examples."""
        if self.prompt is None or self.pictures is None:
            return {"prompt": None, "pictures": None}
        examples = self.examples.used(self.items)
        drawn = map(self.drawn, (*self.each_shown(), *examples))
        keys = [self.pictures.keys(one) for one in drawn if one is not None]
        return {
            "prompt": {"name": self.prompt.name, "version": self.prompt.version},
            "pictures": hex_digest(json.dumps(keys)),
            **({"examples": [example.key for example in examples]} if examples else {}),
        }

    @abstractmethod
    def outlines(self, item: ItemT) -> Iterable[tuple[Request, bool]]:
        """Yield the requests of an item as far as they are known before any is answered.

        With seed 0 and no parameters, made without rendering; with each, True if its pictures are
        the real ones.
        """

    async def work_out(self, work: Callable[[], Any]) -> Any:
        """Return what `work`, a `partial`, gives in another process; without a shop in a thread."""
        if self.shop is None:
            return await asyncio.to_thread(work)
        return await self.shop.work_out(work)

    def close(self) -> None:
        """Stop the worker processes."""
        if self.shop is not None:
            self.shop.close()


class SingleTrack(Track[ItemT]):
    """A track that asks once a sample."""

    @abstractmethod
    def subject_of(self, item: ItemT) -> object:
        """Return what baselines answer about."""

    @abstractmethod
    def facts(self, item: ItemT, pictures: Sequence[Image]) -> dict[str, object]:
        """Return what templates may use; nothing in it gives an answer away."""

    @abstractmethod
    def judge(self, item: ItemT, text: str | None) -> Judgement:
        """Read and score a reply; None, where there is no reply, is scored as nothing said."""

    async def judge_apart(
        self, item: ItemT, text: str | None, _earlier: Record | None
    ) -> Judgement:
        """Return what `judge` does; where that takes long, beside the calls of others.

        Of an earlier record of the same sample it may take what replies alone do not decide.
        """
        return self.judge(item, text)

    def right_answer(self, item: ItemT) -> str:
        """Return the answer of a worked example, in the form that is asked for."""
        raise NotImplementedError(f"there is no worked example of {item.key}")

    async def request(
        self, item: ItemT, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """Return the request of one sample; without messages for models that need none."""
        if not with_messages or self.pictures is None:
            return Request(item.key, seed, (), params, "", self.subject_of(item))
        drawn = self._drawn_with_examples(item, seed)
        images = [() if one is None else await self.pictures.of(one) for one in drawn]
        return self._request(item, seed, params, images)

    def outlines(self, item: ItemT) -> Iterator[tuple[Request, bool]]:
        """Yield the one request, made without rendering, and True if its pictures are real."""
        if self.pictures is None:
            yield Request(item.key, 0, (), {}, "", self.subject_of(item)), True
            return
        found = [
            ((), True) if one is None else self.pictures.outline(one)
            for one in self._drawn_with_examples(item, 0)
        ]
        request = self._request(item, 0, {}, [images for images, _ in found])
        yield request, all(are_real for _, are_real in found)

    def _drawn_with_examples(self, item: ItemT, seed: int) -> list[object | None]:
        return [*map(self.drawn, self.examples.of(item)), self.drawn(item, seed)]

    def _request(
        self,
        item: ItemT,
        seed: int,
        params: Mapping[str, object],
        images: Sequence[tuple[Image, ...]],
    ) -> Request:
        """Return the request with the pictures of each worked example, then of the item."""
        assert self.prompt is not None
        examples, turns = self.examples.of(item), list[Message]()
        for one, pictures in zip(examples, images, strict=False):
            *_, asked = self.prompt.messages(pictures, self.facts(one, pictures))
            name = f"example {one.key}: "
            parts = tuple(
                replace(part, label=name + part.label) if isinstance(part, Image) else part
                for part in asked.parts
            )
            turns += [Message("user", parts), Message("assistant", (self.right_answer(one),))]
        *first, question = self.prompt.messages(images[-1], self.facts(item, images[-1]))
        messages, version = (*first, *turns, question), self.prompt.version
        asks = self.form(item)
        form = None if asks is None else asks.response_format
        keys = tuple(one.key for one in examples)
        subject = self.subject_of(item)
        return Request(item.key, seed, messages, params, version, subject, form, examples=keys)


class EpisodeTrack(Track[ItemT]):
    """A track whose samples are episodes."""

    plays = True

    @abstractmethod
    def start(
        self, item: ItemT, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Episode:
        """Return an episode that has not begun."""

    @abstractmethod
    def again(self, item: ItemT, record: Record) -> Episode:
        """Return the episode of a record before its first reply, to be judged again.

        What replies alone do not decide, as what fell, is taken from the record.
        """


class SceneTrack(Track[AssemblyTask]):
    """A track about scenes, as a seed shows them; its section may hold `PictureControls`."""

    drawn_here: ClassVar[str] = ""
    """The reason why pictures of the data set will not do; "" where they will."""

    def __init__(self, opening: Opening) -> None:
        """Select scenes evenly over levels. Raises SpecError where another goal is to be shown and
        a scene has none.
        """
        suite, self.pool = opening.suite, opening.dataset.tasks
        self.items = select_tasks(self.pool, suite.levels, opening.limit)
        is_blind, elsewhere = False, None
        if self.section is not None:
            controls = suite.section(self.section[1])
            if isinstance(controls, PictureControls):
                is_blind = controls.blind
                elsewhere = other_goals(self.pool) if controls.wrong_image else None
            if elsewhere is not None:
                elsewhere.check(self.items, "scene", f"{self.section[0]}.wrong_image")
        self.presentation = Presentation(suite.candidates.order, is_blind, elsewhere, suite.seeds)
        super().__init__(opening)

    def open_pictures(self, shop: Workshop) -> Pictures:
        """Return pictures of goals and candidates as a suite wants them."""
        images = self.suite.images
        if self.drawn_here and images.source == "dataset":
            where = self.suite.where("images", "source")
            hint = "render the pictures: --set images.source=render"
            raise SpecError(Problem(where, self.drawn_here, "images.source", "dataset", hint=hint))
        return ScenePictures(shop, images)

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """Return the scene as a seed shows it."""
        return self.presentation.of(item, seed)

    def each_shown(self) -> Sequence[AssemblyTask]:
        """Return all scenes, in every form in which they are shown."""
        return [self.shown(task, s) for s in self.presentation.drawn_seeds for task in self.items]

    def about(self, item: AssemblyTask) -> dict[str, Any]:
        """Return how the scene is shown, where not as the file has it."""
        return presentation_fields(item)

    def facts(self, item: AssemblyTask, pictures: Sequence[Image]) -> dict[str, object]:
        """Return what templates may use; nothing in it gives an answer away."""
        scale = self.pictures.candidate_scale if isinstance(self.pictures, ScenePictures) else None
        return {
            "pictures": [picture.label for picture in pictures],
            "n_candidates": len(item.candidates),
            "candidate_scale": scale,
            "is_blind": self.presentation.blind,
            **form_facts(self.form(item)),
        }


AnyTrack = SingleTrack[Any] | EpisodeTrack[Any]
"""A track of either kind."""
kinds, kind_of = known_tracks, known_track
"""All tracks by name, and the one of a name."""


def kinds_with_physics(suite: Mapping[str, Any]) -> tuple[type[AnyTrack], ...]:
    """Return the tracks of a suite, as a manifest holds it, that use a physics engine."""
    asked = [kind for name, kind in kinds().items() if name in (suite.get("tracks") or ())]
    return tuple(kind for kind in asked if kind.physics(suite))


def count_sample(track: str, item: Any, judged: Any) -> Mapping[str, tuple[float, ...]]:
    """Return the counts of one sample that the measures of a track need, by name of the counts.

    `judged` is the judgement of the reply, or the episode once it has ended. Counts are empty where
    a measure does not count a sample.
    """
    added: list[SampleCounts] = [measure.counted for measure in added_measures(track)]
    return {
        counted.name: tuple(map(float, counted.sample(item, judged) or ()))
        for counted in (*kind_of(track).counted, *added)
        if counted.sample is not None
    }


def open_tracks(opening: Opening, names: Sequence[str]) -> tuple[AnyTrack, ...]:
    """Return the tracks of these names, in their order.

    Raises SpecError, DataError or PromptError with what is wrong.
    """
    suite = opening.suite
    for name in names:
        kind, field = kind_of(name), "answer_format"
        if suite.answer_format == "json_schema" and kind.json_template is None:
            message, hint = f"{name} cannot be asked for as JSON", "use answer_format: text"
            raise SpecError(Problem(suite.where(field), message, field, "json_schema", hint=hint))
        if suite.examples and kind.no_examples:
            message = f"cannot be shown in {name}: {kind.no_examples}"
            where = suite.where("examples")
            raise SpecError(Problem(where, message, "examples", hint="leave them out"))
    return tuple(kind_of(name)(opening) for name in names)


def template_prompt(suite: Suite, name: str) -> TemplatePrompt:
    """Return the prompt of a track: the suite's own template, else the bundled one for its format.

    Raises PromptError for a broken one.
    """
    kind = kind_of(name)
    own = kind.template if suite.answer_format == "text" else kind.json_template
    default = None if own is None else TemplatePrompt(own, "default")
    path = suite.files.templates.get(name)
    if path is not None:
        return TemplatePrompt(path, path.stem, default)
    assert default is not None, f"{name} has no prompt of its own"
    return default
