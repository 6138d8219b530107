"""What the terminal shows at the end of a run, as data that can be kept and shown again."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from phyblock.tables.text_table import Column, TextTable, between, number
from phyblock.text import counted

if TYPE_CHECKING:
    import pandas as pd

    from phyblock.report.write import TablesWritten
    from phyblock.tables.load import Run


@dataclass(frozen=True)
class Summary:
    """Headline tables, the coverage where it is not complete, one sentence a track on the strongest
    blind baseline, and failed calls by model and message, the most frequent first.
    """

    tables: tuple[TextTable, ...] = ()
    blind: tuple[str, ...] = ()
    failures: tuple[tuple[str, str, int], ...] = ()


def summary_of(written: TablesWritten) -> Summary:
    """Sum up the tables that were written."""
    run, coverage = written.run, written.frames["coverage"]
    tables = [_headline(run, track, coverage) for track in run.design.suite.tracks]
    if (coverage["ok"] < coverage["recorded"]).any():
        tables.append(_coverage(run, coverage))
    blind = _blind_sentences(run, written.frames["floors"]) if "floors" in written.frames else ()
    failed = run.records.dropna(subset=["error_message"])
    messages = Counter(zip(failed["model"], failed["error_message"], strict=True))
    failures = ((model, message, n) for (model, message), n in messages.most_common())
    return Summary(tuple(tables), tuple(blind), tuple(failures))


def _headline(run: Run, track: str, coverage: pd.DataFrame) -> TextTable:
    """Models by the main column of a track, the best first; baselines have no rank, nor have models
    with samples that were not asked.
    """
    from phyblock.report.measure_table import headline_of
    from phyblock.tables.showing import marked, varied_words
    from phyblock.tracks.estimates import (
        headline_columns,
        main_column,
        main_measure,
        track_measures,
    )
    from phyblock.tracks.kind import kind_of

    main, better = main_column(run, track), main_measure(run, track).better
    others = [one for one in headline_columns(run, track) if one != main]
    # Where the main measure stands in several cells, as by level, these tell most.
    by_cell = [one for one in others if one.measure == main.measure and one.cell != main.cell]
    columns = [main, *(by_cell or others)]
    values = headline_of(run, track)
    units = {one.name: one.unit for one in track_measures(track)}
    unit = " (%)" if {units[column.measure] for column in columns} == {"%"} else ""

    def standing(model: str) -> tuple[bool, float]:
        found = values.get((model, main.heading))
        value = math.nan if found is None else found.value
        return math.isnan(value), -value if better == "higher" else value

    mine = coverage[coverage["track"] == track].set_index("model")
    missing, recorded, expected = (
        mine[name].astype("int64").to_dict() for name in ("not_run", "recorded", "expected")
    )
    baselines = {one.name for one in run.manifest.models if one.kind == "baseline"}
    rows, rank = [], 0
    for model in sorted(run.design.model_names, key=standing):
        is_ranked = model not in baselines and not missing[model] and not standing(model)[0]
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
    words = (*kind.report().showing(run), *varied_words(run))
    return marked(
        TextTable(f"{kind.title}{run.design.of_suite}{unit}", tuple(names), tuple(rows)), words
    )


def _coverage(run: Run, coverage: pd.DataFrame) -> TextTable:
    """Return the outcomes of samples, of the models that have any but plain answers."""
    from phyblock.tables.outcomes import HEADINGS, NOT_RUN, OUTCOMES
    from phyblock.tables.text_table import track_column, track_text

    lacking = coverage[coverage["ok"] < coverage["recorded"]]
    headings = {"expected": "Expected", "not_run": NOT_RUN} | {n: HEADINGS[n] for n in OUTCOMES}
    shown = {name: text for name, text in headings.items() if lacking[name].any()}
    tracks = run.design.suite.tracks
    rows = tuple(
        (row["model"], *track_text(row["track"], tracks), *(f"{row[name]:,}" for name in shown))
        for row in lacking.to_dict("records")
    )
    columns = (Column("Model", is_text=True), *track_column(tracks), *map(Column, shown.values()))
    return TextTable("Coverage", columns, rows)


def _blind_sentences(run: Run, floors: pd.DataFrame) -> list[str]:
    """How many models are above the strongest baseline that never sees the goal, by track."""
    from phyblock.tables.headline import headline_rows, rows_of
    from phyblock.tracks.estimates import main_column, main_measure
    from phyblock.tracks.kind import kind_of

    baselines = {one.name for one in run.manifest.models if one.kind == "baseline"}
    sentences = []
    for track in run.design.suite.tracks:
        main, measure = main_column(run, track), main_measure(run, track)
        rows = rows_of(headline_rows(floors[floors["track"] == track], run.design), main)
        if not len(rows):
            continue
        floor = f"{rows.iloc[0]['floor']} ({number(measure.scale * rows.iloc[0]['floor_value'])})"
        asked = rows[~rows["model"].isin(baselines)]
        above = int((asked["verdict"] == "above").sum())
        verb = "is" if len(asked) == 1 else "are"
        text = f"{above} of {counted(len(asked), 'model')} {verb} above {floor}"
        if not len(asked):
            text = f"the strongest baseline that never sees the goal is {floor}"
        title = f"{kind_of(track).title}: " if len(run.design.suite.tracks) > 1 else ""
        sentence = f"{title}{text}."
        sentences.append(sentence[0].upper() + sentence[1:])
    return sentences
