"""What replies took: tokens, dollars and seconds, a reply and in total."""

from __future__ import annotations

import pandas as pd

from phyblock.registry import known_track
from phyblock.tables.coverage import coverage_frame
from phyblock.tables.flat import TOKENS
from phyblock.tables.load import Run
from phyblock.tables.text_table import NO_VALUE, Column, TextTable, number

__all__ = ["cost_frame", "cost_view"]

_ROW = ["model", "track"]


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
    episodes = [known_track(name) for name in run.design.suite.tracks if known_track(name).plays]
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
