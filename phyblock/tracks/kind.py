"""The declaration of a track, by which everything outside its module goes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from phyblock.config.suite import Suite
from phyblock.data import Dataset
from phyblock.records.manifest import Manifest
from phyblock.records.record import Record
from phyblock.registry import known_tracks
from phyblock.tracks.base import AnyTrack
from phyblock.tracks.by_hand import Picking
from phyblock.tracks.measures import SampleCounts, TrackReport
from phyblock.tracks.pictures import Workshop, render_workers

__all__ = ["Opening", "TrackKind", "kind_of", "kinds", "kinds_with_physics"]


@dataclass(frozen=True)
class Opening:
    """The arguments that a track is opened with; without `with_prompts` nothing is asked of anyone.

    `limit` is how many items the user wants at most, None for all. `shop` is where pictures
    of all tracks are drawn.
    """

    suite: Suite
    dataset: Dataset
    limit: int | None
    with_prompts: bool
    shop: Workshop = field(default_factory=lambda: Workshop(render_workers()))


@dataclass(frozen=True)
class TrackKind:
    """A track: what it is called, what it adds to a suite, how it is opened.

    `title` and `item` (the noun for what it asks about) are for people, `about` says in a suite's
    documentation what it asks. `open` raises SpecError, DataError or PromptError with what is
    wrong. `report` imports what tables and figures are made by, which takes long. `subject` is the
    type that the rules of its `baselines` take, with a random generator, to answer in the
    benchmark's own reply form. `section` is the key, model and description of the part of a suite
    that is its own. `template` is the bundled prompt, None where it has none, and `prompt_field`
    where a suite names another; `json_template` is the one that asks for JSON, None where the track
    asks for text alone. `own_data` gives the folder of data of its own as a suite says it,
    `manifest` what the manifest says beyond what all tracks have. `own_root` tells where a run
    found these data. With `rescored`, what its replies are worth depends on the suite's parser and
    matchers, and `phyblock score` judges them again even where no measure counts samples. With
    `plays`, samples are episodes of several turns. `record` is the model of its records, where it
    adds something to them. `counted` is what its measures count of every sample as it is judged.
    `no_examples` says why it shows no worked examples, "" where it does.
    `by_hand` says of a subject how a person answers, None where nothing can be picked.
    `varies` names the factors of a suite's `vary` that change what it asks. `physics` says of a
    suite, as a manifest holds it, whether blocks are let go in a physics engine.
    """

    name: str
    title: str
    item: str
    about: str
    open: Callable[[Opening], AnyTrack]
    report: Callable[[], TrackReport]
    subject: type[object]
    template: Path | None = None
    json_template: Path | None = None
    record: type[Record] | None = None
    prompt_field: tuple[str, ...] = ("prompt",)
    section: tuple[str, type[BaseModel], str] | None = None
    baselines: Mapping[str, Callable[..., str]] = field(default_factory=dict)
    tables: tuple[str, ...] = ()
    own_data: Callable[[Suite], tuple[str, tuple[str, ...], bool] | None] | None = None
    manifest: Callable[[Suite], Mapping[str, Any]] | None = None
    plays: bool = False
    own_root: Callable[[Manifest], str | None] = lambda _: None
    rescored: bool = False
    counted: tuple[SampleCounts, ...] = ()
    no_examples: str = "it declares none"
    by_hand: Callable[[Any], Picking] | None = None
    varies: tuple[str, ...] = ("repeats",)
    physics: Callable[[Mapping[str, Any]], bool] = lambda _: False

    def data_folder(self, suite: Any) -> tuple[str, tuple[str, ...], bool] | None:
        """The folder of its own data: text, path of keys, whether it may be a bundled set."""
        return None if self.own_data is None else self.own_data(suite)


def kinds() -> Mapping[str, TrackKind]:
    """Every track by name, in the order in which they are listed."""
    return {name: kind for name, kind in known_tracks().items() if isinstance(kind, TrackKind)}


def kinds_with_physics(suite: Mapping[str, Any]) -> tuple[TrackKind, ...]:
    """The tracks of a suite, as a manifest holds it, that let blocks go in a physics engine."""
    asked = [kind for name, kind in kinds().items() if name in (suite.get("tracks") or ())]
    return tuple(kind for kind in asked if kind.physics(suite))


def kind_of(name: str) -> TrackKind:
    """The track of a name; KeyError for one that there is not."""
    return kinds()[name]
