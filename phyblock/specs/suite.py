"""What a person may write in a suite file.

The descriptions below become the JSON Schema's, which an editor shows beside each key.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
    create_model,
    model_validator,
)

from phyblock.registry import PUBLISHED_TABLE, known_tracks, table_names
from phyblock.specs.fields import (
    Count,
    ModelName,
    Section,
    Unique,
    UniqueSome,
    refuse,
)
from phyblock.specs.prompt import PROMPT_WORDS, Prompt
from phyblock.specs.rules import broken_rules, read_dotted
from phyblock.specs.sections import (
    CandidatesSpec,
    DatasetSpec,
    ImagesSpec,
    LimitsSpec,
    SamplingSpec,
    ScoringSpec,
)
from phyblock.specs.vary import FACTORS, ExampleCount, VarySpec, with_values
from phyblock.types import (
    AnswerFormat,
    PlanParser,
    Setting,
)
from phyblock.variants import Variant

__all__ = [
    "BUILTIN_DATASET",
    "PROMPT_WORDS",
    "RECORDED",
    "SuiteSpec",
    "suite_model",
]

RECORDED = "recorded"
"""The word that stands for every folder of recorded replies."""
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


class SuiteSpec(Section):
    """A suite: which models are asked about which scenes, how, and what is made of the replies.

    Cross-field rules (`phyblock.specs.rules`) hold on every instance; pydantic's
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

    @model_validator(mode="after")
    def _check_rules(self) -> SuiteSpec:
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

    def at(self, variant: Variant) -> SuiteSpec:
        """The suite as a variant asks, its other factors at their reference."""
        levels = {name: self.vary.names(name)[0] for name in self.vary.factors}
        values: dict[tuple[str, ...], Any] = {}
        for factor, level in {**levels, **dict(variant.levels)}.items():
            value = self.vary.value(factor, level)
            values |= dict.fromkeys(self.fields_of(factor), value)
        return with_values(self, values)

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


def suite_model() -> type[SuiteSpec]:
    """What a suite may hold: `SuiteSpec` with the sections of all tracks."""
    return _composed(tuple(kind.section for kind in known_tracks().values() if kind.section))


@functools.cache
def _composed(sections: tuple[tuple[str, type[BaseModel], str], ...]) -> type[SuiteSpec]:
    fields: dict[str, Any] = {
        key: (model, Field(default_factory=model, description=description))
        for key, model, description in sections
    }
    return create_model("SuiteSpec", __base__=SuiteSpec, __doc__=SuiteSpec.__doc__, **fields)
