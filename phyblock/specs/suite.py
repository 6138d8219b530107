"""What a person may write in a suite file.

The descriptions below become the JSON Schema's, which an editor shows beside each key.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from phyblock.specs.fields import (
    Count,
    MaxTokens,
    ModelName,
    Section,
    Temperature,
    TimeoutS,
    TopP,
    Unique,
    UniqueSome,
    check_unique,
    refuse,
)
from phyblock.specs.rules import broken_rules, read_dotted
from phyblock.specs.tracks import SECTIONS, StepsSpec, TrackName, VqaSpec

__all__ = [
    "BASELINES",
    "BUILTIN_DATASET",
    "PROMPT_WORDS",
    "RECORDED",
    "DatasetSpec",
    "ImagesSpec",
    "LimitsSpec",
    "SamplingSpec",
    "ScoringSpec",
    "SuiteSpec",
]

BASELINES = (
    "random",
    "all-candidates",
    "oracle",
    "oracle-no-orientation",
    "repeat",
    "majority",
    "text-only",
)
"""Models that are built in; no models file may use their names."""
RECORDED = "recorded"
"""The word that stands for every folder of recorded replies."""
BUILTIN_DATASET = "phyblock-400"
"""The bundled data set that is used when a suite names none."""
PROMPT_WORDS = ("default", "official")


def _check_whole(level: object) -> object:
    if type(level) is int:
        return level
    raise refuse("is not a whole number", allowed="1, 2, 3, 4")


Level = Annotated[Literal[1, 2, 3, 4], BeforeValidator(_check_whole)]
Setting = Literal["A", "B"]
Matcher = Literal["optimal", "paper"]
Picture = Literal["goal", "candidates"]
Background = Literal["checkerboard", "white", "light-wood", "dark-wood", "concrete", "lawn"]
Table = Literal[
    "assembly", "table1", "table2", "table3", "endings", "progress", "errors", "published"
]
Seed = Annotated[int, Field(strict=True, ge=0, le=2**31 - 1)]


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


def _models_tag(value: object) -> str:
    return "word" if isinstance(value, str) else "list"


ModelNames = Annotated[
    Annotated[UniqueSome[ModelName], Tag("list")] | Annotated[Literal["recorded"], Tag("word")],
    Discriminator(_models_tag),
]


class DatasetSpec(Section):
    """Which scenes are run."""

    format: Literal["builtin", "official"] = Field(
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

    source: Literal["render", "dataset"] = Field(
        default="render",
        description="render: drawn from the scene. dataset: the official composites, or "
        "their two halves apart; a scene without one is an error.",
    )
    layout: Literal["composite", "separate"] = Field(
        default="composite",
        description="composite: goal and candidates in one picture. separate: two pictures.",
    )
    order: Annotated[
        tuple[Picture, ...],
        Field(min_length=2, max_length=2, json_schema_extra={"uniqueItems": True}),
        AfterValidator(check_unique),
    ] = Field(
        default=("goal", "candidates"), description="Order in which separate pictures are sent."
    )
    size_px: Annotated[int, Field(strict=True, ge=128, le=2048)] = Field(
        default=512, description="Edge of a rendered picture [pixels]."
    )
    background: Background = Field(
        default="checkerboard",
        description="Ground of rendered pictures, one of the paper's six; the checkerboard is "
        "dark.",
    )


class ScoringSpec(Section):
    """How replies are scored."""

    matchers: UniqueSome[Matcher] = Field(
        default=("optimal", "paper"),
        description="optimal: interchangeable blocks are matched so that most steps count. paper: "
        "greedy, the paper's Algorithm 1. The first one makes the headline numbers.",
    )
    level1: Literal["selection", "membership", "aov"] = Field(
        default="selection",
        description="Criterion of Level 1. selection: one-to-one, order ignored. membership: what "
        "the paper's Level-1 columns are. aov: as at the other levels.",
    )
    missing: Literal["count", "skip"] = Field(
        default="count",
        description="A missing reply: count its blocks as not placed, or skip the scene (as the "
        "paper did).",
    )


class SamplingSpec(Section):
    """Sampling parameters for models that say nothing of their own."""

    temperature: Temperature | None = Field(default=0.0, description="0 to 2; null: not sent.")
    top_p: TopP | None = Field(default=None, description="Above 0, at most 1; null: not sent.")
    max_tokens: MaxTokens | None = Field(
        default=4096, description="Limit of a reply, thinking included [tokens]; null: not sent."
    )


class LimitsSpec(Section):
    """Bounds of a run; they change how fast results come, not what they are."""

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
    timeout_s: TimeoutS = Field(default=300.0, description="Longest wait for one reply [s].")
    max_cost_usd: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] | None = Field(
        default=None,
        description="The run stops before it costs more than this [USD]; null: no bound.",
    )


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
        default=("full_planning",),
        description="full_planning: a whole plan in one reply. step_planning: step by step in the "
        "simulator. vqa: multiple-choice questions.",
    )
    dataset: DatasetSpec = Field(default_factory=DatasetSpec, description="Which scenes are run.")
    levels: UniqueSome[Level] = Field(default=(1, 2, 3, 4), description="Difficulty levels.")
    settings: UniqueSome[Setting] = Field(
        default=("A", "B"),
        description="A compares type, color and orientation, B type and color. One call is "
        "scored under each.",
    )
    seeds: UniqueSome[Seed] = Field(default=(0,), description="Each seed repeats every question.")
    models: ModelNames = Field(
        description="Names from models.yaml or built-in baselines (random, all-candidates, "
        "oracle, oracle-no-orientation, repeat, majority, text-only); or the word recorded: every "
        "folder of recorded replies in the official data."
    )
    prompt: Prompt = Field(
        default="default",
        description="default; official (read out of the official checkout); or the path of a .j2 "
        "template, relative to the suite file.",
    )
    images: ImagesSpec = Field(
        default_factory=ImagesSpec, description="Which pictures a model is shown."
    )
    vqa: VqaSpec = Field(
        default_factory=VqaSpec,
        description="The questions of the vqa track, and how they are shown.",
    )
    steps: StepsSpec = Field(
        default_factory=StepsSpec, description="The rules of the step_planning track."
    )
    parser: Literal["steps", "official"] = Field(
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
    tables: Unique[Table] = Field(
        default=("assembly", "table1", "table2", "table3", "endings", "progress", "errors"),
        description="Tables to write, as far as they belong to a track of the suite; published "
        "compares with the paper's numbers.",
    )

    @model_validator(mode="after")
    def _check_rules(self) -> SuiteSpec:
        broken = broken_rules(lambda dotted: read_dotted(self, dotted))
        if broken:
            raise refuse("; ".join(f"{rule.field}: {rule.message}" for rule in broken), rules=True)
        return self

    def identity(self) -> dict[str, Any]:
        """What determines the results, as JSON-able data.

        Leaves out description, limits and tables, sections of tracks that are not run, and paths
        (of data and templates): a run stores the hashes of what stands there, which say more and
        survive a move.
        """
        idle = {section for track, section in SECTIONS.items() if track not in self.tracks}
        spec = self.model_dump(mode="json", exclude={"description", "limits", "tables", *idle})
        for section in ("dataset", "vqa"):
            spec.get(section, {}).pop("path", None)
        for part in (spec, *(spec[name] for name in SECTIONS.values() if name in spec)):
            if part["prompt"] not in PROMPT_WORDS:
                part["prompt"] = "template"
        return spec
