"""Suites: which models are asked about which scenes, how, and what is made of the replies."""

from __future__ import annotations

import filecmp
import functools
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path, PurePath
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    create_model,
    model_validator,
)

from phyblock.config.models import (
    GROUP,
    RECORDED,
    ModelConfig,
    SamplingSpec,
    group_names,
    unknown_model,
    with_members,
)
from phyblock.config.validation import (
    MOST_HINTS,
    Count,
    ModelName,
    Section,
    TimeoutS,
    Unique,
    UniqueSome,
    check,
    check_unique,
    find_secrets,
    merge_problems,
    refuse,
)
from phyblock.config.yaml import (
    FieldPath,
    YamlSource,
    apply_overrides,
    dotted,
    expand,
    read_yaml,
    show,
    sort_problems,
)
from phyblock.errors import Problem, SpecError
from phyblock.registry import (
    PUBLISHED_TABLE,
    baseline_names,
    known_track,
    known_tracks,
    table_names,
)
from phyblock.text import did_you_mean
from phyblock.types import (
    AnswerFormat,
    Background,
    CandidateOrder,
    CandidateScale,
    Criterion,
    DataFormat,
    Matcher,
    MissingPolicy,
    PictureLayout,
    PictureName,
    PictureSource,
    PlanParser,
    Setting,
    View,
)

PROMPT_WORDS = ("default", "official")


def _check_prompt(prompt: str) -> str:
    if prompt in PROMPT_WORDS or prompt.endswith(".j2"):
        return prompt
    raise refuse(
        "is neither a known prompt nor a template",
        allowed="default, official, or the path of a .j2 file",
        words=PROMPT_WORDS,
    )


Prompt = Annotated[
    str,
    AfterValidator(_check_prompt),
    Field(json_schema_extra={"pattern": r"^(default|official|.*\.j2)$"}),
]


class DatasetSpec(Section):
    """Which scenes are run."""

    format: DataFormat = Field(
        default="builtin",
        description="builtin: the project's own format. official: a checkout of the official "
        "PhyBlock repository.",
    )
    path: str | None = Field(
        default=None,
        min_length=1,
        description="builtin: the name of a bundled data set (phyblock-400 when left out) or a "
        "folder that holds scenes.jsonl (write ./name for a folder beside the suite). official: "
        "the checkout's folder. Relative to the suite file, or to the working directory when "
        "given by --set; ~ and $VARIABLES are expanded.",
    )


class ImagesSpec(Section):
    """Which pictures a model is shown."""

    later: ClassVar[tuple[str, ...]] = ("view",)

    source: PictureSource = Field(
        default="render",
        description="render: drawn from the scene. dataset: the official composites, or "
        "their two halves apart; a scene without one is an error.",
    )
    layout: PictureLayout = Field(
        default="composite",
        description="composite: goal and candidates in one picture. separate: two pictures.",
    )
    order: Annotated[
        tuple[PictureName, ...],
        Field(min_length=2, max_length=2, json_schema_extra={"uniqueItems": True}),
        AfterValidator(check_unique),
    ] = Field(
        default=("goal", "candidates"), description="Order in which separate pictures are sent."
    )
    candidate_scale: CandidateScale = Field(
        default="common",
        description="common: all rendered candidates of a grid are drawn at one scale. fit: each "
        "fills its cell. The prompt says which.",
    )
    size_px: Annotated[int, Field(strict=True, ge=128, le=2048)] = Field(
        default=512, description="Edge of a rendered picture [pixels]."
    )
    view: View = Field(
        default="oblique",
        description="Where rendered scenes and candidates are seen from; questions have views of "
        "their own.",
    )
    background: Background | None = Field(
        default=None,
        description="Ground of all rendered pictures, one of the paper's six; the checkerboard is "
        "dark. null: each question's own, and the checkerboard for all else.",
    )


class CandidatesSpec(Section):
    """How candidates are offered."""

    order: CandidateOrder = Field(
        default="file",
        description="file: numbered as in the data. shuffled: each seed draws another order for "
        "every scene, the same for all models; numbers in pictures, prompts and replies go along.",
    )


class ScoringSpec(Section):
    """How replies are scored."""

    later: ClassVar[tuple[str, ...]] = ("extractor",)

    matchers: UniqueSome[Matcher] = Field(
        default=("optimal", "paper"),
        description="optimal: interchangeable blocks are matched so that most steps count. paper: "
        "greedy, the paper's Algorithm 1. The first one makes the headline numbers.",
    )
    level1: Criterion = Field(
        default="selection",
        description="Criterion of Level 1. selection: one-to-one, order ignored. membership: what "
        "the paper's Level-1 columns are. aov: as at the other levels.",
    )
    missing: MissingPolicy = Field(
        default="count",
        description="A missing reply: count its blocks as not placed, or skip the scene (as the "
        "paper did).",
    )
    extractor: str | None = Field(
        default=None,
        description="A model of the models file that is sent the text of replies from which "
        "nothing could be read, and copies what they say into the asked form; its calls count "
        "against limits.max_cost_usd. Null: such replies stay unread.",
    )


class LimitsSpec(Section):
    """Bounds of a run; they change how fast results come, not what they are."""

    later: ClassVar[tuple[str, ...]] = ("batch_poll_s",)

    max_concurrency: Count = Field(
        default=64, description="Calls under way at once, over all models."
    )
    max_attempts: Count = Field(
        default=8,
        description="Requests that must have failed before a sample is given up. More are sent "
        "until retry_for_s is over, but for answers that were paid for and cannot be read.",
    )
    retry_for_s: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] = Field(
        default=300.0,
        description="Outage that is outlasted [s]: a sample is not given up sooner after its first "
        "failure, and a model whose server cannot be reached for longer is stopped.",
    )
    max_connection_failures: Count = Field(
        default=20,
        description="Failures to reach a server, one after another, after which its models are "
        "stopped where it has not answered once in this run; as many answers with HTTP 2xx that "
        "hold no reply, where it has not given one.",
    )
    timeout_s: TimeoutS = Field(default=300.0, description="Longest wait for one reply [s].")
    batch_poll_s: Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)] = Field(
        default=60.0,
        description="Longest pause between two looks at a batch [s], for models with batch: true.",
    )
    max_cost_usd: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] | None = Field(
        default=None,
        description="The run stops before it costs more than this [USD]; null: no bound.",
    )


REPEAT = "repeats"
"""The factor that changes nothing that is sent: its levels ask the same again."""


@dataclass(frozen=True)
class Variant:
    """The factors in which a way of asking differs from the reference of its run, with levels.

    Another run may have another reference: only where two suites vary alike do names agree.
    """

    levels: tuple[tuple[str, str], ...] = ()

    @property
    def key(self) -> str:
        """What its run calls it: `background=lawn,repeats=2`, "" for the reference."""
        return ",".join(f"{factor}={level}" for factor, level in self.levels)

    @property
    def repeat(self) -> int:
        """For which time the same is asked, from 1."""
        return int(dict(self.levels).get(REPEAT, "1"))

    @property
    def shown(self) -> Variant:
        """What of it changes what is sent, alike for all repeats."""
        return Variant(tuple(pair for pair in self.levels if pair[0] != REPEAT))


FACTORS: Mapping[str, tuple[str, ...] | None] = {
    "prompt": None,
    "background": ("images", "background"),
    "view": ("images", "view"),
    "candidate_order": ("candidates", "order"),
    "layout": ("images", "layout"),
    "examples": ("examples",),
    REPEAT: None,
}
"""Factors with the path of the field that each gives values to; every track names its prompt in a
field of its own."""
_MOST_VARIANTS = 1000

LevelT = TypeVar("LevelT")
SpecT = TypeVar("SpecT", bound=BaseModel)


def _check_levels(levels: tuple[LevelT, ...]) -> tuple[LevelT, ...]:
    if len(levels) < 2:
        raise refuse("needs levels to compare", allowed="two or more, the reference first")
    return levels


Levels = Annotated[
    tuple[LevelT, ...],
    AfterValidator(check_unique),
    AfterValidator(_check_levels),
    Field(json_schema_extra={"uniqueItems": True, "minItems": 2}),
]


ExampleCount = Annotated[int, Field(strict=True, ge=0, le=16)]


class VarySpec(Section):
    """Ways of asking that are crossed; the first level of each is the reference."""

    later: ClassVar[tuple[str, ...]] = (*FACTORS, "design")

    prompt: Levels[Prompt] = Field(
        default=(), description="Prompts, as in the track's own field; for suites of one track."
    )
    background: Levels[Background] = Field(
        default=(), description="Grounds of rendered pictures, as images.background."
    )
    view: Levels[View] = Field(
        default=(), description="Where rendered scenes are seen from, as images.view."
    )
    candidate_order: Levels[CandidateOrder] = Field(
        default=(), description="Orders of the candidates, as candidates.order."
    )
    layout: Levels[PictureLayout] = Field(
        default=(), description="Layouts of pictures, as images.layout."
    )
    examples: Levels[ExampleCount] = Field(
        default=(), description="Numbers of worked examples, as examples."
    )
    repeats: Annotated[int, Field(strict=True, ge=1, le=100)] = Field(
        default=1,
        description="How often the same is asked, each time anew: the cache answers none but the "
        "first, and the provider is sent another seed.",
    )
    design: Literal["crossed", "one_at_a_time"] = Field(
        default="crossed",
        description="crossed: every level with every level of the others. one_at_a_time: each "
        "factor alone, the others at their reference; both ask each repeatedly.",
    )

    @model_validator(mode="after")
    def _check_size(self) -> Self:
        names = list(self.names("prompt"))
        if twice := sorted({name for name in names if names.count(name) > 1}):
            allowed = "templates of different names"
            raise refuse(f"has two templates called {twice[0]}", at=("prompt",), allowed=allowed)
        if (n := self.n_variants) > _MOST_VARIANTS:
            allowed = f"{_MOST_VARIANTS:,} ways of asking at most"
            hint = "take levels out, or set vary.design to one_at_a_time"
            raise refuse(f"crosses to {n:,} ways of asking", allowed=allowed, hint=hint)
        return self

    @property
    def factors(self) -> tuple[str, ...]:
        """The factors that have several levels."""
        return tuple(name for name in FACTORS if len(self.values(name)) > 1)

    def values(self, factor: str) -> tuple[Any, ...]:
        """The levels of a factor as fields of the suite take them."""
        levels = getattr(self, factor)
        return tuple(range(1, levels + 1)) if factor == REPEAT else tuple(levels)

    def names(self, factor: str) -> tuple[str, ...]:
        """The levels of a factor as records and tables name them: of a template, its file's."""
        return tuple(_name(value) for value in self.values(factor))

    @property
    def n_variants(self) -> int:
        """How many ways of asking there are."""
        sizes = [len(self.values(name)) for name in self.factors if name != REPEAT]
        n = 1 + sum(size - 1 for size in sizes)
        if self.design == "crossed":
            n = 1
            for size in sizes:
                n *= size
        return n * self.repeats

    @property
    def variants(self) -> tuple[Variant, ...]:
        """All ways of asking, the reference first, repeats of one behind one another."""
        shown = [name for name in self.factors if name != REPEAT]
        levels = [[(name, level) for level in self.names(name)] for name in shown]
        first = tuple(of_factor[0] for of_factor in levels)
        if self.design == "crossed":
            chosen = list(product(*levels))
        else:
            others = [
                (*first[:place], pair, *first[place + 1 :])
                for place, of_factor in enumerate(levels)
                for pair in of_factor[1:]
            ]
            chosen = [first, *others]
        again = [((REPEAT, name),) if n else () for n, name in enumerate(self.names(REPEAT))]
        return tuple(
            Variant((*(pair for pair in one if pair not in first), *repeat))
            for one in chosen
            for repeat in again
        )

    def value(self, factor: str, level: str) -> Any:
        """The value of a level; ValueError for one that there is not."""
        return self.values(factor)[self.names(factor).index(level)]


def _name(value: object) -> str:
    text = str(value)
    return PurePath(text).stem if text.endswith(".j2") else text


def with_values(spec: SpecT, values: Mapping[tuple[str, ...], Any]) -> SpecT:
    """A validated suite or section with other values at these paths of fields."""
    for path, value in values.items():
        name, below = path[0], path[1:]
        inner = with_values(getattr(spec, name), {below: value}) if below else value
        spec = spec.model_copy(update={name: inner})
    return spec


Get = Callable[[str], Any]


@dataclass(frozen=True)
class Rule:
    """One rule.

    `reads` are the dotted fields it looks at; the first is the one to mend, and the error points
    at the first that is written in the file. `broken` gets a reader of fields.
    """

    reads: tuple[str, ...]
    broken: Callable[[Get], bool]
    message: str
    hint: str

    @property
    def field(self) -> str:
        """The dotted field to mend."""
        return self.reads[0]


def _unofficial(get: Get) -> bool:
    return bool(get("dataset.format") != "official")


def _asks_json(get: Get) -> bool:
    return bool(get("answer_format") == "json_schema")


_SET_OFFICIAL = "set dataset.format to official and dataset.path to a checkout"

RULES = (
    Rule(
        ("dataset.path", "dataset.format"),
        lambda get: get("dataset.format") == "official" and get("dataset.path") is None,
        "the official format needs the folder of a checkout of the official repository",
        "give it on the command line: --set dataset.path=FOLDER",
    ),
    Rule(
        ("models", "dataset.format"),
        lambda get: get("models") == "recorded" and _unofficial(get),
        "recorded replies come with the official data set only",
        _SET_OFFICIAL + ", or list the models",
    ),
    Rule(
        ("prompt", "dataset.format"),
        lambda get: get("prompt") == "official" and _unofficial(get),
        "the official prompt is read out of a checkout of the official repository",
        _SET_OFFICIAL + ", or use prompt: default",
    ),
    Rule(
        ("answer_format", "prompt"),
        lambda get: _asks_json(get) and get("prompt") == "official",
        "the official prompt asks for lines of text",
        "use prompt: default, or answer_format: text",
    ),
    Rule(
        ("answer_format", "models"),
        lambda get: _asks_json(get) and get("models") == "recorded",
        "recorded replies were asked for in text",
        "use answer_format: text, or list the models",
    ),
    Rule(
        ("parser", "answer_format"),
        lambda get: _asks_json(get) and get("parser") == "official",
        "the official expression reads no JSON",
        "use parser: steps, or answer_format: text",
    ),
    Rule(
        ("images.source", "dataset.format"),
        lambda get: get("images.source") == "dataset" and _unofficial(get),
        "only the official data set has pictures of its own",
        _SET_OFFICIAL + ", or use images.source: render",
    ),
    Rule(
        ("candidates.order", "images.source"),
        lambda get: get("candidates.order") == "shuffled" and get("images.source") == "dataset",
        "the data set's own pictures show the candidates in the order of the file",
        "use images.source: render, or candidates.order: file",
    ),
    Rule(
        ("candidates.order", "models"),
        lambda get: get("candidates.order") == "shuffled" and get("models") == "recorded",
        "recorded replies name candidates by the numbers of the file",
        "use candidates.order: file, or list the models",
    ),
    Rule(
        ("tables", "dataset.format"),
        lambda get: "published" in get("tables") and _unofficial(get),
        "published numbers compare with the official data set only",
        _SET_OFFICIAL + ", or leave published out of tables",
    ),
    Rule(
        ("scoring.matchers", "tables"),
        lambda get: "published" in get("tables") and "paper" not in get("scoring.matchers"),
        "the published numbers were made by the paper matcher",
        "add paper to scoring.matchers, or leave published out of tables",
    ),
    Rule(
        ("scoring.level1", "tables", "levels"),
        lambda get: (
            "published" in get("tables")
            and 1 in get("levels")
            and get("scoring.level1") != "membership"
        ),
        "the published Level-1 columns are the membership criterion",
        "use scoring.level1: membership, or leave published out of tables",
    ),
    Rule(
        ("settings", "tables"),
        lambda get: "published" in get("tables") and "A" not in get("settings"),
        "the published numbers are those of setting A",
        "add A to settings, or leave published out of tables",
    ),
)


def broken_rules(get: Get, faulty: tuple[str, ...] = ()) -> list[Rule]:
    """The rules that do not hold; one that reads a field of `faulty` is not judged."""
    return [rule for rule in RULES if not _touches(rule, faulty) and rule.broken(get)]


def read_dotted(spec: BaseModel, dotted: str) -> Any:
    """The value of a dotted field of a validated suite."""
    value: Any = spec
    for key in dotted.split("."):
        value = getattr(value, key)
    return value


def _touches(rule: Rule, faulty: tuple[str, ...]) -> bool:
    return any(
        read == field or read.startswith(field + ".") for read in rule.reads for field in faulty
    )


BUILTIN_DATASET = "phyblock-400"
"""The bundled data set that is used when a suite names none."""


def _check_whole(level: object) -> object:
    if type(level) is int:
        return level
    raise refuse("is not a whole number", allowed="1, 2, 3, 4")


Level = Annotated[Literal[1, 2, 3, 4], BeforeValidator(_check_whole)]
SceneName = Annotated[str, Field(min_length=1)]
Seed = Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]


SectionT = TypeVar("SectionT", bound=BaseModel)


def _one_of(name: str, names: Sequence[str]) -> str:
    if name in names:
        return name
    raise refuse("is not one of the choices", allowed=", ".join(names), words=tuple(names))


def _default_tables() -> tuple[str, ...]:
    """Tables of a suite that names none."""
    return tuple(name for name in table_names() if name != PUBLISHED_TABLE)


TrackName = Annotated[str, AfterValidator(lambda name: _one_of(name, tuple(known_tracks())))]
TableName = Annotated[str, AfterValidator(lambda name: _one_of(name, table_names()))]


def _models_tag(value: object) -> str:
    return "word" if isinstance(value, str) else "list"


ModelNames = Annotated[
    Annotated[UniqueSome[ModelName], Tag("list")] | Annotated[Literal["recorded"], Tag("word")],
    Discriminator(_models_tag),
]


def _examples_tag(value: object) -> str:
    return "names" if isinstance(value, list | tuple) else "number"


Examples = Annotated[
    Annotated[ExampleCount, Tag("number")] | Annotated[UniqueSome[SceneName], Tag("names")],
    Discriminator(_examples_tag),
]


@dataclass(frozen=True)
class SuiteFiles:
    """The files that a suite was read from and names.

    `path` is the suite's own; `dataset` the absolute folder of the data set; by track, `folders`
    are those of data of its own, and `templates` the absolute paths of prompts that are files.
    Where prompts vary, `templates` are those of the reference, and `prompts` has the paths of all
    by their texts. `unused` are custom templates that stand in for the bundled one of the other
    form of answers.
    """

    path: Path
    dataset: Path
    source: YamlSource = field(repr=False, compare=False)
    folders: Mapping[str, Path] = field(default_factory=dict)
    templates: Mapping[str, Path] = field(default_factory=dict)
    prompts: Mapping[str, Path] = field(default_factory=dict)
    unused: Mapping[str, Path] = field(default_factory=dict)


class Suite(Section):
    """A suite: which models are asked about which scenes, how, and what is made of the replies.

    Cross-field rules (`RULES`) hold on every instance; pydantic's
    ValidationError is raised where one is broken.
    """

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,63}$")] = Field(
        description="Short name: small letters, digits and hyphens; runs are filed under it."
    )
    description: str = Field(default="", description="One line on what the suite is for.")
    tracks: UniqueSome[TrackName] = Field(
        default_factory=lambda: tuple(known_tracks())[:1], description="What is asked."
    )
    dataset: DatasetSpec = Field(default_factory=DatasetSpec, description="Which scenes are run.")
    levels: UniqueSome[Level] = Field(default=(1, 2, 3, 4), description="Difficulty levels.")
    limit: Count | None = Field(
        default=None,
        description="Items of each track at most, spread over levels or subtasks; null: all. "
        "--limit says another number.",
    )
    settings: UniqueSome[Setting] = Field(
        default=("A", "B"),
        description="A compares type, color and orientation, B type and color. One call is "
        "scored under each.",
    )
    seeds: UniqueSome[Seed] = Field(default=(0,), description="Each seed repeats every question.")
    models: ModelNames = Field(
        description="Names from models.yaml or built-in baselines, group:NAME for all models of a "
        "group; or the word recorded: every folder of recorded replies in the official data."
    )
    prompt: Prompt = Field(
        default="default",
        description="default; official (read out of the official checkout); or the path of a .j2 "
        "template, relative to the suite file.",
    )
    answer_format: AnswerFormat = Field(
        default="text",
        description="text: lines of text. json_schema: one JSON object, of which the prompt says "
        "the schema; it is sent as response_format too where the provider takes one.",
    )
    examples: Examples = Field(
        default=0,
        description="Worked examples that are shown before each question, with a right answer: a "
        "number (drawn by the first of seeds, never a scene that shares a base scene or its goal "
        "with the one asked about), or names of scenes (where one may not be shown, a drawn one "
        "stands in).",
    )
    images: ImagesSpec = Field(
        default_factory=ImagesSpec, description="Which pictures a model is shown."
    )
    candidates: CandidatesSpec = Field(
        default_factory=CandidatesSpec, description="How candidates are offered."
    )
    parser: PlanParser = Field(
        default="steps",
        description="steps: reads the step list and records the rule that matched. official: the "
        "official expression over the whole reply.",
    )
    scoring: ScoringSpec = Field(default_factory=ScoringSpec, description="How replies are scored.")
    sampling: SamplingSpec = Field(
        default_factory=SamplingSpec,
        description="Sampling parameters for models that say nothing of their own.",
    )
    limits: LimitsSpec = Field(
        default_factory=LimitsSpec,
        description="Bounds of a run; they change how fast results come, not what they are.",
    )
    vary: VarySpec = Field(
        default_factory=VarySpec,
        description="Ways of asking that are crossed, to tell how much each of them moves a model.",
    )
    tables: Unique[TableName] = Field(
        default_factory=_default_tables,
        description="Tables to write, as far as they belong to a track of the suite; published "
        "compares with the paper's numbers.",
    )

    later: ClassVar[tuple[str, ...]] = ("limit", "vary", "examples")
    _files: SuiteFiles | None = PrivateAttr(default=None)

    @property
    def files(self) -> SuiteFiles:
        """The files that it was read from and names; LookupError for one without any."""
        if self._files is None:
            raise LookupError(f"the suite {self.name} was not read from a file")
        return self._files

    def with_files(self, files: SuiteFiles) -> Self:
        """Return the suite as one that was read from these files."""
        suite = self.model_copy()
        suite._files = files
        return suite

    def where(self, *path: str | int) -> str:
        """Return the place ("file:line:col" or "--set ...") of a field, for errors found later."""
        return self.files.source.where(path)

    @model_validator(mode="after")
    def _check_rules(self) -> Suite:
        broken = broken_rules(lambda dotted: read_dotted(self, dotted))
        if broken:
            raise refuse("; ".join(f"{rule.field}: {rule.message}" for rule in broken), rules=True)
        return self

    def section(self, model: type[SectionT]) -> SectionT:
        """The section of a track; LookupError where the suite was made without it."""
        values = (getattr(self, name) for name in type(self).model_fields)
        section = next((value for value in values if isinstance(value, model)), None)
        if section is None:
            raise LookupError(f"the suite has no section of {model.__name__}")
        return section

    def at(self, variant: Variant) -> Self:
        """The suite as a variant asks, its other factors at their reference."""
        levels = {name: self.vary.names(name)[0] for name in self.vary.factors}
        values: dict[tuple[str, ...], Any] = {}
        for factor, level in {**levels, **dict(variant.levels)}.items():
            value = self.vary.value(factor, level)
            values |= dict.fromkeys(self.fields_of(factor), value)
        suite = with_values(self, values)
        if self._files is None or "prompt" not in self.vary.factors:
            return suite
        texts = {name: _prompt(suite, name) for name in suite.tracks}
        prompts = self._files.prompts
        templates = {name: prompts[text] for name, text in texts.items() if text in prompts}
        return suite.with_files(replace(self._files, templates=templates))

    def fields_of(self, factor: str) -> tuple[tuple[str, ...], ...]:
        """The paths of the fields that a factor gives values to; none for repeats."""
        if factor == "prompt":
            return tuple(known_tracks()[name].prompt_field for name in self.tracks)
        path = FACTORS[factor]
        return () if path is None else (path,)

    def identity(self) -> dict[str, Any]:
        """What determines the results, as JSON-able data.

        Leaves out description, limits and tables, sections of tracks that are not run, models,
        limit and paths (of data and templates): a run stores which models were run, about which
        items, and the hashes of what stands at the paths, which say more and survive a move. What
        is asked for in text says nothing of the format, as suites did before there was another.
        """
        sections = {kind.section[0]: name for name, kind in known_tracks().items() if kind.section}
        idle = {key for key, track in sections.items() if track not in self.tracks}
        spec = self.model_dump(
            mode="json", exclude={"description", "limit", "limits", "models", "tables", *idle}
        )
        if self.answer_format == "text":
            del spec["answer_format"]
        for section in ("dataset", *sections):
            spec.get(section, {}).pop("path", None)
        for part in (spec, *(spec[key] for key in sections if key in spec)):
            if part.get("prompt", PROMPT_WORDS[0]) not in PROMPT_WORDS:
                part["prompt"] = "template"
        if "prompt" in spec.get("vary", {}):
            spec["vary"]["prompt"] = list(self.vary.names("prompt"))
        return spec


def suite_model() -> type[Suite]:
    """What a suite may hold: `Suite` with the sections of all tracks."""
    return _composed(tuple(kind.section for kind in known_tracks().values() if kind.section))


@functools.cache
def _composed(sections: tuple[tuple[str, type[BaseModel], str], ...]) -> type[Suite]:
    fields: dict[str, Any] = {
        key: (model, Field(default_factory=model, description=description))
        for key, model, description in sections
    }
    return create_model("Suite", __base__=Suite, __doc__=Suite.__doc__, **fields)


_DRAWN = ("background", "view")
"""Factors of pictures that are drawn."""


def vary_problems(suite: Suite, source: YamlSource) -> Iterator[Problem]:
    """What is wrong with the section `vary` of a suite, each fault at its place in the file."""
    for factor in suite.vary.factors:
        at = ("vary", factor)
        unknown = [name for name in suite.tracks if factor not in known_tracks()[name].varies]
        if unknown:
            known = known_tracks()[unknown[0]].varies
            message, allowed = f"has no meaning in {unknown[0]}", ", ".join(known)
            yield Problem(source.where(at, key=True), message, dotted(at), allowed=allowed)
        elif factor == "prompt" and len(suite.tracks) > 1:
            message = "is varied in a suite of several tracks, each of which has its own"
            hint = "run one track at a time"
            yield Problem(source.where(at, key=True), message, dotted(at), hint=hint)
        elif factor in _DRAWN and suite.images.source == "dataset":
            message = "cannot be varied in the data set's own pictures"
            hint = "use images.source: render"
            yield Problem(source.where(at, key=True), message, dotted(at), hint=hint)
        else:
            yield from _conflicts(suite, source, factor)
            yield from _levels(suite, source, factor)


def _conflicts(suite: Suite, source: YamlSource, factor: str) -> Iterator[Problem]:
    """A field that says something else than the reference of the factor that varies it."""
    for path in suite.fields_of(factor):
        value, first = read_dotted(suite, dotted(path)), suite.vary.values(factor)[0]
        if path in source.values and value != first:
            message = f"is varied by vary.{factor}, whose first level is the reference"
            hint = "leave it out, or change vary"
            yield Problem(source.where(path), message, dotted(path), show(value), str(first), hint)


def _levels(suite: Suite, source: YamlSource, factor: str) -> Iterator[Problem]:
    """Levels that break a rule of suites."""
    for place, level in enumerate(suite.vary.names(factor)):
        at = ("vary", factor, place)
        if level == "official" and suite.fields_of(factor) != (("prompt",),):
            message, allowed = "is no prompt of this track", "default, or the path of a .j2 file"
            yield Problem(source.where(at), message, dotted(at), level, allowed)
            continue
        one = suite.at(Variant(((factor, level),)))
        before = broken_rules(lambda name: read_dotted(suite, name))
        for rule in broken_rules(lambda name, one=one: read_dotted(one, name)):  # type: ignore[misc]
            if rule not in before:
                yield Problem(source.where(at), rule.message, dotted(at), level, hint=rule.hint)


_BARE_NAME = re.compile(r"^[A-Za-z0-9][A-Za-z0-9_-]*$")


def load_suite(
    path: Path,
    overrides: Sequence[str] = (),
    *,
    data_dir: Path,
    prompt_dirs: Sequence[Path] = (),
) -> Suite:
    """Read, override and validate a suite.

    `overrides` are "key=value" texts; `data_dir` is the folder of the bundled data sets, where
    bare names are looked up. A file in one of `prompt_dirs` that is called as a bundled prompt is
    used in its place where the suite says `default`. Raises SpecError with all that is wrong, in
    the order of the file.
    """
    source = read_yaml(path)
    apply_overrides(source, overrides)
    if source.data is None:
        raise SpecError([*source.problems, Problem(str(path), "is empty", allowed="a suite")])
    suite, problems = check(suite_model(), source.data, source)
    secrets = list(find_secrets(source.data, source))
    if suite is None and isinstance(source.data, dict):
        problems += _broken_rules(source, problems)
    all_problems = merge_problems(source.problems, secrets, problems)
    if suite is not None:
        all_problems += vary_problems(suite, source)
    if suite is None or all_problems:
        raise SpecError(sort_problems(all_problems))
    # What varies has the values of the reference, wherever one value alone is asked for.
    return _locate(suite.at(Variant()), path, source, data_dir, prompt_dirs)


def suite_tracks(path: Path) -> tuple[str, ...]:
    """The tracks of a suite that is known to be sound, whatever else it still needs to run."""
    default = suite_model().model_fields["tracks"].get_default(call_default_factory=True)
    return tuple(read_yaml(path).data.get("tracks", default))


def resolve_models(suite: Suite, known: Mapping[str, ModelConfig]) -> dict[str, ModelConfig | None]:
    """The suite's models in its order, those of a group in its place; None stands for a built-in
    baseline.

    Raises SpecError for each unknown name, at its place in the suite, and ValueError when the
    suite asks for recorded replies (those are listed by the data set).
    """
    names = suite.models
    if names == RECORDED:
        raise ValueError("the models of a suite of recorded replies are listed by its data set")
    allowed = [*baseline_names(), *known, *(GROUP + name for name in group_names(known))]
    unknown = [(index, name) for index, name in enumerate(names) if name not in allowed]
    problems = [
        Problem(
            suite.where("models", index),
            unknown_model(name),
            f"models[{index}]",
            show(name),
            ", ".join(allowed) if len(allowed) <= 12 else "",
            (did_you_mean(name, allowed) if number < MOST_HINTS else "")
            or "list them: phyblock models",
        )
        for number, (index, name) in enumerate(unknown)
    ]
    if problems:
        raise SpecError(problems)
    return {name: known.get(name) for name in with_members(names, known)}


def _broken_rules(source: YamlSource, problems: list[Problem]) -> list[Problem]:
    """Problems between fields, judged on the raw data where the fields themselves are sound."""
    faulty = {re.sub(r"\[.*", "", problem.field) for problem in problems}
    get = _raw_reader(source.data)
    return [
        Problem(_rule_place(source, rule.reads), rule.message, rule.field, hint=rule.hint)
        for rule in broken_rules(get, tuple(sorted(faulty)))
    ]


def _raw_reader(data: Mapping[str, Any]) -> Callable[[str], Any]:
    def get(name: str) -> Any:
        here: Any = data
        for key in name.split("."):
            if not isinstance(here, Mapping) or key not in here:
                return _default(name)
            here = here[key]
        return here

    return get


def _default(name: str) -> Any:
    value: Any = suite_model()
    for key in name.split("."):
        value = (
            value.model_fields[key].get_default(call_default_factory=True)
            if isinstance(value, type) and issubclass(value, BaseModel)
            else getattr(value, key)
        )
    return value


def _rule_place(source: YamlSource, reads: tuple[str, ...]) -> str:
    paths: list[FieldPath] = [tuple(name.split(".")) for name in reads]
    written = next((path for path in paths if path in source.values), paths[0])
    return source.where(written)


def _locate(
    suite: Suite,
    path: Path,
    source: YamlSource,
    data_dir: Path,
    prompt_dirs: Sequence[Path],
) -> Suite:
    finder = _Finder(path, source, data_dir)
    scenes = suite.dataset
    is_bundled = scenes.format == "builtin"
    dataset = finder.data(scenes.path or BUILTIN_DATASET, ("dataset", "path"), is_bundled)
    folders: dict[str, Path | None] = {}
    templates: dict[str, Path | None] = {}
    unused: dict[str, Path | None] = {}
    for name in suite.tracks:
        kind = known_track(name)
        if (own := kind.data_folder(suite)) is not None:
            folders[name] = finder.data(*own)
        prompt = _prompt(suite, name)
        if "prompt" not in suite.vary.factors and prompt not in PROMPT_WORDS:
            templates[name] = finder.file(prompt, kind.prompt_field)
        elif prompt == PROMPT_WORDS[0] or "default" in suite.vary.prompt:
            in_text = suite.answer_format == "text"
            forms = (kind.template, kind.json_template)
            bundled, other = forms if in_text else reversed(forms)
            templates[name] = _in_place_of(bundled, prompt_dirs)
            unused[name] = _in_place_of(other, prompt_dirs)
    prompts = {
        text: finder.file(text, ("vary", "prompt", place))
        for place, text in enumerate(suite.vary.prompt)
        if text not in PROMPT_WORDS
    }
    if "default" in suite.vary.prompt:
        prompts |= {"default": next(iter(templates.values()), None)}
    finder.check_twice(prompts, ("vary", "prompt"))
    if dataset is None or finder.problems:
        raise SpecError(sort_problems(finder.problems))
    located = map(_there, (folders, templates, prompts, unused))
    return suite.with_files(SuiteFiles(path, dataset, source, *located)).at(Variant())


def _prompt(suite: Suite, track: str) -> str:
    """What a suite names as the prompt of a track."""
    return str(read_dotted(suite, ".".join(known_track(track).prompt_field)))


def _in_place_of(bundled: Path | None, folders: Sequence[Path]) -> Path | None:
    """The first file of the same name in the folders, unless it is the same as the bundled one."""
    if bundled is None:
        return None
    paths = (folder.absolute() / bundled.name for folder in folders)
    own = next((path for path in paths if os.path.isfile(path)), None)
    is_same = own is not None and filecmp.cmp(own, bundled, shallow=False)
    return None if is_same else own


def _there(paths: Mapping[str, Path | None]) -> dict[str, Path]:
    return {name: path for name, path in paths.items() if path is not None}


class _Finder:
    """Resolves the paths of one suite and gathers what is wrong with them."""

    def __init__(self, path: Path, source: YamlSource, data_dir: Path) -> None:
        self.problems: list[Problem] = []
        self._path = path
        self._source = source
        self._data_dir = data_dir

    def data(self, text: str, at: FieldPath, may_be_bundled: bool) -> Path | None:
        """The folder of data: a bundled set by its name, or a path."""
        if may_be_bundled and _BARE_NAME.match(text):
            folder = self._data_dir.absolute() / text
            if not os.path.isdir(folder):
                names = sorted(p.name for p in self._data_dir.glob("*/"))
                allowed = f"a bundled data set ({', '.join(names)}), or the path of a folder"
                hint = did_you_mean(text, names) or f"for a folder beside the suite write ./{text}"
                self._complain(at, "is not a bundled data set", show(text), allowed, hint)
            return folder
        path = self._expand(text, at)
        if path is not None and not os.path.isdir(path):
            self._complain(at, "no such folder", str(path))
        return path

    def file(self, text: str, at: FieldPath) -> Path | None:
        """A file that must be there."""
        path = self._expand(text, at)
        if path is not None and not os.path.isfile(path):
            self._complain(at, "no such file", str(path))
        return path

    def check_twice(self, files: Mapping[str, Path | None], at: FieldPath) -> None:
        """Complain of names that mean a file that another means already."""
        first: dict[str, str] = {}
        for text, path in files.items():
            if path is not None and os.path.isfile(path):
                known = first.setdefault(os.path.realpath(path), text)
                if known != text:
                    message = f"is the same file as {known}: this level would change nothing"
                    hint = "name the other one in another way, or move it out of prompts/"
                    self._complain(at, message, show(text), hint=hint)

    def _expand(self, text: str, at: FieldPath) -> Path | None:
        base = Path.cwd() if self._source.is_overridden(at) else self._path.parent
        try:
            return expand(text, base)
        except ValueError as error:
            self._complain(at, str(error), show(text))
            return None

    def _complain(
        self, at: FieldPath, message: str, found: str, allowed: str = "", hint: str = ""
    ) -> None:
        where = self._source.where(at)
        self.problems.append(Problem(where, message, dotted(at), found, allowed, hint))
