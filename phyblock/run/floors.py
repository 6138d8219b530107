"""What answers reach that never see the goal: worked out for the scenes of a run, without a call.

A track whose replies can be read again without a model (`rescored`) is answered here by the rules
of its own baselines. What they reach stands in `run.yaml`, so that tables need nothing but the
run.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from phyblock.config.suite import Suite
from phyblock.records.manifest import MANIFEST, Manifest, ManifestModel
from phyblock.records.record import Record
from phyblock.records.reply import Reply
from phyblock.results.design import read_design
from phyblock.results.estimates import counted_samples, estimate_frame, track_measures
from phyblock.results.load import Run, frames_of
from phyblock.run.floor_orders import floor_orders, floor_seeds
from phyblock.run.records import begun, judged
from phyblock.tracks import AnyTrack, SingleTrack, kind_of, shown_item
from phyblock.tracks.measures import VALUE_KEY, Better, value_key

__all__ = ["COMPUTED_FLOORS", "FloorValues", "floor_values"]

COMPUTED_FLOORS = ("goal-blind", "all-candidates")
"""Those that leave nothing to chance; `random` stays below them."""
FloorValues = dict[str, dict[str, dict[str, float]]]
"""Values by track, floor and `value_key`."""


def floor_values(
    manifest: Manifest,
    suite: Suite,
    reopened: Callable[[str, Suite], AnyTrack],
) -> FloorValues:
    """What the floors of `COMPUTED_FLOORS` reach on a run, for every measure that names them.

    `reopened` opens a track under a suite, without prompts. Floors learn under each setting of
    the suite; the best value counts. Where the order of the candidates varies they answer in each
    order, and are pooled over orders as the values of models are.
    """
    found: FloorValues = {}
    for name in suite.tracks:
        named = {floor for measure in track_measures(name) for floor in measure.floors}
        floors = [floor for floor in COMPUTED_FLOORS if floor in named]
        if not kind_of(name).rescored or not floors:
            continue
        found[name] = {floor: {} for floor in floors}
        for setting in suite.settings:
            # What is learned goes by the first setting; what scores best in B may be either.
            others = (other for other in suite.settings if other != setting)
            one = suite.model_copy(update={"settings": (setting, *others)})
            records = [
                record
                for order, copies in floor_orders(one)
                for record in _answered(reopened(name, order), floors, order, copies)
            ]
            for floor, key, value, better in _estimates(manifest, name, floors, records):
                best = max if better == "higher" else min
                found[name][floor][key] = best(value, found[name][floor].get(key, value))
    return found


def _answered(
    track: AnyTrack, floors: Sequence[str], suite: Suite, copies: int
) -> Iterator[Record]:
    """The judged answers of floors, each so many times."""
    assert isinstance(track, SingleTrack)
    rules = kind_of(track.name).baselines
    order = suite.candidates.order
    for item in track.items:
        for seed in floor_seeds(suite):
            shown = shown_item(track, item, seed)
            ((request, _),) = track.outlines(shown)
            for floor in floors:
                text = rules[floor](request.subject, np.random.default_rng(seed))
                sample = f"{track.name}/{floor}/{item.key}/s{seed}/{order}"
                fields = begun(
                    sample, track.name, floor, shown, seed, Reply(text=text, cost_usd=0.0)
                )
                record = judged({**fields, **track.about(shown)}, shown, track.judge(shown, text))
                yield from (
                    record.model_copy(update={"sample": f"{sample}/{n}"}) for n in range(copies)
                )


def _estimates(
    manifest: Manifest, track: str, floors: Sequence[str], records: Sequence[Record]
) -> Iterator[tuple[str, str, float, Better]]:
    """Floor, `value_key`, value and which values are better, of measures that name floors."""
    models = tuple(ManifestModel(name=floor) for floor in floors)
    facts = manifest.model_copy(update={"models": models})
    design = read_design(facts.fields())
    run = Run(Path(MANIFEST), facts, design, *frames_of(records, design, texts=False))
    measures = [measure for measure in track_measures(track) if measure.floors]
    better = {measure.name: measure.better for measure in measures}
    counts = partial(counted_samples, run, track)
    rows = estimate_frame(run, measures, kind_of(track).report().cells(run), counts)
    for row in rows[["model", *VALUE_KEY, "value"]].to_dict("records"):
        if not math.isnan(row["value"]):
            value = float(row["value"])
            yield str(row["model"]), value_key(row), value, better[row["measure"]]
