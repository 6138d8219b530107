"""Tables of a run: layouts filled from its estimates, coverage, cost, and all of their files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import pandas as pd
import yaml
from pydantic import BaseModel, ConfigDict

from phyblock.files import OutFolder
from phyblock.registry import added_measures
from phyblock.results.estimates import (
    all_estimates,
    headline_columns,
    headline_floors,
    headline_of,
    headline_rows,
    main_column,
    main_measure,
    track_estimates,
    track_measures,
)
from phyblock.results.load import HEADINGS, NOT_RUN, TOKENS, Run, load_run
from phyblock.results.text import (
    NO_VALUE,
    Column,
    TextTable,
    between,
    captioned,
    number,
    to_csv,
    to_latex,
    to_markdown,
    track_column,
    track_text,
)
from phyblock.text import counted
from phyblock.tracks.base import kind_of, kinds
from phyblock.tracks.measures import CELL, Measure
from phyblock.types import OUTCOMES

TABLES = "tables"
"""The folder of tables in the folder of a run."""
_FORMS = ("csv", "md", "tex")
_PUBLISHED = "published"


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class LayoutColumn(_Strict):
    """Columns of a table: a measure each, in one cell or in each.

    `measures` are names, with headings where a column is not headed as its measure. `cell` is the
    one that is shown, the last of the track where it is left out; with `cells: each`, all are.
    `show` gives values, the ends of intervals, or both. `group` heads neighbors; in it, in headings
    and in `key`, the name in CSV files, `{cell}`, `{group}`, `{level}`, `{measure}` and
    `{criterion}` stand for what a column is of.
    """

    measures: dict[str, str] | tuple[str, ...] = ()
    cells: Literal["each", "one"] = "one"
    cell: str = ""
    criterion: str = ""
    group: str = ""
    show: Literal["value", "interval", "both"] = "value"
    key: str = "{measure}"
    digits: int = 1


class Layout(_Strict):
    """A table: a row a model; by `rows`, a row a model and cell, or one a model and measure."""

    caption: str
    rows: Literal["model", "cell"] | tuple[str, ...] = "model"
    columns: tuple[LayoutColumn, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Table:
    """A table of a run: its numbers, and how people read it."""

    frame: pd.DataFrame
    view: TextTable


@dataclass(frozen=True)
class _Shown:
    """A column of numbers: what it is of ("" for what the row says), and how it is shown."""

    column: Column
    key: str
    measure: str
    cell: str
    criterion: str
    is_interval: bool
    digits: int


@cache
def layouts_of(track: str) -> Mapping[str, Layout]:
    """Return the layouts of a track's tables by name; {} for a track that has none of its own."""
    path = files("phyblock.results") / "layouts" / f"{track}.yaml"
    if not path.is_file():
        return {}
    held = yaml.safe_load(path.read_text(encoding="utf-8"))
    return {name: Layout.model_validate(layout) for name, layout in held.items()}


def _layouts(run: Run, track: str) -> Mapping[str, Layout]:
    """Return the layouts of a track, of one that has none its headline under the track's name."""
    columns = [
        LayoutColumn(
            measures={one.measure: one.heading},
            cell=one.cell,
            criterion=one.criterion,
            show="both",
            key="{cell}_{measure}",
        )
        for one in headline_columns(run, track)
    ]
    own = layouts_of(track) or {track: Layout(caption=kind_of(track).title, columns=tuple(columns))}
    if not (added := added_measures(track)):
        return own
    notes = tuple(f"{m.heading}: {m.meaning}; over {m.over}; {m.better} is better." for m in added)
    shown = LayoutColumn(measures=tuple(measure.name for measure in added), show="both")
    caption = f"Further measures of {kind_of(track).title.lower()}"
    return {**own, f"{track}_measures": Layout(caption=caption, columns=(shown,), notes=notes)}


def filled(run: Run, track: str, layout: Layout) -> Table:
    """Fill a layout with the estimates of a track in the headline setting and matcher."""
    measures = {measure.name: measure for measure in track_measures(track)}
    cells = {cell.name: cell for cell in kind_of(track).report().cells(run)}
    known: dict[tuple[str, str, str, str], Mapping[Hashable, Any]] = {}
    for row in headline_rows(track_estimates(run, track), run.design).to_dict("records"):
        key = (str(row["model"]), str(row["measure"]), str(row[CELL]))
        known[*key, str(row["criterion"])] = known[*key, ""] = row
    there = {(measure, cell) for _, measure, cell, _ in known}
    shown = list(_shown(layout, measures, cells, there))
    # What a row is of beside its model: a measure, a cell, or nothing.
    parts: list[tuple[str, str, str]] = [("", "", "")]
    if layout.rows == "cell":
        wanted = {column.measure for column in shown}
        parts = [
            ("", name, cell.heading)
            for name, cell in cells.items()
            if any((measure, name) in there for measure in wanted)
        ]
    elif layout.rows != "model":
        parts = [(name, "", measures[name].heading) for name in layout.rows]
    numbers: list[dict[str, Any]] = []
    rows: list[tuple[str, ...]] = []
    for model in run.design.model_names:
        for place, (measure, cell, heading) in enumerate(parts):
            named: dict[str, Any] = {"model": model} | (
                {"part": measure or cell} if heading else {}
            )
            texts = [model if place == 0 else "", *([heading] if heading else [])]
            for one in shown:
                at = (model, measure or one.measure, cell or one.cell, one.criterion)
                scale, found = measures[at[1]].scale, known.get(at, {})
                ends = [scale * float(found.get(name, math.nan)) for name in ("value", "lo", "hi")]
                if one.is_interval:
                    named |= {f"{one.key}_lo": ends[1], f"{one.key}_hi": ends[2]}
                    texts.append(between(*ends[1:]))
                else:
                    named[one.key] = ends[0]
                    texts.append(number(ends[0], one.digits))
            numbers.append(named)
            rows.append(tuple(texts))
    head = [
        Column("Model", is_text=True),
        *([Column("", is_text=True)] if layout.rows != "model" else []),
    ]
    columns = (*head, *(one.column for one in shown))
    report = kind_of(track).report()
    words = (*report.showing(run), *run.varied_words)
    caption = captioned(f"{layout.caption}{run.design.of_suite}", words)
    notes = (*report.notes(run), *layout.notes, *_sample_notes(run, track))
    frame = pd.DataFrame(numbers, columns=None if numbers else ["model"])
    return Table(frame, TextTable(caption, columns, tuple(rows), notes))


def _shown(
    layout: Layout,
    measures: Mapping[str, Measure],
    cells: Mapping[str, Any],
    there: set[tuple[str, str]],
) -> Iterator[_Shown]:
    """Return the columns of a layout; of each cell, those that have an estimate."""
    last = list(cells)[-1]
    of_rows = layout.rows if isinstance(layout.rows, tuple) else ()
    for spec in layout.columns:
        headings = dict(spec.measures) if isinstance(spec.measures, dict) else {}
        names = tuple(headings) or tuple(spec.measures) or ("",)
        places = [spec.cell or last]
        if spec.cells == "each":
            asked = [name for name in names if name] or of_rows
            places = [cell for cell in cells if any((name, cell) in there for name in asked)]
        for place in places:
            for name in names:
                cell = cells.get(place, cells[last])
                level = f"level{place}" if place.isdigit() else place
                about = {"cell": cell.heading, "group": cell.group, "level": level}
                about |= {"measure": name, "criterion": spec.criterion}
                default = measures[name].heading if name else ""
                heading = headings.get(name, default).format(**about)
                group = spec.group.format(**about)
                unit = measures[name or of_rows[0]].unit or "Value"
                if spec.show == "both" and not group:
                    heading, group = unit, heading
                at = (spec.key.format(**about), name, "" if layout.rows == "cell" else place)
                for is_interval in (False, True):
                    if spec.show in ("both", "interval" if is_interval else "value"):
                        text = "95 % CI" if is_interval else heading or unit
                        yield _Shown(
                            Column(text, group), *at, spec.criterion, is_interval, spec.digits
                        )


def _sample_notes(run: Run, track: str) -> Iterator[str]:
    """Say how many samples are behind values, where that is not as many as were planned."""
    design = run.design
    if len(design.suite.seeds) > 1:
        yield f"Values pool the samples of {len(design.suite.seeds)} seeds."
    table = coverage_frame(run)
    table = table[table["track"] == track]
    if len(short := table[table["not_run"] > 0]):
        counts = zip(short["model"], short["recorded"], strict=True)
        listed = ", ".join(f"{model} {n}" for model, n in counts)
        yield f"Not complete, of {design.samples(track)} samples: {listed}."
    listed = ", ".join(
        f"{row['model']} {' and '.join(kinds)}"
        for row in table.to_dict("records")
        if (kinds := [f"{row[name]} {text}" for name, text in _LACKING.items() if row[name]])
    )
    if listed:
        how = "left out" if design.outcomes_left_out else "counted as wrong"
        yield f"Without a reply, {how}: {listed}."
    rows = run.records[run.records["track"] == track]
    refused = rows.loc[~rows["seed_sent"].fillna(True).astype(bool), "model"].unique()
    if len(refused):
        yield f"{', '.join(refused)}: seed unsupported, seeds are independent repeats."


_LACKING = {"api_error": "API errors", "missing": "missing replies"}


_COUNTS = (
    *("recorded", *OUTCOMES, "extracted", "replies"),
    *("tokens_unknown", "cost_unknown", "cached", "attempts"),
)

_ROW = ["model", "track"]
_COLUMNS = (
    *_ROW,
    "expected",
    "recorded",
    "not_run",
    *OUTCOMES,
    "extracted",
    "replies",
    *TOKENS,
    "tokens_unknown",
    "cost_usd",
    "cost_unknown",
    "latency_s",
    "cached",
    "attempts",
)


def coverage_frame(run: Run) -> pd.DataFrame:
    """Return one row a model and track.

    `expected` samples are `recorded` + `not_run`; the outcomes split `recorded`,
    and `extracted` are those that an extraction model read. Of the `replies`
    (samples that hold one): token sums of those that tell, with `tokens_unknown` that do not;
    `cost_usd` what the run paid, the sum of the known prices, NaN where none is, with
    `cost_unknown` without one; `cached` ones were paid for by another run and cost nothing here;
    `latency_s` the mean over replies for which a request was sent, so neither `cached` ones nor
    recordings; `attempts` the sum of requests sent for them, not for samples without a reply.
    """
    records = run.records[run.records["track"].isin(run.design.suite.tracks)]
    replied = records["finish"].notna()
    cached = records["cached"].fillna(False).astype("bool")
    paid = replied & ~cached
    attempts = records["attempts"].fillna(0).astype("int64")
    facts = records[[*_ROW, *TOKENS]].assign(
        recorded=1,
        **{name: (records["outcome"] == name).astype("int64") for name in OUTCOMES},
        extracted=(records["rule"] == "extractor").astype("int64"),
        replies=replied.astype("int64"),
        tokens_unknown=(replied & records["completion_tokens"].isna()).astype("int64"),
        cost_usd=records["paid_usd"].where(paid),
        cost_unknown=(paid & records["paid_usd"].isna()).astype("int64"),
        cached=cached.astype("int64"),
        attempts=attempts,
        latency_s=records["latency_s"].where(attempts > 0),
    )
    groups = facts.groupby(_ROW)
    sums = groups[list(_COUNTS)].sum()
    known = groups[[*TOKENS, "cost_usd"]].sum(min_count=1)
    design = run.design
    rows = [
        (model, track, design.samples(track))
        for model in design.model_names
        for track in design.suite.tracks
    ]
    table = pd.DataFrame(rows, columns=[*_ROW, "expected"])
    table = table.join(sums, on=_ROW).join(known, on=_ROW)
    table = table.join(groups["latency_s"].mean(), on=_ROW)
    # Out of an empty frame columns of any type come, and pandas fills these with a warning.
    table[list(_COUNTS)] = table[list(_COUNTS)].astype("float64").fillna(0).astype("int64")
    table.loc[(table["replies"] > 0) & (table["replies"] == table["cached"]), "cost_usd"] = 0.0
    table["not_run"] = table["expected"] - table["recorded"]
    return table[list(_COLUMNS)]


def coverage_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Show outcomes out of `coverage_frame`."""
    tracks = run.design.suite.tracks
    headings = {"expected": "Expected", "not_run": NOT_RUN} | {n: HEADINGS[n] for n in OUTCOMES}
    rows = tuple(
        (row["model"], *track_text(row["track"], tracks), *(f"{row[name]:,}" for name in headings))
        for row in table.to_dict("records")
    )
    columns = (
        Column("Model", is_text=True),
        *track_column(tracks),
        *map(Column, headings.values()),
    )
    read = table[table["extracted"] > 0]
    counts = zip(read["model"], read["extracted"], read["recorded"], strict=True)
    listed = ", ".join(f"{model} {count} of {recorded}" for model, count, recorded in counts)
    notes: tuple[str, ...] = (f"Read by extractor: {listed}.",) if listed else ()
    if run.is_cut:
        notes += ("The last line of records.jsonl was cut off and is ignored.",)
    return TextTable(f"Coverage{run.design.of_suite}", columns, rows, notes)


def is_complete(table: pd.DataFrame) -> bool:
    """True if every sample of a `coverage_frame` was asked and answered plainly."""
    return bool((table["ok"] == table["expected"]).all())


def cost_frame(run: Run) -> pd.DataFrame:
    """One row a model and track: replies, mean tokens a reply, dollars and seconds.

    A reply is what a sample got: of step planning, those of a whole episode together.
    Tokens are means over the replies that tell them. `cost_usd` is what the run paid, as in
    `coverage`, and `cost_per_100_usd` what 100 replies cost at the price of those with a known
    one, cached ones included: what another run of the same would cost. Latency [s] is of replies
    for which a request was sent: median and 90th percentile. NaN where nothing is known.
    """
    records = run.records
    sent = records["attempts"].fillna(0).astype("int64") > 0
    facts = records[[*_ROW, *TOKENS]].astype(dict.fromkeys(TOKENS, "Float64"))
    facts["price"] = records["cost_usd"].where(sent | records["cached"].fillna(False).astype(bool))
    facts["latency_s"] = records["latency_s"].where(sent)
    groups = facts.groupby(_ROW)
    costs = groups[list(TOKENS)].mean().astype("float64")
    costs["cost_per_100_usd"] = 100 * groups["price"].mean()
    costs["latency_median_s"] = groups["latency_s"].median()
    costs["latency_p90_s"] = groups["latency_s"].quantile(0.9)
    return coverage_frame(run)[[*_ROW, "replies", "cost_usd"]].join(costs, on=_ROW)


def cost_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Tokens, dollars and seconds out of `cost_frame`."""
    columns = (
        Column("Model", is_text=True),
        Column("Track", is_text=True),
        Column("Replies"),
        Column("in", "Tokens a reply"),
        Column("out", "Tokens a reply"),
        Column("reasoning", "Tokens a reply"),
        Column("this run", "Cost (USD)"),
        Column("100 replies", "Cost (USD)"),
        Column("median", "Latency (s)"),
        Column("90 %", "Latency (s)"),
    )
    rows = [
        (
            row["model"],
            row["track"].replace("_", " "),
            f"{row['replies']:,}",
            *(number(row[name], 0) for name in TOKENS),
            _dollars(row["cost_usd"]),
            _dollars(row["cost_per_100_usd"]),
            number(row["latency_median_s"], 2),
            number(row["latency_p90_s"], 2),
        )
        for row in table.to_dict("records")
    ]
    notes = ["Replies from the cache cost this run nothing; 100 replies are priced as if asked."]
    episodes = [kind_of(name) for name in run.design.suite.tracks if kind_of(name).plays]
    notes += [
        f"Of {kind.title.lower()}, a reply is a whole episode: all its steps together."
        for kind in episodes
        if (table["track"] == kind.name).any()
    ]
    return TextTable(
        f"Tokens, cost and latency{run.design.of_suite}", columns, tuple(rows), tuple(notes)
    )


def _dollars(amount: float) -> str:
    return NO_VALUE if pd.isna(amount) else f"{amount:,.{2 if amount >= 1 or not amount else 4}f}"


@dataclass(frozen=True, eq=False)
class TablesWritten:
    """The `files` of `tables`, by name, of a `run`, in a `folder`."""

    folder: Path
    files: tuple[Path, ...]
    tables: Mapping[str, Table]
    run: Run

    @property
    def views(self) -> Mapping[str, TextTable]:
        """The tables as people read them."""
        return {name: table.view for name, table in self.tables.items()}


def write_tables(path: str | Path) -> TablesWritten:
    """Rebuild `tables/` of a run folder from its records; each file appears whole or not at all.

    Raises StoreError for a broken run (see `load_run`) or a folder that cannot be written, and,
    before anything is, naming every file in the way that we never wrote.
    """
    run = load_run(path, texts=False)
    made = make_tables(run)
    texts: dict[str, str | bytes] = {f"{TABLES}/estimates.csv": to_csv(all_estimates(run), "%.6f")}
    for name, table in made.items():
        texts[f"{TABLES}/{name}.csv"] = to_csv(table.frame, "%.6f")
        texts[f"{TABLES}/{name}.md"] = to_markdown(table.view)
        texts[f"{TABLES}/{name}.tex"] = to_latex(table.view, f"phyblock-{name}")
    folder = OutFolder(run.path)
    written = folder.write(texts)
    # Coverage that was not complete before may be so now.
    known = set(table_files()) - set(texts)
    folder.remove(name for name in folder.names(f"{TABLES}/") if name in known)
    return TablesWritten(run.path / TABLES, written, made, run)


def table_files() -> tuple[str, ...]:
    """Return every file of tables that a run folder may hold, by its name in it."""
    own = [name for track in kinds() for name in layouts_of(track) or (track,)]
    own += [f"{track}_measures" for track in kinds()]
    names = (*own, _PUBLISHED, "sensitivity", "coverage", "cost")
    return (f"{TABLES}/estimates.csv", *(f"{TABLES}/{n}.{form}" for form in _FORMS for n in names))


def table_names(run: Run) -> tuple[str, ...]:
    """Return the names of the tables that a run may have."""
    own = [name for track in run.design.suite.tracks for name in _layouts(run, track)]
    return (*own, _PUBLISHED, "sensitivity", "coverage", "cost")


def make_tables(run: Run, names: Sequence[str] | None = None) -> dict[str, Table]:
    """Make the tables of these names that the run has values for; of None, those that it writes.

    A run writes the tables of its tracks, what the way of asking changes, coverage that is not
    complete, cost, and the paper's numbers where it counts as the paper does.
    """
    from phyblock.results.paper import beside_paper, is_as_published
    from phyblock.results.sensitivity import sensitivity_frame, sensitivity_view

    made: dict[str, Table] = {}
    wanted = set(table_names(run) if names is None else names)
    for track in run.design.suite.tracks:
        for name, layout in _layouts(run, track).items():
            if name in wanted:
                table = filled(run, track, layout)
                made |= {name: table} if table.view.rows else {}
    counts_as_paper = names is not None or is_as_published(run)
    if _PUBLISHED in wanted and counts_as_paper and (beside := beside_paper(run, 1)) is not None:
        made[_PUBLISHED] = beside
    if "sensitivity" in wanted and len(moved := sensitivity_frame(run)):
        made["sensitivity"] = Table(moved, sensitivity_view(moved, run))
    coverage = coverage_frame(run)
    if "coverage" in wanted and not (names is None and is_complete(coverage) and not run.is_cut):
        made["coverage"] = Table(coverage, coverage_view(coverage, run))
    if "cost" in wanted:
        cost = cost_frame(run)
        made["cost"] = Table(cost, cost_view(cost, run))
    return made


@dataclass(frozen=True)
class Summary:
    """The text that the terminal shows at the end of a run.

    Headline tables, the coverage where it is not complete, one sentence a track on the strongest
    blind baseline, and failed calls by model and message, the most frequent first.
    """

    tables: tuple[TextTable, ...] = ()
    blind: tuple[str, ...] = ()
    failures: tuple[tuple[str, str, int], ...] = ()


def summary_of(run: Run) -> Summary:
    """Sum up a run."""
    coverage = coverage_frame(run)
    tracks = run.design.suite.tracks
    tables = [headline_table(run, track, coverage) for track in tracks]
    lacking = coverage[coverage["ok"] < coverage["recorded"]]
    if len(lacking):
        view = coverage_view(lacking, run)
        none = [
            c.name for n, c in enumerate(view.columns) if {row[n] for row in view.rows} == {"0"}
        ]
        tables.append(view.without(none))
    blind = [sentence for track in tracks if (sentence := blind_sentence(run, track))]
    failed = run.records.dropna(subset=["error_message"])
    messages = Counter(zip(failed["model"], failed["error_message"], strict=True))
    failures = ((model, message, n) for (model, message), n in messages.most_common())
    return Summary(tuple(tables), tuple(blind), tuple(failures))


def headline_table(run: Run, track: str, coverage: pd.DataFrame) -> TextTable:
    """Show models by the main column of a track, the best first.

    Baselines have no rank, nor have models with samples that were not asked.
    """
    main, better = main_column(run, track), main_measure(run, track).better
    others = [one for one in headline_columns(run, track) if one != main]
    # Where the main measure stands in several cells, as by level, these tell most.
    by_cell = [one for one in others if one.measure == main.measure and one.cell != main.cell]
    columns = [main, *(by_cell or others)]
    values = headline_of(run, track)
    units = {one.name: one.unit for one in track_measures(track)}
    unit = " (%)" if {units[column.measure] for column in columns} == {"%"} else ""

    def place(model: str) -> tuple[bool, float]:
        found = values.get((model, main.heading))
        value = math.nan if found is None else found.value
        return math.isnan(value), -value if better == "higher" else value

    mine = coverage[coverage["track"] == track].set_index("model")
    missing, recorded, expected = (
        mine[name].astype("int64").to_dict() for name in ("not_run", "recorded", "expected")
    )
    baselines = {one.name for one in run.manifest.models if one.is_baseline}
    rows, rank = [], 0
    for model in sorted(run.design.model_names, key=place):
        is_ranked = model not in baselines and not missing[model] and not place(model)[0]
        rank += is_ranked
        cells = [str(rank) if is_ranked else "", model]
        for column in columns:
            value = values.get((model, column.heading))
            cells.append(number(math.nan if value is None else value.value))
            if column is main:
                ends = (math.nan, math.nan) if value is None else (value.lo, value.hi)
                cells.append(between(*ends))
        if any(missing.values()):
            cells.append(f"{recorded[model]:,}/{expected[model]:,}")
        rows.append(tuple(cells))
    names = [Column("#", is_text=True), Column("Model", is_text=True)]
    names += [
        Column(main.heading),
        Column("95 % CI"),
        *(Column(one.heading) for one in columns[1:]),
    ]
    names += [Column("Samples")] if any(missing.values()) else []
    kind = kind_of(track)
    words = (*kind.report().showing(run), *run.varied_words)
    caption = captioned(f"{kind.title}{run.design.of_suite}{unit}", words)
    return TextTable(caption, tuple(names), tuple(rows))


def blind_sentence(run: Run, track: str) -> str:
    """Say how many models are above the strongest blind baseline; "" where there is none."""
    main, measure = main_column(run, track), main_measure(run, track)
    floor = headline_floors(run, track).get(main.heading)
    if floor is None:
        return ""
    named = f"{floor.name} ({number(floor.value)})"
    baselines = {one.name for one in run.manifest.models if one.is_baseline}
    above = [
        bool(floor.is_below(value, measure.better))
        for (model, heading), value in headline_of(run, track).items()
        if heading == main.heading and model not in baselines and not math.isnan(value.value)
    ]
    verb = "is" if len(above) == 1 else "are"
    text = f"{sum(above)} of {counted(len(above), 'model')} {verb} above {named}"
    if not above:
        text = f"The strongest baseline that never sees the goal is {named}"
    title = f"{kind_of(track).title}: " if len(run.design.suite.tracks) > 1 else ""
    return f"{title}{text}."
