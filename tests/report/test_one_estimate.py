"""One estimator: whatever shows a number of a measure shows that of `estimates.csv`."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import matplotlib.figure
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phyblock.domain import SUBTASKS
from phyblock.report import Run, TextTable
from phyblock.report.compare import compare_models
from phyblock.report.figures.dots import measure_dots
from phyblock.report.floors import floors_frame
from phyblock.report.html.headline import headlines
from phyblock.report.measure_table import headline_columns, main_heading, measures_frame
from phyblock.report.notebook import LoadedRun
from phyblock.report.write import table_makers
from phyblock.tables.design import OVERALL
from phyblock.tables.text_table import NO_VALUE, level_name, number
from phyblock.tables.track_report import TableMaker
from phyblock.tracks.estimates import all_estimates
from phyblock.tracks.full_planning_results import (
    assembly_frame,
    f1_radar,
    settings_dots,
    settings_frame,
)
from phyblock.tracks.step_planning_results import step_intervals, step_scores_frame
from phyblock.tracks.vqa_results import accuracy_by_subtask, questions_frame, vqa_intervals
from tests.report.factory import LEVELS, laws, manifest, record, record_lists, run_of, score

METRICS = {"Prec": "precision", "Rec": "recall", "F1": "f1"}
CRITERIA = {"1": "selection"}
WAYS = (("A", "optimal", "aov"), ("A", "", "selection"), ("", "", ""))
"""Headline ways, but those of episodes, which are named where they are meant."""
Key = tuple[str, ...]
Shown = tuple[str, Key, float | str]
"""Where a number is shown, what it is (as `Estimates` finds it), and what is shown [%]."""


class Estimates:
    """Rows of `estimates.csv` by model, measure and cell, in the headline way unless named."""

    def __init__(self, run: Run) -> None:
        frame = all_estimates(run)
        keys = ["model", "measure", "cell", "setting", "matcher", "criterion"]
        self.rows = frame.set_index(keys)[["value", "lo", "hi", "mean", "sd"]].to_dict("index")
        assert len(self.rows) == len(frame)

    def of(self, key: Key, end: str = "value") -> float:
        model, measure, cell, *way = key
        rows = [self.rows.get((model, measure, cell, *one)) for one in ([way] if way else WAYS)]
        known = [row for row in rows if row is not None]
        return 100 * known[0][end] if known else math.nan


def plan_way(cell: str) -> tuple[str, str, str]:
    criterion = CRITERIA.get(cell, "aov")
    return "A", "optimal" if criterion == "aov" else "", criterion


def check(run: Run, shown: Iterator[Shown]) -> set[str]:
    """Hold every number against its estimate; the places that showed one."""
    estimates, places = Estimates(run), set()
    for place, key, value in shown:
        wanted = estimates.of(key)
        if isinstance(value, str):
            assert value == number(wanted), (place, key)
        else:
            assert value == pytest.approx(wanted, nan_ok=True), (place, key)
        if not math.isnan(wanted):
            places.add(place)
    return places


def in_view(
    place: str, view: TextTable, known: dict[tuple[str, str], tuple[str, ...]]
) -> Iterator[Shown]:
    """Cells of a table of models, of columns that are `known` by group and name."""
    for row in view.rows:
        if not row[0].startswith(" "):
            for column, text in zip(view.columns, row, strict=True):
                if key := known.get((column.group, column.name)):
                    yield place, (row[0], *key), text


def views(maker: TableMaker, run: Run) -> Iterator[tuple[str, TextTable]]:
    """A table as files have it, and its forms in the terminal."""
    frame = maker.frame(run)
    assert maker.view is not None
    yield "file", (view := maker.view(frame, run))
    for form in maker.in_terminal(view, frame) if maker.in_terminal else ():
        yield "terminal", form


def of_plans(run: Run) -> Iterator[Shown]:
    for row in assembly_frame(run).to_dict("records"):
        way = (row["setting"], row["matcher"], row["criterion"])
        for metric in METRICS.values():
            yield "assembly", (row["model"], metric, row["level"], *way), 100 * row[metric]
    for row in settings_frame(run).to_dict("records"):
        _, matcher, criterion = plan_way(row["level"])
        for setting in "AB":
            key = (row["model"], "f1", row["level"], setting, matcher, criterion)
            yield "settings", key, 100 * row[f"f1_{setting.lower()}"]
    makers = table_makers(run)
    for row in makers["orders"].frame(run).to_dict("records"):
        yield "orders", (row["model"], "f1", OVERALL), 100 * row["f1"]
    known = {
        (level_name(level), name): (metric, level)
        for level in run.design.levels
        for name, metric in METRICS.items()
    }
    for table in ("table1", "intervals"):
        for form, view in views(makers[table], run):
            yield from in_view(f"{table}, {form}", view, known)
    for row in makers["published"].frame(run).to_dict("records"):
        matcher = "paper" if row["level"] != "1" else ""
        way = ("A", matcher, CRITERIA.get(row["level"], "aov"))
        yield "published", (row["model"], row["metric"], row["level"], *way), row["ours"]


def of_headlines(run: Run) -> Iterator[Shown]:
    for track, headline in zip(run.design.suite.tracks, headlines(run), strict=True):
        columns = {column.heading: column for column in headline_columns(run, track)}
        for row in headline.rows:
            if row.kind != "reference":
                for heading, cell in zip(headline.columns, row.cells, strict=True):
                    if (column := columns.get(heading)) is None:
                        continue
                    key = (row.name, column.measure, column.cell)
                    if column.criterion:
                        key = (*key, "A", "", column.criterion)
                    yield f"headline of {track}", key, cell.text
                    yield (
                        f"headline of {track}",
                        key,
                        math.nan if cell.value is None else cell.value,
                    )
    for row in floors_frame(run).to_dict("records"):
        way = (row["setting"], row["matcher"], row["criterion"])
        yield "floors", (row["model"], row["measure"], row["cell"], *way), 100 * row["value"]
    for row in measures_frame(run).to_dict("records"):
        value = row["value"] if row["unit"] == "%" else 100 * row["value"]
        yield "measures", (row["model"], row["measure"], row["cell"]), value


@settings(laws, max_examples=4)
@given(record_lists(), st.sampled_from(["skip", "count"]))
def test_tables_page_and_terminal_show_the_estimate_of_plans(
    records: list[dict[str, Any]], missing: str
) -> None:
    run = run_of(records, manifest(models=[("alpha", "GPT-4o"), "beta"], missing=missing))
    check(run, of_plans(run))
    check(run, of_headlines(run))


def sample(track: str, model: str, name: str, scene: str, seed: int, **more: Any) -> dict[str, Any]:
    about = {"sample": f"{track}/{model}/{name}/s{seed}", "track": track}
    return record(model, scene, seed, more.pop("scores", ()), more.pop("outcome")) | about | more


@pytest.fixture(scope="module")
def run() -> Run:
    """Three tracks, two seeds that go unlike ways, every failure, a model that said nothing."""
    facts = manifest(models=[("alpha", "GPT-4o"), "beta", "silent"], missing="count")
    facts["suite"] |= {"tracks": ["full_planning", "vqa", "step_planning"], "settings": ["A", "B"]}
    facts["items"] = {"full_planning": 5, "vqa": 80, "step_planning": 5}
    facts["tracks"] = {"vqa": {"by_subtask": {str(name): 5 for name in SUBTASKS}}}
    rng, records = np.random.default_rng(4), []
    outcomes = ["ok", "ok", "ok", "parse_failure", "api_error", "missing"]
    for model in run_models(facts):
        for place, scene in enumerate(LEVELS):
            for seed in (0, 1):
                silent = model == "silent"
                outcome = "api_error" if silent else str(rng.choice(outcomes if seed else ["ok"]))
                tp = int(rng.integers(1, 4)) if outcome == "ok" else 0
                fp = int(rng.integers(0, 9 * seed + 1)) if outcome == "ok" else 0
                plans = [
                    score(tp, fp + (setting == "A"), 4 - tp, matcher=matcher, setting=setting)
                    for setting in "AB"
                    for matcher in ("optimal", "paper")
                ]
                plans += [
                    score(tp, fp, 4 - tp, criterion="selection", setting=setting)
                    for setting in ("AB" if 1 in LEVELS[scene] else "")
                ]
                records.append(record(model, scene, seed, plans, outcome))
                moves = [
                    score(tp, wrong, 4 - tp, criterion=way, setting=setting)
                    for setting in "AB"
                    for way, wrong in (("placed", 0), ("attempted", fp))
                ]
                outcomes_told = ["placed"] * tp + ["overflow"] * fp
                told = {
                    "ending": "completed" if tp == 3 else "done",
                    "outcomes": outcomes_told,
                    "progress": [min(n + 1, tp) for n in range(tp + fp)],
                    "max_steps": 40,
                    "counts": {"poses": [tp, 4, fp, 9]},
                }
                made = {"scores": moves, "outcome": outcome, **told}
                records.append(sample("step_planning", model, scene, scene, seed, **made))
                for subtask in SUBTASKS:
                    is_right = bool(rng.random() < 0.3 + 0.5 * seed) and outcome == "ok"
                    given = "ABCD"[0 if is_right else 1 + place % 3] if outcome == "ok" else None
                    question = {"id": f"{subtask}-{scene}", "subtask": subtask, "rotation": 0}
                    answer = {"right": "A", "given": given, "correct": is_right}
                    told = {"question": question, "answer": answer, "outcome": outcome}
                    name = f"{subtask}-{scene}"
                    records.append(sample("vqa", model, name, scene, seed, **told))
    return run_of(records, facts)


def run_models(facts: dict[str, Any]) -> list[str]:
    return [model["name"] for model in facts["models"]]


def of_answers(run: Run) -> Iterator[Shown]:
    for row in questions_frame(run).to_dict("records"):
        yield "questions", (row["model"], "accuracy", row["cell"]), 100 * row["accuracy"]
    for row in vqa_intervals(run).to_dict("records"):
        yield "vqa_intervals", (row["model"], "accuracy", row["cell"]), row["value"]
    for model, values in accuracy_by_subtask(run).iterrows():
        for subtask, value in values.items():
            yield "vqa figure", (str(model), "accuracy", str(subtask)), value
    for form, view in views(table_makers(run)["table2"], run):
        known = {("", name): ("accuracy", name) for name in SUBTASKS}
        groups = {column.group for column in view.columns if column.group}
        known |= {(group, name): ("accuracy", name) for group in groups for name in SUBTASKS}
        for group in groups:
            cell = group.lower().replace(" ", "_")
            known[group, "Avg"] = ("accuracy", cell)
        yield from in_view(f"table2, {form}", view, known)


def of_episodes(run: Run) -> Iterator[Shown]:
    for row in step_scores_frame(run).to_dict("records"):
        for metric in METRICS.values():
            way = (row["setting"], "", row["criterion"])
            yield "step_scores", (row["model"], metric, OVERALL, *way), 100 * row[metric]
    for row in step_intervals(run).to_dict("records"):
        key = (row["model"], "f1", OVERALL, "A", "", row["cell"])
        yield "step_intervals", key, row["value"]
    makers = table_makers(run)
    for row in makers["endings"].frame(run).to_dict("records"):
        key = (row["model"], "completion", OVERALL)
        yield "endings", key, 100 * row["completed_share"]
    for row in makers["step_orders"].frame(run).to_dict("records"):
        key = (row["model"], "f1", OVERALL, "A", "", "placed")
        yield "step_orders", key, 100 * row["f1"]
    known: dict[tuple[str, str], tuple[str, ...]] = {
        ("Completed", "%"): ("completion", OVERALL),
        ("F1 of attempts", "%"): ("f1", OVERALL, "A", "", "attempted"),
        ("Attempts", "Prec"): ("precision", OVERALL, "A", "", "attempted"),
        ("Goal blocks", "Rec"): ("recall", OVERALL, "A", "", "placed"),
        ("Placed blocks", "Prec"): ("precision", OVERALL, "A", "", "placed"),
        ("Placed blocks", "F1"): ("f1", OVERALL, "A", "", "placed"),
    }
    for form, view in views(makers["table3"], run):
        yield from in_view(f"table3, {form}", view, known)


def of_comparison(run: Run) -> Iterator[Shown]:
    """Models have the same samples here, so that a comparison is of all of them."""
    measures = {"vqa": "accuracy", "full_planning": "f1", "step_planning": "f1"}
    for track, measure in measures.items():
        for row in compare_models(run, ("alpha", "beta"), track).table.to_dict("records"):
            key = (measure, row["part"])
            if track == "step_planning":
                key = (measure, OVERALL, "A", "", row["part"])
            for side in "ab":
                yield f"compare {track}", (row[side], *key), row[f"value_{side}"]


def of_figures(run: Run) -> Iterator[Shown]:
    drawn = {track: measure_dots(run, track=track) for track in run.design.suite.tracks}
    for track, figure in drawn.items():
        assert figure is not None
        measure = "accuracy" if track == "vqa" else "f1"
        columns = [c for c in headline_columns(run, track) if c.measure == measure]
        names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
        headings = [ax.get_title() for ax in figure.axes]
        assert headings[0] == main_heading(run, track)
        for ax in figure.axes:
            column = next(c for c in columns if c.heading == ax.get_title())
            way = ("A", "", column.criterion) if column.criterion else ()
            (dots,) = ax.lines
            for name, value in zip(names, dots.get_xdata(), strict=True):
                yield f"dots of {track}", (name, measure, column.cell, *way), float(value)
    radar, dots = f1_radar(run), settings_dots(run)
    assert radar is not None
    assert dots is not None
    for setting, ax in zip("AB", radar.axes, strict=True):
        for line in ax.lines:
            for level, value in zip(run.design.levels[:-1], line.get_ydata(), strict=False):
                way = (setting, *plan_way(level)[1:])
                yield "radar", (str(line.get_label()), "f1", level, *way), float(value)
    yield from of_dots(run, dots)


def of_dots(run: Run, figure: matplotlib.figure.Figure) -> Iterator[Shown]:
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    levels = run.design.levels
    for ax, level in zip(figure.axes, (levels[-1], *levels[:-1]), strict=True):
        for setting, line in zip("AB", ax.lines, strict=True):
            for name, value in zip(names, line.get_xdata(), strict=True):
                way = (setting, *plan_way(level)[1:])
                yield "settings figure", (name, "f1", level, *way), float(value)


def test_every_place_shows_the_estimate(run: Run) -> None:
    sources = (of_plans, of_answers, of_episodes, of_headlines, of_comparison, of_figures)
    places = set().union(*(check(run, source(run)) for source in sources))
    assert places == {
        *("assembly", "settings", "orders", "published", "questions", "vqa_intervals"),
        *(f"{name}, file" for name in ("table1", "intervals", "table2", "table3")),
        *(f"{name}, terminal" for name in ("table1", "table2", "table3")),
        *("step_scores", "step_intervals", "endings", "step_orders", "measures", "floors"),
        *("vqa figure", "radar", "settings figure"),
        *(
            f"{what} {track}"
            for what in ("headline of", "dots of", "compare")
            for track in run.design.suite.tracks
        ),
    }


def test_summaries_and_seeds_stand_beside(run: Run) -> None:
    estimates, summary = (
        Estimates(run),
        LoadedRun(
            **{
                name: getattr(run, name)
                for name in ("path", "manifest", "design", "records", "scores")
            }
        ).summary(),
    )
    keys = {
        "f1": ("f1", OVERALL),
        "vqa": ("accuracy", OVERALL),
        "steps_f1": ("f1", OVERALL, "A", "", "attempted"),
    }
    for model in ("alpha", "beta"):
        for column, key in keys.items():
            for end, name in {"value": column, "lo": f"{column}_lo", "hi": f"{column}_hi"}.items():
                assert summary.loc[model, name] == pytest.approx(estimates.of((model, *key), end))
    key = ("alpha", "f1", OVERALL)
    mean, sd = estimates.of(key, "mean"), estimates.of(key, "sd")
    assert abs(mean - estimates.of(key)) > 0.1
    told = f"{number(mean)} ± {number(sd)}"
    (_, table1), *terminal = views(table_makers(run)["table1"], run)
    assert table1.rows[0][-1] == terminal[0][1].rows[0][-1] == told
    (headline, *_) = headlines(run)
    assert headline.rows[0].cells[0].below[-1] == f"seeds {told}"
    silent = [row for row in table1.rows if row[0] == "silent"]
    assert set(silent[0][1:]) == {NO_VALUE}
