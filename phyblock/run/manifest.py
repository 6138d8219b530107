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
    Limits, prices, labels, paths, and where and in which order models are named and served
    are no part of it. `variants` has the tracks of every condition.
    """
    data_version = read_version(dataset.root)
    known: dict[str, object] = {"name": dataset.name, "sha256": dataset.sha256}
    if data_version != UNNUMBERED:
        known["version"] = data_version
    decisive = [{"name": m.name, **_model(m)} for m in models]
    inputs: dict[str, Any] = {
        "format": FORMAT,
        "suite": suite.identity(),
        # Whoever is asked, the run is the same; but every person has a run alone.
        "models": [model for model in decisive if str(model["name"]).startswith(HUMAN)],
        "dataset": known,
        "tracks": {track.name: track.identity() for track in variants[Variant()]},
        "limit": limit,
    }
    if extractor is not None:
        inputs["extractor"] = {**extractor.identity(), "prompt": extraction_prompt().version}
    if suite.vary.factors:
        inputs["variants"] = {
            variant.key: {track.name: track.identity() for track in of_variant}
            for variant, of_variant in variants.items()
            if variant == variant.shown
        }
    identity = hex_digest(json.dumps(inputs, sort_keys=True, separators=(",", ":")))
    scenes = [task.scene for task in dataset.tasks]
    kinds = [kind_of(name) for name in suite.tracks]
    engine = {"engine": described_engine()} if kinds_with_physics(suite.model_dump()) else {}
    fields = {
        "identity": identity,
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **inputs,
        "suite": suite.model_dump(mode="json"),
        "models": [
            {**one, "published": m.published, "size_b": m.size_b, **_place(m)}
            for one, m in zip(decisive, models, strict=True)
        ],
        "dataset": {
            **known,
            "version": data_version,
            "format": suite.dataset.format,
            "root": str(dataset.root),
        },
        **engine,
        **{key: value for kind in kinds for key, value in kind.manifest(suite).items()},
        "items": {track.name: len(track.items) for track in variants[Variant()]},
        "scenes": len(scenes),
        "scenes_by_level": {
            level: sum(level in scene.levels for scene in scenes) for level in suite.levels
        },
        "versions": {"python": platform.python_version(), **_versions(), **code_versions()},
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


def _model(model: PlannedModel) -> dict[str, object]:
    """Return what decides a model's replies; a recording by what is in it, not by where it is."""
    folder = model.config.recording
    if folder is None:
        return model.config.identity()
    digest = hashlib.sha256()
    for path in sorted((*folder.glob("*.json"), *folder.glob("records.jsonl"))):
        digest.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return {**model.config.identity(), "recording": digest.hexdigest()}
