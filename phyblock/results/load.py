"""A run as data frames: its design, one row per sample, and the counts behind measures."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phyblock.config.suite import Suite
from phyblock.errors import Problem, SpecError
from phyblock.records import files
from phyblock.records.files import Manifest, ManifestModel
from phyblock.records.record import Record
from phyblock.registry import added_measures
from phyblock.tracks.base import kind_of
from phyblock.tracks.measures import SCORED_BY, Cell, Measure, SampleCounts
from phyblock.types import WITHOUT_REPLY

if TYPE_CHECKING:
    import pandas as pd

    from phyblock.results.compare import Comparison

TOKENS = ("prompt_tokens", "completion_tokens", "reasoning_tokens")
"""Columns that count tokens."""
_OF_RECORD = {
    **dict.fromkeys(("sample", "track", "model", "scene", "item", "group", "part"), "object"),
    **dict.fromkeys(("levels", "parents"), "object"),
    **{"n_blocks": "Int64", "seed": "int64", "outcome": "object"},
}
_OF_REPLY = {
    **{"finish": "object", "cost_usd": "float64", "latency_s": "float64"},
    **{"attempts": "Int64", "cached": "boolean", "seed_sent": "boolean"},
}
_OF_ERROR = {"kind": "object", "status": "Int64", "message": "object"}
_TYPES = {
    **_OF_RECORD,
    "variant": "object",
    **_OF_REPLY,
    **dict.fromkeys(TOKENS, "Int64"),
    "paid_usd": "float64",
    **{f"error_{name}": kind for name, kind in _OF_ERROR.items()},
    **{"rule": "object", "start": "int64"},
}
"""Columns of `Run.records` with their types; `start` is the offset in `records.jsonl` [bytes]."""


def track_measures(track: str) -> tuple[Measure, ...]:
    """Return a track's measures, then those of plugins. Raises ValueError for repeated names."""
    measures = (*kind_of(track).report().measures, *added_measures(track))
    for named in (measures, {measure.counted for measure in measures}):
        names = [one.name for one in named]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"two measures or counts of {track} are called {', '.join(twice)}")
    return measures


def frames_of(
    records: Iterable[tuple[Record, int]], design: Design
) -> tuple[pd.DataFrame, dict[tuple[str, str], pd.DataFrame]]:
    """Return `Run.records` and `Run.counts` from records with their offsets [bytes].

    Only the newest record of a sample counts. Order and types do not depend on the file.
    """
    import pandas as pd

    found: list[tuple[Any, ...]] = []
    numbers: dict[tuple[str, str], list[tuple[Any, ...]]] = {}
    taken: dict[str, list[SampleCounts]] = {}
    named: dict[tuple[str, str], Sequence[str]] = {}
    for owner, (record, start) in enumerate(records):
        found.append(_row(record, start))
        track = record.track
        if track not in taken:
            known = dict.fromkeys(measure.counted for measure in track_measures(track))
            taken[track] = [counted for counted in known if counted.sample is None]
            named |= {(track, counted.name): counted.columns for counted in known}
        for counted in taken[track]:
            rows = numbers.setdefault((track, counted.name), [])
            rows += [(owner, *way, *of_way) for way, of_way in counted.of(record)]
        for name, kept in record.counts.items():
            if kept:
                numbers.setdefault((track, name), []).append((owner, "", "", "", *kept))
    frame = pd.DataFrame(found, columns=list(_TYPES)).astype(_TYPES)
    place = {name: n for n, name in enumerate(design.model_names)}
    frame = frame.drop_duplicates("sample", keep="last")
    frame["place"] = [place.get(name, len(place)) for name in frame["model"]]
    frame = frame.sort_values(["track", "place", "model", "scene", "seed", "sample"])
    # Replaced records have no row.
    row_of = pd.Series(range(len(frame)), index=frame.index)
    counts = {}
    for key, rows in ((key, rows) for key, rows in numbers.items() if rows):
        names = enumerate(("row", *SCORED_BY, *named.get(key, ())))
        held = pd.DataFrame(rows).rename(columns=dict(names))
        held["row"] = held["row"].map(row_of)
        held = held.dropna(subset="row").astype({"row": "intp"})
        counts[key] = held.sort_values("row", kind="stable", ignore_index=True)
    return frame.drop(columns="place").reset_index(drop=True), counts


def _row(record: Record, start: int) -> tuple[Any, ...]:
    """Return a row of `Run.records`, in the order of `_TYPES`."""
    reply, error, parse = record.reply, record.error, record.parse
    rule = parse.get("rule") if isinstance(parse, dict) else getattr(parse, "rule", None)
    return (
        *(getattr(record, name) for name in _OF_RECORD),
        record.way.key,
        *(getattr(reply, name, None) for name in _OF_REPLY),
        *(getattr(reply and reply.usage, name, None) for name in TOKENS),
        reply and record.paid_usd,
        *(getattr(error, name, None) for name in _OF_ERROR),
        None if rule is None else str(rule),
        start,
    )


@dataclass(frozen=True)
class Design:
    """The plan of a run from its `run.yaml`, which determines the rows and columns of tables.

    `items` has their number by track. The suite's first matcher and setting are the headline's.
    """

    suite: Suite
    models: tuple[ManifestModel, ...]
    items: Mapping[str, int]
    scenes: int

    @property
    def model_names(self) -> tuple[str, ...]:
        """Names of the models in the order of the suite."""
        return tuple(model.name for model in self.models)

    @property
    def baselines(self) -> frozenset[str]:
        """Names of the models that are baselines."""
        return frozenset(model.name for model in self.models if model.is_baseline)

    @property
    def of_suite(self) -> str:
        """The end of captions, `, suite NAME`; "" if the suite has no name."""
        return f", suite {self.suite.name}" if self.suite.name else ""

    def samples(self, track: str) -> int:
        """Number of samples of one model in a track of a complete run."""
        return self.items.get(track, 0) * len(self.suite.seeds) * len(self.suite.vary.variants)

    @property
    def all_samples(self) -> int:
        """Number of samples of a complete run."""
        return len(self.models) * sum(self.samples(track) for track in self.suite.tracks)

    @property
    def matcher(self) -> str:
        """The headline matcher."""
        return self.suite.scoring.matchers[0]

    @property
    def setting(self) -> str:
        """The headline setting."""
        return self.suite.settings[0]

    @property
    def outcomes_left_out(self) -> frozenset[str]:
        """Outcomes that the policy on missing replies excludes from scores."""
        return frozenset(WITHOUT_REPLY) if self.suite.scoring.missing == "skip" else frozenset()


def design_of(manifest: Manifest, where: str = files.MANIFEST) -> Design:
    """Return the design of a run. Raises StoreError naming `where` and every wrong field."""
    return Design(files.suite_of(manifest, where), manifest.models, manifest.items, manifest.scenes)


@dataclass(frozen=True, eq=False)
class Run:
    """A loaded run folder: `manifest` is its `run.yaml`, `design` the plan in it.

    `records` has one row per sample: track, model, scene, levels, parents, n_blocks, seed, outcome,
    tokens, cost_usd, latency_s and so on, and the error. `counts` are those of its measures, by
    track and name: the row in `records`, the columns of `SCORED_BY`, and the numbers. `is_cut` is
    true if a kill cut off the last line, which is then ignored. `made` caches frames.
    """

    path: Path
    manifest: Manifest = field(repr=False)
    design: Design = field(repr=False)
    records: pd.DataFrame = field(repr=False)
    counts: Mapping[tuple[str, str], pd.DataFrame] = field(repr=False)
    is_cut: bool = False
    made: dict[str, pd.DataFrame] = field(default_factory=dict, repr=False, init=False)

    @property
    def estimates(self) -> pd.DataFrame:
        """Every value with its 95 % interval, by track, measure, way of counting, model and cell.

        Shares are in [0, 1]. The frame is a copy.
        """
        import pandas as pd

        from phyblock.results.estimates import ESTIMATE_COLUMNS, track_estimates

        tracks = self.design.suite.tracks
        parts = [track_estimates(self, track).assign(track=track) for track in tracks]
        columns = ["track", *ESTIMATE_COLUMNS]
        known = [part for part in parts if len(part)] or [pd.DataFrame(columns=columns)]
        return pd.concat(known, ignore_index=True)[columns]

    def summary(self) -> pd.DataFrame:
        """Return one row per model: the headline of each track with the ends of its interval.

        Columns are the short name of a track, or its name, and the same with `_lo` and `_hi`.
        """
        import pandas as pd

        from phyblock.results.estimates import Headline

        table = pd.DataFrame(index=pd.Index(self.design.model_names, name="model"))
        for track in self.design.suite.tracks:
            short, values = kind_of(track).report().short or track, Headline(self, track).ranked
            for end, name in {"value": short, "lo": f"{short}_lo", "hi": f"{short}_hi"}.items():
                table[name] = [getattr(values.get(model), end, np.nan) for model in table.index]
        return table

    def _repr_html_(self) -> str:
        """Show the summary in a notebook."""
        return str(self.summary().to_html(float_format="{:.1f}".format))

    def table(self, name: str) -> pd.DataFrame:
        """Return the numbers of a table by name. Raises KeyError if the run has no such table."""
        from phyblock.results.tables import make_tables

        frame: pd.DataFrame = make_tables(self, [name])[name].frame
        return frame

    def compare(
        self,
        other: Run | None = None,
        models: Sequence[str] = (),
        track: str = "",
        measure: str = "",
    ) -> Comparison:
        """Compare the models of this run with one another, or with those of `other`.

        Raises SpecError for unknown names or runs that cannot be compared.
        """
        from phyblock.results.compare import compare

        return compare(self, other, models, track, measure)

    def cells(self, track: str) -> tuple[Cell, ...]:
        """Return the cells of a track, the last of which is the whole."""
        return kind_of(track).report().cells(self.design.suite, self.manifest)

    def presentation(self, track: str) -> tuple[str, ...]:
        """Return the unusual features of a track's presentation, as words for captions."""
        suite, kind = self.design.suite, kind_of(track)
        held = self.manifest.suite.get(kind.section) or {}
        is_one_order = "candidate_order" in {*kind.varies} - {*suite.vary.factors}
        words = ["candidates shuffled"] * (is_one_order and suite.candidates.order == "shuffled")
        words += [name for name in ("circular", "blind") if held.get(name)]
        words += ["answers asked for as JSON"] * (suite.answer_format == "json_schema")
        n = len(suite.vary.variants)
        return (*words, *([f"asked in {n:,} ways"] if n > 1 else []))


def load_run(path: str | Path) -> Run:
    """Read a run folder.

    Raises StoreError for a folder that is not a run, a broken `run.yaml`, or a line of
    `records.jsonl` that is corrupt, other than an unfinished last one, or belongs to another run.
    """
    folder = Path(path)
    manifest = files.read_manifest(folder)
    design = design_of(manifest, str(folder / files.MANIFEST))
    lines = files.run_records(folder, manifest)
    frames = frames_of(((record, lines.start_bytes) for _, record in lines), design)
    return Run(folder, manifest, design, *frames, lines.is_cut)


def checked_models(run: Run, models: Sequence[str]) -> Sequence[str]:
    """Return the named models, or all. Raises SpecError for an unknown or repeated name."""
    known = run.design.model_names
    if unknown := [name for name in models if name not in known]:
        where, found, allowed = str(run.path), ", ".join(unknown), ", ".join(known)
        is_kept = any(other.name in unknown for other in run.manifest.others)
        hint = "the run holds it, but was last continued without it: name it there" * is_kept
        raise SpecError(Problem(where, "has no such model", "--models", found, allowed, hint))
    if twice := [name for name in dict.fromkeys(models) if models.count(name) > 1]:
        problem = Problem(str(run.path), "is given a model twice", "--models", ", ".join(twice))
        raise SpecError(problem)
    return models or known
