"""`run.yaml`: what a run is, written before anything is asked."""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from phyblock.config.models import HUMAN, ModelConfig
from phyblock.config.suite import Suite, Variant
from phyblock.data import UNNUMBERED, Dataset, read_version
from phyblock.parsing.text import READER_VERSION
from phyblock.records.manifest import FORMAT, Manifest
from phyblock.run.judge import extraction_prompt
from phyblock.run.models import PlannedModel
from phyblock.sim.engine import ENGINES, described_engine
from phyblock.stable import hex_digest
from phyblock.tracks import AnyTrack, kind_of
from phyblock.tracks.base import kinds_with_physics

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
    """Address of a model's server, which decides nothing."""
    addresses = model.config.addresses
    return {"served_at": addresses} if addresses else {}


def _versions() -> dict[str, str]:
    found = {}
    for name in _LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _of_tracks(suite: Suite) -> dict[str, Any]:
    """Facts of single tracks beyond what all of them have."""
    kinds = [kind_of(name) for name in suite.tracks]
    told = {"engine": described_engine()} if kinds_with_physics(suite.model_dump()) else {}
    return told | {key: value for kind in kinds for key, value in kind.manifest(suite).items()}


Inputs = Mapping[str, Any]
"""Data that decides the results, but for the version of the readers."""


def inputs_of(
    suite: Suite,
    models: Sequence[PlannedModel],
    dataset: Dataset,
    data_version: int,
    variants: Mapping[Variant, Sequence[AnyTrack]],
    limit: int | None,
    extractor: ModelConfig | None = None,
) -> Inputs:
    """Return what decides the results; `variants` has the tracks of every condition."""
    inputs: dict[str, Any] = {
        "format": FORMAT,
        "suite": suite.identity(),
        "models": [{"name": m.name, **_model(m)} for m in models],
        "dataset": _dataset(dataset, data_version),
        "tracks": {track.name: _track(track) for track in variants[Variant()]},
        "limit": limit,
    }
    if extractor is not None:
        version = extraction_prompt().version
        inputs["extractor"] = {**extractor.identity(), "prompt": version}
    if suite.vary.factors:
        inputs["variants"] = {
            variant.key: {track.name: _track(track) for track in of_variant}
            for variant, of_variant in variants.items()
            if variant == variant.shown
        }
    return inputs


def identity_of(inputs: Inputs) -> str:
    """Return the hex digest of the inputs, whoever is asked; every person has a run alone."""
    people = [model for model in inputs["models"] if str(model["name"]).startswith(HUMAN)]
    decisive = {**inputs, "models": people}
    return hex_digest(json.dumps(decisive, sort_keys=True, separators=(",", ":")))


def _track(track: AnyTrack) -> dict[str, Any]:
    """Return what decides a track's requests."""
    return track.identity()


def _dataset(dataset: Dataset, data_version: int) -> dict[str, object]:
    """Return the facts of the data that decide the results."""
    known: dict[str, object] = {"name": dataset.name, "sha256": dataset.sha256}
    return known if data_version == UNNUMBERED else {**known, "version": data_version}


def _model(model: PlannedModel) -> dict[str, object]:
    """Return what decides a model's replies; a recording by what is in it, not by where it is."""
    folder = model.config.recording
    if folder is None:
        return model.config.identity()
    digest = hashlib.sha256()
    for path in sorted((*folder.glob("*.json"), *folder.glob("records.jsonl"))):
        digest.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return {**model.config.identity(), "recording": digest.hexdigest()}
