"""What became of every sample, and what the replies took: tokens, dollars, seconds."""

from __future__ import annotations

import math

import pandas as pd

from phyblock.tables.flat import TOKENS, joined_counts
from phyblock.tables.load import Run, made_once_copied
from phyblock.tables.outcomes import HEADINGS, NOT_RUN, OUTCOMES
from phyblock.tables.text_table import (
    NO_VALUE,
    Column,
    TextTable,
    number,
    track_column,
    track_text,
)

__all__ = ["coverage_frame", "coverage_view"]

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


@made_once_copied
def coverage_frame(run: Run) -> pd.DataFrame:
    """One row a model and track.

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
    table[list(_COUNTS)] = joined_counts(table[list(_COUNTS)])
    table.loc[(table["replies"] > 0) & (table["replies"] == table["cached"]), "cost_usd"] = 0.0
    table["not_run"] = table["expected"] - table["recorded"]
    return table[list(_COLUMNS)]


def coverage_view(table: pd.DataFrame, run: Run) -> TextTable:
    """Outcomes, tokens, cost and time out of `coverage_frame`.

    Tokens, latency, cached and requests are left out where no model has any, and the track where
    there is one.
    """
    counts = {"expected": "Expected", "not_run": NOT_RUN}
    counts |= {outcome: HEADINGS[outcome] for outcome in OUTCOMES}
    parts: list[tuple[Column, list[str]]] = [(Column("Model", is_text=True), list(table["model"]))]
    tracks = run.design.suite.tracks
    texts = [text for track in table["track"] for text in track_text(track, tracks)]
    parts += [(column, texts) for column in track_column(tracks)]
    parts += [
        (Column(heading), [str(count) for count in table[name]]) for name, heading in counts.items()
    ]
    usage = [
        *(
            (Column(f"Tokens {name}"), [_tokens(n) for n in table[f"{kind}_tokens"]])
            for kind, name in (("prompt", "in"), ("completion", "out"), ("reasoning", "reasoning"))
        ),
        (Column("Latency (s)"), [number(seconds, 2) for seconds in table["latency_s"]]),
        (Column("Cached"), [str(count) for count in table["cached"]]),
        (Column("Requests"), [str(count) for count in table["attempts"]]),
    ]
    costs = zip(table["cost_usd"], table["cost_unknown"], table["replies"], strict=True)
    parts.append((Column("Cost"), [_cost(*cost) for cost in costs]))
    parts += [(column, cells) for column, cells in usage if set(cells) - {NO_VALUE, "0"}]
    return TextTable(
        f"Coverage{run.design.of_suite}: what became of every sample",
        tuple(column for column, _ in parts),
        tuple(zip(*(cells for _, cells in parts), strict=True)),
        tuple(_coverage_notes(table, run)),
    )


def _tokens(total: int | None) -> str:
    return NO_VALUE if total is None or pd.isna(total) else f"{total:,}"


def _cost(known: float, unknown: int, replies: int) -> str:
    if not replies:
        return NO_VALUE
    if math.isnan(known):
        return "unknown"
    dollars = f"${known:,.2f}" if known >= 1 or not known else f"${known:.4f}"
    return dollars + (f" + {unknown} unknown" if unknown else "")


def _coverage_notes(table: pd.DataFrame, run: Run) -> list[str]:
    notes = []
    if table["extracted"].any():
        read = table[table["extracted"] > 0]
        counts = zip(read["model"], read["extracted"], read["recorded"], strict=True)
        listed = ", ".join(f"{model} {count} of {recorded}" for model, count, recorded in counts)
        notes.append(f"Read by extractor: {listed}.")
    if table["latency_s"].notna().any():
        notes.append("Latency is the mean over replies that were asked for in this run.")
    if table["cached"].any():
        notes.append("Cost is what this run paid; replies from the cache cost it nothing.")
    unanswered = table["recorded"] - table["missing"] - table["replies"]
    if table["attempts"].any() and unanswered.any():
        notes.append("Requests are those that led to a reply, with their retries.")
    partly = table[table["tokens_unknown"].between(1, table["replies"] - 1)]
    if len(partly):
        counts = zip(partly["model"], partly["tokens_unknown"], partly["replies"], strict=True)
        listed = ", ".join(f"{model} {unknown} of {replies}" for model, unknown, replies in counts)
        notes.append(f"Tokens are sums over the replies that tell them; these do not: {listed}.")
    if run.is_cut:
        notes.append("The last line of records.jsonl was cut off and is ignored.")
    return notes
