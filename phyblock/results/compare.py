"""Comparisons of models on the same samples: differences, ranks, effects of the presentation."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from phyblock.config.suite import REPEAT
from phyblock.config.yaml import shown
from phyblock.errors import Problem, SpecError
from phyblock.files import OutFolder
from phyblock.results import estimates
from phyblock.results.estimates import Headline
from phyblock.results.load import Design, Run, checked_models, track_measures
from phyblock.results.text import NO_VALUE, Column, TextTable, level_name, number, to_csv
from phyblock.scoring import statistics
from phyblock.scoring.plan import Floats
from phyblock.text import counted
from phyblock.tracks.base import kind_of, kinds
from phyblock.tracks.measures import SCORED_BY, Cell, Measure, in_unit

_LEVEL = 1 - statistics.CONFIDENCE
_KEYS = ["scene", "item", "seed", "variant"]
_ASKED = ("prompt", "answer_format", "parser", "images", "candidates", "settings", "scoring")
_JOINT = ("p_holm", "verdict", "detectable_holm")
"""Columns of `Comparison.table` that depend on all of its tests."""


def check_pair(run: Run, first: Run, cells: Sequence[str], track: str, measure: Measure) -> None:
    """Raise SpecError if `run` cannot be compared with `first` by a measure in these cells.

    They must have the same version of the data set, scoring rules, conditions, and values of the
    fields that the counts name; scenes with the same name must have the same blocks.
    """

    def need(field: str, found: object, wanted: object, hint: str = "") -> None:
        if found != wanted:
            message = f"cannot be compared with {first.path}"
            raise SpecError(Problem(str(run.path), message, field, str(found), str(wanted), hint))

    mine, other = run.manifest.dataset, first.manifest.dataset
    if mine is not None and other is not None and mine.name == other.name:
        need("dataset.version", mine.version, other.version, "run the suite on the newer version")
    suite, vary, other_vary = run.design.suite, run.design.suite.vary, first.design.suite.vary
    varied, other_varied = ({n: one.names(n) for n in one.factors} for one in (vary, other_vary))
    need("vary", varied, other_varied)
    held = first.counts.get((track, measure.counted.name))
    scored = [held is not None and (held[name] != "").any() for name in SCORED_BY]
    criteria = {cell.criterion for cell in first.cells(track) if cell.name in cells} - {""}
    rules: list[tuple[str, Sequence[str], set[str]]] = [
        ("settings", suite.settings, {first.design.setting}),
        ("scoring.matchers", suite.scoring.matchers, {first.design.matcher}),
        ("scoring.level1", ("aov", suite.scoring.level1), criteria),
    ]
    for (field, known, needed), is_scored in zip(rules, scored, strict=True):
        for name in sorted(needed.difference(known)) if is_scored else ():
            need(field, ", ".join(known), name, "phyblock score reads stored replies again")
    for path in measure.counted.same:
        need(path, _field(run, path), _field(first, path), "run the older one again")
    scenes = [one.records.drop_duplicates("scene") for one in (first, run)]
    blocks = [one.set_index("scene")["n_blocks"] for one in scenes]
    both = pd.concat(blocks, axis=1, join="inner", keys=["first", "other"])
    for row in both[both["first"] != both["other"]].itertuples():
        need(f"blocks of scene {row.Index}", row.other, row.first)


def _field(run: Run, path: str) -> Any:
    """Return the value at a path of keys in `run.yaml`, None if it is missing or false."""
    value: Any = vars(run.manifest)
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    return value or None


class Part(NamedTuple):
    """The subject of one row of a pair: a cell, and the criterion if there are several."""

    name: str
    cell: str
    criterion: str = ""


class Side(NamedTuple):
    """A model of a run, with its name in a comparison."""

    label: str
    model: str
    run: Run


def sides_of(run: Run, models: Sequence[str] = ()) -> list[Side]:
    """Return the named models of a run, or all, as sides. Raises SpecError as `checked_models`."""
    return [Side(name, name, run) for name in checked_models(run, models)]


@dataclass(frozen=True, eq=False)
class Samples:
    """Counts of the samples that several sides have in a part of a track.

    `keys` has a row per scene, item, seed and variant, ascending; `cell` is the place of its cell
    among the pooled ones; `counts` (sides, keys, columns) are NaN where a side has no sample.
    """

    keys: pd.DataFrame
    cell: NDArray[np.intp]
    counts: Floats

    @property
    def has(self) -> NDArray[np.bool_]:
        """True where a side has a sample, (sides, keys)."""
        return ~np.isnan(self.counts[:, :, 0])

    def values(self, measure: Measure) -> list[pd.Series]:
        """Return each side's values by scene, item, seed and variant, NaN where not defined."""
        index = pd.MultiIndex.from_frame(self.keys)
        of_sides = zip(self.counts, self.has, strict=True)
        return [pd.Series(measure.value(counts[has]), index[has]) for counts, has in of_sides]


@dataclass(frozen=True)
class Comparable:
    """A measure of a track, prepared for comparisons.

    `parts` are the rows of one pair, the last of which is the whole; `how` describes the values.
    """

    track: str
    measure: Measure
    cells: Mapping[str, Cell]
    parts: tuple[Part, ...]
    how: str

    def samples(self, sides: Sequence[Side], part: Part, design: Design) -> Samples:
        """Return the samples of sides in the headline setting and matcher of a design.

        Samples of a model without any reply in a cell are excluded.
        """
        runs = {id(side.run): side.run for side in sides}
        wanted = dict(zip(SCORED_BY, (design.setting, design.matcher, part.criterion), strict=True))
        tables, counts, cells = [], [], self.cells.values()
        for name, run in runs.items():
            rows = estimates.counted_rows(run, self.track, self.measure.counted, cells, design)
            pooled = estimates.pooled_in(self.cells[part.cell], self.cells)
            masks = np.stack([rows.cells[name] for name in pooled])
            used = masks.any(axis=0)
            for column, value in wanted.items():
                used &= rows.about[column].isin(["", value]).to_numpy() | (not value)
            table = rows.about[used].assign(cell=masks[:, used].argmax(axis=0), run=name)
            heard = table.groupby(["model", "cell"])["replied"].transform("any").to_numpy(bool)
            tables.append(table[heard])
            counts.append(rows.counts[used][heard])
        table, numbers = pd.concat(tables, ignore_index=True), np.concatenate(counts)
        key = table.groupby(_KEYS, sort=True).ngroup().to_numpy()
        _, first = np.unique(key, return_index=True)
        every = np.full((len(sides), len(first), numbers.shape[1]), np.nan)
        for n, side in enumerate(sides):
            mine = ((table["run"] == id(side.run)) & (table["model"] == side.model)).to_numpy()
            every[n, key[mine]] = numbers[mine]
        keys = table.loc[first, _KEYS].reset_index(drop=True)
        return Samples(keys, table["cell"].to_numpy(np.intp)[first], every)

    def values(self, run: Run, part: Part, design: Design) -> Iterator[tuple[str, pd.Series]]:
        """Yield each model with its samples' values in the measure's unit, by `_KEYS`, no NaN."""
        sides = sides_of(run)
        found = self.samples(sides, part, design).values(self.measure)
        for side, worth in zip(sides, found, strict=True):
            if len(worth):
                yield side.model, self.measure.scale * worth.dropna()

    def contrast(
        self,
        samples: Samples,
        pair: Sequence[int],
        part: Part,
        parents: Mapping[str, tuple[str, ...]],
    ) -> dict[str, Any]:
        """Return a row of `Comparison.table`, except for names, corrected p and verdicts.

        It is the difference of two sides on the samples that both have, from the sums of their
        counts by scene and cell; means are over the cells that have samples.
        """
        measure, both = self.measure, samples.has[list(pair)].all(axis=0)
        scene, scenes = pd.factorize(samples.keys["scene"].to_numpy()[both], sort=True)
        cell, counts = self.cells[part.cell], samples.counts[list(pair)][:, both]
        pooled = estimates.pooled_in(cell, self.cells)
        sums = np.zeros((len(scenes), 2, len(pooled), counts.shape[-1]))
        for side in range(2):
            np.add.at(sums[:, side], (scene, samples.cell[both]), counts[side])
        asked = np.bincount(samples.cell[both], minlength=len(pooled)) > 0

        def worth(of: Floats) -> Floats:
            single = measure.value(of)
            known = {name: single[..., n] for n, name in enumerate(pooled) if asked[n]}
            lacking = np.full(single.shape[:-1], np.nan)
            return estimates.cell_value(cell, self.cells, known) if known else lacking

        clusters, scale = statistics.Clusters.of([parents[name] for name in scenes]), measure.scale
        estimate = statistics.bounded(
            statistics.jackknife(sums, clusters, lambda of: worth(of)[..., 0] - worth(of)[..., 1]),
            measure.most_apart / scale,
        )
        value_a, value_b = scale * worth(sums.sum(axis=0))
        # Only a plan without steps for a goal without blocks would have no F1.
        a, b = measure.value(counts)
        sign = np.sign(np.nan_to_num(a - b)) * (1 if measure.better == "higher" else -1)
        ends = {name: scale * float(getattr(estimate, name)) for name in ("se", "lo", "hi")}
        return {
            **{"value_a": value_a, "value_b": value_b, "difference": scale * float(estimate.value)},
            **{**ends, "p": float(estimate.p), **dict.fromkeys(_JOINT), "better": (sign > 0).sum()},
            **{"worse": (sign < 0).sum(), "same": (sign == 0).sum(), "n_samples": len(sign)},
            **{"n_scenes": len(scenes), "n_clusters": clusters.size},
        }


def comparable(run: Run, track: str, measure: str = "") -> Comparable:
    """Return a measure, by default the main one, for comparisons. Raises SpecError if unknown."""
    known = {one.name: one for one in track_measures(track)}
    if measure and measure not in known:
        message, allowed = "has no such measure", ", ".join(known)
        raise SpecError(Problem(f"track {track}", message, "--measure", measure, allowed))
    headline = Headline(run, track)
    chosen = known[measure] if measure else headline.measure
    columns = headline.columns
    cells = {cell.name: cell for cell in chosen.counted.cells or run.cells(track)}
    criteria = [s.criterion for s in columns if s.measure == chosen.name and s.criterion] or [""]
    # A pooled part of a mean is too small to be compared alone.
    joined = {name for cell in cells.values() for name in cell.of}
    names = [name for name, cell in cells.items() if cell.of or name not in joined]
    parts = tuple(Part(one or name, name, one) for name in names for one in reversed(criteria))
    is_shown = chosen.name in {column.measure for column in columns}
    notes = estimates.track_notes(run, track) if is_shown else ()
    how = " ".join((f"{chosen.heading}: {chosen.meaning}.", *notes, "Samples that both have."))
    return Comparable(track, chosen, cells, parts, how)


@dataclass(frozen=True, eq=False)
class Comparison:
    """The result of `compare`.

    `table` has one row per pair and part of the track (level, category of questions): a, b, part,
    value_a, value_b, difference (a minus b), se, lo, hi [all in `unit`], p, p_holm (corrected for
    all rows), verdict, detectable_holm (the difference that is found in four of five cases at
    the first step of Holm's correction) [in `unit`; NaN beyond the most that values can differ
    by], better, worse and same (samples on which a is better, worse, the same), n_samples,
    n_scenes, n_clusters. `ranks`, if all pairs of a run were compared, has one row per ranked
    model: model, value, best and worst rank. `name`, `unit` and `how` are those of the values.
    """

    table: pd.DataFrame
    ranks: pd.DataFrame
    name: str
    unit: str
    how: str


def compare(
    run: Run,
    other: Run | None = None,
    models: Sequence[str] = (),
    track: str = "",
    measure: str = "",
) -> Comparison:
    """Compare every pair of models of a run, or each model with itself in the `other` run.

    `models` limits the comparison to these; of two models and two runs, one is of each run. A
    single pair is compared in every part of the track, several overall. `track` is by default the
    first one that all runs have, `measure` the main one of the track. Raises SpecError for unknown
    names, for fewer than two models, and for runs that cannot be compared.
    """
    runs = [run] if other is None else [run, other]
    if other is None:
        sides = sides_of(run, models)
        if len(sides) < 2:
            allowed = f"two of: {', '.join(run.design.model_names)}"
            raise SpecError(Problem(str(run.path), "needs two models to compare", allowed=allowed))
        pairs = list(combinations(sides, 2))
    else:
        pairs = _pairs_of_runs(run, other, models)
    shared = [name for name in kinds() if all(name in one.design.suite.tracks for one in runs)]
    if not shared or (track and track not in shared):
        where, allowed = ", ".join(str(one.path) for one in runs), ", ".join(shared)
        message = "has no such track to compare" if shared else "have no track in common"
        raise SpecError(Problem(where, message, "track", track, allowed))
    what = comparable(run, track or shared[0], measure)
    parts = what.parts
    if other is not None:
        known = comparable(other, what.track, what.measure.name).parts
        parts = tuple(part for part in parts if part in known)
    ranked = with_rank(sides, what.track) if other is None else ()
    return compare_pairs(pairs, parts if len(pairs) == 1 else parts[-1:], what, ranked)


def _pairs_of_runs(first: Run, second: Run, models: Sequence[str]) -> list[tuple[Side, Side]]:
    """Return two models as the sides of a pair, or each model that both runs have."""
    if len(models) == 2:
        names = [(*checked_models(first, models[:1]), *checked_models(second, models[1:]))]
    else:
        shared = [name for name in first.design.model_names if name in second.design.model_names]
        unknown = [name for name in models if name not in shared]
        if unknown or not shared:
            named = f"are not both runs of {', '.join(unknown)}"
            message = named if unknown else "have no model in common"
            where, allowed = f"{first.path}, {second.path}", ", ".join(shared)
            hint = "name one of each: --models A,B"
            raise SpecError(Problem(where, message, allowed=allowed, hint=hint))
        names = [(name, name) for name in models or shared]
    folders = first.path.resolve().name, second.path.resolve().name
    tags = (folders, (str(first.path), str(second.path)), ("first", "second"))
    one, two = next(pair for pair in tags if pair[0] != pair[1])
    return [(Side(f"{a} ({one})", a, first), Side(f"{b} ({two})", b, second)) for a, b in names]


def compare_pairs(
    pairs: Sequence[tuple[Side, Side]],
    parts: Sequence[Part],
    what: Comparable,
    ranked: Sequence[Side] = (),
) -> Comparison:
    """Compare the sides of each pair in each part of a track on the samples that both have.

    `ranked` sides, every pair of which is among `pairs`, get ranks by the last part. Setting,
    matcher, criteria and the policy on missing replies are those of the first run. Raises SpecError
    if a run was scored differently, asked other questions, or has other blocks in a scene.
    """
    sides = list(dict.fromkeys(side for pair in pairs for side in pair))
    runs = list({id(side.run): side.run for side in sides}.values())
    for run in runs[1:]:
        check_pair(run, runs[0], [part.cell for part in parts], what.track, what.measure)
    parents = {scene: found for run in runs for scene, found in estimates.base_scenes(run).items()}
    rows = []
    for part in parts:
        samples = what.samples(sides, part, pairs[0][0].run.design)
        for a, b in pairs:
            about = {"a": a.label, "b": b.label, "part": part.name}
            pair = [sides.index(a), sides.index(b)]
            rows.append({**about, **what.contrast(samples, pair, part, parents)})
    table, measure = pd.DataFrame(rows), what.measure
    n_tests = int(table["p"].notna().sum())
    table["p_holm"] = statistics.holm(table["p"])
    table["verdict"] = [_verdict(row, measure, n_tests) for row in table.to_dict("records")]
    level, spread = _LEVEL / max(n_tests, 1), (table["se"], table["n_clusters"])
    table["detectable_holm"] = statistics.detectable(*spread, level, measure.most_apart)
    said = [pd.json_normalize(run.manifest.suite).to_dict("records")[0] for run in runs]
    ours = {*_ASKED, kind_of(what.track).section}
    names = [str(name) for name in said[0] | said[-1] if str(name).partition(".")[0] in ours]
    both = [(name, *(shown(one.get(name)) for one in (said[0], said[-1]))) for name in names]
    differ = ", ".join(f"{name} ({a}, {b})" for name, a, b in both if a != b)
    how = [what.how, *([f"The runs differ in {differ}."] if differ else [])]
    how += [f"Run {run.path.name}: {', '.join(words)}."
            for run in runs if (words := run.presentation(what.track))]  # fmt: skip
    ranks = _ranks(table, measure, ranked)
    return Comparison(table, ranks, measure.heading, measure.unit, " ".join(how))


def _verdict(row: Mapping[Any, Any], measure: Measure, n_tests: int) -> str:
    if np.isnan(row["difference"]):
        return "nothing to compare"
    if np.isnan(row["p_holm"]):
        return "too few base scenes to tell"
    if row["p_holm"] >= _LEVEL:
        # With so few base scenes, no corrected p value can be below the level.
        too_few = n_tests * statistics.least_p(row["n_clusters"]) >= _LEVEL
        return "too few base scenes to tell" if too_few else "cannot tell"
    a_is_better = (row["difference"] > 0) == (measure.better == "higher")
    return f"{row['a' if a_is_better else 'b']} is better"


def rank_ranges_of(sides: Sequence[Side], track: str) -> dict[str, tuple[int, int]]:
    """Return best and worst ranks of all ranked sides, by label. Raises SpecError as `compare`."""
    ranked = with_rank(sides, track)
    if len(ranked) < 2:
        return {side.label: (1, 1) for side in ranked}
    what = comparable(ranked[0].run, track)
    found = compare_pairs(list(combinations(ranked, 2)), what.parts[-1:], what, ranked)
    rows = found.ranks.to_dict("records")
    return {str(row["model"]): (int(row["best"]), int(row["worst"])) for row in rows}


def with_rank(sides: Sequence[Side], track: str) -> list[Side]:
    """Return the sides that are models, not baselines, with a value and all their records."""
    able = {}
    for run in {id(side.run): side.run for side in sides}.values():
        recorded = run.records.loc[run.records["track"] == track, "model"].value_counts()
        whole = recorded.index[recorded == run.design.samples(track)]
        able[id(run)] = Headline(run, track).ranked.keys() & {*whole} - run.design.baselines
    return [side for side in sides if side.model in able[id(side.run)]]


def _ranks(table: pd.DataFrame, measure: Measure, ranked: Sequence[Side]) -> pd.DataFrame:
    """Return the ranks by the last part of a table, with tests corrected only for ranked pairs."""
    names, columns = [side.label for side in ranked], ["model", "value", "best", "worst"]
    if not names:
        return pd.DataFrame(columns=columns)
    whole = table[table["part"] == table["part"].iloc[-1]]
    pairs = whole[whole["a"].isin(names) & whole["b"].isin(names)]
    known = dict[str, float]()
    # The value of a single ranked model is in its pair with another side.
    for row in (pairs if len(pairs) else whole).to_dict("records"):
        known |= {row["a"]: row["value_a"], row["b"]: row["value_b"]}
    is_better = np.zeros((len(names), len(names)), dtype=bool)
    for row, p in zip(pairs.to_dict("records"), statistics.holm(pairs["p"]), strict=True):
        a, b = names.index(row["a"]), names.index(row["b"])
        a_is_better = (row["difference"] > 0) == (measure.better == "higher")
        is_better[(a, b) if a_is_better else (b, a)] = p < _LEVEL
    ranges = zip(names, statistics.rank_ranges(is_better), strict=True)
    rows = [(name, known[name], *ends) for name, ends in ranges]
    return pd.DataFrame(rows, columns=columns).sort_values(
        "value", ascending=measure.better == "lower", ignore_index=True, kind="stable"
    )


def rank_text(best: int, worst: int) -> str:
    """Return the text of a range of ranks."""
    return str(best) if best == worst else f"{best}\N{EN DASH}{worst}"


def compare_view(found: Comparison) -> TextTable:
    """Return a table with a row per pair and part, without the part if there is only one."""
    group = in_unit(found.name, found.unit)
    columns = [Column.text("a", "A", once=True), Column.text("b", "B", once=True)]
    if found.table["part"].nunique() > 1:
        columns.append(Column("Part", "", True, lambda row: level_name(row["part"])))
    columns += [
        *(Column.value("value_a", "A", group), Column.value("value_b", "B", group)),
        Column.value("difference", "A - B", group, signed=True),
        Column.interval(group, signed=True),
        Column.value("detectable_holm", "finds", group),
        Column("p (Holm)", show=lambda row: number(row["p_holm"], 3).replace("0.000", "< 0.001")),
        Column.text("verdict", "Verdict"),
        Column.whole("better", "A better", "Samples"),
        Column.whole("worse", "B better", "Samples"),
        Column.whole("same", "same", "Samples"),
    ]
    most = found.table.to_dict("records")[int(found.table["n_scenes"].argmax())]
    notes = (
        found.how,
        f"{counted(most['n_samples'], 'sample')} of {counted(most['n_scenes'], 'scene')} from "
        f"{counted(most['n_clusters'], 'base scene')}; scenes that share one are not taken as "
        "independent.",
        f"“finds”: the difference that this comparison would find in {statistics.POWER:.0%} of "
        f"cases. {NO_VALUE}: none that is possible, or no sample differs.",
        f"p values are corrected for {found.table['p'].notna().sum()} comparisons (Holm); “cannot "
        "tell” stands where p is 0.05 or more.",
    )
    return TextTable.of(found.table, "Models compared on the same samples", columns, notes)


def ranks_view(found: Comparison) -> TextTable:
    """Return a table of `Comparison.ranks`, the best model first."""
    columns = [
        Column.text("model", "Model"),
        Column.value("value", in_unit(found.name, found.unit)),
        Column("Rank", show=lambda row: rank_text(row["best"], row["worst"])),
    ]
    note = (
        "All ranges hold at once with 95 % confidence, by the comparisons of these models (Holm). "
        "Baselines have no rank, nor have models that are not complete."
    )
    return TextTable.of(found.ranks, "Ranks that each model may have", columns, [note])


def write_comparison(found: Comparison, folder: Path) -> tuple[Path, ...]:
    """Write comparison (.csv, .md, .tex) and ranks.csv. Raises StoreError if that fails."""
    files = compare_view(found).files("comparison")
    files |= {"ranks.csv": to_csv(found.ranks, "%.6f")}
    return OutFolder(folder).write(files)


_COLUMNS = (
    *("track", "model", "factor", "levels", "shift", "shift_lo", "shift_hi"),
    *("n_items", "n_clusters"),
)


def sensitivity_frame(run: Run) -> pd.DataFrame:
    """Return one row per track, model and factor: how far it moves scores, in the measure's unit.

    `shift` is the standard deviation of the means of the `levels` of a factor; `shift_lo` and
    `shift_hi` bound its 95 % interval over the `n_clusters` base scenes of the `n_items` items that
    the model answered under every condition. Repeats are no factor. Empty if nothing varies.
    """
    rows: list[tuple[object, ...]] = []
    suite, parents = run.design.suite, estimates.base_scenes(run)
    factors = [factor for factor in suite.vary.factors if factor != REPEAT]
    ways = [(seed, one.key) for seed in suite.seeds for one in suite.vary.variants]
    # Variants are all combinations of levels, with the repeats of each in sequence.
    sizes = [len(suite.seeds), *(len(suite.vary.names(factor)) for factor in factors), -1]
    for track in suite.tracks if suite.vary.factors else ():
        what = comparable(run, track)
        sides = sides_of(run)
        found = what.samples(sides, what.parts[-1], run.design).values(what.measure)
        for side, worth in zip(sides, found, strict=True):
            # Only items answered under every condition, which may differ between models.
            by_way = worth.fillna(0.0).unstack(["seed", "variant"]).reindex(columns=ways)
            whole = by_way.dropna()
            if whole.empty:
                continue
            clusters = statistics.Clusters.of([parents[scene] for scene, _ in whole.index])
            scores = np.moveaxis(whole.to_numpy().reshape(len(whole), *sizes), 1, -1)
            for place, factor in enumerate(factors, 1):
                levels = np.moveaxis(scores, place, 1)
                part = statistics.shift(levels.reshape(*levels.shape[:2], -1), clusters)
                sd, lo, hi = (what.measure.scale * end for end in (part.sd, part.lo, part.hi))
                shift = (levels.shape[1], sd, lo, np.minimum(hi, what.measure.most_apart))
                rows.append((track, side.model, factor, *shift, len(whole), clusters.size))
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def sensitivity_table(run: Run) -> TextTable | None:
    """Return a table of standard deviations with intervals, a row per model and factor, or None."""
    table, tracks = sensitivity_frame(run), run.design.suite.tracks
    if table.empty:
        return None
    columns = [Column.text("model", "Model"), *Column.track(tracks)]
    columns.append(Column("Factor", "", True, lambda row: row["factor"].replace("_", " ")))
    columns += [Column.value("shift", "Shift"), Column.interval("", "shift_lo", "shift_hi")]
    notes = [
        f"{kind_of(str(track)).title}: {comparable(run, str(track)).measure.heading_in_unit}, "
        f"{sizes_text(group)}."
        for track, group in table.groupby("track", sort=False)
    ]
    notes.append("Shift: standard deviation of the means of a factor's levels.")
    return TextTable.of(table, f"Effect of the presentation{run.design.of_suite}", columns, notes)


def sizes_text(table: pd.DataFrame) -> str:
    """Return the range over models of the numbers of items and base scenes behind these rows."""
    ends = [(int(table[name].min()), int(table[name].max())) for name in ("n_items", "n_clusters")]
    items, scenes = (f"{a}" if a == b else f"{a} to {b}" for a, b in ends)
    return f"{items} items of {scenes} base scenes"
