"""Suites: which models are asked about which scenes, how, and what is made of the replies.

The descriptions below become the JSON Schema's, which an editor shows beside each key.
"""

from __future__ import annotations

import filecmp
import functools
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from math import prod
from pathlib import Path, PurePath
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Discriminator,
    Field,
    PrivateAttr,
    Tag,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic_core import InitErrorDetails

from phyblock.config.models import (
    RECORDED,
    SamplingSpec,
)
from phyblock.config.validation import (
    BackgroundName,
    Count,
    ModelName,
    Section,
    TimeoutS,
    Unique,
    UniqueSome,
    check,
    check_unique,
    joined,
    prompt_check,
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
)
from phyblock.errors import Problem, SpecError
from phyblock.registry import (
    baseline_names,
    known_track,
    known_tracks,
)
from phyblock.text import did_you_mean
from phyblock.types import (
    AnswerFormat,
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

SectionT = TypeVar("SectionT", bound=BaseModel)
LevelT = TypeVar("LevelT")

BUILTIN_DATASET = "phyblock-400"
"""The bundled data set that is used when a suite names none."""
PROMPT_WORDS = ("default", "official")
REPEAT = "repeats"
"""The factor that changes nothing that is sent: its levels ask the same again."""
FACTORS: Mapping[str, tuple[str, ...] | None] = {
    "prompt": None,
    "background": ("images", "background"),
    "view": ("images", "view"),
    "candidate_order": ("candidates", "order"),
    "layout": ("images", "layout"),
    "examples": ("examples",),
    REPEAT: None,
}
"""Factors of `vary` with the path of the field that each gives values to; every track names its
prompt in a field of its own."""

Prompt = Annotated[
    str,
    AfterValidator(prompt_check(*PROMPT_WORDS)),
    Field(json_schema_extra={"pattern": r"^(default|official|.*\.j2)$"}),
]
ExampleCount = Annotated[int, Field(strict=True, ge=0, le=16)]
Seed = Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]


def _check_whole(level: object) -> object:
    if type(level) is int:
        return level
    raise refuse("is not a whole number", allowed="1, 2, 3, 4")


Level = Annotated[Literal[1, 2, 3, 4], BeforeValidator(_check_whole)]


def _one_of(names: Callable[[], Sequence[str]]) -> AfterValidator:
    def check_name(name: str) -> str:
        known = tuple(names())
        if name in known:
            return name
        raise refuse("is not one of the choices", allowed=", ".join(known), words=known)

    return AfterValidator(check_name)


def _list_tag(value: object) -> str:
    return "list" if isinstance(value, list | tuple) else "one"


ModelNames = Annotated[
    Annotated[UniqueSome[ModelName], Tag("list")] | Annotated[Literal["recorded"], Tag("word")],
    Discriminator(lambda value: "word" if isinstance(value, str) else "list"),
]
Examples = Annotated[
    Annotated[ExampleCount, Tag("one")]
    | Annotated[UniqueSome[Annotated[str, Field(min_length=1)]], Tag("list")],
    Discriminator(_list_tag),
]


class DatasetSpec(Section):
    """The scenes of a run."""

    format: DataFormat = "builtin"
    """builtin: the project's own format. official: a checkout of the official PhyBlock
    repository."""
    path: str | None = Field(default=None, min_length=1)
    """builtin: the name of a bundled data set (phyblock-400 when left out) or a folder that holds
    scenes.jsonl (write ./name for a folder beside the suite). official: the checkout's folder.
    Relative to the suite file, or to the working directory when given by --set; ~ and $VARIABLES
    are expanded."""


class ImagesSpec(Section):
    """The pictures that a model is shown."""

    source: PictureSource = "render"
    """render: drawn from the scene. dataset: the official composites, or their two halves apart; a
    scene without one is an error."""
    layout: PictureLayout = "composite"
    """composite: goal and candidates in one picture. separate: two pictures."""
    order: Annotated[
        tuple[PictureName, ...],
        Field(min_length=2, max_length=2, json_schema_extra={"uniqueItems": True}),
        AfterValidator(check_unique),
    ] = ("goal", "candidates")
    """Order in which separate pictures are sent."""
    candidate_scale: CandidateScale = "common"
    """common: all rendered candidates of a grid are drawn at one scale. fit: each fills its cell.
    The prompt says which."""
    size_px: Annotated[int, Field(strict=True, ge=128, le=2048)] = 512
    """Edge of a rendered picture [pixels]."""
    view: View = "oblique"
    """Where rendered scenes and candidates are seen from; questions have views of their own."""
    background: BackgroundName | None = None
    """Ground of all rendered pictures, one of the paper's six; the checkerboard is dark. null: each
    question's own, and the checkerboard for all else."""


class CandidatesSpec(Section):
    """The presentation of candidates."""

    order: CandidateOrder = "file"
    """file: numbered as in the data. shuffled: each seed draws another order for every scene, the
    same for all models; numbers in pictures, prompts and replies go along."""


class ScoringSpec(Section):
    """The rules of scoring."""

    matchers: UniqueSome[Matcher] = ("optimal", "paper")
    """optimal: interchangeable blocks are matched so that most steps count. paper: greedy, the
    paper's Algorithm 1. The first one makes the headline numbers."""
    level1: Criterion = "selection"
    """Criterion of Level 1. selection: one-to-one, order ignored. membership: what the paper's
    Level-1 columns are. aov: as at the other levels."""
    missing: MissingPolicy = "count"
    """A missing reply: count its blocks as not placed, or skip the scene (as the paper did)."""
    extractor: str | None = None
    """A model of the models file that is sent the text of replies from which nothing could be read,
    and copies what they say into the asked form; its calls count against limits.max_cost_usd. Null:
    such replies stay unread."""


class LimitsSpec(Section):
    """Bounds of a run; they change how fast results come, not what they are."""

    max_concurrency: Count = 64
    """Calls under way at once, over all models."""
    max_attempts: Count = 8
    """Requests that must have failed before a sample is given up. More are sent until retry_for_s
    is over, but for answers that were paid for and cannot be read."""
    retry_for_s: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] = 300.0
    """Outage that is outlasted [s]: a sample is not given up sooner after its first failure, and a
    model whose server cannot be reached for longer is stopped."""
    max_connection_failures: Count = 20
    """Failures to reach a server, one after another, after which its models are stopped where it
    has not answered once in this run; as many answers with HTTP 2xx that hold no reply, where it
    has not given one."""
    timeout_s: TimeoutS = 300.0
    """Longest wait for one reply [s]."""
    batch_poll_s: Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)] = 60.0
    """Longest pause between two looks at a batch [s], for models with batch: true."""
    max_cost_usd: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] | None = None
    """The run stops before it costs more than this [USD]; null: no bound."""


@dataclass(frozen=True)
class Variant:
    """One choice of levels of the factors that a suite varies, as far as it differs from the
    reference of its run.

    Another run may have another reference: only where two suites vary alike do names agree.
    """

    levels: tuple[tuple[str, str], ...] = ()

    @property
    def key(self) -> str:
        """Its name in a run: `background=lawn,repeats=2`, "" for the reference."""
        return ",".join(f"{factor}={level}" for factor, level in self.levels)

    @property
    def repeat(self) -> int:
        """The number of the time for which the same is asked, from 1."""
        return int(dict(self.levels).get(REPEAT, "1"))

    @property
    def shown(self) -> Variant:
        """The part of it that changes what is sent, alike for all repeats."""
        return Variant(tuple(pair for pair in self.levels if pair[0] != REPEAT))


def _check_levels(levels: tuple[LevelT, ...]) -> tuple[LevelT, ...]:
    if len(levels) == 1:
        raise refuse("needs levels to compare", allowed="two or more, the reference first")
    return levels


Levels = Annotated[
    tuple[LevelT, ...],
    AfterValidator(check_unique),
    AfterValidator(_check_levels),
    Field(json_schema_extra={"uniqueItems": True}),
]


class VarySpec(Section):
    """Ways of asking that are crossed; the first level of each factor is the reference."""

    prompt: Levels[Prompt] = ()
    """Prompts, as in the track's own field; for suites of one track."""
    background: Levels[BackgroundName] = ()
    """Grounds of rendered pictures, as images.background."""
    view: Levels[View] = ()
    """Where rendered scenes are seen from, as images.view."""
    candidate_order: Levels[CandidateOrder] = ()
    """Orders of the candidates, as candidates.order."""
    layout: Levels[PictureLayout] = ()
    """Layouts of pictures, as images.layout."""
    examples: Levels[ExampleCount] = ()
    """Numbers of worked examples, as examples."""
    repeats: Annotated[int, Field(strict=True, ge=1, le=100)] = 1
    """How often the same is asked, each time anew: the cache answers none but the first, and the
    provider is sent another seed."""
    design: Literal["crossed", "one_at_a_time"] = "crossed"
    """crossed: every level with every level of the others. one_at_a_time: each factor alone, the
    others at their reference; both ask each repeatedly."""

    @model_validator(mode="after")
    def _check_names(self) -> Self:
        names = list(self.names("prompt"))
        if twice := sorted({name for name in names if names.count(name) > 1}):
            allowed = "templates of different names"
            raise refuse(f"has two templates called {twice[0]}", at=("prompt",), allowed=allowed)
        return self

    @property
    def factors(self) -> tuple[str, ...]:
        """The factors that have several levels."""
        return tuple(name for name in FACTORS if len(self.values(name)) > 1)

    def values(self, factor: str) -> tuple[Any, ...]:
        """Return the levels of a factor as fields of the suite take them."""
        levels = getattr(self, factor)
        return tuple(range(1, levels + 1)) if factor == REPEAT else tuple(levels)

    def names(self, factor: str) -> tuple[str, ...]:
        """Return the levels of a factor as records and tables name them: a template by its file."""
        texts = map(str, self.values(factor))
        return tuple(PurePath(text).stem if text.endswith(".j2") else text for text in texts)

    def value(self, factor: str, level: str) -> Any:
        """Return the value of a level; ValueError for one that there is not."""
        return self.values(factor)[self.names(factor).index(level)]

    @property
    def n_variants(self) -> int:
        """The number of ways of asking."""
        sizes = [len(self.values(name)) for name in self.factors if name != REPEAT]
        crossed = self.design == "crossed"
        return (prod(sizes) if crossed else 1 + sum(n - 1 for n in sizes)) * self.repeats

    @property
    def variants(self) -> tuple[Variant, ...]:
        """All ways of asking, the reference first, repeats of one behind one another."""
        levels = [
            [(name, level) for level in self.names(name)] for name in self.factors if name != REPEAT
        ]
        first = tuple(of_factor[0] for of_factor in levels)
        if self.design == "crossed":
            chosen = list(product(*levels))
        else:
            chosen = [first] + [(pair,) for of_factor in levels for pair in of_factor[1:]]
        again = [((REPEAT, name),) if n else () for n, name in enumerate(self.names(REPEAT))]
        return tuple(
            Variant((*(pair for pair in one if pair not in first), *repeat))
            for one in chosen
            for repeat in again
        )


def with_values(spec: SectionT, values: Mapping[tuple[str, ...], Any]) -> SectionT:
    """Return a validated suite or section with other values at these paths of fields."""
    for path, value in values.items():
        name, below = path[0], path[1:]
        inner = with_values(getattr(spec, name), {below: value}) if below else value
        spec = spec.model_copy(update={name: inner})
    return spec


@dataclass(frozen=True)
class SuiteFiles:
    """The files that a suite was read from and names.

    `path` is the suite's own; `dataset` the absolute folder of the data set; by track, `folders`
    are those of data of its own, and `templates` the absolute paths of prompts that are files.
    Where prompts vary, `templates` are those of the reference, and `prompts` has the paths of all
    by their texts.
    """

    path: Path
    dataset: Path
    source: YamlSource = field(repr=False, compare=False)
    folders: Mapping[str, Path] = field(default_factory=dict)
    templates: Mapping[str, Path] = field(default_factory=dict)
    prompts: Mapping[str, Path] = field(default_factory=dict)


class Suite(Section):
    """A suite: which models are asked about which scenes, how, and what is made of the replies."""

    name: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]{0,63}$")]
    """Short name: small letters, digits and hyphens; runs are filed under it."""
    description: str = ""
    """One line on what the suite is for."""
    tracks: UniqueSome[Annotated[str, _one_of(lambda: tuple(known_tracks()))]] = Field(
        default_factory=lambda: tuple(known_tracks())[:1]
    )
    """What is asked."""
    dataset: DatasetSpec = DatasetSpec()
    """The scenes of a run."""
    levels: UniqueSome[Level] = (1, 2, 3, 4)
    """Difficulty levels."""
    limit: Count | None = None
    """Items of each track at most, spread over levels or subtasks; null: all. --limit says another
    number."""
    settings: UniqueSome[Setting] = ("A", "B")
    """A compares type, color and orientation, B type and color. One call is scored under each."""
    seeds: UniqueSome[Seed] = (0,)
    """Each seed repeats every question."""
    models: ModelNames
    """Names from models.yaml or built-in baselines, group:NAME for all models of a group; or the
    word recorded: every folder of recorded replies in the official data."""
    baselines: Unique[Annotated[str, _one_of(baseline_names)]] = ("goal-blind", "random")
    """Built-in baselines that are scored beside models and recordings of full_planning, where every
    track has them; they cost nothing. []: none."""
    prompt: Prompt = "default"
    """default; official (read out of the official checkout); or the path of a .j2 template,
    relative to the suite file."""
    answer_format: AnswerFormat = "text"
    """text: lines of text. json_schema: one JSON object, of which the prompt says the schema; it is
    sent as response_format too where the provider takes one."""
    examples: Examples = 0
    """Worked examples that are shown before each question, with a right answer: a number (drawn by
    the least of seeds, never a scene that shares a base scene or its goal with the one asked
    about), or names of scenes (where one may not be shown, a drawn one stands in)."""
    images: ImagesSpec = ImagesSpec()
    """The pictures that a model is shown."""
    candidates: CandidatesSpec = CandidatesSpec()
    """The presentation of candidates."""
    parser: PlanParser = "steps"
    """steps: reads the step list and records the rule that matched. official: the official
    expression over the whole reply."""
    scoring: ScoringSpec = ScoringSpec()
    """The rules of scoring."""
    sampling: SamplingSpec = SamplingSpec()
    """Sampling parameters for models that say nothing of their own."""
    limits: LimitsSpec = LimitsSpec()
    """Bounds of a run; they change how fast results come, not what they are."""
    vary: VarySpec = VarySpec()
    """Ways of asking that are crossed, to tell how much each of them moves a model."""

    _files: SuiteFiles | None = PrivateAttr(default=None)

    @model_validator(mode="after")
    def _check_rules(self) -> Self:
        faults: list[dict[str, Any]] = []
        for fields, message, hint in self._conflicts():
            paths = [tuple(name.split(".")) for name in fields.split()]
            faults.append({"message": message, "hint": hint, "at": paths[0], "reads": paths})
        faults += (fault for factor in self.vary.factors for fault in self._vary_faults(factor))
        if faults:
            lines = [InitErrorDetails(type=refuse(**fault), loc=(), input=None) for fault in faults]
            raise ValidationError.from_exception_data("suite", lines)
        return self

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

    def section(self, model: type[SectionT]) -> SectionT:
        """Return the section of a track; LookupError where the suite was made without it."""
        for name in type(self).model_fields:
            if isinstance(value := getattr(self, name), model):
                return value
        raise LookupError(f"the suite has no section of {model.__name__}")

    def read(self, path: FieldPath) -> Any:
        """Return the value of a field by its path."""
        value: Any = self
        for name in path:
            value = getattr(value, str(name))
        return value

    def fields_of(self, factor: str) -> tuple[tuple[str, ...], ...]:
        """Return the paths of the fields that a factor gives values to; none for repeats."""
        if factor == "prompt":
            return tuple(known_track(name).prompt_field() for name in self.tracks)
        path = FACTORS[factor]
        return () if path is None else (path,)

    def at(self, variant: Variant) -> Self:
        """Return the suite as a variant asks, its other factors at their reference."""
        levels = {name: self.vary.names(name)[0] for name in self.vary.factors}
        values: dict[tuple[str, ...], Any] = {}
        for factor, level in {**levels, **dict(variant.levels)}.items():
            value = self.vary.value(factor, level)
            values |= dict.fromkeys(self.fields_of(factor), value)
        suite = with_values(self, values)
        if self._files is None or "prompt" not in self.vary.factors:
            return suite
        prompts = self._files.prompts
        texts = {name: str(suite.read(known_track(name).prompt_field())) for name in suite.tracks}
        templates = {name: prompts[text] for name, text in texts.items() if text in prompts}
        return suite.with_files(replace(self._files, templates=templates))

    def identity(self) -> dict[str, Any]:
        """Return what determines the results, as JSON-able data, whatever the order of lists.

        Leaves out name, description and limits, sections of tracks that are not run,
        models, baselines, seeds, limit and paths (of data and templates): a run stores which models
        were run, about which items, and the hashes of what stands at the paths, which say more and
        survive a move.
        """
        sections = {kind.section: name for name, kind in known_tracks().items() if kind.section}
        idle = {key for key, track in sections.items() if track not in self.tracks}
        unsaid = {
            "name",
            "description",
            "limit",
            "limits",
            "models",
            "baselines",
            "seeds",
        }
        spec = self.model_dump(mode="json", exclude={*unsaid, *idle})
        for name in ("levels", "settings", "tracks"):
            spec[name].sort()
        for section in ("dataset", *sections):
            spec.get(section, {}).pop("path", None)
        for part in (spec, *(spec[key] for key in sections if key in spec)):
            if part.get("prompt", PROMPT_WORDS[0]) not in PROMPT_WORDS:
                part["prompt"] = "template"
        spec["vary"]["prompt"] = list(self.vary.names("prompt"))
        return spec

    def _conflicts(self) -> Iterator[tuple[str, str, str]]:
        """Give the rules between fields that are broken: fields, message and hint.

        The first field is the one to fix; the error points at the first that is written.
        """
        official = self.dataset.format == "official"
        recorded, as_json = self.models == RECORDED, self.answer_format == "json_schema"
        shuffled = self.candidates.order == "shuffled"
        set_official = "set dataset.format to official and dataset.path to a checkout"
        if official and self.dataset.path is None:
            message = (
                "the official format needs the folder of a checkout of the official repository"
            )
            yield (
                "dataset.path dataset.format",
                message,
                ("give it on the command line: --set dataset.path=FOLDER"),
            )
        if recorded and not official:
            message = "recorded replies come with the official data set only"
            yield "models dataset.format", message, f"{set_official}, or list the models"
        if self.prompt == "official" and not official:
            message = "the official prompt is read out of a checkout of the official repository"
            yield "prompt dataset.format", message, f"{set_official}, or use prompt: default"
        if self.prompt == "official" and as_json:
            message = "the official prompt asks for lines of text"
            yield "answer_format prompt", message, "use prompt: default, or answer_format: text"
        if recorded and as_json:
            message = "recorded replies were asked for in text"
            yield "answer_format models", message, "use answer_format: text, or list the models"
        if self.parser == "official" and as_json:
            message = "the official expression reads no JSON"
            yield "parser answer_format", message, "use parser: steps, or answer_format: text"
        if self.images.source == "dataset" and not official:
            message = "only the official data set has pictures of its own"
            hint = f"{set_official}, or use images.source: render"
            yield "images.source dataset.format", message, hint
        if self.images.source == "dataset" and shuffled:
            message = "the data set's own pictures show the candidates in the order of the file"
            hint = "use images.source: render, or candidates.order: file"
            yield "candidates.order images.source", message, hint
        if recorded and shuffled:
            message = "recorded replies name candidates by the numbers of the file"
            hint = "use candidates.order: file, or list the models"
            yield "candidates.order models", message, hint

    def _vary_faults(self, factor: str) -> Iterator[dict[str, Any]]:
        """Give what is wrong with a factor: its tracks must know it, other fields allow it."""
        at = ("vary", factor)
        paths = self.fields_of(factor)
        unknown = [name for name in self.tracks if factor not in known_tracks()[name].varies]
        if unknown:
            allowed = ", ".join(known_tracks()[unknown[0]].varies)
            message = f"has no meaning in {unknown[0]}"
            yield {"message": message, "at": at, "key": True, "allowed": allowed}
            return
        if factor == "prompt" and len(self.tracks) > 1:
            message = "is varied in a suite of several tracks, each of which has its own"
            yield {"message": message, "at": at, "key": True, "hint": "run one track at a time"}
            return
        if factor in ("background", "view") and self.images.source == "dataset":
            message, hint = (
                "cannot be varied in the data set's own pictures",
                "use images.source: render",
            )
            yield {"message": message, "at": at, "key": True, "hint": hint}
            return
        first = self.vary.values(factor)[0]
        for path in paths:
            section = self.read(path[:-1])
            if path[-1] in section.model_fields_set and self.read(path) != first:
                message = f"is varied by vary.{factor}, whose first level is the reference"
                hint = "leave it out, or change vary"
                yield {"message": message, "at": path, "allowed": str(first), "hint": hint}
        before = set(self._conflicts())
        for place, level in enumerate(self.vary.names(factor)):
            if level == "official" and paths != (("prompt",),):
                allowed = "default, or the path of a .j2 file"
                message = "is no prompt of this track"
                yield {"message": message, "at": (*at, place), "allowed": allowed}
                continue
            one = self.at(Variant(((factor, level),)))
            for _, message, hint in (rule for rule in one._conflicts() if rule not in before):
                yield {"message": message, "at": (*at, place), "hint": hint}


def suite_model() -> type[Suite]:
    """Return the model of a suite file: `Suite` with the sections of all tracks."""
    kinds = known_tracks().values()
    return _composed(tuple((one.section, one.options) for one in kinds if one.options is not None))


@functools.cache
def _composed(sections: tuple[tuple[str, type[BaseModel]], ...]) -> type[Suite]:
    fields: dict[str, Any] = {
        key: (model, Field(default_factory=model, description=model.__doc__))
        for key, model in sections
    }
    return create_model("Suite", __base__=Suite, __doc__=Suite.__doc__, **fields)


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
    if suite is None or source.problems:
        raise SpecError(joined(source, problems))
    # What varies has the values of the reference, wherever one value alone is asked for.
    suite = suite.at(Variant())
    return suite.with_files(_files_of(suite, path, source, data_dir, prompt_dirs)).at(Variant())


def _files_of(
    suite: Suite, path: Path, source: YamlSource, data_dir: Path, prompt_dirs: Sequence[Path]
) -> SuiteFiles:
    """Resolve the paths of a suite; SpecError for all that lead nowhere."""
    problems: list[Problem] = []

    def complain(
        at: FieldPath, message: str, found: str, allowed: str = "", hint: str = ""
    ) -> None:
        problems.append(Problem(source.where(at), message, dotted(at), found, allowed, hint))

    def existing(text: str, at: FieldPath, is_there: Callable[[Path], bool], kind: str) -> Path:
        base = Path.cwd() if source.is_overridden(at) else path.parent
        try:
            found = expand(text, base)
        except ValueError as error:
            complain(at, str(error), show(text))
            return path
        if not is_there(found):
            complain(at, f"no such {kind}", str(found))
        return found

    def data(text: str, at: FieldPath, may_be_bundled: bool) -> Path:
        if not (may_be_bundled and re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_-]*", text)):
            return existing(text, at, os.path.isdir, "folder")
        folder = data_dir.absolute() / text
        if not os.path.isdir(folder):
            names = sorted(known.name for known in data_dir.glob("*/"))
            allowed = f"a bundled data set ({', '.join(names)}), or the path of a folder"
            hint = did_you_mean(text, names) or f"for a folder beside the suite write ./{text}"
            complain(at, "is not a bundled data set", show(text), allowed, hint)
        return folder

    def own_template(bundled: Path | None) -> Path | None:
        names = [folder.absolute() / bundled.name for folder in prompt_dirs] if bundled else []
        own = next((name for name in names if os.path.isfile(name)), None)
        is_same = own is not None and filecmp.cmp(own, str(bundled), shallow=False)
        return None if is_same else own

    is_builtin = suite.dataset.format == "builtin"
    dataset = data(suite.dataset.path or BUILTIN_DATASET, ("dataset", "path"), is_builtin)
    varied = suite.vary.prompt
    folders: dict[str, Path] = {}
    templates: dict[str, Path | None] = {}
    for name in suite.tracks:
        kind = known_track(name)
        if kind.has_own_data():
            own = getattr(suite, kind.section)
            folders[name] = data(own.path, (kind.section, "path"), own.format == "builtin")
        prompt_field = kind.prompt_field()
        prompt = str(suite.read(prompt_field))
        if not varied and prompt not in PROMPT_WORDS:
            templates[name] = existing(prompt, prompt_field, os.path.isfile, "file")
        elif prompt == "default" or "default" in varied:
            templates[name] = own_template(kind.template_for(suite.answer_format))
    prompts = {
        text: existing(text, ("vary", "prompt", place), os.path.isfile, "file")
        for place, text in enumerate(varied)
        if text not in PROMPT_WORDS
    }
    there = {name: template for name, template in templates.items() if template is not None}
    if "default" in varied and there:
        prompts["default"] = next(iter(there.values()))
    if problems:
        raise SpecError(source.in_order(problems))
    return SuiteFiles(path, dataset, source, folders, there, prompts)


def suite_tracks(path: Path) -> tuple[str, ...]:
    """Return the tracks of a suite that is known to be sound, whatever else it needs to run."""
    default = suite_model().model_fields["tracks"].get_default(call_default_factory=True)
    return tuple(read_yaml(path).data.get("tracks", default))
