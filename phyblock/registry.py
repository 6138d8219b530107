"""The registry of tracks and their baselines, the only place that names them.

Lower layers look up here what tracks add, without importing them: modules load on first use.
"""

from __future__ import annotations

import functools
import pkgutil
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from phyblock.tracks.base import Track

_TRACKS = (
    *("full_planning:FullPlanning", "step_planning:StepPlanning"),
    *("questions:Vqa", "pose_planning:PosePlanning"),
)
"""Modules of `tracks` and their classes, in the order in which tracks are listed."""

PLUGINS: list[str] = []
"""Modules that every worker process imports first, so that their additions are known there too."""

_registered: dict[str, type[Track]] = {}
_measures: dict[str, tuple[Any, ...]] = {}
_baselines: dict[str, dict[str, Callable[..., str]]] = {}


@functools.cache
def _built_in() -> Mapping[str, type[Track]]:
    tracks = [pkgutil.resolve_name(f"phyblock.tracks.{name}") for name in _TRACKS]
    return {kind.name: kind for kind in tracks}


def known_tracks() -> Mapping[str, type[Track]]:
    """Every track by name, the built-in ones first."""
    return {**_built_in(), **_registered}


def known_track(name: str) -> type[Track]:
    """Return the track with this name. Raises KeyError if there is none."""
    return known_tracks()[name]


def register_track(kind: type[Track]) -> None:
    """Add a track. Raises ValueError if its name or section is taken."""
    taken = {name for other in known_tracks().values() for name in (other.name, other.section)}
    if clash := sorted({kind.name, kind.section} & taken - {""}):
        raise ValueError(f"a track or section has this name: {', '.join(clash)}")
    _registered[kind.name] = kind


def add_measure(track: str, measure: Any) -> None:
    """Add a `tracks.measures.Measure` to a track. Raises KeyError for an unknown track."""
    _measures[known_track(track).name] = (*added_measures(track), measure)


def added_measures(track: str) -> tuple[Any, ...]:
    """Return the measures that were added to a track, in their order."""
    return _measures.get(track, ())


def add_baseline(track: str, name: str, rule: Callable[..., str]) -> None:
    """Add a rule from a request's subject and a random generator to a reply. Raises ValueError."""
    if name in track_baselines(known_track(track)):
        raise ValueError(f"the track {track} has a baseline of this name: {name}")
    _baselines.setdefault(track, {})[name] = rule


def track_baselines(kind: type[Track]) -> Mapping[str, Callable[..., str]]:
    """Return the rules of a track by name, the built-in ones first."""
    return {**kind.baselines, **_baselines.get(kind.name, {})}


def baseline_names() -> tuple[str, ...]:
    """Return the names of all baselines, in the order of their tracks."""
    tracks = known_tracks().values()
    return tuple(dict.fromkeys(name for kind in tracks for name in track_baselines(kind)))


def baseline_rules(name: str) -> Mapping[str, Callable[..., str]]:
    """Return the rules of one baseline by track; empty if there is no such baseline."""
    rules = {track: track_baselines(kind) for track, kind in known_tracks().items()}
    return {track: known[name] for track, known in rules.items() if name in known}
