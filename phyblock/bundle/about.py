"""What a bundle says of itself: digests of what is in it and of all that its scores rest on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from phyblock.bundle.archive import ABOUT, MEMBERS
from phyblock.errors import Problem, StoreError
from phyblock.files import read_bytes
from phyblock.parsing.text import READER_VERSION
from phyblock.records.files import RECORDS
from phyblock.records.line import Line, decode, problems_of
from phyblock.records.manifest import MANIFEST, Manifest
from phyblock.report.inputs import digest_of_file
from phyblock.stable import hex_digest

__all__ = [
    "FORMAT",
    "About",
    "BundledData",
    "about_text",
    "data_of",
    "describe",
    "read_about",
]

FORMAT = 1
"""Version of bundles."""

_IS_NOT = "is no description of a bundle"
_HINT = "ask for the bundle again, or make it again with phyblock bundle"
Digest = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class BundledData(Line):
    """A data set or question set that is needed to score again; the bundle does not hold it."""

    name: str
    """Its name."""
    version: Annotated[int, Field(ge=1)] = 1
    """Its version."""
    format: str = "builtin"
    """Its layout."""
    sha256: str = ""
    """Digest of the scenes that were asked about; "" for questions, whose are in `tracks`."""


class About(Line):
    """`bundle.json`."""

    format: Annotated[int, Field(ge=1, le=FORMAT)]
    """Version of the bundle."""
    run: str
    """Identity of the run."""
    phyblock: str
    """The phyblock that made the bundle."""
    readers: int
    """Version of the readers by which it scores replies."""
    files: dict[str, Digest]
    """Digests of the other members."""
    tables: dict[str, Digest]
    """Digests of the tables that the records make, by file name."""
    suite: Digest
    """Digest of the suite in `run.yaml`, as JSON with sorted keys."""
    tracks: dict[str, dict[str, Any]]
    """Version of the prompt, and digests of pictures and questions, by track."""
    data: dict[str, BundledData]
    """What is needed to score again: `dataset`, and `questions` where there are any."""


_ABOUT: TypeAdapter[About] = TypeAdapter(About)


def describe(
    manifest: Manifest, files: dict[str, bytes], tables: dict[str, str], phyblock: str
) -> About:
    """What a bundle of these files says of itself; `tables` are digests."""
    return About(
        format=FORMAT,
        run=manifest.identity,
        phyblock=phyblock,
        readers=READER_VERSION,
        files={name: hex_digest(files[name]) for name in (MANIFEST, RECORDS)},
        tables=tables,
        suite=_digest_of_suite(manifest),
        tracks=manifest.tracks,
        data=data_of(manifest),
    )


def data_of(manifest: Manifest) -> dict[str, BundledData]:
    """What is needed to score a run again, by its part of the manifest."""
    needed: dict[str, BundledData] = {}
    if (held := manifest.dataset) is not None:
        needed["dataset"] = BundledData(
            name=held.name, version=held.version, format=held.format, sha256=held.sha256
        )
    if (asked := manifest.questions) is not None:
        name = Path(asked.root).name
        needed["questions"] = BundledData(name=name, version=asked.version, format=asked.format)
    return needed


def about_text(about: About) -> str:
    """`bundle.json`, for people too."""
    return json.dumps(about.fields(), indent=2, allow_nan=False) + "\n"


def read_about(path: Path, folder: Path, manifest: Manifest) -> About:
    """What the bundle at `path`, unpacked in `folder`, says of itself, held against its members.

    Raises StoreError for anything that does not agree.
    """
    where = f"{path}: {ABOUT}"
    try:
        about = decode(_ABOUT, read_bytes(folder / ABOUT, MEMBERS[ABOUT]))
    except ValidationError as error:
        raise StoreError(problems_of(error, where, About, _IS_NOT, _HINT)) from error
    except ValueError as error:
        raise StoreError(Problem(where, f"{_IS_NOT}: {error}", hint=_HINT)) from error
    assert isinstance(about, About)
    if not manifest.models:
        raise StoreError(Problem(f"{path}: {MANIFEST}", "names no model", "models", hint=_HINT))
    actual = {
        **{f"files.{name}": digest_of_file(folder / name) for name in (MANIFEST, RECORDS)},
        "run": manifest.identity,
        "suite": _digest_of_suite(manifest),
    }
    stated = {
        **{f"files.{name}": about.files.get(name, "") for name in (MANIFEST, RECORDS)},
        "run": about.run,
        "suite": about.suite,
    }
    differ = [name for name in actual if actual[name] != stated[name]]
    if about.tracks != manifest.tracks:
        differ.append("tracks")
    if about.data != data_of(manifest):
        differ.append("data")
    if differ:
        message = "is not what the bundle says it is: it was changed after it was made"
        raise StoreError(
            Problem(str(path), message, name, actual.get(name, ""), stated.get(name, ""), _HINT)
            for name in differ
        )
    return about


def _digest_of_suite(manifest: Manifest) -> str:
    text = json.dumps(manifest.suite, sort_keys=True, separators=(",", ":"), default=str)
    return hex_digest(text.encode("utf-8", "replace"))
