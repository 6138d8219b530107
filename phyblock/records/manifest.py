"""`run.yaml`: what a run is, written before anything is asked."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from phyblock.config.suite import Suite, suite_model
from phyblock.config.validation import Fault, checked, problems_of
from phyblock.config.yaml import parse_yaml
from phyblock.errors import InputError, Problem, StoreError, reason_of
from phyblock.files import read_text
from phyblock.records.line import Line, not_a, validated

FORMAT = 1
"""Version of run folders; one that adds fields alone stays the same."""
MANIFEST = "run.yaml"
_HINT = "run.yaml is written by `phyblock run` and never edited: restore it from a copy"
_DIGITS = 16
_LARGEST_BYTES = 2 * 1024 * 1024
"""Far above what a suite of the largest allowed size comes to."""


Version = Annotated[int, Field(ge=1)]


class ManifestModel(Line):
    """A model of the run; what decides its replies stands beside it."""

    name: str
    """Its name in the run."""
    published: str | None = None
    """Its name in the paper."""
    size_b: float | None = None
    """Its size [billion parameters]."""
    served_at: tuple[str, ...] = ()
    """Addresses of your own servers at which it was called when the run began."""
    kind: str = ""
    """`litellm`: asked over the network; `replay`: a recording; `baseline`: a rule; `human`: a
    person."""

    @property
    def is_baseline(self) -> bool:
        """True if it is a rule; rules have no rank among models."""
        return self.kind == "baseline"


def _same_names(models: tuple[ManifestModel, ...]) -> Iterator[Fault]:
    names = [model.name for model in models]
    for index, name in enumerate(names):
        if name in names[:index]:
            yield Fault("stands twice in this list", found=name, at=(index, "name"))


class ManifestDataset(Line):
    """The data set."""

    name: str
    """Its name."""
    sha256: str
    """Digest of the scenes that were asked about."""
    version: Version = 1
    """Its version; results on different versions are never mixed."""
    format: str = "builtin"
    """Its layout."""
    root: str = ""
    """The folder that it was in."""


class ManifestQuestions(Line):
    """The question set."""

    format: str
    """Its layout."""
    root: str
    """The folder that it was in."""
    version: Version = 1
    """Its version; results on different versions are never mixed."""


class Manifest(Line):
    """A description of a run, written before anything is asked."""

    identity: str
    """Digest of everything that decides the results: only the same run continues in a folder."""
    created: str = ""
    """The time when it was begun, UTC."""
    format: Annotated[int, Field(ge=1, le=FORMAT)] = FORMAT
    """Version of the run folder."""
    suite: dict[str, Any] = Field(default_factory=dict)
    """The suite, with all defaults filled in."""
    models: Annotated[tuple[ManifestModel, ...], checked(_same_names)] = ()
    """The models and how they are called."""
    others: tuple[ManifestModel, ...] = ()
    """Models that ran in this folder before, but were not named this time: their records stay, and
    tables leave them out until they are named again."""
    dataset: ManifestDataset | None = None
    """The data set."""
    tracks: dict[str, dict[str, Any]] = Field(default_factory=dict)
    """Digests of what decides the results of each track: prompt, pictures, questions."""
    variants: dict[str, dict[str, dict[str, Any]]] = Field(default_factory=dict)
    """The same digests by condition, as records name it, and track; empty: there is only one."""
    limit: int | None = None
    """Most items of each track."""
    questions: ManifestQuestions | None = None
    """The question set, where one is asked."""
    items: dict[str, int] = Field(default_factory=dict)
    """Number of items that each track asks about."""
    scenes: int = 0
    """Distinct scenes."""
    scenes_by_level: dict[int, int] = Field(default_factory=dict)
    """Scenes of each level; one scene may be of several."""
    engine: str | None = None
    """The physics engine, with its version; null where nothing in the run depends on one."""
    versions: dict[str, str] = Field(default_factory=dict)
    """Versions of Python, of libraries, and of the readers that read the replies."""

    @property
    def run(self) -> str:
        """The digest by which its records show that they are its own."""
        return self.identity[:_DIGITS]

    def selects(self, model: str, seed: int) -> bool:
        """True if the models and seeds of the run include these; others may be on file."""
        seeds = self.suite.get("seeds")
        return seed in (seeds or [seed]) and (
            not self.models or any(model == one.name for one in self.models)
        )


def read_manifest(folder: Path) -> Manifest:
    """Return the run's manifest; StoreError when there is none or it cannot be read."""
    path = folder / MANIFEST
    try:
        return _manifest(read_text(path, _LARGEST_BYTES), str(path))
    except (FileNotFoundError, NotADirectoryError) as error:
        allowed = "a folder that phyblock run wrote"
        raise StoreError(Problem(str(folder), f"holds no {MANIFEST}", allowed=allowed)) from error
    except (OSError, ValueError) as error:
        message = f"cannot be read: {reason_of(error)}"
        raise StoreError(Problem(str(path), message, hint=_HINT)) from error
    except InputError as error:
        raise not_a("run manifest", error, _HINT) from error


@functools.lru_cache(maxsize=2)
def _manifest(text: str, where: str) -> Manifest:
    """Return a manifest, which one command reads several times."""
    source = parse_yaml(text, where, _LARGEST_BYTES)
    return validated(Manifest, source.data, source)


def suite_of(manifest: Manifest, where: str) -> Suite:
    """Return the suite of a run; StoreError naming `where` and every field that is wrong."""
    try:
        return suite_model().model_validate(manifest.suite)
    except ValidationError as error:
        problems = problems_of(error, suite_model(), manifest.suite, where)
        raise StoreError(
            replace(one, field=f"suite.{one.field}", hint=_HINT) for one in problems
        ) from error
