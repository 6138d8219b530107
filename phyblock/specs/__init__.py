"""What a person may write in YAML: suites, models files and --set overrides."""

from phyblock.specs.groups import GROUP, HUMAN, group_names, unknown_model, with_members
from phyblock.specs.loading import LoadedSuite, load_suite, resolve_models, suite_tracks
from phyblock.specs.model import ModelSpec
from phyblock.specs.models_file import load_models
from phyblock.specs.prices import BatchRateSpec, RateSpec
from phyblock.specs.schema import models_schema, suite_schema
from phyblock.specs.sections import (
    SamplingSpec,
)
from phyblock.specs.suite import RECORDED, SuiteSpec, suite_model
from phyblock.specs.words import did_you_mean

__all__ = [
    "GROUP",
    "HUMAN",
    "RECORDED",
    "BatchRateSpec",
    "LoadedSuite",
    "ModelSpec",
    "RateSpec",
    "SamplingSpec",
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
