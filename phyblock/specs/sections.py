"""The sections of a suite file that belong to no single track.

The descriptions below become the JSON Schema's, which an editor shows beside each key.
"""

from __future__ import annotations

from typing import Annotated, ClassVar

from pydantic import AfterValidator, Field

from phyblock.specs.fields import (
    Count,
    MaxTokens,
    Section,
    Temperature,
    TimeoutS,
    TopP,
    UniqueSome,
    check_unique,
)
from phyblock.types import (
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
    View,
)

__all__ = [
    "CandidatesSpec",
    "DatasetSpec",
    "ImagesSpec",
    "LimitsSpec",
    "SamplingSpec",
    "ScoringSpec",
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


class SamplingSpec(Section):
    """Sampling parameters for models that say nothing of their own."""

    temperature: Temperature | None = Field(default=0.0, description="0 to 2; null: not sent.")
    top_p: TopP | None = Field(default=None, description="Above 0, at most 1; null: not sent.")
    max_tokens: MaxTokens | None = Field(
        default=4096, description="Limit of a reply, thinking included [tokens]; null: not sent."
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
