"""What decides a run's results, and the digests of it that name the run."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from phyblock.config.suite import Suite, Variant
from phyblock.data import Dataset
from phyblock.data.version import UNNUMBERED
from phyblock.parsing.text import READER_VERSION
from phyblock.records import FORMAT
from phyblock.run.models import PlannedModel
from phyblock.stable import hex_digest
from phyblock.tracks import AnyTrack
from phyblock.tracks.base import READER

__all__ = ["Inputs", "earlier_identities", "identity_of", "inputs_of"]

Inputs = Mapping[str, Any]
"""What decides the results but for the version of the readers that tracks share."""


def inputs_of(
    suite: Suite,
    models: Sequence[PlannedModel],
    dataset: Dataset,
    data_version: int,
    variants: Mapping[Variant, Sequence[AnyTrack]],
    limit: int | None,
) -> Inputs:
    """What decides the results; `variants` has the tracks of every way of asking."""
    inputs: dict[str, Any] = {
        "format": FORMAT,
        "suite": suite.identity(),
        "models": [{"name": m.name, **_model(m)} for m in models],
        "dataset": _dataset(dataset, data_version),
        "tracks": {track.name: track.identity() for track in variants[Variant()]},
        "limit": limit,
    }
    if suite.vary.factors:
        inputs["variants"] = {
            variant.key: {track.name: track.identity() for track in of_variant}
            for variant, of_variant in variants.items()
            if variant == variant.shown
        }
    return inputs


def identity_of(inputs: Inputs, readers: int | None) -> str:
    """Hex digest of the inputs, whatever the order of the models; `readers` None stands for a time
    when their versions were not counted.
    """
    by_name = sorted(inputs["models"], key=lambda model: str(model["name"]))
    decided = {**inputs, "models": by_name}
    if readers is not None:
        decided["readers"] = readers
    canonical = json.dumps(decided, sort_keys=True, separators=(",", ":"))
    return hex_digest(canonical)


def earlier_identities(inputs: Inputs) -> tuple[str, ...]:
    """What the same run was named while earlier readers read its replies, the latest first."""
    known = (*range(READER_VERSION, 0, -1), None)
    named = [identity_of(one, readers) for readers, one in product(known, _by_own(inputs))]
    return tuple(named[1:])


def _by_own(inputs: Inputs) -> Iterator[Inputs]:
    """The inputs under every version up to this one of the readers that tracks have of their own,
    this version first.
    """
    own = {name: told[READER] for name, told in inputs["tracks"].items() if READER in told}

    def under(told: Mapping[str, Any], versions: Mapping[str, int]) -> dict[str, Any]:
        return {
            name: {**about, READER: versions[name]} if READER in about else about
            for name, about in told.items()
        }

    for chosen in product(*(range(version, 0, -1) for version in own.values())):
        versions = dict(zip(own, chosen, strict=True))
        changed = {**inputs, "tracks": under(inputs["tracks"], versions)}
        if "variants" in inputs:
            of_variants = inputs["variants"].items()
            changed["variants"] = {key: under(told, versions) for key, told in of_variants}
        yield changed


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
