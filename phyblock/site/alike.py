"""Which runs can stand in one table: those asked the same, about the same, and counted the same."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from phyblock.config.suite import ImagesSpec
from phyblock.errors import Problem, SpecError
from phyblock.results.load import Run
from phyblock.site.runs import SiteRun
from phyblock.tracks.base import CARRYING, ENGINE, FIRST_CARRYING, READER
from phyblock.tracks.kind import kind_of

__all__ = ["check_runs_alike"]

_ASKED_ANEW = ("pictures", READER)
"""What a track's identity says that may differ: digests of pictures, which change with their size,
and who read the replies.
"""
_CONTROLS = frozenset({"blind", "wrong_image", "prompt", "path"})
"""What a track's section of the suite says that is shown with the run, or known by its digest."""
_HINT = "make a site of each"
_CARRYING_HINT = (
    "run the older one again, as phyblock score leaves what was carried out as it was, or make a "
    "site of each"
)
_SCENES = "dataset.sha256"
_SCENES_HINT = "give all runs the same levels and --limit, or make a site of each"


def check_runs_alike(runs: Sequence[SiteRun]) -> None:
    """Raise SpecError naming all in which a run differs from the first that it could be held
    against, so that they cannot stand in one table.

    All must be of one version of one data set. Those that share a track must have asked about the
    same items of it, in the same words, shown alike in any size, and count in the same way.
    """
    problems: list[Problem] = []
    for number, one in enumerate(runs):
        for first in runs[:number]:
            found = list(_differences(one, first))
            if found:
                problems += found
                break
    if problems:
        raise SpecError(problems)


def _differences(one: SiteRun, first: SiteRun) -> Iterator[Problem]:
    shared = [track for track in one.run.design.suite.tracks if track in _tracks(first.run)]
    told, wanted = (dict(_facts(side.run, shared)) for side in (one, first))
    for field, value in told.items():
        other = wanted.get(field)
        # A recording was asked elsewhere, and a baseline is asked in no words.
        if value is None or other is None or value == other:
            continue
        message = f"cannot stand in one table with {first.where}"
        if field == _SCENES:
            message += ": other scenes were asked about"
            found, allowed = (_asked(side.run, shared) for side in (one, first))
            yield Problem(one.where, message, field, found, allowed, _SCENES_HINT)
        else:
            hint = _CARRYING_HINT if field.endswith(f".{CARRYING}") else _HINT
            yield Problem(one.where, message, field, str(value), str(other), hint)


def _asked(run: Run, shared: Sequence[str]) -> str:
    """How many items of each track, and the digest of the scenes that they are about."""
    assert run.manifest.dataset is not None
    items = (f"{run.manifest.items.get(track, 0):,} of {track}" for track in shared)
    return f"{', '.join(items)}, scenes {run.manifest.dataset.sha256[:12]}"


def _tracks(run: Run) -> tuple[str, ...]:
    return run.design.suite.tracks


def _facts(run: Run, shared: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """What has to agree, by name; None where it is not said."""
    manifest, suite = run.manifest, run.design.suite
    if (data := manifest.dataset) is not None:
        yield "dataset.name", data.name
        yield "dataset.version", data.version
    if not shared:
        return
    if data is not None:
        yield _SCENES, data.sha256
    if (asked := manifest.questions) is not None:
        yield "questions.version", asked.version
    yield "scoring.matchers", suite.scoring.matchers[0]
    yield "scoring.level1", suite.scoring.level1
    yield "scoring.missing", suite.scoring.missing
    yield "settings", ", ".join(suite.settings)
    yield "answer_format", suite.answer_format
    yield "vary", ", ".join(suite.vary.factors) or "nothing"
    for track in shared:
        for key, value in manifest.tracks.get(track, {}).items():
            if key not in _ASKED_ANEW:
                yield f"tracks.{track}.{key}", _shown(value)
        if manifest.tracks.get(track, {}).get("pictures") is not None:
            yield from _said("images", run.section("images", ImagesSpec), {"size_px"})
        if (section := kind_of(track).section) is not None:
            yield from _said(section[0], run.section(*section[:2]), _CONTROLS)
        if ENGINE not in manifest.tracks.get(track, {}):
            yield f"tracks.{track}.{ENGINE}", "the engine of reference"
        if CARRYING not in manifest.tracks.get(track, {}):
            yield f"tracks.{track}.{CARRYING}", FIRST_CARRYING


def _said(name: str, section: BaseModel, without: Collection[str]) -> Iterator[tuple[str, Any]]:
    """What a section of the suite says, its defaults as well."""
    for field in type(section).model_fields:
        if field not in without:
            yield f"{name}.{field}", str(getattr(section, field))


def _shown(value: Any) -> Any:
    """A prompt by its name and digest; anything else as it is."""
    if isinstance(value, Mapping) and {"name", "version"} <= value.keys():
        return f"{value['name']} ({str(value['version'])[:12]})"
    return value
