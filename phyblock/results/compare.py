"""Models compared on the same samples: differences, ranks, and what varied presentation changes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from phyblock.config.suite import REPEAT, Variant, VarySpec
from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.results.estimates import (
    Rows,
    base_scenes,
    counted_rows,
    headline_columns,
    main_measure,
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
    track_column,
    track_text,
    with_interval,
)
from phyblock.scoring.counts import Floats
from phyblock.scoring.statistics import (
    CONFIDENCE,
    NO_COMPONENT,
    POWER,
    Clusters,
    Component,
    bounded,
    detectable,
    holm,
    interaction,
    jackknife,
    least_p,
    rank_ranges,
    shift,
    spread_of_items,
    within,
)
from phyblock.text import counted
from phyblock.tracks.base import kind_of, kinds
from phyblock.tracks.measures import SCORED_BY, Cell, Measure, in_unit

_LEVEL = 1 - CONFIDENCE
_KEYS = ["scene", "item", "seed", "variant"]
_FLIPPED = ["a", "b", *_KEYS, "right", "value_a", "value_b"]
_AT_ONCE = 100
"""Pairs that are estimated together, which bounds memory."""


def check_alike(run: Run, first: Run, cells: Sequence[str], track: str, measure: Measure) -> None:
    """Raise SpecError where `run` cannot be compared with `first` by a measure in these cells.

    The track says what must agree in how the two were asked and scored; scenes of a name must be
    the same.
    """

    def differs(message: str, field: str, found: str, wanted: str = "", hint: str = "") -> None:
        message = f"{message} {first.path}"
        raise SpecError(Problem(str(run.path), message, field, found, wanted, hint))

    sets = [(one.manifest.dataset, one.manifest.questions) for one in (run, first)]
    for field, mine, other in zip(("dataset", "questions"), *sets, strict=True):
        # Scenes and questions of two versions of a set may share a name and nothing else.
        if mine is None or other is None or mine.version == other.version:
            continue
        names = [getattr(one, "name", "") or Path(one.root).name for one in (mine, other)]
        if names[0] == names[1]:
            hint, versions = "run the suite again on the newer version", (mine, other)
            said, wanted = (str(one.version) for one in versions)
            differs(f"is of another version of {names[0]} than", f"{field}.version", said, wanted,
                    hint)  # fmt: skip
    vary, wanted_vary = (one.design.suite.vary for one in (run, first))
    if vary != wanted_vary:
        said, wanted = (", ".join(one.factors) or "nothing" for one in (vary, wanted_vary))
        hint = "compare runs that vary the same, in the same order"
        differs("asks in other ways than", "vary", said, wanted, hint)
    if (check := kind_of(track).report().check_alike) is not None:
        check(run, first, cells, measure)
    blocks = [
        one.records.drop_duplicates("scene").set_index("scene")["n_blocks"] for one in (first, run)
    ]
    both = pd.concat(blocks, axis=1, join="inner", keys=["first", "other"])
    if len(differ := both[both["first"] != both["other"]]):
        said = f"other blocks in {counted(len(differ), 'scene')}, the first {differ.index[0]}"
        differs("is of other data than", "scenes", said)


@dataclass(frozen=True)
class Part:
    """The subject of one row of a pair: a cell, and the way of counting where there are several."""

    name: str
    cell: str
    criterion: str = ""


@dataclass(frozen=True, eq=False)
class Side:
    """A model of a run, under the name that a comparison gives it."""

    label: str
    model: str
    run: Run


@dataclass(frozen=True, eq=False)
class Samples:
    """Counts of the samples that several sides have in a part of a track.

    `keys` has a row for each scene, item, seed and variant, ascending; `cell` is its pooled cell,
    and `counts`, (sides, keys, columns), NaN where a side has no such sample.
    """

    keys: pd.DataFrame
    cell: NDArray[np.intp]
    counts: Floats

    @property
    def has(self) -> NDArray[np.bool_]:
        """True where a side has a sample, (sides, keys)."""
        return ~np.isnan(self.counts[:, :, 0])


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

    def samples(self, sides: Sequence[Side], part: Part, design: Design) -> Samples:
        """Return the samples of sides in the headline setting and matcher of a design."""
        runs = list({id(side.run): side.run for side in sides}.values())
        found, counts = [], []
        for n, run in enumerate(runs):
            rows = counted_rows(replace(run, design=design), self.track, self.measure.counted)
            table, own = self._chosen(rows, part, design)
            found.append(table.assign(run=n))
            counts.append(own)
        table, numbers = pd.concat(found, ignore_index=True), np.concatenate(counts)
        key = table.groupby(_KEYS, sort=True).ngroup().to_numpy()
        _, first = np.unique(key, return_index=True)
        all_counts = np.full((len(sides), len(first), numbers.shape[1]), np.nan)
        for n, side in enumerate(sides):
            place = next(place for place, run in enumerate(runs) if run is side.run)
            mine = ((table["run"] == place) & (table["model"] == side.model)).to_numpy()
            all_counts[n, key[mine]] = numbers[mine]
        keys = table.loc[first, _KEYS].reset_index(drop=True)
        return Samples(keys, table["cell"].to_numpy(np.intp)[first], all_counts)

    def _chosen(self, rows: Rows, part: Part, design: Design) -> tuple[pd.DataFrame, Floats]:
        """Rows of a part with the number of their pooled cell, and their counts.

        Those of models that said nothing at all in a cell are left out.
        """
        masks = np.stack([rows.cells[name] for name in self.pooled(part)])
        wanted = dict(zip(SCORED_BY, (design.setting, design.matcher, part.criterion), strict=True))
        used = masks.any(axis=0)
        for name, value in wanted.items():
            if value:
                used &= rows.about[name].isin(["", value]).to_numpy()
        about, counts = rows.about[used], rows.counts[used].to_numpy(np.float64)
        records = rows.run.records.iloc[about["place"]]
        table = records[["model", "scene", "seed", "variant"]].reset_index(drop=True)
        cell = masks[:, used].argmax(axis=0)
        table = table.assign(item=about["item"].to_numpy(), cell=cell, heard=rows.replied[used])
        heard = table.groupby(["model", "cell"])["heard"].transform("any").to_numpy(bool)
        return table[heard], np.nan_to_num(counts[heard])

    def values(self, run: Run, part: Part, design: Design) -> Iterator[tuple[str, pd.Series]]:
        """Return the value of each sample in the measure's unit, by model; by scene, item, seed and
        variant, without samples that have no value.
        """
        sides = [Side(name, name, run) for name in run.design.model_names]
        samples = self.samples(sides, part, design)
        index = pd.MultiIndex.from_frame(samples.keys)
        for side, counts, has in zip(sides, samples.counts, samples.has, strict=True):
            if has.any():
                worth = self.measure.scale * self.measure.value(counts)
                yield side.model, pd.Series(worth, index=index)[has].dropna()

    def of_sums(self, part: Part, totals: Floats) -> Callable[[Floats], Floats]:
        """Return the value of sums of counts (..., pooled, columns and number of samples).

        Means are over the pooled cells of which `totals` have samples.
        """
        reached = {part.cell}
        for cell in reversed(self.cells):
            reached |= set(cell.of) if cell.name in reached else set()
        cells = [cell for cell in self.cells if cell.name in reached]
        values = value_of_cells(self.measure, cells, self.pooled(part))
        return lambda sums: values(sums[..., :-1], totals[..., -1] > 0)[..., -1]


def comparable(run: Run, track: str, measure: str = "") -> Comparable:
    """A measure of a track of a run, the main one where none is named.

    Raises SpecError for a measure that the track has not.
    """
    known = {one.name: one for one in track_measures(track)}
    if measure and measure not in known:
        message, allowed = "has no such measure", ", ".join(known)
        raise SpecError(Problem(f"track {track}", message, "--measure", measure, allowed))
    chosen = known[measure] if measure else main_measure(run, track)
    report, columns = kind_of(track).report(), headline_columns(run, track)
    cells = report.cells(run)
    criteria = [s.criterion for s in columns if s.measure == chosen.name and s.criterion]
    # A part of a mean that is pooled itself is too small to be compared alone.
    names = [
        cell.name for cell in cells if cell.of or not any(cell.name in other.of for other in cells)
    ]
    parts = [Part(name, name) for name in names]
    if criteria:
        parts = [Part(one, name, one) for name in names for one in reversed(criteria)]
    notes = report.notes(run) if chosen.name in {column.measure for column in columns} else ()
    how = " ".join((f"{chosen.heading}: {chosen.meaning}.", *notes, "Samples that both have."))
    return Comparable(track, chosen, cells, tuple(parts), how)


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
    n, columns = len(names), ["model", "value", "best", "worst"]
    if len(whole) != n * (n - 1) // 2 or whole["p"].isna().any():
        return pd.DataFrame(columns=columns)
    is_better, values = np.zeros((n, n), dtype=bool), dict.fromkeys(names, np.nan)
    for row in whole.to_dict("records"):
        a, b = names.index(row["a"]), names.index(row["b"])
        a_is_better = (row["difference"] > 0) == (measure.better == "higher")
        is_better[(a, b) if a_is_better else (b, a)] = row["p_holm"] < _LEVEL
        values |= {row["a"]: row["value_a"], row["b"]: row["value_b"]}
    ranges = rank_ranges(is_better)
    rows = [(name, values[name], *ranges[place]) for place, name in enumerate(names)]
    is_ascending = measure.better == "lower"
    return pd.DataFrame(rows, columns=columns).sort_values(
        "value", ascending=is_ascending, ignore_index=True, kind="stable"
    )


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
    `compare_models`. Raises SpecError for names that are not there.
    """
    where = f"{first.path}, {second.path}"
    if len(models) == 2:
        names = [(*checked_models(first, models[:1]), *checked_models(second, models[1:]))]
    else:
        shared = [name for name in first.design.model_names if name in second.design.model_names]
        if unknown := [name for name in models if name not in shared]:
            allowed = ", ".join(shared) or "none is in both"
            raise SpecError(
                Problem(where, f"are not both runs of {', '.join(unknown)}", allowed=allowed)
            )
        names = [(name, name) for name in models or shared]
    if not names:
        hint = "name one of each: --models A,B"
        raise SpecError(Problem(where, "have no model in common", hint=hint))
    folders = first.path.resolve().name, second.path.resolve().name
    tags = folders if folders[0] != folders[1] else (str(first.path), str(second.path))
    tags = tags if tags[0] != tags[1] else ("first", "second")
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


def compare(
    pairs: Sequence[tuple[Side, Side]], parts: Sequence[Part], what: Comparable
) -> Comparison:
    """Compare the sides of each pair in each part of a track on the samples that both have.

    Setting, matcher, criteria and what becomes of missing replies are those of the first run.
    Raises SpecError when a run was not scored so, asked other questions, or has other blocks in a
    scene of the same name.
    """
    design = pairs[0][0].run.design
    sides = list({side.label: side for pair in pairs for side in pair}.values())
    place = {side.label: n for n, side in enumerate(sides)}
    runs = list({id(side.run): side.run for side in sides}.values())
    for run in runs[1:]:
        check_alike(run, runs[0], [part.cell for part in parts], what.track, what.measure)
    parents = {scene: found for run in runs for scene, found in base_scenes(run).items()}
    labels = pd.DataFrame([(a.label, b.label) for a, b in pairs], columns=["a", "b"])
    numbers = np.array([(place[a.label], place[b.label]) for a, b in pairs])
    tables: list[pd.DataFrame] = []
    flipped = pd.DataFrame(columns=_FLIPPED)
    for part in parts:
        samples = what.samples(sides, part, design)
        batches = [
            _differences(samples, numbers[start : start + _AT_ONCE], parents, part, what)
            for start in range(0, len(pairs), _AT_ONCE)
        ]
        found = pd.concat(batches, ignore_index=True)
        tables.append(pd.concat([labels.assign(part=part.name), found], axis=1))
        if part == parts[-1]:
            flips = [
                _flips(samples, of_pair, (a.label, b.label), what)
                for of_pair, (a, b) in zip(numbers, pairs, strict=True)
            ]
            if flips := [flip for flip in flips if len(flip)]:
                flipped = pd.concat(flips, ignore_index=True)[_FLIPPED]
    table = with_verdicts(pd.concat(tables, ignore_index=True), what.measure)
    measure, how = what.measure, " ".join([what.how, *_asked(runs, what.track)])
    rows = ranks(table, measure)
    return Comparison(table, flipped, rows, measure.heading, measure.unit, how)


def _asked(runs: Sequence[Run], track: str) -> Iterator[str]:
    """Return what is unusual about how each run asked and read, where there is anything."""
    for run in runs:
        if words := (*kind_of(track).report().showing(run), *run.varied_words):
            yield f"Run {run.path.name}: {', '.join(words)}."
    readers = {run.path.name: run.manifest.versions.get("readers", "1") for run in runs}
    if len(set(readers.values())) > 1:
        names = ", ".join(f"{name} by readers {version}" for name, version in readers.items())
        yield f"Replies were read: {names}; phyblock score reads a run with those of this version."


def _differences(
    samples: Samples,
    pairs: NDArray[np.intp],
    parents: Mapping[str, tuple[str, ...]],
    part: Part,
    what: Comparable,
) -> pd.DataFrame:
    """Rows of `Comparison.table` for pairs of sides, but for names, corrected p and verdicts."""
    scene, scenes = pd.factorize(samples.keys["scene"], sort=True)
    shape = (len(scenes), len(what.pooled(part)), samples.counts.shape[-1] + 1)
    sums = np.zeros((shape[0], len(pairs), 2, *shape[1:]))
    seen = np.zeros((shape[0], len(pairs)), dtype=bool)
    tallies = []
    for n, pair in enumerate(pairs):
        both = samples.has[pair].all(axis=0)
        counts = samples.counts[pair][:, both]
        for side in range(2):
            at = (scene[both], samples.cell[both])
            ones = np.ones((len(at[0]), 1))
            np.add.at(sums[:, n, side], at, np.concatenate([counts[side], ones], axis=1))
        seen[scene[both], n] = True
        # A plan without a step for a goal without a block would have no F1; there is none.
        a, b = what.measure.value(counts)
        sign = np.sign(np.nan_to_num(a - b)) * (1 if what.measure.better == "higher" else -1)
        tallies.append([(sign > 0).sum(), (sign < 0).sum(), (sign == 0).sum(), len(sign)])
    used = seen.any(axis=1)
    sums, seen = sums[used], seen[used]
    clusters = Clusters.of([parents[name] for name in np.asarray(scenes)[used]])
    totals = sums.sum(axis=0)
    whole = what.of_sums(part, totals)
    sizes = clusters.behind(seen)
    values = whole(totals)
    estimate = jackknife(
        sums, clusters, lambda one: whole(one)[..., 0] - whole(one)[..., 1], n_clusters=sizes
    )
    scale = what.measure.scale
    estimate = bounded(estimate, what.measure.most_apart / scale)
    table = pd.DataFrame(
        {
            **{"value_a": scale * values[:, 0], "value_b": scale * values[:, 1]},
            **{"difference": scale * estimate.value, "se": scale * estimate.se},
            **{"lo": scale * estimate.lo, "hi": scale * estimate.hi, "p": estimate.p},
        }
    )
    table[["better", "worse", "same", "n_samples"]] = tallies
    return table.assign(n_scenes=seen.sum(axis=0), n_clusters=sizes)


def _flips(
    samples: Samples, pair: NDArray[np.intp], names: tuple[str, str], what: Comparable
) -> pd.DataFrame:
    """Samples that one of two sides alone got wholly right."""
    both = samples.has[pair].all(axis=0)
    a, b = what.measure.scale * np.nan_to_num(what.measure.value(samples.counts[pair][:, both]))
    table = samples.keys[both].assign(a=names[0], b=names[1], value_a=a, value_b=b)
    table["right"] = np.where(a == what.measure.best, *names)
    rows = table.loc[(a == what.measure.best) != (b == what.measure.best), _FLIPPED]
    return rows.sort_values(["right", *_KEYS])


def compare_view(found: Comparison) -> TextTable:
    """A row a pair and part; the part is left out where there is but one."""
    table = found.table
    parts = table["part"].nunique() > 1
    group = in_unit(found.name, found.unit)
    columns = [Column("A", is_text=True), Column("B", is_text=True)]
    columns += [Column("Part", is_text=True)] if parts else []
    columns += [Column(name, group) for name in ("A", "B", "A - B", "95 % CI", "finds")]
    columns += [Column("p (Holm)"), Column("Verdict", is_text=True)]
    columns += [Column(name, "Samples") for name in ("A better", "B better", "same")]
    rows, previous = [], ("", "")
    for row in table.to_dict("records"):
        pair = (row["a"], row["b"])
        texts = [*(pair if pair != previous else ("", ""))]
        texts += [level_name(row["part"].replace("_", " "))] if parts else []
        texts += [number(row["value_a"]), number(row["value_b"])]
        texts += [number(row["difference"], signed=True)]
        texts += [between(row["lo"], row["hi"], signed=True), number(row["detectable_holm"])]
        texts += [p_text(row["p_holm"]), row["verdict"]]
        rows.append((*texts, *(str(row[name]) for name in ("better", "worse", "same"))))
        previous = pair
    title = "Models compared on the same samples"
    return TextTable(title, tuple(columns), tuple(rows), _notes(found))


def _notes(found: Comparison) -> tuple[str, ...]:
    table, notes = found.table, [found.how]
    if len(table):
        most = table.to_dict("records")[int(table["n_scenes"].argmax())]
        single = table["detectable"].dropna().median()
        median = "" if pd.isna(single) else f"; a single test, in the median, {number(single)}"
        notes += [
            f"{counted(most['n_samples'], 'sample')} of {counted(most['n_scenes'], 'scene')} from "
            f"{counted(most['n_clusters'], 'base scene')}; scenes that share one are not taken as "
            "independent.",
            f"“finds”: the difference that this comparison would find in {POWER:.0%} of cases"
            f"{median}; {NO_VALUE}: none that is possible, or no sample differs.",
        ]
    notes.append(
        f"p values are corrected for {table['p'].notna().sum()} comparisons (Holm); “cannot tell” "
        "stands where p is 0.05 or more."
    )
    return tuple(notes)


def rank_text(row: Mapping[Any, Any]) -> str:
    """Return the ranks that a model may have: `2`, or `1 to 3`."""
    return " to ".join(str(n) for n in sorted({row["best"], row["worst"]}))


def ranks_view(found: Comparison) -> TextTable:
    """The rank that each model may have, out of `Comparison.ranks`, the best first."""
    rows = [
        (row["model"], number(row["value"]), rank_text(row))
        for row in found.ranks.to_dict("records")
    ]
    columns = (
        Column("Model", is_text=True), Column(in_unit(found.name, found.unit)), Column("Rank"),
    )  # fmt: skip
    note = "All ranges hold at once with 95 % confidence, by the comparisons above."
    return TextTable("Ranks that each model may have", columns, tuple(rows), (note,))


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
            names = []
            for row in flips[flips["right"] == side].to_dict("records"):
                how = filter(None, (f"seed {row['seed']}" if several else "", row["variant"]))
                told = ", ".join(how)
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
    return OutFolder(folder).write(
        {
            "comparison.csv": to_csv(found.table, "%.6f"),
            "comparison.md": to_markdown(view),
            "comparison.tex": to_latex(view, "phyblock-comparison"),
            "flipped.csv": to_csv(found.flipped, "%.2f"),
            "ranks.csv": to_csv(found.ranks, "%.6f"),
        }
    )


ITEMS = "items"
"""The row of what differs from item to item, to hold factors against."""
_COLUMNS = (
    *("track", "model", "factor", "levels"),
    *(f"{name}{end}" for name in ("shift", "single") for end in ("", "_lo", "_hi")),
    *("n_items", "n_clusters"),
)


def sensitivity_frame(run: Run) -> pd.DataFrame:
    """One row a track, model and factor: how far it moves scores, in the measure's unit.

    `shift` is the standard deviation of the means of the `levels` of a factor, `single` that of the
    scores of single items over levels beyond the shift; of repeats, that of one question asked
    again; in the row `items`, that between items. `*_lo` and `*_hi` bound 95 % intervals over the
    `n_clusters` base scenes of the `n_items` items that the model has in every way of asking.
    See `phyblock.scoring.statistics`. Empty where the run varies nothing.
    """
    rows: list[dict[str, Any]] = []
    vary = run.design.suite.vary
    for track in run.design.suite.tracks if vary.factors else ():
        what = comparable(run, track)
        for model, scores, clusters in _scores(run, what):
            for factor in (*vary.factors, ITEMS):
                levels = len(scores) if factor == ITEMS else len(vary.names(factor))
                row = {"track": track, "model": model, "factor": factor, "levels": levels}
                parts = _components(vary, factor, scores, clusters)
                for name, part in zip(("shift", "single"), parts, strict=True):
                    scale = what.measure.scale
                    row |= {name: scale * part.sd, f"{name}_lo": scale * part.lo}
                    row[f"{name}_hi"] = np.minimum(scale * part.hi, what.measure.most_apart)
                rows.append(row | {"n_items": len(scores), "n_clusters": clusters.size})
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def _scores(run: Run, what: Comparable) -> Iterator[tuple[str, Floats, Clusters]]:
    """Yield each model with its scores by the main measure, (items, seeds, variants), and the base
    scenes of these items: those that it has in every way of asking. Models may have different ones.
    """
    suite, parents = run.design.suite, base_scenes(run)
    sides = [Side(name, name, run) for name in run.design.model_names]
    samples = what.samples(sides, what.parts[-1], run.design)
    ways = [(seed, one.key) for seed in suite.seeds for one in suite.vary.variants]
    index = pd.MultiIndex.from_frame(samples.keys)
    for side, counts, has in zip(sides, samples.counts, samples.has, strict=True):
        sizes = samples.keys[has].groupby(["scene", "item"]).size()
        names = sorted(sizes.index[sizes == len(ways)])
        if names:
            wanted = pd.MultiIndex.from_tuples([(*name, *way) for name in names for way in ways])
            values = np.nan_to_num(what.measure.value(counts[index.get_indexer(wanted)]))
            scores = values.reshape(len(names), len(suite.seeds), suite.vary.n_variants)
            yield side.model, scores, Clusters.of([parents[scene] for scene, _ in names])


def _components(
    vary: VarySpec, factor: str, scores: Floats, clusters: Clusters
) -> tuple[Component, Component]:
    """The shift of a factor, and what it does to single items."""
    if factor == ITEMS:
        return NO_COMPONENT, spread_of_items(scores, clusters)
    # (items, levels, blocks with each seed, repeats)
    of_levels = np.moveaxis(scores[:, :, _places(vary, factor)], 1, 3)
    of_levels = of_levels.reshape(*of_levels.shape[:2], -1, of_levels.shape[-1])
    if factor == REPEAT:
        return NO_COMPONENT, within(np.moveaxis(of_levels[..., 0], 1, 2), clusters)
    # Repeats tell noise apart where nothing else was varied.
    cells = of_levels.mean(axis=3) if of_levels.shape[2] > 1 else of_levels[:, :, 0]
    return shift(cells, clusters), interaction(cells, clusters)


def _places(vary: VarySpec, factor: str) -> NDArray[np.intp]:
    """Numbers of the variants in which a factor has all its levels while all else stays, of shape
    (levels, blocks, repeats).
    """
    levels, repeats = vary.names(factor), vary.names(REPEAT) or ("1",)
    places: dict[Variant, dict[tuple[str, str], int]] = {}
    for place, variant in enumerate(vary.variants):
        here = dict(variant.levels)
        level = here.pop(factor, levels[0])
        again = level if factor == REPEAT else here.pop(REPEAT, "1")
        places.setdefault(Variant(tuple(here.items())), {})[level, again] = place
    # Of repeats each level is one: all others stand beside it as blocks.
    pairs = [[(n, again) for again in ((n,) if factor == REPEAT else repeats)] for n in levels]
    every = {pair for row in pairs for pair in row}
    whole = [found for found in places.values() if every <= set(found)]
    numbers = [[[found[pair] for pair in row] for found in whole] for row in pairs]
    return np.array(numbers, dtype=np.intp)


def factor_name(factor: str) -> str:
    """Return the name of a factor for people."""
    names = {REPEAT: "asked again", ITEMS: "between items"}
    return names.get(factor, factor.replace("_", " "))


def sensitivity_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Standard deviations with intervals out of `sensitivity_frame`, a row a model and factor."""
    tracks = run.design.suite.tracks
    rows = [
        (
            *(row["model"], *track_text(row["track"], tracks), factor_name(row["factor"])),
            *(*with_interval(row, "shift"), *with_interval(row, "single")),
        )
        for row in table.to_dict("records")
    ]
    pairs = [
        Column(n, head) for head in ("Shift of all", "Single items") for n in ("SD", "95 % CI")
    ]
    notes = [
        f"{kind_of(str(track)).title}: {comparable(run, str(track)).measure.heading_in_unit}, "
        f"{sizes_text(group)}."
        for track, group in table.groupby("track", sort=False)
    ]
    notes.append(
        "Shift: standard deviation of the means of a factor's levels. Single items: of one item's "
        "score over levels, beyond the shift and noise; asked again: of one question repeated."
    )
    if table.loc[~table["factor"].isin([REPEAT, ITEMS]), "single"].isna().any():
        notes.append("One factor alone without repeats cannot be told from noise in single items.")
    columns = (
        *(Column("Model", is_text=True), *track_column(tracks), Column("Factor", is_text=True)),
        *pairs,
    )
    title = f"What the way of asking changes{run.design.of_suite}"
    return TextTable(title, columns, tuple(rows), tuple(notes))


def sizes_text(table: pd.DataFrame) -> str:
    """Return how many items, of how many base scenes, are behind rows of `sensitivity_frame`: from
    the model that has fewest to the one that has most.
    """
    ends = [(int(table[name].min()), int(table[name].max())) for name in ("n_items", "n_clusters")]
    items, scenes = (f"{a}" if a == b else f"{a} to {b}" for a, b in ends)
    return f"{items} items of {scenes} base scenes"
