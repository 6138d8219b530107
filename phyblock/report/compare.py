"""Two models on the same samples: the difference, how sure it is, and which samples flipped."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from phyblock.errors import Problem, SpecError
from phyblock.report.alike import check_alike
from phyblock.report.comparable import Comparable, Part, comparable, comparable_tracks
from phyblock.report.verdicts import ranks, with_verdicts
from phyblock.scoring.counts import Floats
from phyblock.scoring.statistics import Clusters, bounded, jackknife
from phyblock.tables.intervals import parents_of
from phyblock.tables.load import Run
from phyblock.tables.showing import varied_words
from phyblock.tracks.kind import kind_of

__all__ = [
    "Comparison",
    "Side",
    "checked_models",
    "compare",
    "compare_models",
    "compare_runs",
]

_FLIPPED = ["a", "b", "scene", "item", "seed", "variant", "right", "value_a", "value_b"]
_AT_ONCE = 100
"""Pairs that are estimated together, which bounds memory."""


@dataclass(frozen=True, eq=False)
class Side:
    """A model of a run, under the name that a comparison gives it."""

    label: str
    model: str
    run: Run


@dataclass(frozen=True, eq=False)
class Comparison:
    """What `compare` found.

    `table` has one row a pair and part of the track (levels, categories of questions): a, b, part,
    value_a, value_b, difference (a minus b), se, lo, hi [all in `unit`], p, p_holm (corrected for
    all rows), verdict, detectable (the difference that a single test finds in four of five cases)
    and detectable_holm (the same at the first step of Holm's correction) [in `unit`; NaN where that
    is more than values can differ by], better, worse and same (samples on which a has the better,
    worse, same value), n_samples, n_scenes, n_clusters. `ranks` has one row a model where all pairs
    of several models were compared as a whole: model, value, best and worst rank that the model may
    have. `flipped` has one row a pair and sample that one side alone got wholly right: a, b, scene,
    item (scene or question), seed, variant (what differs from the reference of the run), right
    (that side's label), value_a, value_b; by a measure without a best value it has none. `name` is
    what the values are called, `unit` theirs, `how` says what they are.
    """

    table: pd.DataFrame
    flipped: pd.DataFrame
    ranks: pd.DataFrame
    name: str
    unit: str
    how: str


def compare_models(
    run: Run, models: Sequence[str] = (), track: str = "", measure: str = ""
) -> Comparison:
    """Every pair of models of a run as a whole; in every part where there are but two.

    `models` limits it to those named; `track` is the first that the run has and `measure` the first
    of the track, if they are not named. Raises SpecError for a name that the run has not, or when
    fewer than two are left.
    """
    sides = [Side(name, name, run) for name in checked_models(run, models)]
    if len(sides) < 2:
        allowed = f"two of: {', '.join(run.design.model_names)}"
        raise SpecError(Problem(str(run.path), "needs two models to compare", allowed=allowed))
    what = comparable(run, _shared_track([run], track), measure)
    parts = what.parts if len(sides) == 2 else what.parts[-1:]
    return compare(list(combinations(sides, 2)), parts, what)


def compare_runs(
    first: Run, second: Run, models: Sequence[str] = (), track: str = "", measure: str = ""
) -> Comparison:
    """Each model that both runs have; or, with two `models`, one of the first and one of the other.

    In every part where that is one pair, else as a whole; `track` and `measure` as for
    `compare_models`. Raises
    SpecError for names that are not there.
    """
    if len(models) == 2:
        names = [(*checked_models(first, models[:1]), *checked_models(second, models[1:]))]
    else:
        shared = [name for name in first.design.model_names if name in second.design.model_names]
        if unknown := [name for name in models if name not in shared]:
            allowed = ", ".join(shared) or "none is in both"
            message = f"are not both runs of {', '.join(unknown)}"
            raise SpecError(Problem(f"{first.path}, {second.path}", message, allowed=allowed))
        names = [(name, name) for name in models or shared]
    if not names:
        message, hint = "have no model in common", "name one of each: --models A,B"
        raise SpecError(Problem(f"{first.path}, {second.path}", message, hint=hint))
    tags = _tags(first, second)
    pairs = [
        (Side(f"{a} ({tags[0]})", a, first), Side(f"{b} ({tags[1]})", b, second)) for a, b in names
    ]
    what = comparable(first, _shared_track([first, second], track), measure)
    other = comparable(second, what.track, what.measure.name)
    parts = [part for part in what.parts if part in other.parts]
    return compare(pairs, parts if len(pairs) == 1 else parts[-1:], what)


def _shared_track(runs: Sequence[Run], wanted: str) -> str:
    """The track that is compared: `wanted`, else the first one that all runs have."""
    shared = [
        name for name in comparable_tracks() if all(name in run.design.suite.tracks for run in runs)
    ]
    if not shared or (wanted and wanted not in shared):
        where, allowed = ", ".join(str(run.path) for run in runs), ", ".join(shared) or "none"
        raise SpecError(Problem(where, "has no such track to compare", "track", wanted, allowed))
    return wanted or shared[0]


def _tags(first: Run, second: Run) -> tuple[str, str]:
    """What tells two runs apart in a label: their folders' names, else paths, else their order."""
    names = first.path.resolve().name, second.path.resolve().name
    paths = str(first.path), str(second.path)
    return next((pair for pair in (names, paths) if pair[0] != pair[1]), ("first", "second"))


def checked_models(run: Run, models: Sequence[str]) -> Sequence[str]:
    """The models that are named, all of the run where none are; SpecError for one that it has not,
    or that is named twice.
    """
    known = run.design.model_names
    if unknown := [name for name in models if name not in known]:
        where, found, allowed = str(run.path), ", ".join(unknown), ", ".join(known)
        raise SpecError(Problem(where, "has no such model", "--models", found, allowed))
    if twice := [name for name in dict.fromkeys(models) if models.count(name) > 1]:
        problem = Problem(str(run.path), "is given a model twice", "--models", ", ".join(twice))
        raise SpecError(problem)
    return models or known


def compare(
    pairs: Sequence[tuple[Side, Side]], parts: Sequence[Part], what: Comparable
) -> Comparison:
    """Compare the sides of each pair in each part of a track on the samples that both have.

    Setting, matcher, criteria and what becomes of missing replies are those of the first run.
    Raises SpecError when a run was not scored so, asked other questions, or has other blocks in a
    scene of the same name.
    """
    design = pairs[0][0].run.design
    sides = {side.label: side for pair in pairs for side in pair}
    runs = list({id(side.run): side.run for side in sides.values()}.values())
    for run in runs[1:]:
        check_alike(run, runs[0], [part.cell for part in parts], what.track, what.measure)
    parents = pd.concat([parents_of(run) for run in runs]).groupby(level=0).first()
    labels = [(a.label, b.label) for a, b in pairs]
    tables: list[pd.DataFrame] = []
    flips: list[pd.DataFrame] = []
    for part in parts:
        of_run = {id(run): what.samples(run, part, design) for run in runs}
        samples = {name: of_run[id(side.run)].get(side.model) for name, side in sides.items()}
        counted = [_paired(samples[a], samples[b], what, part) for a, b in labels]
        tables.append(_differences(labels, counted, parents, part, what))
        if part == parts[-1]:
            flips = [
                _flipped(*pair, one, what, part) for pair, one in zip(labels, counted, strict=True)
            ]
    table = with_verdicts(pd.concat(tables, ignore_index=True), what.measure)
    # Some versions of pandas warn of an empty frame among others.
    flips = [flip for flip in flips if len(flip)] or [pd.DataFrame(columns=_FLIPPED)]
    flipped = pd.concat(flips)[_FLIPPED]
    return Comparison(
        table,
        flipped.reset_index(drop=True),
        ranks(table, what.measure),
        what.measure.heading,
        what.measure.unit,
        " ".join([what.how, *_asked(runs, what.track)]),
    )


def _asked(runs: Sequence[Run], track: str) -> Iterator[str]:
    """What is unusual about how each run asked and read, where there is anything."""
    for run in runs:
        words = (*kind_of(track).report().showing(run), *varied_words(run))
        if words:
            yield f"Run {run.path.name}: {', '.join(words)}."
    readers = {run.path.name: run.manifest.versions.get("readers", "1") for run in runs}
    if len(set(readers.values())) > 1:
        names = ", ".join(f"{name} by readers {version}" for name, version in readers.items())
        yield f"Replies were read: {names}; phyblock score reads a run with those of this version."


@dataclass(frozen=True, eq=False)
class _Paired:
    """Samples that two sides both have: a row each in `keys`, and (samples, 2, counts)."""

    keys: pd.DataFrame
    counts: Floats


def _paired(
    a: pd.DataFrame | None, b: pd.DataFrame | None, what: Comparable, part: Part
) -> _Paired | None:
    """None where a side has no sample."""
    if a is None or b is None:
        return None
    both = pd.concat([a, b], axis=1, join="inner", keys=["a", "b"])
    return _Paired(both.index.to_frame(index=False), what.counts(both, part)) if len(both) else None


def _differences(
    labels: Sequence[tuple[str, str]],
    paired: Sequence[_Paired | None],
    parents: pd.Series[Any],
    part: Part,
    what: Comparable,
) -> pd.DataFrame:
    """Rows of `Comparison.table` but for corrected p values and verdicts."""
    scenes = sorted({scene for one in paired if one for scene in one.keys["scene"]})
    place = {scene: n for n, scene in enumerate(scenes)}
    clusters = Clusters.of([tuple(parents[scene]) or (scene,) for scene in scenes])
    batches = [
        _estimated(paired[start : start + _AT_ONCE], place, clusters, what, part)
        for start in range(0, len(paired), _AT_ONCE)
    ]
    keys = pd.DataFrame(list(labels), columns=["a", "b"]).assign(part=part.name)
    return pd.concat([keys, pd.concat(batches, ignore_index=True)], axis=1)


def _estimated(
    paired: Sequence[_Paired | None],
    place: Mapping[str, int],
    clusters: Clusters,
    what: Comparable,
    part: Part,
) -> pd.DataFrame:
    counts = np.zeros((len(place), len(paired), 2, what.n_counts(part)))
    seen = np.zeros((len(place), len(paired)), dtype=bool)
    for n, one in enumerate(paired):
        if one:
            rows = [place[scene] for scene in one.keys["scene"]]
            np.add.at(counts[:, n], rows, one.counts)
            seen[rows, n] = True
    totals = counts.sum(axis=0)
    whole = what.whole(part, totals)
    sizes = clusters.behind(seen)
    estimate = jackknife(counts, clusters, lambda sums: _difference(whole(sums)), n_clusters=sizes)
    estimate = bounded(estimate, what.measure.most_apart / what.measure.scale)
    values = whole(totals)
    numbers = {"value_a": values[:, 0], "value_b": values[:, 1], "difference": estimate.value}
    numbers |= {"se": estimate.se, "lo": estimate.lo, "hi": estimate.hi}
    table = pd.DataFrame({name: what.measure.scale * value for name, value in numbers.items()})
    tallies = pd.DataFrame([_tally(one, what, part) for one in paired])
    more = {"n_scenes": seen.sum(axis=0), "n_clusters": sizes}
    return pd.concat([table.assign(p=estimate.p), tallies], axis=1).assign(**more)


def _difference(values: Floats) -> Floats:
    return np.asarray(values[..., 0] - values[..., 1])


def _tally(one: _Paired | None, what: Comparable, part: Part) -> dict[str, int]:
    """On how many samples the first side is better, worse, the same, and how many there are."""
    # A plan without a step for a goal without a block would have no F1; there is none.
    sign = np.sign(np.nan_to_num(_difference(what.each(part)(one.counts)))) if one else np.zeros(0)
    sign = sign if what.measure.better == "higher" else -sign
    counts = {"better": int((sign == 1).sum()), "worse": int((sign == -1).sum())}
    return {**counts, "same": int((sign == 0).sum()), "n_samples": len(sign)}


def _flipped(a: str, b: str, one: _Paired | None, what: Comparable, part: Part) -> pd.DataFrame:
    if one is None:
        return pd.DataFrame(columns=_FLIPPED)
    values = what.measure.scale * np.nan_to_num(what.each(part)(one.counts))
    table = one.keys.assign(a=a, b=b, value_a=values[:, 0], value_b=values[:, 1])
    right = values == what.measure.best
    table["right"] = np.where(right[:, 0], a, b)
    rows = table.loc[right[:, 0] != right[:, 1], _FLIPPED]
    return rows.sort_values(["right", "scene", "item", "seed", "variant"])
