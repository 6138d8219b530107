"""What tests of differences say together: verdicts, what they could have found, and ranks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from phyblock.scoring.statistics import CONFIDENCE, detectable, holm, least_p, rank_ranges
from phyblock.tables.measures import Measure

__all__ = ["ranks", "with_verdicts"]

_LEVEL = 1 - CONFIDENCE


def with_verdicts(table: pd.DataFrame, measure: Measure) -> pd.DataFrame:
    """A table of tests (a, b, difference, se, p, n_clusters, ...) with what they say together.

    Behind `p` stand p_holm, verdict, detectable and detectable_holm, as `Comparison` explains.
    """
    n_tests = int(table["p"].notna().sum())
    judged = table.assign(p_holm=holm(table["p"]))
    judged["verdict"] = [_verdict(row, measure, n_tests) for row in judged.to_dict("records")]
    levels = {"detectable": _LEVEL, "detectable_holm": _LEVEL / max(n_tests, 1)}
    for name, level in levels.items():
        judged[name] = detectable(table["se"], table["n_clusters"], level, measure.most_apart)
    columns = [str(name) for name in table]
    after = columns.index("p") + 1
    return judged[[*columns[:after], "p_holm", "verdict", *levels, *columns[after:]]]


def _verdict(row: Mapping[Any, Any], measure: Measure, n_tests: int) -> str:
    if np.isnan(row["difference"]):
        return "nothing to compare"
    if np.isnan(row["p_holm"]):
        return "cannot tell: a single base scene"
    if row["p_holm"] >= _LEVEL:
        # So few base scenes give no p value that the correction leaves below the level.
        too_few = n_tests * least_p(row["n_clusters"]) >= _LEVEL
        return "too few base scenes to tell" if too_few else "cannot tell"
    a_is_better = (row["difference"] > 0) == (measure.better == "higher")
    return f"{row['a' if a_is_better else 'b']} is better"


def ranks(table: pd.DataFrame, measure: Measure) -> pd.DataFrame:
    """The ranks that each model may have, the best first: model, value, best, worst.

    Out of a table that compares every pair of its models as a whole; empty for any other.
    """
    whole = table[table["part"] == table["part"].iloc[-1]] if len(table) else table
    names = list(dict.fromkeys([*whole["a"], *whole["b"]]))
    columns = ["model", "value", "best", "worst"]
    n = len(names)
    if len(whole) != n * (n - 1) // 2 or whole["p"].isna().any():
        return pd.DataFrame(columns=columns)
    is_better = np.zeros((n, n), dtype=bool)
    values: dict[str, float] = {}
    for row in whole.to_dict("records"):
        a, b = names.index(row["a"]), names.index(row["b"])
        a_is_better = (row["difference"] > 0) == (measure.better == "higher")
        is_better[(a, b) if a_is_better else (b, a)] = row["p_holm"] < _LEVEL
        values |= {row["a"]: row["value_a"], row["b"]: row["value_b"]}
    ranges = rank_ranges(is_better)
    rows = [(name, values[name], *ranges[place]) for place, name in enumerate(names)]
    table = pd.DataFrame(rows, columns=columns)
    is_ascending = measure.better == "lower"
    return table.sort_values("value", ascending=is_ascending, ignore_index=True, kind="stable")
