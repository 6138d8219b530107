"""What a person may write in YAML: suites, models files and --set overrides."""

from phyblock.specs.model import ModelSpec, PriceSpec
from phyblock.specs.suite import (
    BASELINES,
    BUILTIN_DATASET,
    RECORDED,
    DatasetSpec,
    ImagesSpec,
    LimitsSpec,
    SamplingSpec,
    ScoringSpec,
    SuiteSpec,
)

__all__ = [
    "BASELINES",
    "BUILTIN_DATASET",
    "RECORDED",
    "DatasetSpec",
    "ImagesSpec",
    "LimitsSpec",
    "ModelSpec",
    "PriceSpec",
    "SamplingSpec",
    "ScoringSpec",
    "SuiteSpec",
]
