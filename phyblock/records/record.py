"""Lines of a run's files: replies, records, calls, prompts, batches.

`Record` has the fields of all tracks; a track adds its own in a subclass, with its name as `track`.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from phyblock.config.suite import Variant
from phyblock.config.validation import problems_of
from phyblock.config.yaml import FieldPath, YamlSource
from phyblock.domain.scene import AssemblyTask, Block
from phyblock.errors import DataError, InputError, Problem, StoreError
from phyblock.files import load_json
from phyblock.text import plain_sum, well_formed
from phyblock.types import Finish, Outcome, Role

LARGEST_WHOLE = 2**53


def _finite(value: Any) -> Any:
    """Return a value of an undeclared field if JSON can hold it."""
    json.dumps(value, allow_nan=False)
    return value


class Line(BaseModel):
    """A JSON object in a run's files, or a part of one.

    Given fields, also unknown ones, are written in declared order: a line stays as it was read.
    """

    # Building is deferred because most commands read one kind of line, if any.
    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False, defer_build=True)
    __pydantic_extra__: dict[str, Annotated[Any, AfterValidator(_finite)]] = Field(init=False)

    def as_given(self) -> dict[str, Any]:
        """Return the given fields unchanged, in the order of writing."""
        return {name: value for name, value in self if name in self.model_fields_set}

    def fields(self) -> dict[str, Any]:
        """Return the given fields as plain values, as they are written."""
        return self.model_dump(exclude_unset=True)

    def as_json(self) -> str:
        """Return the line as JSON, without a newline at its end."""
        return json.dumps(self.fields(), allow_nan=False)


LineT = TypeVar("LineT", bound=Line)
ValueT = TypeVar("ValueT")

Whole = Annotated[int, Field(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)]
"""An integer that tables can hold and add up."""
Amount = Annotated[float, Field(allow_inf_nan=False)]
"""A finite number."""
Usd = Annotated[float, Field(ge=0, allow_inf_nan=False)]
"""A finite amount of money [US dollars], at least 0."""


def validated(
    kind: type[LineT], raw: object, source: YamlSource | str, base: FieldPath = ()
) -> LineT:
    """Return data at `base` of a source as a line. Raises DataError with all problems."""
    try:
        return kind.model_validate(raw)
    except ValidationError as error:
        raise DataError(problems_of(error, kind, raw, source, base)) from None


def decode(
    adapter: TypeAdapter[ValueT], data: bytes, where: str, kind: type[BaseModel] = Line
) -> ValueT:
    """Return JSON text as validated by `adapter`, without type coercion.

    Raises DataError with all problems; `kind` is the model. Lone surrogates become U+FFFD.
    """
    try:
        return adapter.validate_json(data, strict=True)
    except ValidationError:
        pass  # Only invalid lines are decoded again, to find the reason.
    try:
        value = _storable(load_json(data.decode("utf-8")))
    except json.JSONDecodeError as error:
        place = f"{error.lineno}:{error.colno}" if b"\n" in data.rstrip() else f"{error.colno}"
        raise DataError(Problem(f"{where}:{place}", f"is not JSON: {error.msg}")) from error
    except ValueError as error:
        message = "is not UTF-8" if isinstance(error, UnicodeDecodeError) else str(error)
        raise DataError(Problem(where, message)) from error
    try:
        return adapter.validate_json(json.dumps(value), strict=True)
    except ValidationError as error:
        raise DataError(problems_of(error, kind, value, where)) from None


def not_a(noun: str, error: InputError, hint: str) -> StoreError:
    """Return the error that a file of a run is not a `noun`, with its problems."""
    return StoreError(
        replace(one, message=f"is not a {noun}: {one.message}", hint=hint) for one in error.problems
    )


def _storable(value: Any) -> Any:
    """Return a decoded value with texts that UTF-8 can encode."""
    if isinstance(value, str):
        return well_formed(value)
    if isinstance(value, list):
        return [_storable(below) for below in value]
    if isinstance(value, dict):
        return {well_formed(name): _storable(below) for name, below in value.items()}
    return value


BatchEvent = Literal["intended", "created", "lost", "ended"]
ErrorKind = Literal["retryable", "sample", "refused", "unavailable", "unjudged"]

_NumberT = TypeVar("_NumberT", int, float)


def _within(number: _NumberT | None, least: int) -> _NumberT | None:
    return number if number is not None and least <= number <= LARGEST_WHOLE else None


class Usage(Line):
    """Tokens of a reply as counted by the provider; null: not reported."""

    prompt_tokens: Whole | None = None
    """Tokens of the prompt, including pictures."""
    completion_tokens: Whole | None = None
    """Tokens of the reply."""
    reasoning_tokens: Whole | None = None
    """The part of `completion_tokens` spent on reasoning."""
    cached_tokens: Whole | None = None
    """The part of `prompt_tokens` that the provider read from its prompt cache."""
    cache_write_tokens: Whole | None = None
    """The part of `prompt_tokens` that it wrote to its prompt cache and bills as such."""


class Reply(Line):
    """A reply of a model."""

    text: str
    """The answer."""
    reasoning: str = ""
    """The reasoning that the provider returned with it."""
    finish: Finish = "stop"
    """The reason why it ended: by itself, at the token limit, by a content filter, or unknown."""
    usage: Usage = Usage()
    """Its tokens."""
    cost_usd: Usd | None = None
    """Its price [US dollars]; null: unknown."""
    billed_usd: Usd | None = None
    """Amount that `max_cost_usd` counts [US dollars], including failed attempts; a reply without
    token counts counts at its highest possible cost. null: no price is known."""
    latency_s: Amount = 0.0
    """Time of the successful request [s]."""
    provider_model: str = ""
    """The model that the provider reports."""
    attempts: Whole = 1
    """Number of requests sent for it; 0 from the cache."""
    cached: bool = False
    """True if it came from the cache."""
    seed_sent: bool = True
    """True if a seed was sent; if not, seeds are independent repeats."""
    batched: bool = False
    """True if it came in a batch, at the batch price."""

    def storable(self) -> Self:
        """Return the reply with all its fields, ready to be written.

        It is paid for, so nothing is an error: absurd numbers are unknown, lone surrogates U+FFFD.
        """
        held, usage = vars(self), self.usage
        fields = {name: held[name] for name in Reply.model_fields}
        fields |= {name: well_formed(one) for name, one in fields.items() if isinstance(one, str)}
        fields |= {name: _within(held[name], 0) for name in ("cost_usd", "billed_usd")}
        known = {name: getattr(usage, name) for name in Usage.model_fields}
        counts = {name: _within(count, -LARGEST_WHOLE) for name, count in known.items()}
        return self.model_copy(update={**fields, "usage": usage.model_copy(update=counts)})

    @property
    def limit_usd(self) -> float:
        """Amount that a limit counted for it, else its cost, unless another run paid it."""
        if self.billed_usd is not None:
            return self.billed_usd
        return 0.0 if self.cached else self.cost_usd or 0.0


class StoredError(Line):
    """The reason why there is no reply, or no judgement of it."""

    kind: ErrorKind
    """`retryable`: every attempt failed; `sample`: this request cannot succeed; `refused`: by a
    content policy; `unjudged`: there is a reply, but no engine could execute it."""
    status: Whole | None = None
    """HTTP status; null: none."""
    message: str = ""
    """Its message."""
    billed_usd: Usd | None = None
    """As in a reply."""


class SentImage(Line):
    """A picture that was sent."""

    label: str
    """Its content: goal, candidates, ..."""
    sha256: str
    """Digest of the bytes sent."""
    width_px: Whole
    """Width [pixels]."""
    height_px: Whole
    """Height [pixels]."""


class SentPrompt(Line):
    """The prompt that was sent."""

    template: str
    """Name of the template."""
    version: str
    """Digest of the template."""
    messages: str
    """Digest of the prompt as sent, which is in `prompts.jsonl`."""
    images: tuple[SentImage, ...] = ()
    """The pictures in the order sent."""


class Score(Line):
    """Steps counted by one criterion under one setting."""

    criterion: str
    """The rule by which steps count."""
    matcher: str | None = None
    """The rule that matches steps and goal blocks; null: the criterion leaves no choice."""
    setting: str
    """`A`: with orientation; `B`: without."""
    tp: Whole
    """Right steps."""
    fp: Whole
    """Wrong steps."""
    fn: Whole
    """Missing blocks."""
    errors: dict[str, Whole] | None = None
    """Number of wrong steps by type; null: the criterion has no types."""
    placed: tuple[Whole | None, ...] | None = None
    """The goal block, from 0, that each step placed, or null."""
    why: tuple[str | None, ...] | None = None
    """The error type of each wrong step, null for right ones."""
    blocks: dict[str, Whole] | None = None
    """Number of goal blocks by outcome; null: the criterion has no outcomes."""
    kept: Whole | None = None
    """Number of steps that the nearest valid order keeps."""


class Course(NamedTuple):
    """An assembly: each step by its named candidate, with its error type (None: right), the number
    of goal blocks missing at the end, and the ending of an episode.
    """

    steps: tuple[tuple[str, str | None], ...]
    missing: int
    ending: str = ""


class AskedTurn(Line):
    """One request of an episode, with its reply."""

    n: Whole
    """Its place in the episode, from 1."""
    reply: Reply
    """The reply."""
    prompt: SentPrompt | None = None
    """The prompt that was sent."""


class ShownScene(Line):
    """The presentation of a scene that differs from the file."""

    order: tuple[Whole, ...]
    """The number in the file of each candidate, in the order shown."""
    blind: bool
    """True if its goal was not shown."""


class Record(Line):
    """A sample's stored outcome."""

    sample: str
    """`track/model/key/s<seed>`, and `/` with its `variant` if it has one; unique in the run."""
    track: str
    """The track."""
    model: str
    """The model."""
    key: str
    """Name of the item in its track: the scene, or the question."""
    scene: str
    """The scene."""
    levels: tuple[Whole, ...]
    """Levels that the scene counts in."""
    parents: tuple[str, ...] = ()
    """Base scenes that the scene was made from."""
    n_blocks: Whole
    """Number of blocks in the goal."""
    seed: Whole
    """The seed."""
    outcome: Outcome
    """The outcome of the request."""
    reply: Reply | None
    """The reply; null: none. For an episode, all its replies combined."""
    error: StoredError | None
    """The error; null: none."""
    prompt: SentPrompt | None = None
    """The prompt, in an episode that of the first turn; null for recordings and baselines."""
    parse: Any = None
    """The parsed answer, in the form of its track; null: none."""
    scores: tuple[Score, ...]
    """Counts for every setting, matcher and criterion; none for questions."""
    time: str = ""
    """Time when it was written, UTC."""
    run: str = ""
    """Digest of its run."""
    shown: ShownScene | None = None
    """The presentation of the scene; null: as in the file."""
    asked: Literal["prompt", "response_format"] | None = None
    """Place where a JSON answer was requested: only the `prompt`, or also the request's
    `response_format`; null: text was requested, or no model was called."""
    variant: dict[str, str] = Field(default_factory=dict)
    """Factors in which the condition differs from the run's reference, with their levels."""
    counts: dict[str, tuple[Amount, ...]] = Field(default_factory=dict)
    """Counts of measures besides `scores`, by name."""

    exported: ClassVar[Mapping[str, tuple[str, str]]] = {}
    """Columns that the track adds to exports, with their types in pandas and their fields."""

    def export_row(self) -> Mapping[str, Any]:
        """The values of `exported`, None for missing ones."""

        def value(path: str) -> Any:
            found: Any = self
            for name in path.split("."):
                found = None if found is None else getattr(found, name)
            return found

        return {column: value(path) for column, (_, path) in self.exported.items()}

    @property
    def part(self) -> str | None:
        """The item's part of its track, such as a subtask, or None."""
        return None

    @property
    def is_correct(self) -> bool | None:
        """True if it is right, False if it is wrong, None if there are degrees."""
        return None

    @property
    def target(self) -> str:
        """The one right answer, or ""."""
        return ""

    @property
    def parsed_text(self) -> str | None:
        """The parsed answer, in short."""
        plan = getattr(self.parse, "plan", None)
        return None if plan is None else " ".join(map(str, plan))

    def course(self, matcher: str) -> Course | None:
        """Return the steps of an assembly by a matcher, else by the first that scored it."""
        assemblies = (score for score in self.scores if score.why is not None)
        score = min(assemblies, key=lambda one: one.matcher != matcher, default=None)
        if score is None:
            return None
        names = (self.parsed_text or "").split()
        return Course(tuple(zip(names, score.why or (), strict=False)), score.fn)

    def built(self, _task: AssemblyTask) -> tuple[Block, ...]:
        """Return the blocks in the world at the end, for its scene as presented."""
        return ()

    @property
    def asked_turns(self) -> tuple[AskedTurn, ...]:
        """The requests of an episode; empty for a single request."""
        return ()

    @property
    def way(self) -> Variant:
        """The condition: the levels of the factors that the suite varies."""
        return Variant(tuple(self.variant.items()))

    @property
    def item(self) -> str:
        """The name of its item in its track, as in tables."""
        return self.key

    @property
    def group(self) -> str:
        """The name of the samples that may count together: its item."""
        return self.item

    @property
    def named(self) -> str:
        """The id made from its other fields."""
        variant = f"/{self.way.key}" if self.variant else ""
        return f"{self.track}/{self.model}/{self.item}/s{self.seed}{variant}"

    @property
    def is_answered(self) -> bool:
        """True if the model answered, even by refusing; a recording may have no reply."""
        return self.error is None or self.error.kind in ("refused", "unjudged")

    @property
    def is_judged(self) -> bool:
        """True if its reply was judged, or there is none."""
        return self.error is None or self.error.kind != "unjudged"

    @property
    def is_final(self) -> bool:
        """True if it is not asked again: it has a reply, or an error that would recur."""
        return self.error is None or self.error.kind in ("refused", "sample", "unjudged")

    @property
    def replies(self) -> tuple[Reply, ...]:
        """All its single replies."""
        return () if self.reply is None else (self.reply,)

    @property
    def paid_usd(self) -> float | None:
        """Cost of replies that are not from the cache [US dollars]; None if a price is unknown."""
        paid = [reply.cost_usd for reply in self.replies if not reply.cached]
        known = [cost for cost in paid if cost is not None]
        return plain_sum(known) if len(known) == len(paid) else None

    @property
    def limit_usd(self) -> float:
        """Amount that the run's cost limit counted for this line [US dollars]."""
        if self.reply is not None:
            return self.reply.limit_usd
        return 0.0 if self.error is None else self.error.billed_usd or 0.0


class Call(Line):
    """A call to a model: written before it is sent, and again when it has ended."""

    call: Whole
    """Its number in the run, from 0."""
    model: str
    """The model."""
    sample: str = ""
    """The sample of the call."""
    key: str
    """Digest of everything that determines the reply, as in the reply cache."""
    run: str
    """Digest of its run."""
    most_usd: Usd | None = None
    """The most that it can cost [US dollars], as estimated before it is sent; null: unknown."""
    ended: bool = False
    """True if its end is known: a reply, or an error."""
    billed_usd: Usd | None = None
    """Its cost [US dollars], or the highest possible if unknown; null: the price is unknown."""
    reply: Reply | None = None
    """The reply as it arrived, before it was judged; null: none."""


class PictureMark(Line):
    """The mark of a picture in a message."""

    image: str
    """Label of the picture."""


class PromptMessage(Line):
    """One chat message."""

    role: Role
    """The speaker."""
    parts: tuple[str | PictureMark, ...]
    """Texts and pictures in the order sent."""


class Prompt(Line):
    """A prompt as it was sent."""

    sha256: str
    """Digest of the messages, by which records refer to it."""
    messages: tuple[PromptMessage, ...]
    """The messages that were sent."""


class BatchLine(Line):
    """An event of a batch of requests; the first line of each is written before it is sent."""

    batch: str
    """phyblock's name for it, which is sent to the provider so that it can be found again."""
    model: str
    """Name of the model."""
    event: BatchEvent
    """`intended`: it is about to be sent; `created`: the provider has it; `lost`: the provider does
    not have it, and nothing was asked; `ended`: its answers are in `batches/`."""
    time: str
    """Time of the event, UTC."""
    id: str = ""
    """The provider's name for it."""
    keys: tuple[str, ...] = ()
    """Requests of an intended batch in their order, by their keys in the reply cache."""
    most_usd: tuple[Usd, ...] = ()
    """The most that each request of an intended batch can cost; empty: no price is known."""
    words: str = ""
    """The reason why it was lost, or the state in which it ended."""


class Stopped(Line):
    """Reasons why the last session on a run did not finish; the file exists only if it has any."""

    models: dict[str, str] = Field(default_factory=dict)
    """The reasons why models were stopped, by name."""
    run: str = ""
    """The reason why the whole run was stopped; empty: it was not."""
