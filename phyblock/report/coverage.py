"""What became of every sample, and what the replies took: tokens, dollars, seconds."""

from __future__ import annotations

import pandas as pd

from phyblock.report.load import Run
from phyblock.report.outcomes import OUTCOMES

__all__ = ["coverage_frame"]

_TOKENS = ("prompt_tokens", "completion_tokens", "reasoning_tokens")
_COUNTS = ("recorded", *OUTCOMES, "replies", "tokens_unknown", "cost_unknown", "cached", "attempts")

_ROW = ["model", "track"]
_COLUMNS = (
    *_ROW,
    "expected",
    "recorded",
    "not_run",
    *OUTCOMES,
    "replies",
    *_TOKENS,
    "tokens_unknown",
    "cost_usd",
    "cost_unknown",
    "latency_s",
    "cached",
    "attempts",
)


def coverage_frame(run: Run) -> pd.DataFrame:
    """One row a model and track.

    `expected` samples are `recorded` + `not_run`; the outcomes split `recorded`. Of the `replies`
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
    facts = records[[*_ROW, *_TOKENS]].assign(
        recorded=1,
        **{name: (records["outcome"] == name).astype("int64") for name in OUTCOMES},
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
    known = groups[[*_TOKENS, "cost_usd"]].sum(min_count=1)
    design = run.design
    rows = [
        (model, track, design.samples(track))
        for model in design.model_names
        for track in design.suite.tracks
    ]
    table = pd.DataFrame(rows, columns=[*_ROW, "expected"])
    table = table.join(sums, on=_ROW).join(known, on=_ROW)
    table = table.join(groups["latency_s"].mean(), on=_ROW)
    table[list(_COUNTS)] = table[list(_COUNTS)].fillna(0).astype("int64")
    table.loc[(table["replies"] > 0) & (table["replies"] == table["cached"]), "cost_usd"] = 0.0
    table["not_run"] = table["expected"] - table["recorded"]
    return table[list(_COLUMNS)]
