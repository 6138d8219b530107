"""The protocol of tracks: items, requests and judgement.

Most tracks ask once a sample; step planning plays an episode of several turns.
"""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

from pydantic import BaseModel

from phyblock.config.suite import ImagesSpec, Suite
from phyblock.config.validation import PictureControls
from phyblock.data import AssemblyTask, Dataset
from phyblock.errors import Problem, SpecError
from phyblock.models.request import Image, Request
from phyblock.parsing.structured import AnswerForm
from phyblock.records.manifest import Manifest
from phyblock.records.record import Record
from phyblock.records.reply import Reply
from phyblock.registry import added_measures, known_tracks
from phyblock.resources import cache_dir
from phyblock.sim.engine import REFERENCE_ENGINE, physics_engine
from phyblock.sim.pictures import PictureStyle
from phyblock.stable import hex_digest
from phyblock.tracks.baselines import Picking
from phyblock.tracks.items import (
    Examples,
    ItemT,
    Shots,
    Showing,
    TaskShowing,
    WorkedExample,
    showing_fields,
)
from phyblock.tracks.measures import SampleCounts, TrackReport
from phyblock.tracks.pictures import PicturePolicy, Pictures, Workshop, render_workers
from phyblock.tracks.prompts import Prompt, TemplatePrompt, form_facts, response_format
from phyblock.types import BACKGROUNDS

ENGINE = "physics"
"""Key in a track's identity of the physics engine that decides its results, where there is one and
it is not the engine of reference. What it decided stands in the records.
"""
READER = "reader"
"""The same of the version of a reader of the track's own; what is scored again is read anew."""
CARRYING = "carrying"
"""The same of the version of how plans are carried out and what stands is measured, as the records
keep it.
"""
FIRST_CARRYING = 1
"""How plans were carried out before runs said so."""


def engine_identity() -> dict[str, Any]:
    """Return the facts of the physics engine in a track's identity: runs made before there was a
    choice say nothing, and are to go on with the engine of reference.
    """
    engine = physics_engine()
    if engine.name == REFERENCE_ENGINE:
        return {}
    return {ENGINE: {"engine": engine.name, **engine.versions}}


class Judgement(Protocol):
    """A reply as it was parsed and scored."""

    @property
    def is_read(self) -> bool:
        """True if anything could be read."""

    def fields(self) -> dict[str, Any]:
        """`parse`, `scores` and what else the record says of it."""


class Track(Protocol[ItemT]):
    """The common part of all tracks."""

    @property
    def name(self) -> str:
        """Its name in suites and records."""

    @property
    def items(self) -> Sequence[ItemT]:
        """Its items; every seed repeats all of them."""

    @property
    def template(self) -> str:
        """Name of the prompt; "" where every model is a recording."""

    def about(self, item: ItemT) -> dict[str, Any]:
        """Return the fields of records about an item besides its scene."""

    def identity(self) -> dict[str, Any]:
        """Digests of what decides its results: data, prompt, pictures; JSON-able."""

    def outlines(self, item: ItemT) -> Iterable[tuple[Request, bool]]:
        """The requests of an item as far as they can be told before any is answered.

        With seed 0 and no parameters, made without rendering; with each, whether its pictures are
        the real ones.
        """

    def close(self) -> None:
        """Release worker processes."""


@runtime_checkable
class SingleTrack(Track[ItemT], Protocol[ItemT]):
    """A track that asks once a sample."""

    async def request(
        self, item: ItemT, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """The request of one sample; without messages for models that need none."""

    def judge(self, item: ItemT, text: str | None) -> Judgement:
        """Read and score a reply; None, where there is no reply, is scored as nothing said."""


@runtime_checkable
class ShowsBySeed(Protocol[ItemT]):
    """A track that shows an item otherwise with every seed, as with its candidates shuffled."""

    def shown(self, item: ItemT, seed: int) -> ItemT:
        """The item as a seed shows it, by which it is asked, judged and counted; its key is the
        same.
        """


def shown_item(track: AnyTrack, item: Any, seed: int) -> Any:
    """An item of a track as a seed shows it."""
    return track.shown(item, seed) if isinstance(track, ShowsBySeed) else item


@runtime_checkable
class JudgesApart(Protocol):
    """A track that takes so long to judge a reply that it does so beside the calls of others."""

    async def judge_apart(self, item: Any, text: str | None, earlier: Record | None) -> Judgement:
        """Return what `judge` does; of the `earlier` record of the same sample it may take what
        replies alone do not decide.
        """


async def judgement_of(
    track: AnySingleTrack, item: Any, text: str | None, earlier: Record | None = None
) -> Judgement:
    """A reply read and scored, for the first time or again after an `earlier` record."""
    if isinstance(track, JudgesApart):
        return await track.judge_apart(item, text, earlier)
    return track.judge(item, text)


class Episode(Protocol):
    """One sample of several turns, as a state machine that replies alone drive.

    The same replies lead to the same requests, so that a killed run goes on in the middle of an
    episode by taking the replies it has.
    """

    async def request(self) -> Request | None:
        """The next request, or None when the episode has ended."""

    def take(self, request: Request, reply: Reply) -> None:
        """Go on with the reply to the last request."""

    @property
    def is_read(self) -> bool:
        """True if anything could be read in any reply."""

    def fields(self) -> dict[str, Any]:
        """`parse`, `scores`, `turns` (a mapping for each reply taken), `ending` and what else the
        record says, as things stand.
        """


@runtime_checkable
class EpisodeTrack(Track[ItemT], Protocol[ItemT]):
    """A track whose samples are episodes."""

    def start(
        self, item: ItemT, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Episode:
        """An episode that has not begun."""

    def again(self, item: ItemT, record: Record) -> Episode:
        """The episode of a record before its first reply, to be judged anew.

        What replies alone do not decide, as what fell, is taken from the record.
        """


AnySingleTrack = SingleTrack[Any]
AnyTrack = AnySingleTrack | EpisodeTrack[Any]
"""A track of either kind."""


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
    shop: Workshop = field(default_factory=lambda: Workshop(render_workers()))


@dataclass(frozen=True)
class TrackKind:
    """A track: what it is called, what it adds to a suite, how it is opened.

    `title` and `item` (the noun for what it asks about) are for people, `about` says in a suite's
    documentation what it asks. `open` raises SpecError, DataError or PromptError with what is
    wrong. `report` imports what tables and figures are made by, which takes long. `subject` is the
    type that the rules of its `baselines` take, with a random generator, to answer in the
    benchmark's own reply form. `section` is the key, model and description of the part of a suite
    that is its own. `template` is the bundled prompt, None where it has none, and `prompt_field`
    where a suite names another; `json_template` is the one that asks for JSON, None where the track
    asks for text alone. `own_data` gives the folder of data of its own as a suite says it,
    `manifest` what the manifest says beyond what all tracks have. `own_root` tells where a run
    found these data. With `rescored`, what its replies are worth depends on the suite's parser and
    matchers, and `phyblock score` judges them again even where no measure counts samples. With
    `plays`, samples are episodes of several turns. `record` is the model of its records, where it
    adds something to them. `counted` is what its measures count of every sample as it is judged.
    `no_examples` says why it shows no worked examples, "" where it does.
    `by_hand` says of a subject how a person answers, None where nothing can be picked.
    `varies` names the factors of a suite's `vary` that change what it asks. `physics` says of a
    suite, as a manifest holds it, whether blocks are let go in a physics engine.
    """

    name: str
    title: str
    item: str
    about: str
    open: Callable[[Opening], AnyTrack]
    report: Callable[[], TrackReport]
    subject: type[object]
    template: Path | None = None
    json_template: Path | None = None
    record: type[Record] | None = None
    prompt_field: tuple[str, ...] = ("prompt",)
    section: tuple[str, type[BaseModel], str] | None = None
    baselines: Mapping[str, Callable[..., str]] = field(default_factory=dict)
    tables: tuple[str, ...] = ()
    own_data: Callable[[Suite], tuple[str, tuple[str, ...], bool] | None] | None = None
    manifest: Callable[[Suite], Mapping[str, Any]] | None = None
    plays: bool = False
    own_root: Callable[[Manifest], str | None] = lambda _: None
    rescored: bool = False
    counted: tuple[SampleCounts, ...] = ()
    no_examples: str = "it declares none"
    by_hand: Callable[[Any], Picking] | None = None
    varies: tuple[str, ...] = ("repeats",)
    physics: Callable[[Mapping[str, Any]], bool] = lambda _: False

    def data_folder(self, suite: Any) -> tuple[str, tuple[str, ...], bool] | None:
        """The folder of its own data: text, path of keys, whether it may be a bundled set."""
        return None if self.own_data is None else self.own_data(suite)


def kinds() -> Mapping[str, TrackKind]:
    """Every track by name, in the order in which they are listed."""
    return {name: kind for name, kind in known_tracks().items() if isinstance(kind, TrackKind)}


def kinds_with_physics(suite: Mapping[str, Any]) -> tuple[TrackKind, ...]:
    """The tracks of a suite, as a manifest holds it, that let blocks go in a physics engine."""
    asked = [kind for name, kind in kinds().items() if name in (suite.get("tracks") or ())]
    return tuple(kind for kind in asked if kind.physics(suite))


def kind_of(name: str) -> TrackKind:
    """The track of a name; KeyError for one that there is not."""
    return kinds()[name]


def open_tracks(opening: Opening, names: Sequence[str]) -> tuple[AnyTrack, ...]:
    """The tracks of these names, in their order.

    Raises SpecError, DataError or PromptError with what is wrong.
    """
    suite = opening.suite
    if suite.answer_format == "json_schema":
        lacking = [name for name in names if kind_of(name).json_template is None]
        if lacking:
            where, message = suite.where("answer_format"), "cannot be asked for as JSON"
            found, hint = f"track {', '.join(lacking)}", "use answer_format: text"
            raise SpecError(Problem(where, message, "answer_format", found, hint=hint))
    if suite.examples:
        for name in names:
            if reason := kind_of(name).no_examples:
                where, message = suite.where("examples"), f"cannot be shown in {name}: {reason}"
                raise SpecError(Problem(where, message, "examples", hint="leave them out"))
    return tuple(kind_of(name).open(opening) for name in names)


def picture_folder() -> Path:
    """Return the folder of drawn pictures."""
    return cache_dir() / "pictures"


def picture_style(images: ImagesSpec) -> PictureStyle:
    """Return the style in which a suite wants pictures drawn."""
    ground = images.background or BACKGROUNDS[0]
    seen = PictureStyle.from_view(images.view, images.size_px, ground)
    return replace(seen, candidate_scale=images.candidate_scale)


def picture_policy(images: ImagesSpec) -> PicturePolicy:
    """Return which pictures of goals and candidates a suite wants, and how they are drawn."""
    return PicturePolicy(images.source, images.layout, images.order, picture_style(images))


def assembly_pictures(suite: Suite, shop: Workshop | None = None) -> Pictures:
    """Pictures of goals and candidates as a suite wants them, drawn in a shop of their own or this
    one.
    """
    return Pictures(picture_folder(), picture_policy(suite.images), shop or render_workers())


def check_drawn(suite: Suite, reason: str) -> None:
    """Raise SpecError, with the reason, for a suite that takes pictures from the data set."""
    if suite.images.source == "dataset":
        where, hint = (
            suite.where("images", "source"),
            "render the pictures: --set images.source=render",
        )
        raise SpecError(Problem(where, reason, "images.source", "dataset", hint=hint))


def task_showing(
    suite: Suite,
    section: type[PictureControls],
    name: str,
    tasks: Sequence[AssemblyTask],
    pool: Sequence[AssemblyTask],
) -> TaskShowing:
    """Return how a suite shows the scenes of a track, whose section is of this type and name.

    Raises SpecError where another goal is wanted and `pool` has none for one of `tasks`.
    """
    controls = suite.section(section)
    how = Showing(suite.candidates.order, controls.blind, controls.wrong_image, suite.seeds)
    return TaskShowing(how, tasks, pool, f"{name}.wrong_image")


def template_prompt(suite: Suite, name: str) -> TemplatePrompt:
    """The prompt of a track: the suite's own template, else the bundled one for its format.

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


def count_sample(track: str, item: Any, judged: Any) -> Mapping[str, tuple[float, ...]]:
    """Return the counts of one sample that the measures of a track need, by name of the counts.

    `judged` is the judgement of the reply, or the episode once it has ended. Where a measure does
    not count a sample, its counts are empty: they are absent where a record was written before the
    measure was there, and `phyblock score` fills them in.
    """
    counts = {name: count(item, judged) for name, count in _sorts(track).items()}
    return {
        name: tuple(float(number) for number in numbers or ()) for name, numbers in counts.items()
    }


def _sorts(track: str) -> dict[str, Callable[[Any, Any], Sequence[float] | None]]:
    """Return the functions that count a sample of a track, by name of the counts."""
    added: list[SampleCounts] = [measure.counted for measure in added_measures(track)]
    return {
        counted.name: counted.sample
        for counted in (*kind_of(track).counted, *added)
        if counted.sample is not None
    }


class _SentPictures(Protocol):
    async def of(self, shown: Any) -> tuple[Image, ...]: ...

    def outline(self, shown: Any) -> tuple[tuple[Image, ...], bool]: ...

    def keys(self, shown: Any) -> tuple[str, ...]: ...

    def close(self) -> None: ...


PicturesT = TypeVar("PicturesT", bound=_SentPictures)


class AskedOnce(ABC, Generic[ItemT, PicturesT]):
    """Asks once about an item, with pictures; how replies are judged is the track's."""

    items: Sequence[ItemT]

    def __init__(
        self,
        prompt: Prompt | None,
        pictures: PicturesT | None,
        examples: Examples[ItemT] | None = None,
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording; `examples` are in
        the form in which they are shown.
        """
        self.template = "" if prompt is None else prompt.name
        self._prompt = prompt
        self._pictures = pictures
        self._examples: Examples[ItemT] = examples or Examples((), 0)
        self._worked: dict[str, WorkedExample] = {}

    @abstractmethod
    def facts(self, item: ItemT, pictures: tuple[Image, ...]) -> dict[str, object]:
        """Return the variables of templates; nothing in it gives an answer away."""

    @abstractmethod
    def _subject(self, item: ItemT) -> object:
        """Return the subject of baselines."""

    @abstractmethod
    def _form(self, item: ItemT) -> AnswerForm[Any] | None:
        """The form in which an answer is asked for; None where that is text."""

    @abstractmethod
    def _pictured(self, item: ItemT) -> object | None:
        """Return the drawing of an item; None where none is sent."""

    def _pictured_for(self, item: ItemT, _seed: int) -> object | None:
        """Return the drawing that a seed sends: that of the item, unless the track differs."""
        return self._pictured(item)

    def _forms(self) -> Sequence[ItemT]:
        """All items, in every form in which they are shown."""
        return self.items

    def _right_answer(self, item: ItemT) -> str:
        """Return the answer of a worked example; of tracks that show such."""
        raise NotImplementedError(f"there is no worked example of {item.key}")

    def identity(self) -> dict[str, Any]:
        """Name and version of the prompt, a digest of all that decides the pictures, and the worked
        examples where there are any.
        """
        if self._prompt is None or self._pictures is None:
            return {"prompt": None, "pictures": None}
        examples = self._examples.used(self.items)
        pictured = map(self._pictured, (*self._forms(), *examples))
        keys = [self._pictures.keys(shown) for shown in pictured if shown is not None]
        return {
            "prompt": {"name": self._prompt.name, "version": self._prompt.version},
            "pictures": hex_digest(json.dumps(keys)),
            **({"examples": [example.key for example in examples]} if examples else {}),
        }

    async def request(
        self, item: ItemT, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """The request of one sample; without messages for models that need none."""
        if not with_messages or self._prompt is None or self._pictures is None:
            return Request(item.key, seed, (), params, "", self._subject(item))
        for one in self._examples.of(item):
            if one.key not in self._worked:
                pictures = await self._images(self._pictures, self._pictured(one))
                self._worked[one.key] = self._example(one, self._prompt, pictures)
        shots = Shots(tuple(self._worked[one.key] for one in self._examples.of(item)))
        pictures = await self._images(self._pictures, self._pictured_for(item, seed))
        return self._request(item, seed, params, self._prompt, pictures, shots)

    def outlines(self, item: ItemT) -> Iterator[tuple[Request, bool]]:
        """The one request, made without rendering, and whether its pictures are the real ones."""
        if self._prompt is None or self._pictures is None:
            yield Request(item.key, 0, (), {}, "", self._subject(item)), True
            return
        examples = []
        pictures, are_real = self._outline(self._pictures, self._pictured_for(item, 0))
        for one in self._examples.of(item):
            its_pictures, is_real = self._outline(self._pictures, self._pictured(one))
            examples.append(self._example(one, self._prompt, its_pictures))
            are_real = are_real and is_real
        shots = Shots(tuple(examples))
        yield self._request(item, 0, {}, self._prompt, pictures, shots), are_real

    def close(self) -> None:
        """Stop the processes that draw pictures and work things out."""
        if self._pictures is not None:
            self._pictures.close()

    async def _images(self, pictures: PicturesT, shown: object | None) -> tuple[Image, ...]:
        return () if shown is None else await pictures.of(shown)

    def _outline(self, pictures: PicturesT, shown: object | None) -> tuple[tuple[Image, ...], bool]:
        return ((), True) if shown is None else pictures.outline(shown)

    def _example(self, item: ItemT, prompt: Prompt, pictures: tuple[Image, ...]) -> WorkedExample:
        *_, question = prompt.messages(pictures, self.facts(item, pictures))
        return WorkedExample(item.key, question, self._right_answer(item))

    def _request(
        self,
        item: ItemT,
        seed: int,
        params: Mapping[str, object],
        prompt: Prompt,
        pictures: tuple[Image, ...],
        shots: Shots,
    ) -> Request:
        messages = prompt.messages(pictures, self.facts(item, pictures))
        return Request(
            item.key,
            seed,
            shots.before(messages),
            params,
            prompt.version,
            self._subject(item),
            response_format(self._form(item)),
            examples=shots.keys,
        )


AS_IN_FILE = TaskShowing(Showing())
"""Scenes as the file has them."""


class _Rules(Protocol):
    def form(self, item: AssemblyTask) -> AnswerForm[Any] | None: ...


RulesT = TypeVar("RulesT", bound=_Rules)


class WholePlanTrack(AskedOnce[AssemblyTask, PicturesT], Generic[RulesT, PicturesT]):
    """Asks once about a scene, as a seed shows it."""

    def __init__(
        self,
        rules: RulesT,
        prompt: Prompt | None,
        pictures: PicturesT | None,
        items: Sequence[AssemblyTask],
        showing: TaskShowing,
        examples: Examples[AssemblyTask] | None = None,
    ) -> None:
        """See `AskedOnce`."""
        super().__init__(prompt, pictures, examples)
        self.rules = rules
        self.items = items
        self._showing = showing

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """The scene as a seed shows it."""
        return self._showing.of(item, seed)

    def about(self, item: AssemblyTask) -> dict[str, Any]:
        """Return how the scene is shown, where not as the file has it."""
        return showing_fields(item)

    def facts(self, item: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """Return the variables of templates; nothing in it gives an answer away."""
        return {
            "pictures": [picture.label for picture in pictures],
            "n_candidates": len(item.candidates),
            "is_blind": self._showing.how.blind,
            **form_facts(self._form(item)),
        }

    def _form(self, item: AssemblyTask) -> AnswerForm[Any] | None:
        return self.rules.form(item)

    def _pictured(self, item: AssemblyTask) -> AssemblyTask:
        return item

    def _forms(self) -> Sequence[AssemblyTask]:
        return [self.shown(task, seed) for seed in self._showing.seeds for task in self.items]
