"""What the models of a run are worth in a track: headline values, single samples, costs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from phyblock.records.manifest import ManifestModel
from phyblock.results.compare import Comparable, comparable
from phyblock.results.estimates import (
    Value,
    headline_columns,
    headline_of,
    track_estimates,
)
from phyblock.results.load import Run
from phyblock.results.tables import cost_frame, coverage_frame
from phyblock.tracks.measures import Measure

__all__ = ["AllValues", "Facts", "Key", "TrackValues", "values_of"]

Key = tuple[str, str, int, str]
"""A sample of one model: scene, item, seed, variant."""


@dataclass(frozen=True, kw_only=True)
class Facts:
    """What a model's samples of a track took and came to; None where it is not known.

    `solved` samples are worth all that a sample can be; None where a sample may always be worth
    more. Costs [US dollars] are at the prices of the replies, cached ones included. `asked` are the
    first and the last day, UTC, on which the run got a reply that it had asked for itself, one of
    recordings and of cached replies being unknown; `cached` counts the latter.
    """

    expected: int
    done: int
    failed: int
    solved: int | None
    prompt_tokens: float | None
    completion_tokens: float | None
    latency_s: float | None
    usd_per_100: float | None
    usd_per_solved: float | None
    asked: tuple[str, str] | None
    cached: int


@dataclass(frozen=True, eq=False)
class TrackValues:
    """A track of a run: `values` by setting, model and heading; `samples` what each sample is worth
    by the main measure, in its unit, by model and `Key`, without those that have no value; `facts`
    by model.

    Settings are those of the run, or "" alone where the track knows none.
    """

    values: Mapping[str, Mapping[tuple[str, str], Value]]
    samples: Mapping[str, Mapping[Key, float]]
    facts: Mapping[str, Facts] = field(default_factory=dict)

    def is_whole(self, model: ManifestModel) -> bool:
        """Whether no sample of a model was left out."""
        facts = self.facts[model.name]
        return facts.done == facts.expected


AllValues = Mapping[tuple[int, str], TrackValues]
"""By number of the run, and track."""


def values_of(run: Run, track: str) -> TrackValues:
    """All values of a track."""
    what = comparable(run, track)
    samples = {model: dict(pairs) for model, pairs in _samples(run, what)}
    return TrackValues(
        dict(_values(run, track)), samples, _facts(run, track, samples, what.measure)
    )


def _values(run: Run, track: str) -> Iterator[tuple[str, Mapping[tuple[str, str], Value]]]:
    estimates, design = track_estimates(run, track), run.design
    columns = headline_columns(run, track)
    shown = estimates[estimates["measure"].isin([column.measure for column in columns])]
    if not shown["setting"].astype(bool).any():
        yield "", headline_of(run, track)
        return
    for setting in design.suite.settings:
        suite = design.suite.model_copy(update={"settings": (setting,)})
        in_setting = design.model_copy(update={"suite": suite})
        yield setting, headline_of(run, track, in_setting)


def _samples(run: Run, what: Comparable) -> Iterator[tuple[str, Iterator[tuple[Key, float]]]]:
    for model, values in what.values(run, what.parts[-1], run.design):
        yield model, zip(values.index, values.tolist(), strict=True)


def _facts(
    run: Run, track: str, samples: Mapping[str, Mapping[Key, float]], measure: Measure
) -> dict[str, Facts]:
    costs = cost_frame(run)
    of_model = costs[costs["track"] == track].set_index("model").to_dict("index")
    outcomes = coverage_frame(run)
    outcomes = outcomes[outcomes["track"] == track].set_index("model")
    days = _days_asked(run, track)
    facts = {}
    for model, row in outcomes.to_dict("index").items():
        cost = of_model[model]
        solved = _solved(samples.get(str(model), {}).values(), measure.best)
        price = _known(cost["cost_per_100_usd"])
        whole = None if price is None else price / 100 * int(row["replies"])
        facts[str(model)] = Facts(
            expected=int(row["expected"]),
            done=int(row["recorded"]),
            failed=int(row["recorded"] - row["ok"]),
            solved=solved,
            prompt_tokens=_known(cost["prompt_tokens"]),
            completion_tokens=_known(cost["completion_tokens"]),
            latency_s=_known(cost["latency_median_s"]),
            usd_per_100=price,
            usd_per_solved=whole / solved if whole is not None and solved else None,
            asked=days.get(str(model)),
            cached=int(row["cached"]),
        )
    return facts


def _solved(values: Iterable[float], best: float) -> int | None:
    return None if math.isnan(best) else sum(value == best for value in values)


def _days_asked(run: Run, track: str) -> dict[str, tuple[str, str]]:
    """By model, the first and the last day of replies for which a request was sent."""
    records = run.records[run.records["track"] == track]
    sent = records["attempts"].fillna(0).astype("int64") > 0
    times = records.loc[sent & records["time"].notna(), ["model", "time"]]
    return {
        str(model): (min(of_model)[:10], max(of_model)[:10])
        for model, of_model in times.groupby("model")["time"]
    }


def _known(number: float) -> float | None:
    return None if math.isnan(number) else float(number)
