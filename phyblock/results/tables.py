"""Tables of a run: layouts filled from its estimates, beside the paper's numbers, coverage, cost.

Also the samples as rows for other tools, and the files of all.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from importlib.resources import files
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from phyblock.files import OutFolder
from phyblock.records.files import RecordLines, read_prompts, record_types
from phyblock.records.record import PictureMark, PromptMessage, Record
from phyblock.registry import added_measures
from phyblock.results.compare import rank_ranges_of, rank_text, sensitivity_table, sides_of
from phyblock.results.estimates import Headline, Value, shown_values, track_estimates, track_notes
from phyblock.results.load import TOKENS, Run, load_run, track_measures
from phyblock.results.text import NO_VALUE, TABLES, Column, TextTable, captioned, number, to_csv
from phyblock.text import counted
from phyblock.tracks.base import kind_of, kinds
from phyblock.tracks.measures import OVERALL, Cell, Layout, LayoutColumn, Measure
from phyblock.types import OUTCOMES

_FURTHER = ("published", "sensitivity", "coverage", "cost")
"""Tables that are not layouts of tracks."""
_NONE = Value(math.nan, math.nan, math.nan)


def _layouts(run: Run, track: str) -> Mapping[str, Layout]:
    """Return the layouts of a track, by default its headline under the track's name."""
    kind, added = kind_of(track), added_measures(track)
    columns = [
        LayoutColumn({one.measure: one.heading}, cell=one.cell, criterion=one.criterion,
                     show="both", key="{cell}_{measure}")
        for one in Headline(run, track).columns
    ]  # fmt: skip
    own = kind.report().tables or {track: Layout(kind.title, columns)}
    if not added:
        return own
    notes = [f"{m.heading}: {m.meaning}; over {m.over}; {m.better} is better." for m in added]
    shown = LayoutColumn([measure.name for measure in added], show="both")
    further = Layout(f"Further measures of {kind.title.lower()}", [shown], notes=notes)
    return {**own, f"{track}_measures": further}


def filled(run: Run, track: str, layout: Layout) -> TextTable:
    """Fill a layout with the estimates of a track in the headline setting and matcher."""
    measures, cells = {one.name: one for one in track_measures(track)}, run.cells(track)
    known = shown_values(run, track)
    there = {(measure, cell) for _, measure, cell, _ in known}
    shown = list(_shown(layout, measures, cells, there))
    # The subject of a row besides its model: a measure, a cell, or nothing.
    parts = {"": ""}
    if layout.rows == "cell":
        asked = {measure for _, _, (measure, _, _) in shown}
        with_values = {cell for measure, cell in there if measure in asked}
        parts = {cell.name: cell.heading for cell in cells if cell.name in with_values}
    elif layout.rows != "model":
        parts = {name: measures[name].heading for name in layout.rows}
    rows = []
    for model, part in product(run.design.model_names, parts):
        row: dict[str, Any] = {"model": model, **({"part": part} if part else {})}
        for _, ends, (measure, cell, criterion) in shown:
            value = known.get((model, measure or part, cell or part, criterion), _NONE)
            row |= {name: getattr(value, end) for name, end in ends.items()}
        rows.append(row)
    fields = [Column.text("model", "Model", once=True)]
    if layout.rows != "model":
        fields.append(Column("", "", True, lambda row: parts[row["part"]]))
    fields += [column for column, _, _ in shown]
    caption = captioned(f"{layout.caption}{run.design.of_suite}", run.presentation(track))
    notes = (*track_notes(run, track), *layout.notes, *_sample_notes(run, track))
    frame = pd.DataFrame(rows, columns=None if rows else ["model"])
    return TextTable.of(frame, caption, fields, notes)


def _shown(
    layout: Layout,
    measures: Mapping[str, Measure],
    cells: Sequence[Cell],
    there: set[tuple[str, str]],
) -> Iterator[tuple[Column, dict[str, str], tuple[str, str, str]]]:
    """Yield the columns of a layout that have an estimate.

    Each is with its columns in the frame, as the parts of a value that they hold, and with its
    measure and cell ("" for those of the row) and criterion.
    """
    of_rows = [] if isinstance(layout.rows, str) else list(layout.rows)
    for spec, cell in [(one, at) for one in layout.columns for at in one.places(cells)]:
        asked = list(spec.headings) or of_rows
        if spec.cells == "each" and not any((name, cell.name) in there for name in asked):
            continue
        for name, heading in (spec.headings or {"": ""}).items():
            level = f"level{cell.name}" if cell.name.isdigit() else cell.name
            about = {"cell": cell.heading, "group": cell.group, "measure": name}
            about |= {"level": level, "criterion": spec.criterion}
            measure, group = measures[name or of_rows[0]], spec.group.format(**about)
            unit = measure.unit or "Value"
            heading = (heading or (measure.heading if name else "")).format(**about)
            if spec.show == "both" and not group:
                heading, group = unit, heading
            key = spec.key.format(**about)
            at = (name, "" if layout.rows == "cell" else cell.name, spec.criterion)
            if spec.show != "interval":
                shown = Column.value(key, heading or unit, group, spec.digits)
                yield shown, {key: "value"}, at
            if spec.show != "value":
                lo, hi = f"{key}_lo", f"{key}_hi"
                yield Column.interval(group, lo, hi), {lo: "lo", hi: "hi"}, at


def _sample_notes(run: Run, track: str) -> Iterator[str]:
    """Yield sentences on the samples behind values, if they are not as many as planned."""
    design, table = run.design, coverage_frame(run)
    table = table[table["track"] == track]
    if len(design.suite.seeds) > 1:
        yield f"Values pool the samples of {len(design.suite.seeds)} seeds."
    short = table[table["not_run"] > 0]
    if listed := ", ".join(f"{row.model} {row.recorded}" for row in short.itertuples()):
        yield f"Not complete, of {design.samples(track)} samples: {listed}."
    lacking = {"api_error": "API errors", "missing": "missing replies"}
    listed = ", ".join(
        f"{row['model']} {' and '.join(said)}"
        for row in table.to_dict("records")
        if (said := [f"{row[name]} {noun}" for name, noun in lacking.items() if row[name]])
    )
    if listed:
        how = "left out" if design.outcomes_left_out else "counted as wrong"
        yield f"Without a reply, {how}: {listed}."
    rows = run.records[run.records["track"] == track]
    refused = rows.loc[~rows["seed_sent"].fillna(True).astype(bool), "model"].unique()
    if len(refused):
        yield f"{', '.join(refused)}: seed unsupported, seeds are independent repeats."


_ROW = ["model", "track"]
_COVERAGE = [*_ROW, "expected", "recorded", "not_run", *OUTCOMES]
_COST = [
    *(*_ROW, "replies", *TOKENS, "tokens_unknown", "cost_usd", "cost_unknown", "cost_per_100_usd"),
    *("latency_median_s", "latency_p90_s", "cached", "attempts"),
]


def coverage_frame(run: Run) -> pd.DataFrame:
    """Return one row per model and track: its samples, tokens, cost and latency.

    `expected` samples are `recorded` + `not_run`; the outcomes split `recorded`. The rest is about
    the `replies` (samples that hold one; in step planning, whole episodes): mean tokens of those
    with known counts, and `tokens_unknown`, the number of others; `cost_usd`, the sum of known
    costs of this run, and `cost_unknown`, the number of others; `cached` ones, paid for by another
    run and free here; `cost_per_100_usd`, the cost of 100 at the price of those with a known one,
    including cached ones; median and 90th percentile of the latency [s] of those that were sent;
    `attempts`, the number of requests. NaN if nothing is known. Do not change the cached frame.
    """
    if "coverage" in run.made:
        return run.made["coverage"]
    records, design = run.records, run.design
    replied, cached = records["finish"].notna(), records["cached"].fillna(False).astype(bool)
    attempts = records["attempts"].fillna(0).astype("int64")
    paid, sent = replied & ~cached, attempts > 0
    marks: dict[str, pd.Series] = {
        "recorded": records["outcome"].notna(),
        **{name: records["outcome"] == name for name in OUTCOMES},
        "replies": replied,
        "tokens_unknown": replied & records["completion_tokens"].isna(),
        "cost_unknown": paid & records["paid_usd"].isna(),
        "cached": cached,
        "attempts": attempts,
    }
    counts = pd.DataFrame(marks).astype("float64")
    by = [records["model"], records["track"]]
    costs = records[list(TOKENS)].astype("Float64").groupby(by).mean().astype("float64")
    costs["cost_usd"] = records["paid_usd"].where(paid).groupby(by).sum(min_count=1)
    costs["cost_per_100_usd"] = 100 * records["cost_usd"].where(sent | cached).groupby(by).mean()
    latencies = records["latency_s"].where(sent).groupby(by)
    costs["latency_median_s"], costs["latency_p90_s"] = latencies.median(), latencies.quantile(0.9)
    planned = [(m, t, design.samples(t)) for m in design.model_names for t in design.suite.tracks]
    table = pd.DataFrame(planned, columns=[*_ROW, "expected"])
    table = table.join(counts.groupby(by).sum(), on=_ROW).join(costs, on=_ROW)
    table = table.astype(dict.fromkeys(counts, "float64")).fillna(dict.fromkeys(counts, 0.0))
    table = table.astype(dict.fromkeys(counts, "int64"))
    table.loc[(table["replies"] > 0) & (table["replies"] == table["cached"]), "cost_usd"] = 0.0
    table["not_run"] = table["expected"] - table["recorded"]
    run.made["coverage"] = table[[*_COVERAGE, *_COST[2:]]]
    return run.made["coverage"]


def coverage_table(run: Run) -> TextTable:
    """Return a table of the outcomes of every model's samples."""
    table = coverage_frame(run)
    fields = [Column.text("model", "Model"), *Column.track(run.design.suite.tracks)]
    headings = {"ok": "OK", "api_error": "API error"}
    for name in ("expected", "not_run", *OUTCOMES):
        fields.append(Column.whole(name, headings.get(name, name.replace("_", " ").capitalize())))
    notes = ["The last line of records.jsonl was cut off and is ignored."] if run.is_cut else []
    return TextTable.of(table[_COVERAGE], f"Coverage{run.design.of_suite}", fields, notes)


def cost_table(run: Run) -> TextTable:
    """Return a table of tokens, dollars and seconds of every model."""

    def dollars(key: str, heading: str) -> Column:
        def show(row: Mapping[Hashable, Any]) -> str:
            usd = row[key]
            return NO_VALUE if pd.isna(usd) else f"{usd:,.{2 if usd >= 1 or not usd else 4}f}"

        return Column(heading, "Cost (USD)", show=show)

    headings = zip(TOKENS, ("in", "out", "reasoning"), strict=True)
    fields = [
        Column.text("model", "Model"),
        *Column.track(("", *run.design.suite.tracks)),
        Column.whole("replies", "Replies"),
        *(Column.value(name, heading, "Tokens a reply", 0) for name, heading in headings),
        *(dollars("cost_usd", "this run"), dollars("cost_per_100_usd", "100 replies")),
        Column.value("latency_median_s", "median", "Latency (s)", 2),
        Column.value("latency_p90_s", "90 %", "Latency (s)", 2),
    ]
    notes = ["Replies from the cache cost this run nothing; 100 replies are priced as if asked."]
    notes += [
        f"Of {kind_of(name).title.lower()}, a reply is a whole episode: all its steps together."
        for name in run.design.suite.tracks
        if kind_of(name).plays
    ]
    title = f"Tokens, cost and latency{run.design.of_suite}"
    return TextTable.of(coverage_frame(run)[_COST], title, fields, notes)


@dataclass(frozen=True, eq=False)
class TablesWritten:
    """The `tables` of a `run` by name, and their `files`."""

    files: tuple[Path, ...]
    tables: Mapping[str, TextTable]
    run: Run = field(repr=False)


def write_tables(path: str | Path) -> TablesWritten:
    """Rebuild `tables/` of a run folder from its records; each file appears whole or not at all.

    Raises StoreError for a broken run (see `load_run`) or a folder that cannot be written and,
    before anything is written, naming every file that would be overwritten and is not phyblock's.
    """
    run = load_run(path)
    made = make_tables(run)
    texts: dict[str, str | bytes] = {f"{TABLES}/estimates.csv": to_csv(run.estimates, "%.6f")}
    for name, table in made.items():
        texts |= table.files(f"{TABLES}/{name}")
    folder = OutFolder(run.path)
    written = folder.write(texts)
    # Coverage may be complete now, and an earlier table obsolete.
    known = set(table_files()) - set(texts)
    folder.remove(name for name in folder.names(f"{TABLES}/") if name in known)
    return TablesWritten(written, made, run)


def table_files() -> tuple[str, ...]:
    """Return the names of all files of tables that a run folder may hold."""
    names = [name for track, kind in kinds().items() for name in kind.report().tables or (track,)]
    names += [*(f"{track}_measures" for track in kinds()), *_FURTHER]
    made = (f"{TABLES}/{name}.{form}" for form in ("csv", "md", "tex") for name in names)
    return (f"{TABLES}/estimates.csv", *made)


def table_names(run: Run) -> tuple[str, ...]:
    """Return the names of the tables that a run may have."""
    return (*(name for track in run.design.suite.tracks for name in _layouts(run, track)),
            *_FURTHER)  # fmt: skip


def make_tables(run: Run, names: Sequence[str] | None = None) -> dict[str, TextTable]:
    """Return the tables of these names that the run has values for; by default those it writes.

    A run writes the tables of its tracks, the effect of varied presentation, coverage if it is not
    complete, cost, and the paper's numbers if it is scored as in the paper.
    """
    wanted, made = set(table_names(run) if names is None else names), dict[str, TextTable | None]()
    for track in run.design.suite.tracks if run.design.models else ():
        for name, layout in _layouts(run, track).items():
            if name in wanted:
                made[name] = filled(run, track, layout)
    scoring, is_a = run.design.suite.scoring, "A" in run.design.suite.settings
    is_level1_alike = 1 not in run.design.suite.levels or scoring.level1 == "membership"
    is_as_published = is_a and "paper" in scoring.matchers and is_level1_alike
    if "published" in wanted and (names is not None or is_as_published):
        made["published"] = beside_paper(run)
    if "sensitivity" in wanted:
        made["sensitivity"] = sensitivity_table(run)
    coverage = coverage_frame(run)
    is_complete = bool((coverage["ok"] == coverage["expected"]).all()) and not run.is_cut
    if "coverage" in wanted and not (names is None and is_complete):
        made["coverage"] = coverage_table(run)
    if "cost" in wanted:
        made["cost"] = cost_table(run)
    return {name: table for name, table in made.items() if table is not None}


def summary_of(run: Run) -> tuple[list[TextTable], list[str], list[tuple[str, str, int]]]:
    """Return the text that the terminal shows at the end of a run.

    Headline tables, and the coverage if it is not complete; one sentence per track on the strongest
    blind baseline; failed calls by model and message, most frequent first.
    """
    coverage, tracks = coverage_frame(run), run.design.suite.tracks
    tables = [headline_table(run, track, coverage) for track in tracks]
    if (coverage["ok"] < coverage["recorded"]).any():
        tables.append(coverage_table(run))
    blind = [sentence for track in tracks if (sentence := blind_sentence(run, track))]
    failed = run.records.dropna(subset=["error_message"])
    messages = Counter(zip(failed["model"], failed["error_message"], strict=True))
    failures = [(model, message, n) for (model, message), n in messages.most_common()]
    return tables, blind, failures


def headline_table(run: Run, track: str, coverage: pd.DataFrame) -> TextTable:
    """Return a table of models by the main column of a track, best first, and its other columns:
    only those of the same measure if it is in several cells, such as levels.

    A rank is a range, as in `compare` and on the page. Baselines and incomplete models have none.
    """
    kind, headline = kind_of(track), Headline(run, track)
    others = headline.parts or [one for one in headline.columns if one != headline.main]
    columns, known = [headline.main, *others], headline.values
    units = {one.name: one.unit for one in track_measures(track)}
    unit = " (%)" if {units[column.measure] for column in columns} == {"%"} else ""
    mine = coverage[coverage["track"] == track].set_index("model").to_dict("index")
    ranks = rank_ranges_of(sides_of(run), track)
    rows = []
    for model in dict.fromkeys((*headline.ranked, *run.design.model_names)):
        found = [known.get((model, column.heading), _NONE) for column in columns]
        rank = rank_text(*ranks[model]) if model in ranks else ""
        row: dict[str, Any] = {"rank": rank, "model": model}
        row |= {column.heading: value.value for column, value in zip(columns, found, strict=True)}
        samples = f"{mine[model]['recorded']:,}/{mine[model]['expected']:,}"
        rows.append({**row, "lo": found[0].lo, "hi": found[0].hi, "samples": samples})
    fields = [Column.text("rank", "#"), Column.text("model", "Model")]
    fields += [Column.value(column.heading, column.heading) for column in columns]
    fields.insert(3, Column.interval())
    if any(row["not_run"] for row in mine.values()):
        fields.append(Column("Samples", show=lambda row: str(row["samples"])))
    caption = captioned(f"{kind.title}{run.design.of_suite}{unit}", run.presentation(track))
    return TextTable.of(pd.DataFrame(rows), caption, fields)


def blind_sentence(run: Run, track: str) -> str:
    """Return a sentence on how many models are above the strongest blind baseline, or ""."""
    headline = Headline(run, track)
    if (floor := headline.floor) is None:
        return ""
    named, better = f"{floor.name} ({number(floor.value)})", headline.measure.better
    models = [v for name, v in headline.ranked.items() if name not in run.design.baselines]
    above = sum(floor.is_below(value, better) for value in models)
    verb = "is" if len(models) == 1 else "are"
    said = f"{above} of {counted(len(models), 'model')} {verb} shown to be above {named}"
    if not models:
        said = f"The strongest baseline here that never sees the goal is {named}"
    title = f"{kind_of(track).title}: " if len(run.design.suite.tracks) > 1 else ""
    return f"{title}{said}."


_METRICS = {"precision": "Prec", "recall": "Rec", "f1": "F1"}
_COLUMNS = ["model", "published_name", "cell", "metric", "published", "ours", "difference", "n"]


def published_table(table: int) -> pd.DataFrame:
    """Return a results table of the paper (1, 2, 3 or 5), with one printed value [%] per row.

    `published/README.md` explains the columns and the sources of the numbers.
    """
    with (files("phyblock.results") / "published" / f"table{table}.csv").open("rb") as file:
        return pd.read_csv(file, dtype={"level": "object"})


def published_frame(run: Run) -> pd.DataFrame:
    """Return one row for each value of Table 1 of a model of the run, with ours [%].

    Columns are model, published_name, cell, metric, published, ours, difference (ours minus
    published) and n, the samples behind ours. Ours is not rounded, and NaN if the run does not
    measure it. It is in setting A, by the `paper` matcher if the run has it.
    """
    design, suite, estimates = run.design, run.design.suite, track_estimates(run, "full_planning")
    matcher = "paper" if "paper" in suite.scoring.matchers else design.matcher
    ours = estimates[(estimates["setting"] == "A") & estimates["matcher"].isin(["", matcher])]
    # The paper's overall numbers pool the scenes of these levels.
    if not {2, 3, 4} <= set(suite.levels):
        ours = ours[ours["cell"] != OVERALL]
    ours = ours[["model", "cell", "n", "measure", "value"]]
    ours = ours.rename(columns={"measure": "metric", "value": "ours"})
    renamed = {"model": "published_name", "value": "published", "level": "cell"}
    printed = published_table(1).rename(columns=renamed)
    known = [(model.name, model.published) for model in design.models if model.published]
    names = pd.DataFrame(known, columns=["model", "published_name"], dtype="object")
    found = names.merge(printed, on="published_name")
    found = found.merge(ours, on=["model", "cell", "metric"], how="left")
    found["ours"] = 100 * found["ours"].astype("float64")
    found["difference"] = found["ours"] - found["published"]
    found["n"] = found["n"].astype("float64").fillna(0).astype("int64")
    return found[_COLUMNS]


def beside_paper(run: Run) -> TextTable | None:
    """Return numbers beside the paper's Table 1; None without its models or official scenes."""
    suite = run.design.suite
    if "full_planning" not in suite.tracks or suite.dataset.format != "official":
        return None
    frame = published_frame(run)
    if frame.empty:
        return None
    rows: dict[tuple[str, str], dict[str, object]] = {}
    for row in frame.to_dict("records"):
        model, metric, name, cell = row["model"], row["metric"], row["published_name"], row["cell"]
        about = {"model": model if name == model else f"{model} ({name})"}
        shown = rows.setdefault((model, metric), {**about, "metric": _METRICS[metric]})
        shown |= {f"{cell} {part}": row[part] for part in ("published", "ours", "difference")}
    headings = {cell.name: cell.heading for cell in run.cells("full_planning")}
    columns = [Column.text("model", "Model", once=True), Column.text("metric", "")]
    for cell in dict.fromkeys(frame["cell"]):
        group = headings.get(cell, cell)
        columns += [
            Column.value(f"{cell} published", "Paper", group),
            Column.value(f"{cell} ours", "Ours", group, 2),
            Column.value(f"{cell} difference", "Diff", group, 2, signed=True),
        ]
    compared = frame["difference"].dropna()
    notes = ["Ours: setting A, micro averages. Published: micro averages of one run."]
    if len(compared):
        largest = number(compared.abs().max(), 3)
        notes.insert(0, f"Largest absolute difference of {len(compared)} cells: {largest}.")
    caption = f"Our numbers beside the paper's Table 1{run.design.of_suite} (%)"
    made = TextTable.of(pd.DataFrame([*rows.values()]), caption, columns, notes)
    return replace(made, frame=frame)


_SAME = (
    *("sample", "track", "model", "scene", "seed", "levels", "parents", "n_blocks", "outcome"),
    *("finish", "rule", "cost_usd", "latency_s", "attempts", *TOKENS, "cached"),
)
"""Columns that frames of records also have, with types that know of missing values."""
_TEXTS = ("prompt", "reply", "reasoning", "provider_model", "error", "asked")


def export_frame(run: Run) -> pd.DataFrame:
    """Return one row per sample: prompt, model, reply, parsed answer and counts.

    Counts are `tp_<setting>`, `fp_<setting>`, `fn_<setting>` of the headline matcher, all levels by
    the `aov` criterion (for episodes over placed blocks). Columns have the same types for any rows;
    values that a track does not have are missing. `levels`, `parents` and `plan` are lists.
    """
    types = {**dict.fromkeys(_TEXTS, "string"), "plan": "object"}
    for record in record_types():
        types |= {column: kind for column, (kind, _) in record.exported.items()}
    for setting in run.design.suite.settings:
        types |= {f"{name}_{setting.lower()}": "Int64" for name in ("tp", "fp", "fn")}
    frame = run.records[list(_SAME)]
    lists = frame[["levels", "parents"]].map(list)
    nullable = {"object": "string", "float64": "Float64"}
    frame = frame.astype({n: nullable.get(str(kind), kind) for n, kind in frame.dtypes.items()})
    frame[["levels", "parents"]] = lists
    if run.design.suite.vary.factors:
        frame.insert(5, "variant", run.records["variant"].astype("string"))
    prompts = read_prompts(run.path)
    rows = [_row(run, one, prompts) for one in RecordLines(run.path).at(run.records["start"])]
    return frame.join(pd.DataFrame(rows, frame.index, list(types)).astype(types))


def _row(
    run: Run, record: Record, prompts: Mapping[str, Sequence[PromptMessage]]
) -> dict[str, Any]:
    """Return the values of a record that a frame of records does not have."""
    reply, plan = record.reply, getattr(record.parse, "plan", None)
    messages = None if record.prompt is None else prompts.get(record.prompt.messages)
    parts = [part for message in messages or () for part in message.parts]
    found: dict[str, Any] = {
        # As it was sent, pictures by their labels; None if none was stored.
        "prompt": None if messages is None else "\n".join(
            f"[picture: {part.image}]" if isinstance(part, PictureMark) else part for part in parts
        ),
        "reply": reply and reply.text,
        "reasoning": reply and reply.reasoning,
        "provider_model": reply and reply.provider_model,
        "error": record.error and record.error.message,
        "asked": record.asked,
        "plan": None if plan is None else list(plan),
        **record.export_row(),
    }  # fmt: skip
    for score in record.scores:
        is_headline = score.matcher in (None, "", run.design.matcher)
        if is_headline and score.criterion in ("aov", "placed"):
            counts = {"tp": score.tp, "fp": score.fp, "fn": score.fn}
            found |= {f"{name}_{score.setting.lower()}": n for name, n in counts.items()}
    return found


def write_csv(run: Run, folder: Path) -> tuple[Path, ...]:
    """Write the rows of a run as `records.csv`, lists as JSON; return its path.

    Raises StoreError if it cannot be written, or would replace a file that is not phyblock's.
    """
    frame = export_frame(run)
    for name in ("levels", "parents", "plan"):
        as_json = [json.dumps(v) if isinstance(v, list) else v for v in frame[name]]
        frame[name] = pd.Series(as_json, dtype="object")
    return OutFolder(folder).write({"records.csv": to_csv(frame)})
