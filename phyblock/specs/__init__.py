"""What a person may write in YAML: suites, models files and --set overrides."""

from phyblock.specs.groups import GROUP, HUMAN, group_names, unknown_model, with_members
from phyblock.specs.loading import LoadedSuite, load_suite, resolve_models, suite_tracks
from phyblock.specs.model import ModelSpec
from phyblock.specs.models_file import load_models
from phyblock.specs.prices import BatchRateSpec, PriceSpec, RateSpec
from phyblock.specs.schema import models_schema, suite_schema
from phyblock.specs.sections import (
    DatasetSpec,
    ImagesSpec,
    LimitsSpec,
    SamplingSpec,
    ScoringSpec,
)
from phyblock.specs.suite import BUILTIN_DATASET, RECORDED, SuiteSpec, suite_model
from phyblock.specs.words import did_you_mean

__all__ = [
    "BUILTIN_DATASET",
    "GROUP",
    "HUMAN",
    "RECORDED",
    "BatchRateSpec",
    "DatasetSpec",
    "ImagesSpec",
    "LimitsSpec",
    "LoadedSuite",
    "ModelSpec",
    "PriceSpec",
    "RateSpec",
    "SamplingSpec",
    "ScoringSpec",
    "SuiteSpec",
    "did_you_mean",
    "group_names",
    "load_models",
    "load_suite",
    "models_schema",
    "resolve_models",
    "suite_model",
    "suite_schema",
    "suite_tracks",
    "unknown_model",
    "with_members",
]
