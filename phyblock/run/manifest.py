"""`run.yaml`: what a run is, written before anything is asked; and what makes two runs of it."""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from phyblock.config.models import HUMAN, ModelConfig
from phyblock.config.suite import Suite, Variant
from phyblock.data import UNNUMBERED, Dataset, read_version
from phyblock.parsing.text import READER_VERSION
from phyblock.records.manifest import FORMAT, Manifest, ManifestModel
from phyblock.run.judge import extraction_prompt
from phyblock.sim.engine import ENGINES, PHYSICS_VARIABLE, REFERENCE_ENGINE, described_engine
from phyblock.stable import hex_digest
from phyblock.tracks import AnyTrack, kind_of
from phyblock.tracks.base import CARRYING, ENGINE, kinds_with_physics

_ENGINES = (engine.distribution for engine in ENGINES.values())
_LIBRARIES = ("litellm", *_ENGINES, "numpy", "pillow", "jinja2")
"""Of the physics engines, one or both may be there."""
_LABELS = ("published", "served_at", "size_b")
_NOT_IDENTITY = {
    *(f"suite.{name}" for name in ("name", "description", "limit", "limits", "models")),
    *(f"suite.{name}" for name in ("baselines", "seeds", "dataset")),
    "dataset.root",
}
"""Parts of a manifest that may change while the run stays the same, or that others repeat."""


def make_manifest(
    suite: Suite,
    models: Sequence[ModelConfig],
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
        **asked_counts(suite, dataset, variants[Variant()]),
        "versions": {"python": platform.python_version(), **_versions(), **code_versions()},
    }
    return Manifest.model_validate(fields)


def asked_counts(suite: Suite, dataset: Dataset, tracks: Iterable[AnyTrack]) -> dict[str, Any]:
    """Return how many items and scenes a run asks about, of what is selected of its data."""
    levels = [task.scene.levels for task in dataset.tasks]
    return {
        "items": {track.name: len(track.items) for track in tracks},
        "scenes": len(levels),
        "scenes_by_level": {level: sum(level in own for own in levels) for level in suite.levels},
    }


def code_versions() -> dict[str, str]:
    """Return the versions of what judges replies."""
    return {"phyblock": version("phyblock"), "readers": str(READER_VERSION)}


def _place(model: ModelConfig) -> dict[str, object]:
    """Address of a model's server, which decides nothing."""
    addresses = model.addresses
    return {"served_at": addresses} if addresses else {}


def _versions() -> dict[str, str]:
    found = {}
    for name in _LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            found[name] = version(name)
    return found


def _model(model: ModelConfig) -> dict[str, object]:
    """Return what decides a model's replies; a recording by what is in it, not by where it is."""
    folder = model.recording
    if folder is None:
        return model.identity()
    digest = hashlib.sha256()
    for path in sorted((*folder.glob("*.json"), *folder.glob("records.jsonl"))):
        digest.update(f"{path.name} {hashlib.sha256(path.read_bytes()).hexdigest()}\n".encode())
    return {**model.identity(), "recording": digest.hexdigest()}


def differences(found: Manifest, wanted: Manifest) -> list[str]:
    """Return dotted names of what makes two manifests two runs; none where they are of one."""
    asked = {model.name: _decisive(model) for model in (*found.models, *found.others)}
    models = [
        f"models.{model.name}.{key}"
        for model in wanted.models
        for was, now in [(asked.get(model.name, {}), _decisive(model))]
        for key in sorted(now.keys() | was.keys())
        if was and now.get(key) != was.get(key)
    ]
    if found.identity == wanted.identity:
        return models
    old, new = dict(_parts(found)), dict(_parts(wanted))
    gone = (name for name in old.keys() - new.keys() if name.partition(".")[0] in wanted.tracks)
    names = [
        name
        for name in (*new, *sorted(gone))
        # What an older version did not know of a suite, it did not do otherwise.
        if name not in _NOT_IDENTITY
        and (name in old or not name.startswith("suite."))
        and old.get(name) != new.get(name)
    ]
    if {"suite.levels", "limit"} & set(names):
        # Other scenes of the same data have other digests, too.
        names = [name for name in names if not name.endswith("sha256")]
    return [*names, *models] or ["how phyblock asks, draws or reads"]


def reasons(found: Manifest, wanted: Manifest) -> Iterator[str]:
    """Yield the differences of manifests that a user wrote in the same words."""
    made, now = (one.dataset.version if one.dataset else 1 for one in (found, wanted))
    if made != now:
        yield f"its data are version {made}, these version {now}"
    tracks = [name for name in wanted.tracks if name in found.tracks]
    differs = {
        key: any(found.tracks[name].get(key) != wanted.tracks[name].get(key) for name in tracks)
        for key in (ENGINE, CARRYING)
    }
    if differs[ENGINE]:
        was, is_now = (one.engine or REFERENCE_ENGINE for one in (found, wanted))
        yield f"its blocks are let go in {was}, here in {is_now} ({PHYSICS_VARIABLE} chooses)"
    if differs[CARRYING]:
        yield (
            "this version carries plans out and measures what stands otherwise than the one "
            "that made it, which phyblock score leaves as it was"
        )


def _decisive(model: ManifestModel) -> dict[str, Any]:
    """Return what decides a model's replies."""
    return {key: value for key, value in model.fields().items() if key not in _LABELS}


def _parts(manifest: Manifest) -> Iterator[tuple[str, Any]]:
    """Yield dotted names and values of what a run is made of, without digests of pictures."""
    fields = manifest.fields()
    yield "limit", manifest.limit
    for part, about in (
        *((one, fields.get(one)) for one in ("suite", "dataset")),
        *manifest.tracks.items(),
    ):
        yield from (
            (f"{part}.{key}", one) for key, one in (about or {}).items() if key != "pictures"
        )
