"""`run.yaml`: the manifest of a run, written before any request, and its identity."""

from __future__ import annotations

import contextlib
import hashlib
import json
import platform
import re
from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from phyblock.config.models import HUMAN, ModelConfig
from phyblock.config.suite import Suite, Variant
from phyblock.data.base import UNNUMBERED, Dataset, read_version
from phyblock.files import digest_of_file
from phyblock.parsing.text import READER_VERSION
from phyblock.records.files import FORMAT, Manifest
from phyblock.sim.engine import ENGINES, described_engine
from phyblock.text import hex_digest
from phyblock.tracks.base import Track, kind_of, simulating

_ENGINES = (engine.distribution for engine in ENGINES.values())
_LIBRARIES = ("litellm", *_ENGINES, "numpy", "pillow", "jinja2")
"""Libraries whose versions a run records; one or both physics engines may be installed."""
_LABELS = ("published", "served_at", "size_b", "pictures")
_NOT_IDENTITY = {
    *("dataset.root", "suite.name", "suite.description", "suite.limits"),
    *("suite.models", "suite.baselines", "suite.seeds", "suite.dataset"),
}
"""Parts of a manifest that may change while the run stays the same, or that repeat others."""
_SENT = frozenset({"params", "sampling"})
"""Keys of values that are sent to a model unchanged, where `/no_think` is not a path."""
_PATH = re.compile(
    r"^([\w.-]+/(?=/|~/|[A-Za-z]:[\\/]))?(?:~/|/.*/|[A-Za-z]:[\\/])(?:.*[\\/])?([^\\/\n]+)[\\/]*$"
)
"""A path from the root or the home folder, after a provider if it names a model."""


def make_manifest(
    suite: Suite,
    models: Sequence[ModelConfig],
    dataset: Dataset,
    variants: Mapping[Variant, Sequence[Track]],
    limit: int | None,
) -> Manifest:
    """Return the manifest of a run.

    `identity` digests everything that determines the results, so that only the same run can
    continue in a folder: not limits, prices, labels, paths, or the order and addresses of models.
    """
    data_version = read_version(dataset.root)
    data: dict[str, object] = {"name": dataset.name, "sha256": dataset.sha256}
    numbered = {"version": data_version} if data_version != UNNUMBERED else {}
    # Models are not part of the identity, but every person has a separate run.
    people = [model for model in models if model.name.startswith(HUMAN)]
    inputs: dict[str, Any] = {
        "format": FORMAT,
        "suite": suite.identity(),
        "models": [{"name": person.name, **person.identity()} for person in people],
        "dataset": {**data, **numbered},
        "tracks": {track.name: track.identity() for track in variants[Variant()]},
        "limit": limit,
    }
    if suite.vary.factors:
        inputs["variants"] = {
            variant.key: {track.name: track.identity() for track in of_variant}
            for variant, of_variant in variants.items()
            if variant == variant.shown
        }
    libraries = {}
    for name in _LIBRARIES:
        with contextlib.suppress(PackageNotFoundError):
            libraries[name] = version(name)
    place = {"format": suite.dataset.format, "root": str(dataset.root)}
    fields = {
        "identity": hex_digest(json.dumps(inputs, sort_keys=True, separators=(",", ":"))),
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        **inputs,
        "suite": suite.model_dump(mode="json"),
        "models": [_model(model) for model in models],
        "dataset": {**data, "version": data_version, **place},
        **asked_counts(suite, dataset, variants[Variant()]),
        "versions": {"python": platform.python_version(), **libraries, **code_versions()},
    }
    if simulating(suite.model_dump()):
        fields["engine"] = described_engine()
    if suite.files.folders:
        name, root = next(iter(suite.files.folders.items()))
        form = getattr(suite, kind_of(name).section).format
        fields["questions"] = {"format": form, "root": str(root), "version": read_version(root)}
    return Manifest.model_validate(fields)


def asked_counts(suite: Suite, dataset: Dataset, tracks: Iterable[Track]) -> dict[str, Any]:
    """Return how many items and scenes a run asks about."""
    levels = [task.scene.levels for task in dataset.tasks]
    return {
        "items": {track.name: len(track.items) for track in tracks},
        "scenes": len(levels),
        "scenes_by_level": {level: sum(level in own for own in levels) for level in suite.levels},
    }


def code_versions() -> dict[str, str]:
    """Return the versions of the code that judges replies."""
    return {"phyblock": version("phyblock"), "readers": str(READER_VERSION)}


def _model(model: ModelConfig) -> dict[str, object]:
    """Return the entry of a model; a recording is identified by its content, not its path."""
    fields = {"name": model.name, **model.identity()}
    if model.replay is not None:
        digest, folder = hashlib.sha256(), Path(model.replay)
        for path in sorted((*folder.glob("*.json"), *folder.glob("records.jsonl"))):
            digest.update(f"{path.name} {digest_of_file(path)}\n".encode())
        fields["recording"] = digest.hexdigest()
    fields |= {"published": model.published, "size_b": model.size_b}
    return fields | ({"served_at": model.addresses} if model.addresses else {})


def differences(found: Manifest, wanted: Manifest) -> list[str]:
    """Return what makes two manifests different runs, by dotted names with old and new values."""
    old, new = _parts(found), _parts(wanted)
    is_same = found.identity == wanted.identity
    differ = [
        f"{part}.{key} ({json.dumps(old[part].get(key))}, now {json.dumps(new[part].get(key))})"
        for part in new
        if part in old and (part.startswith("models.") or not is_same)
        for key in {**old[part], **new[part]}
        if old[part].get(key) != new[part].get(key)
        if key not in _LABELS and f"{part}.{key}" not in _NOT_IDENTITY
    ]
    return differ or ([] if is_same else ["how phyblock asks, draws or reads"])


def _parts(manifest: Manifest) -> dict[str, dict[str, Any]]:
    """Return the fields of a manifest by part and name."""
    fields = manifest.fields()
    models = {f"models.{one.name}": one.fields() for one in (*manifest.models, *manifest.others)}
    suite = {**fields["suite"], "limit": manifest.limit}
    return {"suite": suite, **models, "dataset": fields.get("dataset") or {}, **manifest.tracks}


def portable_manifest(manifest: Manifest) -> Manifest:
    """Return the manifest with only the last part of every path, and without server addresses.

    Values that are sent to models are kept, and so is the identity of the original.
    """
    fields = without_paths(manifest.fields())
    for model in fields.get("models", ()):
        model.pop("served_at", None)
    for part in ("dataset", "questions"):
        held = getattr(manifest, part)
        if held is not None and held.root:
            fields[part]["root"] = Path(held.root).resolve().name
    return Manifest.model_validate(fields)


def without_paths(value: Any) -> Any:
    """Return a value with only the last part of every path, except in values sent to models."""
    if isinstance(value, str):
        return _PATH.sub(r"\1\2", value)
    if isinstance(value, Mapping):
        return {key: one if key in _SENT else without_paths(one) for key, one in value.items()}
    return [*map(without_paths, value)] if isinstance(value, list | tuple) else value
