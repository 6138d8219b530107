"""A comparison as a table that a person reads, and as files."""

from __future__ import annotations

import math
from pathlib import Path

import pandas as pd

from phyblock.files import OutFolder
from phyblock.report.compare import Comparison
from phyblock.scoring.statistics import POWER
from phyblock.tables.csv_text import to_csv
from phyblock.tables.latex import to_latex
from phyblock.tables.markdown import to_markdown
from phyblock.tables.measures import in_unit
from phyblock.tables.text_table import NO_VALUE, Column, TextTable, between, level_name, number
from phyblock.text import counted

__all__ = ["compare_view", "flipped_lines", "p_text", "ranks_view", "write_comparison"]

_LEAST_P = 0.001


def compare_view(found: Comparison) -> TextTable:
    """A row a pair and part; the part is left out where there is but one."""
    table = found.table
    one_part = table["part"].nunique() == 1
    columns = [
        Column("A", is_text=True),
        Column("B", is_text=True),
        *([] if one_part else [Column("Part", is_text=True)]),
        *(
            Column(name, in_unit(found.name, found.unit))
            for name in ("A", "B", "A - B", "95 % CI", "finds")
        ),
        Column("p (Holm)"),
        Column("Verdict", is_text=True),
        *(Column(name, "Samples") for name in ("A better", "B better", "same")),
    ]
    rows = []
    previous: tuple[str, str] = ("", "")
    for row in table.to_dict("records"):
        pair = (row["a"], row["b"])
        rows.append(
            (
                *(pair if pair != previous else ("", "")),
                *([] if one_part else [_part_name(row["part"])]),
                number(row["value_a"]),
                number(row["value_b"]),
                number(row["difference"], signed=True),
                between(row["lo"], row["hi"], signed=True),
                number(row["detectable_holm"]),
                p_text(row["p_holm"]),
                row["verdict"],
                *(str(row[name]) for name in ("better", "worse", "same")),
            )
        )
        previous = pair
    return TextTable(
        "Models compared on the same samples", tuple(columns), tuple(rows), _notes(found)
    )


def _part_name(part: str) -> str:
    return level_name(part.replace("_", " "))


def _notes(found: Comparison) -> tuple[str, ...]:
    table = found.table
    most = max(table.to_dict("records"), key=lambda row: row["n_scenes"], default=None)
    notes = [found.how]
    if most is not None:
        notes.append(
            f"{counted(most['n_samples'], 'sample')} of {counted(most['n_scenes'], 'scene')} from "
            f"{counted(most['n_clusters'], 'base scene')}; scenes that share one are not taken as "
            "independent."
        )
        single = table["detectable"].dropna().median()
        median = "" if math.isnan(single) else f"; a single test, in the median, {number(single)}"
        notes.append(
            f"“finds”: the difference that this comparison would find in {POWER:.0%} of cases"
            f"{median}; {NO_VALUE}: none that is possible, or no sample differs."
        )
    notes.append(
        f"p values are corrected for {table['p'].notna().sum()} comparisons (Holm); “cannot tell” "
        "stands where p is 0.05 or more."
    )
    return tuple(notes)


def ranks_view(found: Comparison) -> TextTable:
    """The rank that each model may have, out of `Comparison.ranks`, the best first."""
    rows = [
        (row["model"], number(row["value"]), _range(row["best"], row["worst"]))
        for row in found.ranks.to_dict("records")
    ]
    return TextTable(
        "Ranks that each model may have",
        (Column("Model", is_text=True), Column(in_unit(found.name, found.unit)), Column("Rank")),
        tuple(rows),
        ("All ranges hold at once with 95 % confidence, by the comparisons above.",),
    )


def _range(best: int, worst: int) -> str:
    return str(best) if best == worst else f"{best} to {worst}"


def p_text(p: float) -> str:
    """A p value with three decimals; `< 0.001` where it is less."""
    if pd.isna(p):
        return NO_VALUE
    return f"< {_LEAST_P}" if p < _LEAST_P else f"{p:.3f}"


def flipped_lines(found: Comparison) -> tuple[str, ...]:
    """For each side of each pair, the samples that it alone got wholly right, as sentences."""
    lines = []
    several = found.flipped["seed"].nunique() > 1
    for (a, b), flips in found.flipped.groupby(["a", "b"], sort=False):
        for side, other in ((a, b), (b, a)):
            rows = flips[flips["right"] == side]
            names = []
            for row in rows.to_dict("records"):
                how = (f"seed {row['seed']}" if several else "", row["variant"])
                told = ", ".join(filter(None, how))
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
    texts: dict[str, bytes | str] = {
        "comparison.csv": to_csv(found.table, "%.6f"),
        "comparison.md": to_markdown(view),
        "comparison.tex": to_latex(view, "phyblock-comparison"),
        "flipped.csv": to_csv(found.flipped, "%.2f"),
        "ranks.csv": to_csv(found.ranks, "%.6f"),
    }
    return OutFolder(folder).write(texts)
