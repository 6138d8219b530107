"""Models compared on the same samples: differences, how sure they are, and ranks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.records.manifest import ManifestDataset, ManifestQuestions
from phyblock.results.estimates import (
    counted_samples,
    headline_columns,
    headline_rows,
    main_measure,
    parents_of,
    pooled_in,
    track_measures,
    value_of_cells,
)
from phyblock.results.load import Design, Run, checked_models
from phyblock.results.text import (
    NO_VALUE,
    Column,
    TextTable,
    between,
    level_name,
    number,
    to_csv,
    to_latex,
    to_markdown,
)
from phyblock.scoring.counts import Floats, Metric
from phyblock.scoring.statistics import (
    CONFIDENCE,
    POWER,
    Clusters,
    bounded,
    detectable,
    holm,
    jackknife,
    least_p,
    rank_ranges,
)
from phyblock.text import counted
from phyblock.tracks.base import kind_of, kinds
from phyblock.tracks.measures import CELL, Cell, Measure, in_unit


def check_alike(run: Run, first: Run, cells: Sequence[str], track: str, measure: Measure) -> None:
    """Raise SpecError where `run` cannot be compared with `first` by a measure in these cells.

    The track says what must agree in how the two were asked and scored; scenes of a name must be
    the same.
    """
    where = str(run.path)
    for field in ("dataset", "questions"):
        # Scenes and questions of two versions of a set may share a name and nothing else.
        found, wanted = (getattr(one.manifest, field) for one in (run, first))
        if found is None or wanted is None or _name(found) != _name(wanted):
            continue
        if found.version != wanted.version:
            message = f"is of another version of {_name(found)} than {first.path}"
            versions = str(found.version), str(wanted.version)
            hint = "run the suite again on the newer version"
            raise SpecError(Problem(where, message, f"{field}.version", *versions, hint))
    vary, wanted_vary = (one.design.suite.vary for one in (run, first))
    if vary != wanted_vary:
        # Values of other factors mean other things.
        message = f"asks in other ways than {first.path}"
        said, allowed = (", ".join(one.factors) or "nothing" for one in (vary, wanted_vary))
        hint = "compare runs that vary the same, in the same order"
        raise SpecError(Problem(where, message, "vary", said, allowed, hint))
    if (check := kind_of(track).report().check_alike) is not None:
        check(run, first, cells, measure)
    blocks = [
        one.records.drop_duplicates("scene").set_index("scene")["n_blocks"] for one in (first, run)
    ]
    both = pd.concat(blocks, axis=1, join="inner", keys=["first", "other"])
    if len(differ := both[both["first"] != both["other"]]):
        message = f"is of other data than {first.path}"
        blocks_of = f"other blocks in {counted(len(differ), 'scene')}, the first {differ.index[0]}"
        raise SpecError(Problem(where, message, "scenes", blocks_of))


def _name(data: ManifestDataset | ManifestQuestions) -> str:
    return data.name if isinstance(data, ManifestDataset) else Path(data.root).name


_KEYS = ["scene", "item", "seed", "variant"]


@dataclass(frozen=True)
class Part:
    """The subject of one row of a pair: a cell, and the way of counting where there are several."""

    name: str
    cell: str
    criterion: str = ""


@dataclass(frozen=True)
class Comparable:
    """A measure of a track, as two models are compared by it.

    `parts` are the rows of one pair, of which the last stands for all; `how` says what the values
    are.
    """

    track: str
    measure: Measure
    cells: tuple[Cell, ...]
    parts: tuple[Part, ...]
    how: str

    def pooled(self, part: Part) -> tuple[str, ...]:
        """The pooled cells that a part is made of."""
        (cell,) = (cell for cell in self.cells if cell.name == part.cell)
        members = pooled_in(cell, self.cells)
        return tuple(cell.name for cell in self.cells if cell.name in members)

    def samples(self, run: Run, part: Part, design: Design) -> dict[str, pd.DataFrame]:
        """Counts of a part by model, by scene, item, seed and variant, with its pooled cell."""
        pooled = self.pooled(part)
        rows = counted_samples(replace(run, design=design), self.track, self.measure.counted)
        rows = headline_rows(rows[rows[CELL].isin(pooled)], design)
        if part.criterion:
            rows = rows[rows["criterion"] == part.criterion]
        heard = rows.groupby(["model", CELL])["replied"].transform("any")
        rows = rows[heard.astype(bool)]
        place = {name: number for number, name in enumerate(pooled)}
        indexed = rows.assign(pooled_cell=rows[CELL].map(place)).set_index(_KEYS)
        columns = ["pooled_cell", *self.measure.counted.columns]
        return {str(model): mine[columns] for model, mine in indexed.groupby("model", sort=False)}

    def values(self, run: Run, part: Part, design: Design) -> Iterator[tuple[str, pd.Series]]:
        """Return the value of each sample in the measure's unit, by model; by scene, item, seed and
        variant, without samples that have no value.
        """
        each = self.each(part)
        for model, samples in self.samples(run, part, design).items():
            worth = self.measure.scale * each(self.counts_of(samples, part))
            yield model, pd.Series(worth, index=samples.index.set_names(_KEYS)).dropna()

    def counts(self, both: pd.DataFrame, part: Part) -> Floats:
        """Counts of paired samples, flat over pooled cells: (samples, 2, pooled x (columns + 1)).

        Behind the columns of each pooled cell stands how many samples it has.
        """
        return np.stack([self.counts_of(pd.DataFrame(both[name]), part) for name in "ab"], axis=1)

    def counts_of(self, samples: pd.DataFrame, part: Part) -> Floats:
        """Counts of samples of one model, in the form of `counts` without its second axis."""
        columns = list(self.measure.counted.columns)
        counts = np.zeros((len(samples), len(self.pooled(part)), len(columns) + 1))
        rows, pooled_cell = np.arange(len(samples)), samples["pooled_cell"].to_numpy(np.intp)
        counts[rows, pooled_cell, :-1] = samples[columns].to_numpy(np.float64)
        counts[rows, pooled_cell, -1] = 1
        return counts.reshape(len(samples), -1)

    def n_counts(self, part: Part) -> int:
        """Length of the last axis of `counts`."""
        return len(self.pooled(part)) * (len(self.measure.counted.columns) + 1)

    def each(self, part: Part) -> Metric:
        """Return the value of one sample."""
        unflat = self._unflat(part)
        return lambda sums: self.measure.value(unflat(sums)[..., :-1].sum(axis=-2))

    def whole(self, part: Part, totals: Floats) -> Metric:
        """Return the values of sums; means are over the pooled cells of which `totals` have
        samples.
        """
        unflat, pooled = self._unflat(part), self.pooled(part)
        values = value_of_cells(self.measure, self.cells_of(part), pooled)
        asked = unflat(totals)[..., -1] > 0

        def metric(sums: Floats) -> Floats:
            # Sums without a pooled cell that was asked have no value.
            return np.asarray(values(unflat(sums)[..., :-1], asked)[..., -1])

        return metric

    def cells_of(self, part: Part) -> tuple[Cell, ...]:
        """The cells below a part, and its own as the last."""
        reached = {part.cell}
        for cell in reversed(self.cells):
            reached |= set(cell.of) if cell.name in reached else set()
        return tuple(cell for cell in self.cells if cell.name in reached)

    def _unflat(self, part: Part) -> Callable[[Floats], Floats]:
        shape = (len(self.pooled(part)), len(self.measure.counted.columns) + 1)
        return lambda sums: np.asarray(sums.reshape(*sums.shape[:-1], *shape))


def comparable(run: Run, track: str, measure: str = "") -> Comparable:
    """A measure of a track of a run, the main one where none is named.

    Raises SpecError for a measure that the track has not.
    """
    known = {one.name: one for one in track_measures(track)}
    if measure and measure not in known:
        message, allowed = "has no such measure", ", ".join(known)
        raise SpecError(Problem(f"track {track}", message, "--measure", measure, allowed))
    chosen = known[measure] if measure else main_measure(run, track)
    report = kind_of(track).report()
    cells = report.cells(run)
    shown = report.headline(run) if report.headline is not None else ()
    criteria = [s.criterion for s in shown if s.measure == chosen.name and s.criterion]
    # A part of a mean that is pooled itself is too small to be compared alone.
    parts = [
        Part(cell.name, cell.name)
        for cell in cells
        if cell.of or not any(cell.name in other.of for other in cells)
    ]
    if criteria:
        parts = [
            Part(criterion, part.cell, criterion)
            for part in parts
            for criterion in reversed(criteria)
        ]
    is_headline = chosen.name in {column.measure for column in headline_columns(run, track)}
    notes = report.notes(run) if is_headline else ()
    how = " ".join((f"{chosen.heading}: {chosen.meaning}.", *notes, "Samples that both have."))
    return Comparable(track, chosen, cells, tuple(parts), how)


_LEVEL = 1 - CONFIDENCE


def with_verdicts(table: pd.DataFrame, measure: Measure) -> pd.DataFrame:
    """A table of tests (a, b, difference, se, p, n_clusters, ...) with what they say together.

    Behind `p` stand p_holm, verdict, detectable and detectable_holm, as `Comparison` explains.
    """
    n_tests = int(table["p"].notna().sum())
    judged = table.assign(p_holm=holm(table["p"]))
    judged["verdict"] = [_verdict(row, measure, n_tests) for row in judged.to_dict("records")]
    levels = {"detectable": _LEVEL, "detectable_holm": _LEVEL / max(n_tests, 1)}
    for name, level in levels.items():
        judged[name] = detectable(table["se"], table["n_clusters"], level, measure.most_apart)
    columns = [str(name) for name in table]
    after = columns.index("p") + 1
    return judged[[*columns[:after], "p_holm", "verdict", *levels, *columns[after:]]]


def _verdict(row: Mapping[Any, Any], measure: Measure, n_tests: int) -> str:
    if np.isnan(row["difference"]):
        return "nothing to compare"
    if np.isnan(row["p_holm"]):
        return "cannot tell: a single base scene"
    if row["p_holm"] >= _LEVEL:
        # So few base scenes give no p value that the correction leaves below the level.
        too_few = n_tests * least_p(row["n_clusters"]) >= _LEVEL
        return "too few base scenes to tell" if too_few else "cannot tell"
    a_is_better = (row["difference"] > 0) == (measure.better == "higher")
    return f"{row['a' if a_is_better else 'b']} is better"


def ranks(table: pd.DataFrame, measure: Measure) -> pd.DataFrame:
    """The ranks that each model may have, the best first: model, value, best, worst.

    Out of a table that compares every pair of its models as a whole; empty for any other.
    """
    whole = table[table["part"] == table["part"].iloc[-1]] if len(table) else table
    names = list(dict.fromkeys([*whole["a"], *whole["b"]]))
    columns = ["model", "value", "best", "worst"]
    n = len(names)
    if len(whole) != n * (n - 1) // 2 or whole["p"].isna().any():
        return pd.DataFrame(columns=columns)
    is_better = np.zeros((n, n), dtype=bool)
    values: dict[str, float] = {}
    for row in whole.to_dict("records"):
        a, b = names.index(row["a"]), names.index(row["b"])
        a_is_better = (row["difference"] > 0) == (measure.better == "higher")
        is_better[(a, b) if a_is_better else (b, a)] = row["p_holm"] < _LEVEL
        values |= {row["a"]: row["value_a"], row["b"]: row["value_b"]}
    ranges = rank_ranges(is_better)
    rows = [(name, values[name], *ranges[place]) for place, name in enumerate(names)]
    table = pd.DataFrame(rows, columns=columns)
    is_ascending = measure.better == "lower"
    return table.sort_values("value", ascending=is_ascending, ignore_index=True, kind="stable")


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
    """The result of `compare`.

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
    shared = [name for name in kinds() if all(name in run.design.suite.tracks for run in runs)]
    if not shared or (wanted and wanted not in shared):
        where, allowed = ", ".join(str(run.path) for run in runs), ", ".join(shared) or "none"
        raise SpecError(Problem(where, "has no such track to compare", "track", wanted, allowed))
    return wanted or shared[0]


def _tags(first: Run, second: Run) -> tuple[str, str]:
    """Return two labels that tell runs apart: folders' names, else paths, else their order."""
    names = first.path.resolve().name, second.path.resolve().name
    paths = str(first.path), str(second.path)
    return next((pair for pair in (names, paths) if pair[0] != pair[1]), ("first", "second"))


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
    """Return what is unusual about how each run asked and read, where there is anything."""
    for run in runs:
        words = (*kind_of(track).report().showing(run), *run.varied_words)
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


def compare_view(found: Comparison) -> TextTable:
    """A row a pair and part; the part is left out where there is but one."""
    table = found.table
    one_part = table["part"].nunique() == 1
    columns = [
        Column("A", is_text=True),
        Column("B", is_text=True),
        *([] if one_part else [Column("Part", is_text=True)]),
        *(
            Column(name, in_unit(found.name, found.unit))
            for name in ("A", "B", "A - B", "95 % CI", "finds")
        ),
        Column("p (Holm)"),
        Column("Verdict", is_text=True),
        *(Column(name, "Samples") for name in ("A better", "B better", "same")),
    ]
    rows = []
    previous: tuple[str, str] = ("", "")
    for row in table.to_dict("records"):
        pair = (row["a"], row["b"])
        rows.append(
            (
                *(pair if pair != previous else ("", "")),
                *([] if one_part else [level_name(row["part"].replace("_", " "))]),
                number(row["value_a"]),
                number(row["value_b"]),
                number(row["difference"], signed=True),
                between(row["lo"], row["hi"], signed=True),
                number(row["detectable_holm"]),
                p_text(row["p_holm"]),
                row["verdict"],
                *(str(row[name]) for name in ("better", "worse", "same")),
            )
        )
        previous = pair
    return TextTable(
        "Models compared on the same samples", tuple(columns), tuple(rows), _notes(found)
    )


def _notes(found: Comparison) -> tuple[str, ...]:
    table = found.table
    most = max(table.to_dict("records"), key=lambda row: row["n_scenes"], default=None)
    notes = [found.how]
    if most is not None:
        notes.append(
            f"{counted(most['n_samples'], 'sample')} of {counted(most['n_scenes'], 'scene')} from "
            f"{counted(most['n_clusters'], 'base scene')}; scenes that share one are not taken as "
            "independent."
        )
        single = table["detectable"].dropna().median()
        median = "" if math.isnan(single) else f"; a single test, in the median, {number(single)}"
        notes.append(
            f"“finds”: the difference that this comparison would find in {POWER:.0%} of cases"
            f"{median}; {NO_VALUE}: none that is possible, or no sample differs."
        )
    notes.append(
        f"p values are corrected for {table['p'].notna().sum()} comparisons (Holm); “cannot tell” "
        "stands where p is 0.05 or more."
    )
    return tuple(notes)


def ranks_view(found: Comparison) -> TextTable:
    """The rank that each model may have, out of `Comparison.ranks`, the best first."""
    rows = [
        (
            row["model"],
            number(row["value"]),
            " to ".join(str(n) for n in sorted({row["best"], row["worst"]})),
        )
        for row in found.ranks.to_dict("records")
    ]
    return TextTable(
        "Ranks that each model may have",
        (Column("Model", is_text=True), Column(in_unit(found.name, found.unit)), Column("Rank")),
        tuple(rows),
        ("All ranges hold at once with 95 % confidence, by the comparisons above.",),
    )


def p_text(p: float) -> str:
    """A p value with three decimals; `< 0.001` where it is less."""
    if pd.isna(p):
        return NO_VALUE
    return "< 0.001" if p < 0.001 else f"{p:.3f}"


def flipped_lines(found: Comparison) -> tuple[str, ...]:
    """For each side of each pair, the samples that it alone got wholly right, as sentences."""
    lines = []
    several = found.flipped["seed"].nunique() > 1
    for (a, b), flips in found.flipped.groupby(["a", "b"], sort=False):
        for side, other in ((a, b), (b, a)):
            rows = flips[flips["right"] == side]
            names = []
            for row in rows.to_dict("records"):
                how = (f"seed {row['seed']}" if several else "", row["variant"])
                told = ", ".join(filter(None, how))
                names.append(f"{row['item']} ({told})" if told else str(row["item"]))
            if names:
                lines.append(
                    f"{side} is right where {other} is not, {len(names)}: {', '.join(names)}"
                )
    return tuple(lines)


def write_comparison(found: Comparison, folder: Path) -> tuple[Path, ...]:
    """Write comparison (.csv, .md, .tex), flipped.csv and ranks.csv into `folder`.

    Raises StoreError where they cannot be written.
    """
    view = compare_view(found)
    texts: dict[str, bytes | str] = {
        "comparison.csv": to_csv(found.table, "%.6f"),
        "comparison.md": to_markdown(view),
        "comparison.tex": to_latex(view, "phyblock-comparison"),
        "flipped.csv": to_csv(found.flipped, "%.2f"),
        "ranks.csv": to_csv(found.ranks, "%.6f"),
    }
    return OutFolder(folder).write(texts)
