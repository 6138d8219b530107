"""Tables of a run: layouts filled from its estimates, coverage, cost, and all of their files."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from phyblock.files import OutFolder
from phyblock.registry import added_measures
from phyblock.results.compare import sensitivity_frame, sensitivity_view
from phyblock.results.estimates import (
    HeadlineColumn,
    all_estimates,
    headline_columns,
    headline_floors,
    headline_of,
    headline_rows,
    main_column,
    main_measure,
    main_values,
    track_estimates,
    track_notes,
)
from phyblock.results.load import TOKENS, Run, load_run, track_measures
from phyblock.results.paper import beside_paper, is_as_published
from phyblock.results.text import (
    NO_VALUE,
    Column,
    Table,
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
from phyblock.tracks.measures import CELL, Layout, LayoutColumn, Measure
from phyblock.types import OUTCOMES, Outcome

TABLES = "tables"
"""The folder of tables in the folder of a run."""
_FURTHER = ("published", "sensitivity", "coverage", "cost")
"""Tables that are no layouts of tracks."""
HEADINGS: dict[Outcome, str] = {
    "ok": "OK",
    "parse_failure": "Unparsed",
    "refusal": "Refusal",
    "truncated": "Truncated",
    "api_error": "API error",
    "missing": "Missing",
}


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


def _layouts(run: Run, track: str) -> Mapping[str, Layout]:
    """Return the layouts of a track, of one that has none its headline under the track's name."""
    kind, added = kind_of(track), added_measures(track)
    columns = [
        LayoutColumn({one.measure: one.heading}, cell=one.cell, criterion=one.criterion,
                     show="both", key="{cell}_{measure}")
        for one in headline_columns(run, track)
    ]  # fmt: skip
    own = kind.report().tables or {track: Layout(kind.title, columns)}
    if not added:
        return own
    notes = [f"{m.heading}: {m.meaning}; over {m.over}; {m.better} is better." for m in added]
    shown = LayoutColumn([measure.name for measure in added], show="both")
    further = Layout(f"Further measures of {kind.title.lower()}", [shown], notes=notes)
    return {**own, f"{track}_measures": further}


def filled(run: Run, track: str, layout: Layout) -> Table:
    """Fill a layout with the estimates of a track in the headline setting and matcher."""
    measures = {measure.name: measure for measure in track_measures(track)}
    cells = {cell.name: cell for cell in run.cells(track)}
    known: dict[tuple[str, ...], Mapping[Hashable, Any]] = {}
    for row in headline_rows(track_estimates(run, track), run.design).to_dict("records"):
        key = (str(row["model"]), str(row["measure"]), str(row[CELL]))
        known[*key, str(row["criterion"])] = known[*key, ""] = row
    there = {(measure, cell) for _, measure, cell, _ in known}
    shown = list(_shown(layout, measures, cells, there))
    # What a row is of beside its model: a measure, a cell, or nothing.
    parts = [("", "", "")]
    if layout.rows == "cell":
        wanted = {column.measure for column in shown}
        with_values = {cell for measure, cell in there if measure in wanted}
        parts = [("", n, cell.heading) for n, cell in cells.items() if n in with_values]
    elif layout.rows != "model":
        parts = [(name, "", measures[name].heading) for name in layout.rows]
    numbers: list[dict[str, Any]] = []
    rows: list[tuple[str, ...]] = []
    for model in run.design.model_names:
        for place, (measure, cell, heading) in enumerate(parts):
            named: dict[str, Any] = {"model": model}
            texts = [model if place == 0 else ""]
            if heading:
                named["part"] = measure or cell
                texts.append(heading)
            for one in shown:
                at = (model, measure or one.measure, cell or one.cell, one.criterion)
                scale, found = measures[at[1]].scale, known.get(at, {})
                value, lo, hi = (scale * found.get(n, math.nan) for n in ("value", "lo", "hi"))
                if one.is_interval:
                    named |= {f"{one.key}_lo": lo, f"{one.key}_hi": hi}
                    texts.append(between(lo, hi))
                else:
                    named[one.key] = value
                    texts.append(number(value, one.digits))
            numbers.append(named)
            rows.append(tuple(texts))
    head = [Column("Model", is_text=True)]
    head += [Column("", is_text=True)] if layout.rows != "model" else []
    caption = captioned(f"{layout.caption}{run.design.of_suite}", run.presentation(track))
    notes = (*track_notes(run, track), *layout.notes, *_sample_notes(run, track))
    frame = pd.DataFrame(numbers, columns=None if numbers else ["model"])
    columns = (*head, *(one.column for one in shown))
    return Table(frame, TextTable(caption, columns, tuple(rows), notes))


def _shown(
    layout: Layout,
    measures: Mapping[str, Measure],
    cells: Mapping[str, Any],
    there: set[tuple[str, str]],
) -> Iterator[_Shown]:
    """Return the columns of a layout; of each cell, those that have an estimate."""
    of_rows = [] if isinstance(layout.rows, str) else list(layout.rows)
    for spec in layout.columns:
        headings = spec.headings
        names = list(spec.measures) or [""]
        places = [cell.name for cell in spec.places([*cells.values()])]
        if spec.cells == "each":
            asked = list(spec.measures) or of_rows
            places = [cell for cell in places if any((name, cell) in there for name in asked)]
        for place in places:
            for name in names:
                cell = cells[place]
                about = {"cell": cell.heading, "group": cell.group, "measure": name}
                about |= {"level": f"level{place}" if place.isdigit() else place}
                about |= {"criterion": spec.criterion}
                measure = measures[name or of_rows[0]]
                heading = (headings.get(name) or (measure.heading if name else "")).format(**about)
                group, unit = spec.group.format(**about), measure.unit or "Value"
                if spec.show == "both" and not group:
                    heading, group = unit, heading
                at = (spec.key.format(**about), name, "" if layout.rows == "cell" else place)
                kinds_shown = {"value": (False,), "interval": (True,), "both": (False, True)}
                for is_interval in kinds_shown[spec.show]:
                    column = Column("95 % CI" if is_interval else heading or unit, group)
                    yield _Shown(column, *at, spec.criterion, is_interval, spec.digits)


def _sample_notes(run: Run, track: str) -> Iterator[str]:
    """Say how many samples are behind values, where that is not as many as were planned."""
    design, table = run.design, coverage_frame(run)
    table = table[table["track"] == track]
    if len(design.suite.seeds) > 1:
        yield f"Values pool the samples of {len(design.suite.seeds)} seeds."
    if len(short := table[table["not_run"] > 0]):
        counts = zip(short["model"], short["recorded"], strict=True)
        listed = ", ".join(f"{model} {n}" for model, n in counts)
        yield f"Not complete, of {design.samples(track)} samples: {listed}."
    lacking = {"api_error": "API errors", "missing": "missing replies"}
    listed = ", ".join(
        f"{row['model']} {' and '.join(said)}"
        for row in table.to_dict("records")
        if (said := [f"{row[name]} {text}" for name, text in lacking.items() if row[name]])
    )
    if listed:
        how = "left out" if design.outcomes_left_out else "counted as wrong"
        yield f"Without a reply, {how}: {listed}."
    rows = run.records[run.records["track"] == track]
    refused = rows.loc[~rows["seed_sent"].fillna(True).astype(bool), "model"].unique()
    if len(refused):
        yield f"{', '.join(refused)}: seed unsupported, seeds are independent repeats."


_ROW = ["model", "track"]
_SUMS = (
    *("recorded", *OUTCOMES, "extracted", "replies"),
    *("tokens_unknown", "cost_unknown", "cached", "attempts"),
)
_COLUMNS = (
    *(*_ROW, "expected", "recorded", "not_run", *OUTCOMES, "extracted", "replies", *TOKENS),
    *("tokens_unknown", "cost_usd", "cost_unknown", "latency_s", "cached", "attempts"),
)


def coverage_frame(run: Run) -> pd.DataFrame:
    """Return one row a model and track.

    `expected` samples are `recorded` + `not_run`; the outcomes split `recorded`, and `extracted`
    are those that an extraction model read. Of the `replies` (samples that hold one): token sums of
    those that tell, with `tokens_unknown` that do not; `cost_usd` what the run paid, the sum of the
    known prices, NaN where none is, with `cost_unknown` without one; `cached` ones were paid for by
    another run and cost nothing here; `latency_s` the mean over replies for which a request was
    sent, so neither `cached` ones nor recordings; `attempts` the sum of requests sent for them.
    """
    records, design = run.records, run.design
    replied, cached = records["finish"].notna(), records["cached"].fillna(False).astype(bool)
    paid, attempts = replied & ~cached, records["attempts"].fillna(0).astype("int64")
    facts = records[[*_ROW, *TOKENS]].assign(
        recorded=1,
        **{name: records["outcome"] == name for name in OUTCOMES},
        extracted=records["rule"] == "extractor",
        replies=replied,
        tokens_unknown=replied & records["completion_tokens"].isna(),
        cost_usd=records["paid_usd"].where(paid),
        cost_unknown=paid & records["paid_usd"].isna(),
        cached=cached,
        attempts=attempts,
        latency_s=records["latency_s"].where(attempts > 0),
    )
    groups = facts.groupby(_ROW)
    planned = [(m, t, design.samples(t)) for m in design.model_names for t in design.suite.tracks]
    table = pd.DataFrame(planned, columns=[*_ROW, "expected"])
    table = table.join(groups[list(_SUMS)].sum(), on=_ROW)
    table = table.join(groups[[*TOKENS, "cost_usd"]].sum(min_count=1), on=_ROW)
    table = table.join(groups["latency_s"].mean(), on=_ROW)
    # Out of an empty frame columns of any type come, and pandas fills these with a warning.
    table[list(_SUMS)] = table[list(_SUMS)].astype("float64").fillna(0).astype("int64")
    table.loc[(table["replies"] > 0) & (table["replies"] == table["cached"]), "cost_usd"] = 0.0
    table["not_run"] = table["expected"] - table["recorded"]
    return table[list(_COLUMNS)]


def coverage_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Show outcomes out of `coverage_frame`."""
    tracks = run.design.suite.tracks
    headings: dict[str, str] = {"expected": "Expected", "not_run": "Not run"}
    headings |= {name: HEADINGS[name] for name in OUTCOMES}
    rows = tuple(
        (row["model"], *track_text(row["track"], tracks), *(f"{row[name]:,}" for name in headings))
        for row in table.to_dict("records")
    )
    columns = (
        Column("Model", is_text=True), *track_column(tracks), *map(Column, headings.values()),
    )  # fmt: skip
    read = table[table["extracted"] > 0]
    counts = zip(read["model"], read["extracted"], read["recorded"], strict=True)
    listed = ", ".join(f"{model} {count} of {recorded}" for model, count, recorded in counts)
    notes = [f"Read by extractor: {listed}."] if listed else []
    if run.is_cut:
        notes.append("The last line of records.jsonl was cut off and is ignored.")
    return TextTable(f"Coverage{run.design.of_suite}", columns, rows, tuple(notes))


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
    groups = {
        "Tokens a reply": ("in", "out", "reasoning"),
        "Cost (USD)": ("this run", "100 replies"),
        "Latency (s)": ("median", "90 %"),
    }
    columns = [Column("Model", is_text=True), Column("Track", is_text=True), Column("Replies")]
    columns += [Column(name, group) for group, names in groups.items() for name in names]
    rows = [
        (
            *(row["model"], row["track"].replace("_", " "), f"{row['replies']:,}"),
            *(number(row[name], 0) for name in TOKENS),
            *(_dollars(row[name]) for name in ("cost_usd", "cost_per_100_usd")),
            *(number(row[name], 2) for name in ("latency_median_s", "latency_p90_s")),
        )
        for row in table.to_dict("records")
    ]
    notes = ["Replies from the cache cost this run nothing; 100 replies are priced as if asked."]
    notes += [
        f"Of {kind_of(name).title.lower()}, a reply is a whole episode: all its steps together."
        for name in run.design.suite.tracks
        if kind_of(name).plays
    ]
    title = f"Tokens, cost and latency{run.design.of_suite}"
    return TextTable(title, tuple(columns), tuple(rows), tuple(notes))


def _dollars(amount: float) -> str:
    return NO_VALUE if pd.isna(amount) else f"{amount:,.{2 if amount >= 1 or not amount else 4}f}"


@dataclass(frozen=True, eq=False)
class TablesWritten:
    """The `files` of `tables`, by name, of a `run`, in a `folder`."""

    folder: Path
    files: tuple[Path, ...]
    tables: Mapping[str, Table]
    run: Run = field(repr=False)


def write_tables(path: str | Path) -> TablesWritten:
    """Rebuild `tables/` of a run folder from its records; each file appears whole or not at all.

    Raises StoreError for a broken run (see `load_run`) or a folder that cannot be written, and,
    before anything is, naming every file in the way that we never wrote.
    """
    run = load_run(path)
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
    names = [name for track in kinds() for name in kinds()[track].report().tables or (track,)]
    names += [*(f"{track}_measures" for track in kinds()), *_FURTHER]
    made = (f"{TABLES}/{name}.{form}" for form in ("csv", "md", "tex") for name in names)
    return (f"{TABLES}/estimates.csv", *made)


def table_names(run: Run) -> tuple[str, ...]:
    """Return the names of the tables that a run may have."""
    return (*(name for track in run.design.suite.tracks for name in _layouts(run, track)),
            *_FURTHER)  # fmt: skip


def make_tables(run: Run, names: Sequence[str] | None = None) -> dict[str, Table]:
    """Make the tables of these names that the run has values for; of None, those that it writes.

    A run writes the tables of its tracks, what the way of asking changes, coverage that is not
    complete, cost, and the paper's numbers where it counts as the paper does.
    """
    made: dict[str, Table] = {}
    wanted = set(table_names(run) if names is None else names)
    for track in run.design.suite.tracks:
        for name, layout in _layouts(run, track).items():
            if name in wanted:
                made |= {name: filled(run, track, layout)} if run.design.models else {}
    if "published" in wanted and (names is not None or is_as_published(run)):
        beside = beside_paper(run, 1)
        made |= {} if beside is None else {"published": beside}
    if "sensitivity" in wanted and len(moved := sensitivity_frame(run)):
        made["sensitivity"] = Table(moved, sensitivity_view(moved, run))
    coverage = coverage_frame(run)
    is_complete = bool((coverage["ok"] == coverage["expected"]).all()) and not run.is_cut
    if "coverage" in wanted and not (names is None and is_complete):
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
    coverage, tracks = coverage_frame(run), run.design.suite.tracks
    tables = [headline_table(run, track, coverage) for track in tracks]
    lacking = coverage[coverage["ok"] < coverage["recorded"]]
    if len(lacking):
        view = coverage_view(lacking, run)
        cells = [{row[n] for row in view.rows} for n in range(len(view.columns))]
        none = [c.name for c, of in zip(view.columns, cells, strict=True) if of == {"0"}]
        tables.append(view.without(none))
    blind = [sentence for track in tracks if (sentence := blind_sentence(run, track))]
    failed = run.records.dropna(subset=["error_message"])
    messages = Counter(zip(failed["model"], failed["error_message"], strict=True))
    failures = ((model, message, n) for (model, message), n in messages.most_common())
    return Summary(tuple(tables), tuple(blind), tuple(failures))


def shown_columns(run: Run, track: str) -> tuple[HeadlineColumn, ...]:
    """Return the main column of a track's headline and those beside it, which tell most: where its
    measure stands in several cells, as by level, these alone.
    """
    main = main_column(run, track)
    others = [one for one in headline_columns(run, track) if one != main]
    by_cell = [one for one in others if one.measure == main.measure and one.cell != main.cell]
    return (main, *(by_cell or others))


def headline_table(run: Run, track: str, coverage: pd.DataFrame) -> TextTable:
    """Show models by the main column of a track, the best first.

    Baselines have no rank, nor have models with samples that were not asked.
    """
    kind, columns = kind_of(track), shown_columns(run, track)
    main = columns[0]
    units = {one.name: one.unit for one in track_measures(track)}
    unit = " (%)" if {units[column.measure] for column in columns} == {"%"} else ""
    values, ranked = headline_of(run, track), main_values(run, track, ranked=True)
    mine = coverage[coverage["track"] == track].set_index("model").to_dict("index")
    is_short = any(row["not_run"] for row in mine.values())
    rows, rank = [], 0
    for model in dict.fromkeys((*ranked, *run.design.model_names)):
        has_rank = model in ranked and model not in run.design.baselines
        has_rank = has_rank and not mine[model]["not_run"]
        rank += has_rank
        found = [values.get((model, column.heading)) for column in columns]
        cells = [number(math.nan if value is None else value.value) for value in found]
        cells.insert(1, NO_VALUE if found[0] is None else between(found[0].lo, found[0].hi))
        if is_short:
            cells.append(f"{mine[model]['recorded']:,}/{mine[model]['expected']:,}")
        rows.append((str(rank) if has_rank else "", model, *cells))
    names = ["95 % CI", *(one.heading for one in columns[1:])] + ["Samples"] * is_short
    head = (Column("#", is_text=True), Column("Model", is_text=True), Column(main.heading))
    caption = captioned(f"{kind.title}{run.design.of_suite}{unit}", run.presentation(track))
    return TextTable(caption, (*head, *map(Column, names)), tuple(rows))


def blind_sentence(run: Run, track: str) -> str:
    """Say how many models are above the strongest blind baseline; "" where there is none."""
    floor = headline_floors(run, track).get(main_column(run, track).heading)
    if floor is None:
        return ""
    named, better = f"{floor.name} ({number(floor.value)})", main_measure(run, track).better
    above = [
        floor.is_below(value, better)
        for model, value in main_values(run, track).items()
        if model not in run.design.baselines
    ]
    verb = "is" if len(above) == 1 else "are"
    text = f"{sum(above)} of {counted(len(above), 'model')} {verb} above {named}"
    if not above:
        text = f"The strongest baseline that never sees the goal is {named}"
    title = f"{kind_of(track).title}: " if len(run.design.suite.tracks) > 1 else ""
    return f"{title}{text}."
