"""The ranks that models may have, over runs, by tests of every pair on the samples both have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

from phyblock.results.compare import Side, comparable, compare, ranks
from phyblock.site.entries import Entry
from phyblock.site.runs import SiteRun
from phyblock.site.values import AllValues

__all__ = ["rank_ranges_of"]


def rank_ranges_of(
    track: str, entries: Sequence[Entry], runs: Sequence[SiteRun], values: AllValues
) -> Mapping[str, tuple[int, int]]:
    """Best and worst rank of entries in a track, by name, Holm-corrected over all pairs.

    `entries` are those with a value in it. Only models have ranks, of which no sample was left out;
    {} where there are not two. A pair without a sample in common is not told apart. Raises
    SpecError for runs that cannot be compared.
    """
    sides = [
        Side(entry.name, entry.model.name, runs[entry.runs[track]].run)
        for entry in entries
        if not entry.model.is_baseline and values[entry.runs[track], track].is_whole(entry.model)
    ]
    if len(sides) < 2:
        return {}
    what = comparable(sides[0].run, track)
    table = compare(list(combinations(sides, 2)), what.parts[-1:], what).table
    known = table.assign(p=table["p"].fillna(1.0), p_holm=table["p_holm"].fillna(1.0))
    found = ranks(known, what.measure)
    rows = found.to_dict("records")
    return {str(row["model"]): (int(row["best"]), int(row["worst"])) for row in rows}
