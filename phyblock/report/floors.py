"""What answers reach that never see the goal, and which models are above that.

A floor is a baseline of the run, what `run.yaml` says that one would reach, or the chance of
guessing; the strongest is the one to hold models against.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pandas as pd

from phyblock.tables.headline import headline_rows, rows_of
from phyblock.tables.load import Run
from phyblock.tables.measures import CELL, SCORED_BY, Better, Measure, value_key
from phyblock.tables.text_table import (
    NO_VALUE,
    Column,
    TextTable,
    number,
    track_column,
    track_text,
)
from phyblock.tracks.estimates import (
    headline_columns,
    track_estimates,
    track_measures,
)
from phyblock.tracks.kind import kind_of

__all__ = [
    "Floor",
    "floors_frame",
    "floors_run",
    "floors_view",
    "headline_floors",
    "strongest_floors",
]

CHANCE = "chance"
"""Name of the floor that is uniform guessing."""
_COLUMNS = (
    *("track", "measure", *SCORED_BY, CELL),
    *("floor", "floor_value", "model", "value", "lo", "hi", "verdict"),
)
_VERDICTS = {True: "above", False: "not above", None: "cannot tell"}


@dataclass(frozen=True)
class Floor:
    """The strongest floor of a cell: its name, and its value in the measure's own unit."""

    name: str
    value: float

    def is_below(self, lo: float, hi: float, better: Better) -> bool | None:
        """Whether an interval lies wholly on the better side; None where there is none."""
        if math.isnan(lo) or math.isnan(hi):
            return None
        return lo > self.value if better == "higher" else hi < self.value


def floors_frame(run: Run) -> pd.DataFrame:
    """One row a track, measure that has floors, way of counting, cell and model.

    `floor` is the strongest of the cell and `floor_value` what it reaches; `value` is the model's,
    with the 95 % interval `lo` to `hi`, all in the measure's own unit. `verdict` is `above` where
    the whole interval is better than the floor, `not above`, or `cannot tell` where there is no
    interval. Floors themselves have no row.
    """
    rows = []
    place = {name: number for number, name in enumerate(run.design.model_names)}
    for track in run.design.suite.tracks:
        found = track_estimates(run, track)
        found = found.sort_values("model", key=lambda names: names.map(place), kind="stable")
        named = floors_run(run, track)
        for measure in track_measures(track):
            floors = strongest_floors(run, track, measure)
            if not floors:
                continue
            for row in found[found["measure"] == measure.name].to_dict("records"):
                floor = floors.get(value_key(row))
                if floor is None or row["model"] in named:
                    continue
                verdict = _VERDICTS[floor.is_below(row["lo"], row["hi"], measure.better)]
                about = {"track": track, "floor": floor.name, "floor_value": floor.value}
                numbers = {str(name): value for name, value in row.items()}
                rows.append({**numbers, **about, "verdict": verdict})
    return pd.DataFrame(rows, columns=list(_COLUMNS))


def strongest_floors(run: Run, track: str, measure: Measure) -> dict[str, Floor]:
    """The strongest floor of every cell that has one, by `value_key`."""
    best: dict[str, Floor] = {}
    for key, floor in _known_floors(run, track, measure):
        other = best.get(key)
        is_higher = other is None or floor.value > other.value
        if other is None or is_higher == (measure.better == "higher"):
            best[key] = floor
    return best


def floors_run(run: Run, track: str) -> set[str]:
    """The models of a run that are floors of a track."""
    named = {floor for measure in track_measures(track) for floor in measure.floors}
    return named & {model.name for model in run.manifest.models if model.kind == "baseline"}


def headline_floors(run: Run, track: str) -> dict[str, Floor]:
    """The strongest floor of the columns of a track's headline that have one, by heading.

    Values are as tables show them, in the unit of the measure.
    """
    rows = headline_rows(track_estimates(run, track), run.design)
    measures = {measure.name: measure for measure in track_measures(track)}
    found: dict[str, Floor] = {}
    for column in headline_columns(run, track):
        mine = rows_of(rows, column)
        if len(mine):
            measure = measures[column.measure]
            floor = strongest_floors(run, track, measure).get(value_key(mine.iloc[0].to_dict()))
            if floor is not None:
                found[column.heading] = Floor(floor.name, measure.scale * floor.value)
    return found


def _known_floors(run: Run, track: str, measure: Measure) -> Iterator[tuple[str, Floor]]:
    """Floors that were run, then those that the manifest knows, then chance."""
    if not measure.floors and measure.chance is None:
        return
    found = track_estimates(run, track)
    found = found[found["measure"] == measure.name]
    asked = [name for name in measure.floors if name in floors_run(run, track)]
    for row in found[found["model"].isin(asked)].to_dict("records"):
        if not math.isnan(row["value"]):
            yield value_key(row), Floor(str(row["model"]), float(row["value"]))
    computed = run.manifest.floors.get(track, {})
    for name in measure.floors:
        for key, value in computed.get(name, {}).items() if name not in asked else ():
            yield key, Floor(name, float(value))
    if measure.chance is not None:
        for row in found.drop_duplicates([CELL, *SCORED_BY]).to_dict("records"):
            yield value_key(row), Floor(CHANCE, measure.chance(run, str(row[CELL])))


def floors_view(table: pd.DataFrame, run: Run) -> TextTable:
    """A row a part and setting out of `floors_frame`: the floor, and who is above it or not."""
    rows, tracks = [], run.design.suite.tracks
    for track in tracks:
        cells = {cell.name: cell for cell in kind_of(track).report().cells(run)}
        parts = {name for cell in cells.values() for name in cell.of if not cells[name].of}
        for measure in track_measures(track):
            mine = table[(table["track"] == track) & (table["measure"] == measure.name)]
            mine = mine[mine["matcher"].isin(["", run.design.matcher]) & ~mine[CELL].isin(parts)]
            groups: dict[tuple[str, ...], list[dict[Hashable, Any]]] = {}
            for row in mine.to_dict("records") if len(mine) else ():
                key = (row["setting"], row["criterion"], row[CELL])
                groups.setdefault(key, []).append(row)
            for (setting, criterion, cell), group in groups.items():
                named = (*track_text(track, tracks), measure.heading, cells[cell].heading)
                rows.append((*named, *_texts(setting, criterion, group, measure)))
    columns = (
        *("Measure", "Part", "Setting", "Counted by"),
        *("Strongest floor", "Floor", "Above", "Not above"),
    )
    return TextTable(
        "Floors: what is reached without seeing the goal",
        (
            *track_column(tracks),
            *(Column(name, is_text=name != "Floor") for name in columns),
        ),
        tuple(rows),
        (
            "Above: the whole 95 % interval is. In brackets: those of which a single base scene "
            "does not tell.",
        ),
    )


def _texts(
    setting: str,
    criterion: str,
    group: Sequence[Mapping[Hashable, Any]],
    measure: Measure,
) -> tuple[str, ...]:
    first = group[0]
    models = {
        verdict: [row["model"] for row in group if row["verdict"] == verdict]
        for verdict in _VERDICTS.values()
    }
    unclear = [f"({name})" for name in models["cannot tell"]]
    return (
        setting or NO_VALUE,
        criterion or NO_VALUE,
        str(first["floor"]),
        number(measure.scale * first["floor_value"]),
        ", ".join(models["above"]) or NO_VALUE,
        ", ".join([*models["not above"], *unclear]) or NO_VALUE,
    )
