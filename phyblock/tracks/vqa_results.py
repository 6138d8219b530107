"""What questions measure: accuracy by subtask, and its means (paper section 3.3)."""

from __future__ import annotations

import io
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from PIL import Image

from phyblock.config.suite import ImagesSpec
from phyblock.data import Dataset, QuestionTask
from phyblock.domain import (
    CATEGORIES,
    LETTERS,
    SUBTASK_NAMES,
    SUBTASKS,
    Question,
    QuestionPicture,
    is_picture_option,
)
from phyblock.errors import DataError, Problem, SpecError
from phyblock.records.manifest import MANIFEST
from phyblock.records.record import Record
from phyblock.scoring.counts import chance, letter_rates, ratio_of
from phyblock.sim.pictures import PictureStyle
from phyblock.sim.question_pictures import question_png
from phyblock.stable import plain_sum
from phyblock.tables.drawing import (
    COLORS,
    INK,
    MUTED,
    headed,
    new_figure,
    wrapped,
)
from phyblock.tables.estimates import pooled_in
from phyblock.tables.headline import (
    interval_frame,
    interval_view,
    seeds_notes,
    uncertainty_cells,
    uncertainty_columns,
)
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.measures import CELL, SCORED_BY, Cell, Measure, SampleCounts
from phyblock.tables.outcomes import FAILURES, has_reply
from phyblock.tables.paper_numbers import (
    HUMAN_NOTE,
    NOTHING,
    OURS,
    PUBLISHED,
    beside_view,
    interleaved,
    published_table,
    row_name,
)
from phyblock.tables.shares import shares_of
from phyblock.tables.showing import control_words
from phyblock.tables.text_table import Column, TextTable, number, with_interval
from phyblock.tables.track_report import (
    FigureMaker,
    HeadlineColumn,
    PageItems,
    PaperTable,
    SceneFigure,
    TableMaker,
    TrackReport,
)
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.opening import picture_style
from phyblock.tracks.pictures import block_entry, rounded
from phyblock.tracks.vqa import (
    AskedQuestion,
    ChoiceRecord,
    QuestionPictures,
    ShownQuestion,
    VqaSpec,
    open_questions,
)
from phyblock.tracks.vqa_export import QUESTION_EXPORT

_TRACK = "vqa"


_RIGHT_GIVEN = ("right", "given")


OVERALL_CELL = "overall"


CELLS: tuple[str, ...] = (
    *(name for category, subtasks in CATEGORIES.items() for name in (*subtasks, category)),
    OVERALL_CELL,
)
"""Cells in the order of Table 2: the subtasks of a category, its average, ..., the overall one."""


def showing(run: Run) -> VqaSpec:
    """What the run's suite says of it."""
    return run.section("vqa", VqaSpec)


def question_digest(run: Run) -> str | None:
    """Digest of the set that the run's questions were chosen from; None where it is not told."""
    return run.manifest.tracks.get(_TRACK, {}).get("questions")


@made_once_copied
def questions_counted(run: Run) -> pd.DataFrame:
    """The questions behind accuracies: model, subtask, scene, question, seed, variant, correct,
    n.

    One row a model, question, seed and variant, `correct` 0 or 1, `n` 1; with rotations it is
    right only if each of them is. Subtasks in which a model said nothing are left out.
    """
    records = run.records[run.records["track"] == _TRACK]
    keys = ["model", "subtask", "scene", "question", "seed", "variant"]
    rows = records[keys].assign(
        correct=records["given"].eq(records["right"]).fillna(False).astype("int64"),
        left_out=records["outcome"].isin(run.design.outcomes_left_out),
        replied=has_reply(records),
    )
    asked = rows.groupby(keys, sort=True).agg(
        {"correct": "sum", "left_out": "any", "replied": "any"}
    )
    asked["replied"] = asked.groupby(["model", "subtask"])["replied"].transform("any")
    kept = asked[asked["replied"].astype(bool) & ~asked["left_out"].astype(bool)]
    correct = (kept["correct"] == showing(run).rotations).astype("int64")
    return pd.DataFrame({"correct": correct, "n": 1}, index=kept.index).reset_index()


def letters_frame(run: Run) -> pd.DataFrame:
    """How often each letter was right and was given [%], by model, without ordering.

    `n` answers were scored; `unread` of them (all failures) have no letter. Columns `right_a`,
    `given_a` to `given_d`, the latter with `*_lo` and `*_hi`, the ends of 95 % intervals. A model
    without any reply has no rates.
    """
    rows, counted = [], []
    for model in run.design.model_names:
        answers = scored_answers(run, model)
        rates = letter_rates(zip(answers["right"], answers["given"], strict=True))
        unread = rates.n - sum(rates.given.values())
        rows.append({"model": model, "n": rates.n, "unread": unread})
        counted.append(answers[answers["right"].str.len() == 1])
    named = {f"{kind}_{letter.lower()}": letter for letter in LETTERS for kind in _RIGHT_GIVEN}
    answers = pd.concat(counted)
    letters = {name: (answers[name[:5]] == letter).astype(int) for name, letter in named.items()}
    replied = has_reply(answers)
    samples = answers[["model", "scene", "seed"]].assign(**letters, replied=replied, n=1)
    shares = 100 * shares_of(run, samples, list(named), whole="n").droplevel(CELL)
    columns = {f"{name}_share": name for name in named}
    columns |= {f"{n}_{end}": f"{n}_{end}" for n in named for end in ("lo", "hi") if n[0] == "g"}
    return pd.DataFrame(rows).join(shares[list(columns)].rename(columns=columns), on="model")


def subtasks_of(cell: str) -> tuple[str, ...]:
    """The subtasks that one of `CELLS` stands for."""
    if cell == OVERALL_CELL:
        return SUBTASKS
    return next((parts for name, parts in CATEGORIES.items() if name == cell), (cell,))


def answers_of(run: Run, model: str) -> pd.DataFrame:
    """Records of the questions that a model was asked."""
    records = run.records
    return records[(records["track"] == _TRACK) & (records["model"] == model)]


def scored_answers(run: Run, model: str) -> pd.DataFrame:
    """Samples that count; under `missing: skip` a question goes with all its rotations."""
    samples = answers_of(run, model)
    left_out = samples["outcome"].isin(run.design.outcomes_left_out)
    if not left_out.any():
        return samples
    names = pd.Series(
        list(zip(*(samples[name] for name in ("question", "seed", "variant")), strict=True)),
        samples.index,
    )
    return samples[~names.isin(set(names[left_out]))]


def expected_answers(run: Run) -> dict[str, int]:
    """Samples of each subtask that a complete run holds of one model."""
    asked = run.manifest.tracks.get(_TRACK, {}).get("by_subtask", {})
    return {name: count * run.design.repeats for name, count in asked.items()}


if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAME = "vqa"
CATEGORY_NAMES = {
    "object_property": "Property",
    "object_relationship": "Relationship",
    "scene_understanding": "Scene",
    "dynamic_reasoning": "Dynamics",
}


def is_asked(run: Run) -> bool:
    """Whether the run has questions."""
    return NAME in run.design.suite.tracks


def subtask_cells(run: Run) -> tuple[Cell, ...]:
    """Subtasks that were asked, then the mean of each category, then that of the categories."""
    return _cells(expected_answers(run) or set(run.records["subtask"].dropna()))


def in_subtasks(rows: pd.DataFrame, run: Run) -> pd.DataFrame:
    """Rows of samples with the subtask of their question."""
    subtasks = run.records.set_index("sample")["subtask"]
    return rows.assign(**{CELL: rows["sample"].map(subtasks)})


def _cells(asked: Container[str]) -> tuple[Cell, ...]:
    parts = {
        category: tuple(name for name in subtasks if name in asked)
        for category, subtasks in CATEGORIES.items()
    }
    parts = {category: names for category, names in parts.items() if names}
    single = [Cell(name, name, category) for category, names in parts.items() for name in names]
    means = [Cell(name, CATEGORY_NAMES[name], "", names) for name, names in parts.items()]
    return (*single, *means, Cell(OVERALL_CELL, "Overall", "", tuple(parts)))


ALL_CELLS = _cells(SUBTASKS)
"""The cells of a run that asks everything."""


def _answers(run: Run) -> pd.DataFrame:
    asked = questions_counted(run)
    return asked.assign(
        **dict.fromkeys(SCORED_BY, ""),
        **{CELL: asked["subtask"], "item": asked["question"]},
        replied=True,
    )


def guessing(run: Run, cell: str) -> float:
    """Expected accuracy of uniform guesses in a cell that was asked."""
    subtask = next((name for name in SUBTASKS if name == cell), None)
    if subtask is not None:
        return chance(subtask) ** showing(run).rotations
    (names,) = (other.of for other in subtask_cells(run) if other.name == cell)
    return plain_sum(guessing(run, name) for name in names) / len(names)


def _single(run: Run) -> pd.DataFrame:
    """Every shown order of options for itself."""
    parts = [scored_answers(run, model) for model in run.design.model_names]
    rows = pd.concat(parts) if parts else run.records.iloc[:0]
    return rows.assign(
        **dict.fromkeys(SCORED_BY, ""),
        **{CELL: rows["subtask"], "item": rows["question"]},
        replied=has_reply(rows),
        correct=rows["given"].eq(rows["right"]).fillna(False).astype("int64"),
        n=1,
    )


ACCURACY = Measure(
    "accuracy",
    "Accuracy",
    SampleCounts("answer", ("correct", "n"), _answers),
    ratio_of,
    "questions that were answered right; under circular evaluation in every rotation",
    over="questions",
    chance=guessing,
    floors=("majority", "text-only", "random"),
)
EACH_ROTATION = Measure(
    "each_rotation",
    "Each rotation",
    SampleCounts("rotations", ("correct", "n"), _single),
    ratio_of,
    "answers that were right, every rotation of a question counted for itself",
    over="answers",
    in_tables=False,
)
VQA_MEASURES = (ACCURACY, EACH_ROTATION)


_COLUMNS = (
    "model",
    "cell",
    "n",
    "expected",
    *FAILURES,
    "correct",
    "accuracy",
    "accuracy_lo",
    "accuracy_hi",
    "each_rotation",
    "seeds",
    "accuracy_mean",
    "accuracy_sd",
    "chance",
)


@made_once_copied
def questions_frame(run: Run) -> pd.DataFrame:
    """Accuracies in [0, 1] by model and cell (`CELLS`), in the suite's order of models.

    Of a subtask, `n` samples are scored of `expected` (seeds and rotations each count), the
    failures are counted by kind, `correct` were answered right. `accuracy` is the headline: the
    share of them, or under circular evaluation the share of questions of which every rotation was
    answered right, while `each_rotation` is then the share over single rotations. Of a category
    and overall it is the unweighted mean over the parts that were asked, NaN unless each of these
    has a value. `*_lo` and `*_hi` bound a 95 % interval, `*_mean` and `*_sd` (ddof = 1) are taken
    over seeds, `chance` is what uniform guessing would give. Where a model
    said nothing at all in a subtask, nothing was measured: NaN.
    """
    estimates = track_estimates(run, NAME).set_index(["measure", "model", CELL])
    known = estimates.to_dict("index")
    asked = {cell.name for cell in subtask_cells(run)}
    expected = expected_answers(run)
    rows: list[dict[str, Any]] = []
    for model in run.design.model_names:
        samples, scored = answers_of(run, model), scored_answers(run, model)
        for cell in CELLS:
            parts = [name for name in SUBTASKS if name in subtasks_of(cell)]
            mine, here = (frame[frame["subtask"].isin(parts)] for frame in (samples, scored))
            estimate = known.get((ACCURACY.name, model, cell), {})
            single = known.get((EACH_ROTATION.name, model, cell), {})
            value = estimate.get("value", np.nan)
            rows.append(
                {
                    "model": model,
                    "cell": cell,
                    "n": len(here),
                    "expected": sum(expected.get(name, 0) for name in parts),
                    **{failure: int((mine["outcome"] == failure).sum()) for failure in FAILURES},
                    "correct": int((here["given"] == here["right"]).sum()),
                    "accuracy": value,
                    "accuracy_lo": estimate.get("lo", np.nan),
                    "accuracy_hi": estimate.get("hi", np.nan),
                    "each_rotation": np.nan if np.isnan(value) else single.get("value", np.nan),
                    "seeds": estimate.get("seeds", 0),
                    "accuracy_mean": estimate.get("mean", np.nan),
                    "accuracy_sd": estimate.get("sd", np.nan),
                    "chance": np.nan
                    if np.isnan(value) or cell not in asked
                    else guessing(run, cell),
                }
            )
    return pd.DataFrame(rows, columns=list(_COLUMNS))


_MODEL = Column("Model", is_text=True)
_GROUPS = {
    "object_property": "Object Property",
    "object_relationship": "Object Relationship",
    "scene_understanding": "Scene Understanding",
    "dynamic_reasoning": "Dynamic Reasoning",
}
_AVERAGES_NOTE = (
    "Avg and Overall are unweighted means of the columns they stand for, as the published category "
    "averages are. Of the published overall numbers five of 14 are not: those of Claude-3.7 "
    "Sonnet, Gemini-1.5-flash, Qwen-VL-Max, Qwen2.5-VL-72B-Instruct and Random."
)


def table2_frame(run: Run) -> pd.DataFrame:
    """The paper's Table 2 [%], unrounded: one row a model, and one as published where it has one.

    Columns are `model`, `source` (run or published), `published_name`, then `CELLS`, pooled over
    seeds, `overall_lo` and `overall_hi`, the ends of an interval, and, with more than one seed,
    `<cell>_mean` and `<cell>_sd` over single seeds.
    """
    design = run.design
    frame = questions_frame(run)
    wanted = [*((cell, "") for cell in CELLS), (OVERALL_CELL, "_lo"), (OVERALL_CELL, "_hi")]
    if len(design.suite.seeds) > 1:
        wanted += [(cell, end) for cell in CELLS for end in ("_mean", "_sd")]
    rows: list[dict[str, Any]] = []
    for model in design.model_names:
        mine = frame[frame["model"] == model].set_index("cell").to_dict("index")
        row: dict[str, Any] = {"model": model, "source": OURS, "published_name": ""}
        row |= {f"{cell}{end}": 100 * mine[cell][f"accuracy{end}"] for cell, end in wanted}
        rows.append(row)
        printed = published_cells(design.published.get(model, ""))
        if printed:
            about = {"model": model, "source": PUBLISHED}
            rows.append({**about, "published_name": design.published[model], **printed})
    names = [f"{cell}{end}" for cell, end in wanted]
    return pd.DataFrame(rows, columns=["model", "source", "published_name", *names])


def published_cells(model: str) -> dict[str, float]:
    """What Table 2 prints for a model [%], by cell; empty where it has no such row."""
    table = published_table(2)
    rows = table[table["model"] == model]
    averages = rows["subtask"] == "average"
    names = rows["subtask"].where(~averages, rows["category"])
    return {str(name): float(value) for name, value in zip(names, rows["value"], strict=True)}


def table2_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Table 2 in the paper's layout out of `table2_frame`."""
    columns = [
        Column("Avg" if name == category else name, _GROUPS[category])
        for category, subtasks in CATEGORIES.items()
        for name in (*subtasks, category)
    ]
    rows = tuple(
        (
            row_name(row),
            *(number(row[cell]) for cell in CELLS),
            *uncertainty_cells(row, OVERALL_CELL, run.design),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        f"Physical-understanding VQA (%){run.design.of_suite}",
        (_MODEL, *columns, Column("Avg", "Overall"), *uncertainty_columns(run.design, "Overall")),
        rows,
        tuple(_notes(table, run)),
    )


def letters_view(table: pd.DataFrame, _: Run) -> TextTable:
    """Rates of letters out of `letters_frame`."""
    kinds = ("right", "given", "95 % CI")
    columns = [Column(kind, letter) for letter in LETTERS for kind in kinds]
    rows = tuple(
        (
            row["model"],
            str(row["n"]),
            str(row["unread"]),
            *(
                text
                for name in map(str.lower, LETTERS)
                for text in (number(row[f"right_{name}"]), *with_interval(row, f"given_{name}"))
            ),
        )
        for row in table.to_dict("records")
    )
    return TextTable(
        "Letters that are right and letters given (%)",
        (_MODEL, Column("n"), Column("No letter"), *columns),
        rows,
        ("Shares of all scored answers; questions of ordering have no one letter.",),
    )


def _notes(table: pd.DataFrame, run: Run) -> list[str]:
    shown, design = showing(run), run.design
    frame = questions_frame(run)
    whole = frame[frame["cell"] == OVERALL_CELL]
    notes = []
    if shown.circular:
        notes.append(
            "Circular: a question counts as right only if every rotation of its options was "
            "answered right; questions.csv has the accuracy over single rotations."
        )
    if shown.blind:
        notes.append("Blind: no picture was sent.")
    if shown.wrong_image:
        notes.append("The pictures shown are those of a question about another scene.")
    notes += seeds_notes(design)
    notes.append(_counts_note(whole))
    unread = whole[whole["parse_failure"] > 0]
    if len(unread):
        counts = zip(unread["model"], unread["parse_failure"], unread["n"], strict=True)
        listed = ", ".join(f"{model} {count} of {n}" for model, count, n in counts)
        notes.append(f"No answer could be read, which counts as wrong: {listed}.")
    if design.suite.scoring.missing == "count":
        notes += _unanswered_notes(whole)
    asked = frame[(frame["cell"].isin(SUBTASKS)) & (frame["expected"] > 0)]
    if asked["cell"].nunique() < len(SUBTASKS):
        notes.append("Means are over the subtasks that were asked.")
    if (table["source"] == PUBLISHED).any():
        notes.append("The published numbers are of the paper's own questions, which differ.")
    return [*notes, _AVERAGES_NOTE]


def _counts_note(whole: pd.DataFrame) -> str:
    counts = {(n, expected) for n, expected in zip(whole["n"], whole["expected"], strict=True)}
    if len(counts) == 1:
        n, expected = counts.pop()
        return f"n = {n} answers a model" + (f" of {expected}." if n != expected else ".")
    each = zip(whole["model"], whole["n"], whole["expected"], strict=True)
    return "Answers: " + ", ".join(f"{model} {n} of {all_}" for model, n, all_ in each) + "."


def _unanswered_notes(whole: pd.DataFrame) -> list[str]:
    unanswered = whole["api_error"] + whole["missing"]
    listed = [
        f"{model} {count}" for model, count in zip(whole["model"], unanswered, strict=True) if count
    ]
    return [f"Without a reply, counted as wrong: {', '.join(listed)}."] if listed else []


def paper_table2_frame(run: Run) -> pd.DataFrame:
    """Accuracies by subtask, category and overall beside the paper's Table 2."""
    if not is_asked(run):
        return NOTHING
    table = interleaved(table2_frame(run), CELLS)
    cells = subtask_cells(run)
    asked = {cell.name: pooled_in(cell, cells) for cell in cells}
    whole = {cell.name: pooled_in(cell, ALL_CELLS) for cell in ALL_CELLS}
    # A mean over a part of what the paper averages is not the same number.
    partly = table["cell"].map(asked) != table["cell"].map(whole)
    table.loc[partly, ["ours", "difference"]] = np.nan
    return table


def paper_table2_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Shows the table of `paper_table2_frame`."""
    note = (
        "Averages are unweighted means. The questions are our own: the paper's are not published."
    )
    names: dict[str, str] = {**dict.fromkeys(CATEGORIES, "Avg"), OVERALL_CELL: "Overall"}
    return beside_view(table, run, number_in_paper=2, names=names, note=note)


def vqa_intervals(run: Run) -> pd.DataFrame:
    """One row a model and cell of Table 2: value, lo, hi, se [%], n, n_scenes, n_clusters."""
    estimates = track_estimates(run, NAME)
    estimates = estimates[estimates["measure"] == ACCURACY.name]
    table = interval_frame(estimates, run.design, ACCURACY.scale, [CELL])
    place = {name: number for number, name in enumerate(CELLS)}
    order = table.assign(m=pd.factorize(table["model"])[0], c=table[CELL].map(place))
    table = table.loc[order.sort_values(["m", "c"], kind="stable").index]
    return table.drop(columns="seeds").reset_index(drop=True)


def vqa_intervals_view(table: pd.DataFrame, run: Run) -> TextTable:
    """The averages of `vqa_intervals`."""
    wanted = [cell for cell in (*CATEGORIES, OVERALL_CELL) if cell in set(table[CELL])]
    return interval_view(table, run, wanted, "Right answers")


_DARK = 55.0
_LEAST_IN = 5.5
_SCALE_ROWS = 6


def accuracy_by_subtask(run: Run) -> pd.DataFrame:
    """Share of right answers [%], a row a model, a column a subtask; NaN for what was not asked.

    As in `questions_frame`; models that answered nothing have no row.
    """
    frame = questions_frame(run)
    table = 100 * frame.pivot(index="model", columns="cell", values="accuracy")
    table = table.reindex(index=list(run.design.model_names), columns=list(SUBTASKS))
    return table.astype("float64").dropna(how="all").rename_axis(index=None, columns=None)


def vqa_heat_map(run: Run) -> Figure | None:
    """A row a model, a column a subtask, categories apart; None without a question."""
    if not is_asked(run):
        return None
    table = accuracy_by_subtask(run)
    if table.empty:
        return None
    order = table.mean(axis=1).sort_values(ascending=False, kind="stable").index
    table = table.loc[order]
    figure = new_figure(1.3 + 0.19 * len(table), _LEAST_IN)
    ax = figure.subplots()
    image = ax.imshow(table.to_numpy(), cmap="cividis", vmin=0, vmax=100, aspect="auto")
    for (row, column), value in np.ndenumerate(table.to_numpy()):
        if not np.isnan(value):
            color = "white" if value < _DARK else "black"
            ax.text(column, row, f"{value:.0f}", ha="center", va="center", color=color, fontsize=7)
    start = 0.0
    for category, subtasks in CATEGORIES.items():
        middle = start + (len(subtasks) - 1) / 2
        name = category.replace("_", " ").capitalize()
        ax.text(middle, -0.75, name, ha="center", va="bottom", fontsize=7.5, color=MUTED)
        start += len(subtasks)
        ax.axvline(start - 0.5, color="white", linewidth=3)
    ax.set_xticks(range(len(table.columns)), list(table.columns))
    ax.set_yticks(range(len(table)), list(table.index))
    ax.tick_params(length=0)
    for side in ax.spines.values():
        side.set_visible(False)
    # Every number is said; beside a few rows there is no room for the scale's name.
    if len(table) >= _SCALE_ROWS:
        bar = figure.colorbar(image, ax=ax, pad=0.015, fraction=0.03)
        bar.set_label("Right answers (%)")
        bar.outline.set_visible(False)
    chance = (
        f"guessing gives {100 * guessing(run, 'SH'):.2g}, in OR {100 * guessing(run, 'OR'):.1g}"
    )
    headed(figure, "Questions by subtask", run.design.after_suite(f"right answers (%); {chance}"))
    return figure


_LEAST_IN_CARDS = 6.5
_TEXT_PT = 5.8
_LINE_IN = 0.1
_PICTURE_IN, _OPTION_IN = 0.95, 0.4
_PICTURE_PX = 320
_HEAD_IN = 0.2
_GAP_IN = 0.16
_RIGHT = "#00704f"
_CATEGORY_COLORS = (COLORS[0], COLORS[1], COLORS[2], COLORS[6])


def subtask_cards(run: Run, dataset: Dataset, scene: str) -> Figure | None:
    """Four cards a category: the pictures that are shown, what is asked, the options and the right
    one. The shortest question of each subtask, about `scene` where that is named; None where there
    is no question with a recipe of its pictures.
    """
    recorded = run.manifest.questions
    if recorded is None:
        return None
    questions = open_questions(recorded.format, Path(recorded.root), dataset)
    asked = (task.question for task in questions.tasks if task.question.pictures)
    cards = _cards(asked, scene)
    if not cards:
        return None
    style = replace(picture_style(run.section("images", ImagesSpec)), size_px=_PICTURE_PX)
    figure = new_figure(0.5, _LEAST_IN_CARDS)
    width_in = figure.get_figwidth() / 4
    texts = {card.subtask: _text(card, width_in - 0.12) for card in cards.values()}
    rows = [[n for n in names if n in cards] for names in CATEGORIES.values()]
    rows = [names for names in rows if names]
    heights = [
        _HEAD_IN + _PICTURE_IN + _GAP_IN + _LINE_IN * max(len(texts[name]) for name in names)
        for names in rows
    ]
    figure.set_figheight(0.5 + sum(heights))
    headed(
        figure,
        "A question of each subtask",
        "The shortest of each; the right answer stands in green, four letters are an order",
    )
    figure.set_layout_engine("none")
    whole, top = figure.get_figheight(), figure.get_figheight() - sum(heights)
    for names, height in zip(rows, heights, strict=True):
        for column, name in enumerate(names):
            place = (column / 4, 1 - (top + height) / whole, 1 / 4, height / whole)
            # In inches, so that pictures and lines keep their places.
            ax = figure.add_axes(place, xlim=(0, width_in), ylim=(height, 0))
            ax.set_axis_off()
            _card(ax, cards[name], texts[name], style, width_in)
        top += height
    return figure


def _cards(questions: Iterable[Question], scene: str) -> dict[str, Question]:
    """The shortest question of each subtask, by its name."""
    by_subtask: dict[str, Question] = {}
    for question in questions:
        if scene and question.scene.id != scene:
            continue
        known = by_subtask.get(question.subtask)
        if known is None or _length(question) < _length(known):
            by_subtask[question.subtask] = question
    return {name: by_subtask[name] for name in SUBTASKS if name in by_subtask}


def _length(question: Question) -> tuple[int, str]:
    return sum(map(len, (question.text, *question.options))), question.id


def _text(question: Question, width_in: float) -> list[tuple[str, str]]:
    """Lines of a card with their colors."""
    lines = [(line, INK) for line in wrapped(question.text, width_in, _TEXT_PT)]
    is_order = len(question.answer) > 1
    for place, option in enumerate(question.options):
        if is_picture_option(option):
            continue
        color = _RIGHT if not is_order and place in question.answer else MUTED
        text = f"{LETTERS[place]}. {option}"
        lines += [(line, color) for line in wrapped(text, width_in, _TEXT_PT)]
    if is_order or any(map(is_picture_option, question.options)):
        lines.append((f"Answer: {question.answer_letters}", _RIGHT))
    return lines


def _card(
    ax: Axes,
    question: Question,
    lines: list[tuple[str, str]],
    style: PictureStyle,
    width_in: float,
) -> None:
    place = list(CATEGORIES).index(question.category)
    title = f"{question.subtask}  {SUBTASK_NAMES[question.subtask]}"
    ax.text(0.03, 0.1, title, fontsize=7.5, fontweight="bold", color=_CATEGORY_COLORS[place])
    _pictures(ax, question, style, width_in)
    top = _HEAD_IN + _PICTURE_IN + 0.1
    for n, (line, color) in enumerate(lines):
        ax.text(0.03, top + n * _LINE_IN, line, fontsize=_TEXT_PT, color=color)


def _pictures(ax: Axes, question: Question, style: PictureStyle, width_in: float) -> None:
    """The scene, beside it the block asked about, or the options in two rows."""
    scenes = [one for one in question.pictures if one.label == "scene"]
    others = [one for one in question.pictures if one.label != "scene"]
    room_in = width_in - 0.1
    side = min(_PICTURE_IN, room_in - 2 * _OPTION_IN) if len(others) > 1 else _PICTURE_IN
    for recipe in scenes:
        _put(ax, recipe, style, 0.03, _HEAD_IN, side)
    left = 0.07 + side if scenes else 0.03
    small = min((width_in - left - 0.05) / min(2, max(1, len(others))), _PICTURE_IN / 2)
    for n, recipe in enumerate(others):
        row, column = divmod(n, 2)
        corner = (left + column * small, _HEAD_IN + row * small)
        _put(ax, recipe, style, *corner, small - 0.02)
        if recipe.label in LETTERS:
            ax.text(
                corner[0] + 0.03,
                corner[1] + 0.1,
                recipe.label,
                fontsize=6,
                fontweight="bold",
                color=INK,
                bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none"},
            )


def _put(
    ax: Axes, recipe: QuestionPicture, style: PictureStyle, left: float, top: float, side: float
) -> None:
    with Image.open(io.BytesIO(question_png(recipe, style))) as image:
        pixels = np.asarray(image.convert("RGB"))
    limits = ax.get_xlim(), ax.get_ylim()
    ax.imshow(pixels, extent=(left, left + side, top + side, top), aspect="equal")
    ax.set(xlim=limits[0], ylim=limits[1])


_CHANGED = "is not the data set that the run was made on, or it was changed since"


def question_items(run: Run, dataset: Dataset) -> PageItems:
    """The questions of a run; DataError where they are not what it was made on."""
    recorded, shown = run.manifest.questions, showing(run)
    if recorded is None:
        raise DataError(Problem(str(run.path / MANIFEST), "names no questions", "questions"))
    questions = open_questions(recorded.format, Path(recorded.root), dataset)
    if questions.sha256 != question_digest(run):
        raise DataError(Problem(str(questions.root), _CHANGED, "sha256", questions.sha256))
    by_id = {task.question.id: task for task in questions.tasks}

    def pictures(folder: Path, style: PictureStyle) -> QuestionPictures:
        # Null is each question's own, which no style can say.
        ground = run.manifest.suite["images"]["background"] and style.background
        return QuestionPictures(folder, style, shown.options_as, 1, ground)

    return PageItems(lambda record: _shown(record, by_id), _entry, pictures)


def _shown(record: Record, questions: Mapping[str, QuestionTask]) -> ShownQuestion | None:
    if not isinstance(record, ChoiceRecord) or record.question.id not in questions:
        return None
    return AskedQuestion(questions[record.question.id], record.question.rotation).shown


def _entry(shown: ShownQuestion) -> dict[str, Any]:
    return question_entry(shown.question)


def question_entry(question: Question) -> dict[str, Any]:
    """A question with the recipes of its pictures."""
    return {
        "id": question.id,
        "subtask": question.subtask,
        "text": question.text,
        "options": list(question.options),
        "answer": question.answer_letters,
        "pictures": [_picture(picture) for picture in question.pictures],
        "evidence": dict(question.evidence),
    }


def _picture(picture: QuestionPicture) -> dict[str, Any]:
    return {
        "label": picture.label,
        "view": list(picture.view_deg),
        "blocks": [block_entry(block) for block in picture.blocks],
        "framed": [block_entry(block) for block in picture.framed],
        "marks": [
            {"letter": mark.letter, "position": rounded(mark.position_m)} for mark in picture.marks
        ],
    }


_COLUMNS_REPORT = (
    *(HeadlineColumn(ACCURACY.name, name, CATEGORY_NAMES[name]) for name in CATEGORIES),
    HeadlineColumn(ACCURACY.name, OVERALL_CELL, "Overall"),
)


def _references(_: Run) -> Mapping[str, Mapping[str, float]]:
    printed = published_cells("Random")
    return {
        "Random, published": {column.heading: printed[column.cell] for column in _COLUMNS_REPORT}
    }


def _notes_report(_: Run) -> Sequence[str]:
    macro = "A category is the unweighted mean of its subtasks, overall that of the categories"
    return (f"Accuracy in percent. {macro}, as far as they were asked.",)


def _how_shown(run: Run) -> tuple[str, ...]:
    shown = showing(run)
    circular = ("circular",) if shown.circular else ()
    letters = ("options on one sheet",) if shown.options_as == "letters" else ()
    return (*circular, *control_words(run, NAME), *letters)


def _check_alike(run: Run, first: Run, _: Sequence[str], __: Measure) -> None:
    circular = [showing(one).circular for one in (run, first)]
    if circular[0] != circular[1]:
        found, allowed = (str(one).lower() for one in circular)
        message = f"counts right answers in another way than {first.path}"
        raise SpecError(Problem(str(run.path), message, "vqa.circular", found, allowed))
    # Digests of the sets that questions were chosen from.
    sets = [question_digest(one) for one in (run, first)]
    if sets[0] != sets[1]:
        message = f"asked questions of another set than {first.path}"
        raise SpecError(Problem(str(run.path), message, "questions", str(sets[0]), str(sets[1])))


REPORT = TrackReport(
    measures=VQA_MEASURES,
    cells=subtask_cells,
    in_cells=in_subtasks,
    headline=lambda _: _COLUMNS_REPORT,
    references=_references,
    notes=_notes_report,
    reference_note=HUMAN_NOTE,
    tables={
        "table2": TableMaker(table2_frame, table2_view),
        "vqa_intervals": TableMaker(vqa_intervals, vqa_intervals_view, "table2"),
        "letters": TableMaker(letters_frame, letters_view, "table2"),
        "questions": TableMaker(questions_frame, None, "table2"),
    },
    main_figure="vqa-accuracy",
    figures={
        "vqa-subtasks": FigureMaker("VQA accuracy by subtask", vqa_heat_map),
        "subtask-cards": SceneFigure("A question of each subtask", subtask_cards),
    },
    paper_tables={2: PaperTable(paper_table2_frame, paper_table2_view)},
    check_alike=_check_alike,
    showing=_how_shown,
    part_names={str(short): name for short, name in SUBTASK_NAMES.items()},
    items=question_items,
    export=QUESTION_EXPORT,
)
