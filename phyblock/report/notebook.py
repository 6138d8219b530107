"""A run in a notebook: frames, tables, a summary, a comparison, and how it is shown."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from html import escape
from pathlib import Path

import pandas as pd

from phyblock.report.compare import Comparison, compare_models, compare_runs
from phyblock.report.measure_table import headline_of, main_heading
from phyblock.report.write import make_tables, table_names
from phyblock.tables.load import Run
from phyblock.tables.load import load_run as load_frames
from phyblock.tables.text_table import TextTable, between, number
from phyblock.text import counted
from phyblock.tracks.estimates import all_estimates
from phyblock.tracks.kind import kind_of

__all__ = ["LoadedRun", "Tables", "load_run"]


class Tables(Mapping[str, pd.DataFrame]):
    """The tables of a run by name, each made when it is first asked for."""

    def __init__(self, run: Run) -> None:
        self._run = run
        self._names = table_names(run)

    def __getitem__(self, name: str) -> pd.DataFrame:
        if name not in self._names:
            raise KeyError(f"{name}; there are: {', '.join(self._names)}")
        return make_tables(self._run, [name])[0][name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def view(self, name: str) -> TextTable | None:
        """The table as people read it, for `to_markdown` and `to_latex`; None where it is not."""
        self[name]
        return make_tables(self._run, [name])[1].get(name)

    def __repr__(self) -> str:
        return f"<tables: {', '.join(self._names)}>"


@dataclass(frozen=True, eq=False)
class LoadedRun(Run):
    """A run folder in a notebook.

    `records` has one row a sample and `scores` one row a score (see `Run`); `tables` maps the names
    of tables to data frames.
    """

    @property
    def tables(self) -> Tables:
        """Data frames by table name, as the files in `tables/` hold them."""
        return Tables(self)

    @property
    def estimates(self) -> pd.DataFrame:
        """Every value with its 95 % interval: a row a track, measure, way of counting, model, cell.

        The frame behind all tables and figures; shares are in [0, 1]. A copy, to be changed freely.
        """
        return all_estimates(self)

    def summary(self) -> pd.DataFrame:
        """One row a model: samples, answered, and the headline of each track with its interval.

        A track's headline is in a column of its short name or its name [%, where it is a share],
        with `*_lo` and `*_hi`. Only of tracks that were run.
        """
        counts = self.tables["coverage"].groupby("model", sort=False)
        table = counts[["expected", "ok"]].sum()
        table = table.reindex(list(self.design.model_names))
        for track in self.design.suite.tracks:
            values, main = headline_of(self, track), main_heading(self, track)
            short = kind_of(track).report().short or track
            for name, end in {short: "value", f"{short}_lo": "lo", f"{short}_hi": "hi"}.items():
                found = (values.get((model, main)) for model in table.index)
                numbers = [math.nan if value is None else getattr(value, end) for value in found]
                table[name] = pd.Series(numbers, table.index, dtype="float64")
        return table

    def compare(
        self,
        other: Run | None = None,
        models: Sequence[str] = (),
        track: str = "",
        measure: str = "",
    ) -> Comparison:
        """The models of this run with one another, or with those of `other`; see `Comparison`.

        Raises SpecError for names that are not there or runs that cannot be compared.
        """
        if other is None:
            return compare_models(self, models, track, measure)
        return compare_runs(self, other, models, track, measure)

    def _repr_html_(self) -> str:
        """What a notebook shows: the headline of every model."""
        name = self.design.suite.name or self.path.name
        summary = self.summary()
        titles = {"expected": "Samples", "ok": "Answered"}
        for track in self.design.suite.tracks:
            titles[kind_of(track).report().short or track] = (
                f"{kind_of(track).title}: {main_heading(self, track)}, 95 % CI"
            )
        heads = ["Model", *titles.values()]
        lines = []
        for model, row in zip(summary.index, summary.to_dict("records"), strict=True):
            cells = []
            for column in summary.columns:
                if column in titles:
                    text = f"{row[column]:,}" if column in _WHOLE else number(row[column])
                    if f"{column}_lo" in row and not pd.isna(row[f"{column}_lo"]):
                        text += f" {between(row[f'{column}_lo'], row[f'{column}_hi'])}"
                    cells.append(f'<td style="text-align:right">{escape(text)}</td>')
            lines.append(
                f'<tr><th style="text-align:left">{escape(str(model))}</th>{"".join(cells)}</tr>'
            )
        head = "".join(f"<th>{escape(text)}</th>" for text in heads)
        return (
            f"<p><b>{escape(name)}</b>, {counted(len(self.records), 'sample')} in "
            f"<code>{escape(str(self.path))}</code></p>"
            f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>"
        )


_WHOLE = ("expected", "ok")


def load_run(path: str | Path, *, texts: bool = True) -> LoadedRun:
    """Read a run folder for a notebook; without `texts` the replies' texts are left on disk.

    Raises StoreError for a folder that is no run or a broken one.
    """
    run = load_frames(path, texts=texts)
    return LoadedRun(
        **{field.name: getattr(run, field.name) for field in fields(run) if field.init}
    )
