"""Identity of a run: a digest of everything that decides its results."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.config.suite import Suite, Variant
from phyblock.data import UNNUMBERED, Dataset
from phyblock.records.manifest import FORMAT
from phyblock.run.extraction import extraction_prompt
from phyblock.run.models import PlannedModel
from phyblock.stable import hex_digest
from phyblock.tracks import AnyTrack
from phyblock.tracks.base import READER

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
    """Return the hex digest of the inputs, whatever the order of the models."""
    by_name = sorted(inputs["models"], key=lambda model: str(model["name"]))
    canonical = json.dumps({**inputs, "models": by_name}, sort_keys=True, separators=(",", ":"))
    return hex_digest(canonical)


def _track(track: AnyTrack) -> dict[str, Any]:
    """What decides what a track asks; replies are judged again when its reader changes."""
    return {name: value for name, value in track.identity().items() if name != READER}


def _dataset(dataset: Dataset, data_version: int) -> dict[str, object]:
    """What of the data decides the results; runs from before versions were counted say none."""
    known: dict[str, object] = {"name": dataset.name, "sha256": dataset.sha256}
    return known if data_version == UNNUMBERED else {**known, "version": data_version}


def _model(model: PlannedModel) -> dict[str, object]:
    """What decides a model's replies; a recording by what is in it, not by where it is."""
    folder = model.config.recording
    if folder is None:
        return model.config.identity()
    digest = hashlib.sha256()
    for path in sorted((*folder.glob("*.json"), *folder.glob("records.jsonl"))):
        digest.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return {**model.config.identity(), "recording": digest.hexdigest()}
