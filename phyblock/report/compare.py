"""Two models on the same samples: the difference, how sure it is, and which samples flipped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd

from phyblock.errors import Problem, SpecError
from phyblock.report.cells import measured
from phyblock.report.design import OVERALL, Design
from phyblock.report.intervals import parents_of, resampler
from phyblock.report.load import Run
from phyblock.scoring.uncertainty import CONFIDENCE, Clusters, Floats, bootstrap, f1_of, holm

__all__ = ["COMPARE_RESAMPLES", "Comparison", "Side", "compare", "compare_models", "compare_runs"]

COMPARE_RESAMPLES = 10_000
"""More than tables take, for p values that stay fine after Holm's correction."""

_COUNTS = ["tp", "fp", "fn"]
_FLIPPED = ["a", "b", "scene", "seed", "right", "f1_a", "f1_b"]


@dataclass(frozen=True, eq=False)
class Side:
    """A model of a run, under the name that a comparison gives it."""

    label: str
    model: str
    run: Run


@dataclass(frozen=True, eq=False)
class Comparison:
    """What `compare` found.

    `table` has one row a pair and level: a, b, level, f1_a, f1_b, difference (a minus b), se, lo,
    hi [all in percent], p, p_holm (corrected for all rows), verdict, better, worse and same
    (samples on which a has the higher, lower, same F1), n_samples, n_scenes, n_clusters.
    `flipped` has one row a pair and sample, of all levels, that one side alone got wholly right:
    a, b, scene, seed, right (that side's label), f1_a, f1_b [percent]. `how` says what F1 is.
    """

    table: pd.DataFrame
    flipped: pd.DataFrame
    how: str


def compare_models(run: Run, models: Sequence[str] = ()) -> Comparison:
    """Every pair of models of a run overall; at every level where there are but two.

    `models` limits it to those named. Raises SpecError for a name that the run has not, or when
    fewer than two are left.
    """
    sides = [Side(name, name, run) for name in _checked(run, models)]
    if len(sides) < 2:
        allowed = f"two of: {', '.join(run.design.model_names)}"
        raise SpecError(Problem(str(run.path), "needs two models to compare", allowed=allowed))
    levels = run.design.levels if len(sides) == 2 else (OVERALL,)
    return compare(list(combinations(sides, 2)), levels)


def compare_runs(first: Run, second: Run, models: Sequence[str] = ()) -> Comparison:
    """Each model that both runs have; or, with two `models`, one of the first and one of the other.

    At every level where that is one pair, else overall. Raises SpecError for names that are not
    there.
    """
    if len(models) == 2:
        names = [(*_checked(first, models[:1]), *_checked(second, models[1:]))]
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
    levels = [name for name in first.design.levels if name in second.design.levels]
    return compare(pairs, levels if len(pairs) == 1 else (OVERALL,))


def _tags(first: Run, second: Run) -> tuple[str, str]:
    """What tells two runs apart in a label: their folders' names, else paths, else their order."""
    names = first.path.resolve().name, second.path.resolve().name
    paths = str(first.path), str(second.path)
    return next((pair for pair in (names, paths) if pair[0] != pair[1]), ("first", "second"))


def _checked(run: Run, models: Sequence[str]) -> Sequence[str]:
    known = run.design.model_names
    if unknown := [name for name in models if name not in known]:
        where, found, allowed = str(run.path), ", ".join(unknown), ", ".join(known)
        raise SpecError(Problem(where, "has no such model", "--models", found, allowed))
    if twice := [name for name in dict.fromkeys(models) if models.count(name) > 1]:
        problem = Problem(str(run.path), "is given a model twice", "--models", ", ".join(twice))
        raise SpecError(problem)
    return models or known


def compare(pairs: Sequence[tuple[Side, Side]], levels: Sequence[str]) -> Comparison:
    """Compare the sides of each pair at each level on the samples that both have.

    Setting, matcher, criteria and what becomes of missing replies are those of the first run.
    Raises SpecError when a run has no full planning, was not scored so, or has other blocks in a
    scene of the same name.
    """
    design = pairs[0][0].run.design
    sides = {side.label: side for pair in pairs for side in pair}
    runs = list({id(side.run): side.run for side in sides.values()}.values())
    for run in runs:
        if not run.design.tracks:
            found = ", ".join(run.design.suite.tracks)
            message, allowed = "has no track that is compared", "full_planning"
            raise SpecError(Problem(str(run.path), message, "tracks", found, allowed))
    for run in runs[1:]:
        _check_alike(run, runs[0], levels)
    parents = pd.concat([parents_of(run) for run in runs]).groupby(level=0).first()
    labels = [(a.label, b.label) for a, b in pairs]
    parts: list[pd.DataFrame] = []
    flips: list[pd.DataFrame] = []
    for level in levels:
        of_run = {id(run): _samples(run, level, design) for run in runs}
        samples = {label: of_run[id(side.run)][side.model] for label, side in sides.items()}
        joined = [
            pd.concat([samples[a], samples[b]], axis=1, join="inner", keys=["a", "b"])
            for a, b in labels
        ]
        parts.append(_differences(labels, joined, parents, level))
        if level == OVERALL:
            flips = [_flipped(*pair, both) for pair, both in zip(labels, joined, strict=True)]
    table = pd.concat(parts, ignore_index=True)
    table.insert(list(table).index("p") + 1, "p_holm", holm(table["p"]))
    verdicts = [_verdict(row) for row in table.to_dict("records")]
    table.insert(list(table).index("p_holm") + 1, "verdict", verdicts)
    flipped = pd.concat([pd.DataFrame(columns=_FLIPPED), *(f for f in flips if len(f))])
    how = f"F1 in setting {design.setting} by the {design.matcher} matcher"
    return Comparison(table, flipped.reset_index(drop=True), how)


def _check_alike(run: Run, first: Run, levels: Sequence[str]) -> None:
    suite, wanted = run.design.suite, first.design
    known = ("aov", suite.scoring.level1)
    needed = (wanted.criterion(level) for level in levels)
    unknown = next((criterion for criterion in needed if criterion not in known), "aov")
    for what, names, name in (
        ("settings", suite.settings, wanted.setting),
        ("scoring.matchers", suite.scoring.matchers, wanted.matcher),
        ("scoring.level1", known, unknown),
    ):
        if name not in names:
            hint = "phyblock score reads stored replies again under other rules"
            message = f"was not scored as {first.path} was, by {name}"
            raise SpecError(Problem(str(run.path), message, what, ", ".join(names), hint=hint))
    blocks = [
        one.records.drop_duplicates("scene").set_index("scene")["n_blocks"] for one in (first, run)
    ]
    both = pd.concat(blocks, axis=1, join="inner", keys=["first", "other"])
    if len(differ := both[both["first"] != both["other"]]):
        message = f"is of other data than {first.path}"
        found = f"other blocks in {len(differ)} scenes, the first {differ.index[0]}"
        raise SpecError(Problem(str(run.path), message, "scenes", found))


def _samples(run: Run, level: str, design: Design) -> dict[str, pd.DataFrame]:
    """Counts by (scene, seed) at one level, by model; of models with a reply at the level."""
    criterion = design.criterion(level)
    scores = run.scores
    kept = scores[
        scores["track"].isin(design.tracks[:1])
        & (scores["criterion"] == criterion)
        & (scores["setting"] == design.setting)
        & (scores["matcher"] == design.matchers(criterion)[0])
        & ~scores["outcome"].isin(design.outcomes_left_out)
    ]
    if level != OVERALL:
        records = run.records
        of_level = [int(level) in levels for levels in records["levels"]]
        kept = kept[kept["sample"].isin(records["sample"][of_level])]
    kept = measured(kept, ["model"]).set_index(["scene", "seed"])
    parts = {str(model): part[_COUNTS] for model, part in kept.groupby("model", sort=False)}
    return {model: parts.get(model, kept.iloc[:0][_COUNTS]) for model in run.design.model_names}


def _differences(
    labels: Sequence[tuple[str, str]],
    joined: Sequence[pd.DataFrame],
    parents: pd.Series[Any],
    level: str,
) -> pd.DataFrame:
    """Rows of `Comparison.table` but for corrected p values and verdicts."""
    scenes = sorted({scene for both in joined for scene in both.index.get_level_values("scene")})
    place = {scene: n for n, scene in enumerate(scenes)}
    origins = [tuple(parents[scene]) or (scene,) for scene in scenes]
    counts = np.zeros((len(scenes), len(joined), 2, 3))
    rows: list[dict[str, Any]] = []
    sizes = []
    for n, (pair, both) in enumerate(zip(labels, joined, strict=True)):
        values = _counts(both)
        present = [place[scene] for scene in both.index.get_level_values("scene")]
        np.add.at(counts[:, n], present, values)
        rows.append({"a": pair[0], "b": pair[1], "level": level, **_tally(values)})
        rows[-1] |= {"n_samples": len(both), "n_scenes": len(set(present))}
        sizes.append(len({name for s in set(present) for name in origins[s]}))
    table = pd.DataFrame(rows).assign(n_clusters=sizes)
    found = bootstrap(
        counts,
        Clusters.of(origins),
        _difference,
        resampler(),
        resamples=COMPARE_RESAMPLES,
        n_clusters=sizes,
    )
    totals = f1_of(counts.sum(axis=0))
    numbers = {"f1_a": totals[:, 0], "f1_b": totals[:, 1], "difference": found.value}
    numbers |= {"se": found.se, "lo": found.lo, "hi": found.hi}
    measured = pd.DataFrame({name: 100 * values for name, values in numbers.items()})
    keys, tallies = table[["a", "b", "level"]], table.drop(columns=["a", "b", "level"])
    return pd.concat([keys, measured.assign(p=found.p), tallies], axis=1)


def _counts(both: pd.DataFrame) -> Floats:
    """Counts of shape (samples, 2, 3)."""
    return np.asarray(both.to_numpy(np.float64).reshape(len(both), 2, 3))


def _difference(sums: Floats) -> Floats:
    f1 = f1_of(sums)
    return np.asarray(f1[..., 0] - f1[..., 1])


def _tally(values: Floats) -> dict[str, int]:
    """On how many samples, shape (samples, 2, 3), the first side is better, worse, the same."""
    # A plan without a step for a goal without a block would have no F1; there is none.
    sign = np.sign(np.nan_to_num(_difference(values)))
    return {
        name: int((sign == wanted).sum())
        for name, wanted in (("better", 1), ("worse", -1), ("same", 0))
    }


def _flipped(a: str, b: str, both: pd.DataFrame) -> pd.DataFrame:
    f1 = 100 * np.nan_to_num(f1_of(_counts(both)))
    table = both.index.to_frame(index=False).assign(a=a, b=b, f1_a=f1[:, 0], f1_b=f1[:, 1])
    right = table[["f1_a", "f1_b"]] == 100
    table["right"] = np.where(right["f1_a"], a, b)
    return table.loc[right["f1_a"] != right["f1_b"], _FLIPPED].sort_values(["right", "scene"])


def _verdict(row: Mapping[Any, Any]) -> str:
    if np.isnan(row["difference"]):
        return "nothing to compare"
    if np.isnan(row["p_holm"]):
        return "cannot tell: a single base scene"
    if row["p_holm"] >= 1 - CONFIDENCE:
        return "cannot tell"
    return f"{row['a'] if row['difference'] > 0 else row['b']} is better"
