"""`run.yaml`: what a run is, written before anything is asked."""

from __future__ import annotations

import contextlib
import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.config.suite import Suite, Variant
from phyblock.data import Dataset, read_version
from phyblock.parsing.text import READER_VERSION
from phyblock.records.manifest import Manifest
from phyblock.run.identity import identity_of, inputs_of
from phyblock.run.models import PlannedModel
from phyblock.sim.engine import ENGINES, described_engine
from phyblock.tracks import AnyTrack, kind_of
from phyblock.tracks.kind import kinds_with_physics

__all__ = ["code_versions", "make_manifest"]

_ENGINES = (engine.distribution for engine in ENGINES.values())
_LIBRARIES = ("litellm", *_ENGINES, "numpy", "pillow", "jinja2")
"""Of the physics engines, one or both may be there."""


def make_manifest(
    suite: Suite,
    models: Sequence[PlannedModel],
    dataset: Dataset,
    variants: Mapping[Variant, Sequence[AnyTrack]],
    limit: int | None,
    extractor: ModelConfig | None = None,
) -> Manifest:
    """Return the manifest of a run.

    `identity` digests what decides the results, so that only the same run goes on in a folder.
    Limits, prices, labels, tables, paths, and where and in which order models are named and served
    are no part of it. `variants` has the tracks of every condition.
    """
    data_version = read_version(dataset.root)
    inputs = inputs_of(suite, models, dataset, data_version, variants, limit, extractor)
    scenes = [task.scene for task in dataset.tasks]
    fields = {
        "identity": identity_of(inputs),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **inputs,
        "suite": suite.model_dump(mode="json"),
        "models": [
            {**decisive, "published": m.published, "size_b": m.size_b, **_place(m)}
            for decisive, m in zip(inputs["models"], models, strict=True)
        ],
        "dataset": {
            **inputs["dataset"],
            "version": data_version,
            "format": suite.dataset.format,
            "root": str(dataset.root),
        },
        **_of_tracks(suite),
        "items": {track.name: len(track.items) for track in variants[Variant()]},
        "scenes": len(scenes),
        "scenes_by_level": {
            level: sum(level in scene.levels for scene in scenes) for level in suite.levels
        },
        "versions": {
            "python": platform.python_version(),
            **_versions(),
            **code_versions(),
        },
    }
    return Manifest.model_validate(fields)


def code_versions() -> dict[str, str]:
    """Return the versions of what judges replies."""
    return {"phyblock": version("phyblock"), "readers": str(READER_VERSION)}


def _place(model: PlannedModel) -> dict[str, object]:
    """Where a model is served, which decides nothing."""
    addresses = model.config.addresses
    return {"served_at": addresses} if addresses else {}


def _versions() -> dict[str, str]:
    found = {}
    for name in _LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _of_tracks(suite: Suite) -> dict[str, Any]:
    """What single tracks say beyond what all of them have."""
    kinds = [kind_of(name) for name in suite.tracks]
    told = {"engine": described_engine()} if kinds_with_physics(suite.model_dump()) else {}
    return told | {
        key: value
        for kind in kinds
        if kind.manifest is not None
        for key, value in kind.manifest(suite).items()
    }
