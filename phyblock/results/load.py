"""A run as data frames: its design, one row a sample, one row a score."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from phyblock.config.suite import Suite
from phyblock.errors import Problem, SpecError
from phyblock.records.files import record_types, run_records
from phyblock.records.manifest import MANIFEST, Manifest, ManifestModel, read_manifest, suite_of
from phyblock.records.record import Record, Score
from phyblock.results.text import level_name
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES
from phyblock.tracks.measures import Cell
from phyblock.types import WITHOUT_REPLY

if TYPE_CHECKING:
    from phyblock.results.compare import Comparison

OVERALL = "overall"
"""Name of the row that pools the scenes of all levels."""
TOKENS = ("prompt_tokens", "completion_tokens", "reasoning_tokens")
"""Columns that count tokens."""
_OF_RECORD = {
    **dict.fromkeys(("sample", "track", "model", "scene", "item"), "object"),
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
"""Columns that records of all tracks have; each track adds its own. `start` is where the record
begins in `records.jsonl` [bytes]."""
_LABELS = ("criterion", "matcher", "setting")
_BLOCKS = tuple(f"blocks_{name}" for name in BLOCK_OUTCOMES)
_COUNTS = ("tp", "fp", "fn", *ERROR_TYPES, *_BLOCKS, *Score.FURTHER)


class _Reader:
    """The columns of a run while its records are read."""

    def __init__(self) -> None:
        self._types = dict(_TYPES)
        for kind in record_types():
            self._types.update(kind.columns)
        self._columns: dict[str, list[Any]] = {name: [] for name in self._types}
        self._shared: dict[Any, Any] = {}
        self._owners, self._labels, self._counts = array("i"), array("i"), array("f")
        self._numbers: dict[str, tuple[array[int], array[int], array[float]]] = {}

    def add(self, record: Record, start: int) -> None:
        """Take in a record, which begins at `start` [bytes]."""
        row = len(self._columns["sample"])
        reply, error, parse = record.reply, record.error, record.parse
        rule = parse.get("rule") if isinstance(parse, dict) else getattr(parse, "rule", None)
        values = {
            **{name: getattr(record, name) for name in _OF_RECORD},
            "variant": record.way.key,
            **{name: getattr(reply, name, None) for name in _OF_REPLY},
            **{name: getattr(reply and reply.usage, name, None) for name in TOKENS},
            "paid_usd": reply and record.paid_usd,
            **{f"error_{name}": getattr(error, name, None) for name in _OF_ERROR},
            "rule": None if rule is None else str(rule),
            "start": start,
            **record.row(),
        }
        for name, column in self._columns.items():
            value = values.get(name)
            is_shared = isinstance(value, (str, tuple)) and name != "sample"
            column.append(self._shared.setdefault(value, value) if is_shared else value)
        for score in record.scores:
            errors: Mapping[Any, float] = score.errors or {}
            blocks: Mapping[Any, float] = score.blocks or {}
            labels = (score.criterion, score.matcher or "", score.setting)
            self._owners.append(row)
            self._labels.append(self._shared.setdefault(("labels", labels), len(self._shared)))
            counts: list[float] = [score.tp, score.fp, score.fn]
            counts += [errors.get(name, np.nan) for name in ERROR_TYPES]
            counts += [blocks.get(name, np.nan) for name in BLOCK_OUTCOMES]
            self._counts.extend([*counts, np.nan if score.kept is None else score.kept])
        for name, numbers in record.counts.items():
            empty = (array("i"), array("i"), array("d"))
            owners, lengths, held = self._numbers.setdefault(name, empty)
            owners.append(row)
            lengths.append(len(numbers))
            held.extend(numbers)

    def frames(self, models: Sequence[str]) -> tuple[pd.DataFrame, pd.DataFrame, Stored]:
        """Return `records`, `scores` and `counts` of a run; call it once.

        The newest record of a sample stands for it. Order and types do not depend on the file.
        """
        place = {name: n for n, name in enumerate(models)}
        newest = {sample: row for row, sample in enumerate(self._columns["sample"])}
        names = ("track", "model", "scene", "seed", "sample")
        track, model, scene, seed, sample = (self._columns[name] for name in names)
        order = sorted(
            newest.values(),
            key=lambda n: (track[n], place.get(model[n], len(place)), model[n], scene[n], seed[n],
                           sample[n]),
        )  # fmt: skip
        rows = np.full(len(sample), -1, dtype=np.int32)
        rows[order] = np.arange(len(order))
        columns = {}
        for name, kind in self._types.items():
            held, values = self._columns.pop(name), np.empty(len(order), dtype=object)
            values[:] = [held[n] for n in order]
            columns[name] = pd.Series(values, dtype=kind, copy=False)
        owners, kept = _placed(rows, self._owners)
        counts = (
            np.frombuffer(self._counts, np.float32) if self._counts else np.zeros(0, np.float32)
        )
        scores = pd.DataFrame(counts.reshape(-1, len(_COUNTS))[kept], columns=list(_COUNTS))
        codes = np.asarray(self._labels, dtype=np.intp)[kept]
        known = {code: key[1] for key, code in self._shared.items() if key[:1] == ("labels",)}
        used, codes = np.unique(codes, return_inverse=True)
        for n, name in enumerate(_LABELS):
            label = [known[number][n] for number in used.tolist()]
            categories = pd.Index(sorted(set(label)), dtype="object")
            own = categories.get_indexer(pd.Index(label))[codes.reshape(-1)]
            labels = pd.Categorical.from_codes(own.tolist(), categories)
            scores.insert(n, name, pd.Series(labels))
        scores.insert(0, "row", owners)
        stored = {}
        for name, (of, lengths, numbers) in self._numbers.items():
            stored[name] = (rows[np.asarray(of)], np.asarray(lengths), np.asarray(numbers))
        return pd.DataFrame(columns, copy=False), scores, stored


Stored = Mapping[str, tuple[NDArray[Any], NDArray[Any], NDArray[Any]]]
"""By name of counts: the row of each record that has them (-1: a newer one replaced it), how many
numbers it has, and these, one after another."""


def _placed(rows: NDArray[np.int32], owners: array[int]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the rows of owners that were kept, ascending, and the places where they stand."""
    of = rows[np.asarray(owners, dtype=np.intp)]
    places = np.argsort(of, kind="stable")
    places = places[of[places] >= 0]
    return of[places], places


@dataclass(frozen=True)
class Design:
    """The plan of a run as its `run.yaml` states it: the rows and columns of every table.

    `items` counts what each track asks about. The first matcher and the first setting of the suite
    are the headline.
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
    def published(self) -> dict[str, str]:
        """Names in the paper of the models that it knows; Table 1 need not have a row of it."""
        return {model.name: model.published for model in self.models if model.published}

    @property
    def of_suite(self) -> str:
        """The suite as captions of tables end in it, `, suite NAME`; "" where it has no name."""
        return f", suite {self.suite.name}" if self.suite.name else ""

    def samples(self, track: str) -> int:
        """Samples that a complete run holds of one model in a track."""
        return self.items.get(track, 0) * self.repeats

    @property
    def all_samples(self) -> int:
        """Samples that a complete run holds."""
        return len(self.models) * sum(self.samples(track) for track in self.suite.tracks)

    @property
    def repeats(self) -> int:
        """Number of samples of an item and model: with every seed, in every way."""
        return len(self.suite.seeds) * self.suite.vary.n_variants

    @property
    def levels(self) -> tuple[str, ...]:
        """Level names in ascending order, then `overall`."""
        return (*(str(level) for level in sorted(self.suite.levels)), OVERALL)

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
        """Outcomes whose samples enter no score under the policy on missing replies."""
        return frozenset(WITHOUT_REPLY) if self.suite.scoring.missing == "skip" else frozenset()

    def criterion(self, level: str) -> str:
        """The criterion that scores a level.

        Level 1 has its own. `overall` counts every scene once by `aov`, or by the Level-1
        criterion where no other level was run.
        """
        is_level1 = level == "1" or (level == OVERALL and set(self.suite.levels) == {1})
        return self.suite.scoring.level1 if is_level1 else "aov"


def design_of(manifest: Manifest, where: str = MANIFEST) -> Design:
    """Return the design of a run; StoreError naming `where` and every field that is wrong."""
    return Design(suite_of(manifest, where), manifest.models, manifest.items, manifest.scenes)


@dataclass(frozen=True, eq=False)
class Run:
    """A run folder, read: `manifest` is its `run.yaml`, `design` the plan in it.

    `records` has one row a sample: track, model, scene, levels, parents, n_blocks, seed, outcome,
    tokens, cost_usd, latency_s and so on, and the error. `scores` has one row a sample (the `row`
    of its record), criterion, matcher ("" where a criterion knows none) and setting with the counts
    tp, fp, fn, the four error types, what became of the goal's blocks and the steps that the
    nearest valid order keeps (NaN where there are none). `counts` are those of other measures.
    `is_cut` says that the last line was cut off by a kill and therefore ignored. `made` keeps
    frames that are made once.
    """

    path: Path
    manifest: Manifest = field(repr=False)
    design: Design = field(repr=False)
    records: pd.DataFrame = field(repr=False)
    scores: pd.DataFrame = field(repr=False)
    counts: Stored = field(repr=False)
    is_cut: bool = False
    made: dict[str, pd.DataFrame] = field(default_factory=dict, repr=False, init=False)

    @property
    def estimates(self) -> pd.DataFrame:
        """Every value with its 95 % interval: a row a track, measure, way of counting, model, cell.

        Shares are in [0, 1]. A copy, to be changed freely.
        """
        from phyblock.results.estimates import all_estimates

        return all_estimates(self)

    def summary(self) -> pd.DataFrame:
        """Return one row a model: the headline of each track with the ends of its interval.

        Columns have the short name of a track, or its name, and then `_lo` and `_hi`.
        """
        from phyblock.results.estimates import main_values
        from phyblock.tracks.base import kind_of

        table = pd.DataFrame(index=pd.Index(self.design.model_names, name="model"))
        for track in self.design.suite.tracks:
            short, values = kind_of(track).report().short or track, main_values(self, track)
            for end, name in {"value": short, "lo": f"{short}_lo", "hi": f"{short}_hi"}.items():
                table[name] = [getattr(values.get(model), end, np.nan) for model in table.index]
        return table

    def _repr_html_(self) -> str:
        """Show the summary in a notebook."""
        return str(self.summary().to_html(float_format="{:.1f}".format))

    def table(self, name: str) -> pd.DataFrame:
        """Return the numbers of a table by its name; KeyError for one that the run has not."""
        from phyblock.results.tables import make_tables

        return make_tables(self, [name])[name].frame

    def compare(
        self,
        other: Run | None = None,
        models: Sequence[str] = (),
        track: str = "",
        measure: str = "",
    ) -> Comparison:
        """Compare the models of this run with one another, or with those of `other`.

        Raises SpecError for names that are not there or runs that cannot be compared.
        """
        from phyblock.results.compare import compare_models, compare_runs

        if other is None:
            return compare_models(self, models, track, measure)
        return compare_runs(self, other, models, track, measure)

    def controls(self, section: str) -> tuple[str, ...]:
        """Return, in words for captions, the controls that a section of the suite sets."""
        held = self.manifest.suite.get(section) or {}
        words = {"blind": "blind", "wrong_image": "pictures of another scene"}
        as_json = self.design.suite.answer_format == "json_schema"
        form = ("answers asked for as JSON",) if as_json else ()
        return (*(text for name, text in words.items() if held.get(name)), *form)

    def showing(self, section: str) -> tuple[str, ...]:
        """Return, in words for captions, what is unusual about how scenes were shown."""
        suite = self.design.suite
        varied = "candidate_order" in suite.vary.factors
        is_shuffled = suite.candidates.order == "shuffled" and not varied
        order = ("candidates shuffled",) if is_shuffled else ()
        return (*order, *self.controls(section))

    @property
    def varied_words(self) -> tuple[str, ...]:
        """The number of ways in which each item was asked, in words, where there are several."""
        n = self.design.suite.vary.n_variants
        return (f"asked in {n:,} ways",) if n > 1 else ()

    def counted_rows(self, track: str) -> pd.Index[int]:
        """Return the places in `records` of the samples of a track that count.

        Under `missing: skip`, missing replies and API errors are left out.
        """
        is_left_out = self.records["outcome"].isin(self.design.outcomes_left_out)
        return self.records.index[(self.records["track"] == track) & ~is_left_out]

    def counted(self, track: str) -> pd.DataFrame:
        """Return the records of a track that count, with their places in `records` as `row`."""
        rows = self.counted_rows(track)
        return self.records.loc[rows].assign(row=rows)

    def scored(self, track: str, counts: Sequence[str]) -> pd.DataFrame:
        """Return these counts of the scores of a track's samples that count."""
        rows = self.scores["row"].isin(self.counted_rows(track))
        return self.scores.loc[rows, ["row", *_LABELS, *counts]]

    def level_cells(self) -> tuple[Cell, ...]:
        """Return the levels of the suite as cells, then all scenes together."""
        return tuple(Cell(level, level_name(level)) for level in self.design.levels)

    def in_levels(self, rows: pd.DataFrame) -> dict[str, NDArray[np.bool_]]:
        """Return, by level, which rows of counts enter it: those of its scenes, by its criterion.

        Levels that the suite does not run are left out.
        """
        codes, held = pd.factorize(self.records["levels"].to_numpy())
        codes = codes[self.records.index.get_indexer(pd.Index(rows["row"]))]
        found = {}
        for level in self.design.levels:
            has = np.array([level == OVERALL or int(level) in one for one in held], dtype=bool)
            found[level] = has[codes]
            if "criterion" in rows:
                found[level] &= (rows["criterion"] == self.design.criterion(level)).to_numpy()
        return found


def load_run(path: str | Path) -> Run:
    """Read a run folder.

    Raises StoreError for a folder that is no run, a broken `run.yaml`, or a line of `records.jsonl`
    that is corrupt, other than an unfinished last one, or of another run.
    """
    folder = Path(path)
    manifest = read_manifest(folder)
    design = design_of(manifest, str(folder / MANIFEST))
    lines = run_records(folder, manifest)
    frames = frames_of(((record, lines.start_bytes) for _, record in lines), design)
    return Run(folder, manifest, design, *frames, lines.is_cut)


def frames_of(
    records: Iterable[tuple[Record, int]], design: Design
) -> tuple[pd.DataFrame, pd.DataFrame, Stored]:
    """Return `Run.records`, `scores` and `counts` of records and where they begin [bytes].

    A later record of a sample replaces an earlier one.
    """
    reader = _Reader()
    for record, start in records:
        reader.add(record, start)
    return reader.frames(design.model_names)


def of_models(run: Run, models: Sequence[str]) -> Run:
    """Return the run as if it had these models alone, in its own order; all where none are named.

    Values and intervals of a model stay what they are. Raises SpecError for a model that the run
    has not, or that is named twice.
    """
    if not models:
        return run
    chosen = checked_models(run, models)
    kept = tuple(model for model in run.design.models if model.name in chosen)
    records = run.records[run.records["model"].isin(chosen)]
    scores = run.scores[run.scores["row"].isin(records.index)]
    design = replace(run.design, models=kept)
    return replace(run, design=design, records=records, scores=scores)


def checked_models(run: Run, models: Sequence[str]) -> Sequence[str]:
    """Return the models that are named, all of the run where none are.

    Raises SpecError for one that the run has not, or that is named twice.
    """
    known = run.design.model_names
    if unknown := [name for name in models if name not in known]:
        where, found, allowed = str(run.path), ", ".join(unknown), ", ".join(known)
        raise SpecError(Problem(where, "has no such model", "--models", found, allowed))
    if twice := [name for name in dict.fromkeys(models) if models.count(name) > 1]:
        problem = Problem(str(run.path), "is given a model twice", "--models", ", ".join(twice))
        raise SpecError(problem)
    return models or known
