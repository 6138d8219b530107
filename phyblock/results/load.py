"""A run as data frames: its design, one row a sample, one row a score."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from phyblock.config.suite import Suite
from phyblock.errors import Problem, SpecError
from phyblock.records.files import record_types, run_records
from phyblock.records.manifest import MANIFEST, Manifest, ManifestModel, read_manifest, suite_of
from phyblock.records.record import Record, Score
from phyblock.results.text import level_name
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES
from phyblock.tracks.measures import CELL, Cell
from phyblock.types import WITHOUT_REPLY, Outcome

if TYPE_CHECKING:
    from phyblock.results.compare import Comparison

HEADINGS: dict[Outcome, str] = {
    "ok": "OK",
    "parse_failure": "Unparsed",
    "refusal": "Refusal",
    "truncated": "Truncated",
    "api_error": "API error",
    "missing": "Missing",
}
"""What heads the column of each outcome."""

NOT_RUN = "Not run"
"""What heads numbers of samples that there are not."""


OVERALL = "overall"
"""Name of the row that pools the scenes of all levels."""
BLOCK_COLUMNS = {name: f"blocks_{name}" for name in BLOCK_OUTCOMES}
"""Columns of scores that say what became of the goal's blocks."""
MATCHED = ("tp", "fp", "fn")
"""Columns that count steps and blocks by whether they match."""

_TEXTS = ("text", "reasoning")
"""Columns that may be long."""

_RECORD_TYPES: dict[str, str] = {
    "sample": "object",
    "track": "object",
    "model": "object",
    "scene": "object",
    "item": "object",
    "levels": "object",
    "parents": "object",
    "n_blocks": "Int64",
    "seed": "int64",
    "variant": "object",
    "outcome": "object",
    "text": "object",
    "reasoning": "object",
    "finish": "object",
    "prompt_tokens": "Int64",
    "completion_tokens": "Int64",
    "reasoning_tokens": "Int64",
    "cost_usd": "float64",
    "paid_usd": "float64",
    "latency_s": "float64",
    "provider_model": "object",
    "attempts": "Int64",
    "cached": "boolean",
    "seed_sent": "boolean",
    "error_kind": "object",
    "error_status": "Int64",
    "error_message": "object",
    "template": "object",
    "prompt_version": "object",
    "asked": "object",
    "rule": "object",
    "time": "object",
    "counts": "object",
    "start": "int64",
}
"""Columns that records of all tracks have; each track adds its own. `start` is where the record
begins in `records.jsonl` [bytes].
"""

_SCORE_TYPES: dict[str, str] = {
    "sample": "object",
    "track": "object",
    "model": "object",
    "scene": "object",
    "seed": "int64",
    "variant": "object",
    "outcome": "object",
    "criterion": "object",
    "matcher": "object",
    "setting": "object",
    **dict.fromkeys(MATCHED, "int32"),
    **dict.fromkeys((*ERROR_TYPES, *BLOCK_COLUMNS.values(), *Score.FURTHER), "Int32"),
}

_OF_SAMPLE = ("sample", "track", "model", "scene", "seed", "variant", "outcome")
"""Columns of scores that are those of the record."""
_REPLY = ("finish", "cost_usd", "latency_s", "provider_model", "attempts", "cached", "seed_sent")
TOKENS = ("prompt_tokens", "completion_tokens", "reasoning_tokens")
"""Columns that count tokens."""
_COUNTS = (*MATCHED, *ERROR_TYPES, *BLOCK_COLUMNS.values(), *Score.FURTHER)
_LABELS = ("criterion", "matcher", "setting")
_UNKNOWN = -(2**31)
"""Stands for a count that there is not."""


class Columns:
    """The columns of both frames while records are read; `texts` keeps those of replies."""

    def __init__(self, *, texts: bool = True) -> None:
        self._texts = texts
        self._rows: dict[str, int] = {}
        self._types = dict(_RECORD_TYPES)
        for kind in record_types():
            self._types.update(kind.columns)
        self._records: dict[str, list[Any]] = {name: [] for name in self._types}
        self._first, self._n_scores = array("q"), array("q")
        self._labels: dict[str, list[str]] = {name: [] for name in _LABELS}
        self._counts = {name: array("i") for name in _COUNTS}
        self._shared: dict[Any, Any] = {}

    def add(self, record: Record, start: int = 0) -> None:
        """Take in a record, which begins at `start` [bytes]; it replaces an earlier one."""
        row = self._rows.setdefault(record.sample, len(self._rows))
        # A slice beyond the end appends.
        values = self._flat(record) | {"start": start}
        for name, column in self._records.items():
            column[row : row + 1] = (values.get(name),)
        self._first[row : row + 1] = array("q", (len(self._counts["tp"]),))
        self._n_scores[row : row + 1] = array("q", (len(record.scores),))
        for score in record.scores:
            self._add_score(score)

    def frames(self, place: Callable[[str], int]) -> tuple[pd.DataFrame, pd.DataFrame]:
        """One row a sample, and one a score, by track, `place` of the model, scene and seed.

        Columns and types do not depend on the records. Columns of text stay Python objects, so
        that long replies are never copied. What was read is used up: call it once.
        """
        order = self._order(place)
        columns = {}
        for name, kind in self._types.items():
            column = self._records.pop(name)
            columns[name] = pd.Series(_objects(column)[order], dtype=kind, copy=False)
        records = pd.DataFrame(columns, copy=False)
        return records, self._scores(records, order)

    def _order(self, place: Callable[[str], int]) -> np.ndarray[Any, np.dtype[np.intp]]:
        names = ("track", "model", "scene", "seed", "sample")
        track, model, scene, seed, sample = (self._records[name] for name in names)
        rows = sorted(
            range(len(sample)),
            key=lambda n: (track[n], place(model[n]), model[n], scene[n], seed[n], sample[n]),
        )
        return np.array(rows, dtype=np.intp)

    def _scores(
        self, records: pd.DataFrame, order: np.ndarray[Any, np.dtype[np.intp]]
    ) -> pd.DataFrame:
        lengths = np.array(self._n_scores, dtype=np.intp)[order]
        ends = np.cumsum(lengths)
        shifts = np.array(self._first, dtype=np.intp)[order] - (ends - lengths)
        kept = np.repeat(shifts, lengths) + np.arange(lengths.sum())
        owners = np.repeat(np.arange(len(order)), lengths)
        columns = {}
        for name, kind in _SCORE_TYPES.items():
            if name in _OF_SAMPLE:
                values = records[name].to_numpy()[owners]
            elif name in _LABELS:
                values = _objects(self._labels.pop(name))[kept]
            else:
                values = _counts(self._counts.pop(name), kept, kind)
            columns[name] = pd.Series(values, dtype=kind, copy=False)
        return pd.DataFrame(columns, copy=False)

    def _add_score(self, score: Score) -> None:
        labels = (score.criterion, score.matcher or "", score.setting)
        for column, label in zip(self._labels.values(), labels, strict=True):
            column.append(self._share(label))
        errors, blocks = score.errors or {}, score.blocks or {}
        counts = [score.tp, score.fp, score.fn]
        counts += [errors.get(name, _UNKNOWN) for name in ERROR_TYPES]
        counts += [blocks.get(name, _UNKNOWN) for name in BLOCK_OUTCOMES]
        counts.append(_UNKNOWN if score.kept is None else score.kept)
        for of_name, count in zip(self._counts.values(), counts, strict=True):
            of_name.append(count)

    def _share(self, value: Any) -> Any:
        """The one object that stands for all that equal it."""
        return self._shared.setdefault(value, value)

    def _flat(self, record: Record) -> dict[str, Any]:
        """One row of the records frame."""
        row = _row(record)
        if not self._texts:
            row.update(dict.fromkeys(_TEXTS))
        for name, value in row.items():
            if isinstance(value, (str, tuple)) and name not in _TEXTS:
                row[name] = self._share(value)
        return row


def _row(record: Record) -> dict[str, Any]:
    reply, error, prompt = record.reply, record.error, record.prompt
    return {
        **{name: getattr(record, name) for name in _OF_SAMPLE},
        "variant": record.way.key,
        **{name: getattr(record, name) for name in ("item", "levels", "parents", "n_blocks")},
        **{name: getattr(reply, name, None) for name in (*_TEXTS, *_REPLY)},
        **{name: getattr(reply and reply.usage, name, None) for name in TOKENS},
        "paid_usd": reply and record.paid_usd,
        "error_kind": error and error.kind,
        "error_status": error and error.status,
        "error_message": error and error.message,
        "template": prompt and prompt.template,
        "prompt_version": prompt and prompt.version,
        "asked": record.asked,
        "rule": _rule(record.parse),
        "time": record.time or None,
        "counts": record.counts or None,
        **record.row(),
    }


def _objects(values: Iterable[Any]) -> np.ndarray[Any, Any]:
    """Values as they are, also where they are sequences themselves."""
    objects = list(values)
    made = np.empty(len(objects), dtype=object)
    made[:] = objects
    return made


def _counts(column: array[int], rows: np.ndarray[Any, np.dtype[np.intp]], kind: str) -> Any:
    values = np.frombuffer(column, dtype=np.int32)[rows] if column else np.zeros(0, np.int32)
    return pd.arrays.IntegerArray(values, values == _UNKNOWN) if kind == "Int32" else values


def _rule(parse: Any) -> str | None:
    """The rule that matched, of whatever a track says of its parsing."""
    rule = parse.get("rule") if isinstance(parse, dict) else getattr(parse, "rule", None)
    return None if rule is None else str(rule)


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
        only_level1 = set(self.suite.levels) == {1}
        if level == "1" or (level == OVERALL and only_level1):
            return self.suite.scoring.level1
        return "aov"


def design_of(manifest: Manifest, where: str = MANIFEST) -> Design:
    """Return the design of a run; StoreError naming `where` and every field that is wrong."""
    return Design(suite_of(manifest, where), manifest.models, manifest.items, manifest.scenes)


@dataclass(frozen=True, eq=False)
class Run:
    """A run folder, read: `manifest` is its `run.yaml`, `design` the plan in it.

    `records` has one row a sample: track, model, scene, levels, parents, n_blocks, seed, outcome,
    the reply's text, tokens, cost_usd, latency_s and so on, error, prompt, parsed plan. `scores`
    has one row a sample, criterion, matcher ("" where a criterion knows none) and setting with the
    counts tp, fp, fn, the four error types, what became of the goal's blocks and the steps that
    the nearest valid order keeps (missing where there are none). `is_cut` says that the last line
    was cut off by a kill and therefore ignored. `made` keeps frames that are made once.
    """

    path: Path
    manifest: Manifest = field(repr=False)
    design: Design = field(repr=False)
    records: pd.DataFrame = field(repr=False)
    scores: pd.DataFrame = field(repr=False)
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
        from phyblock.results.estimates import headline_of, main_column
        from phyblock.tracks.base import kind_of

        table = pd.DataFrame(index=pd.Index(self.design.model_names, name="model"))
        for track in self.design.suite.tracks:
            short, main = kind_of(track).report().short or track, main_column(self, track).heading
            values = headline_of(self, track)
            for end, name in {"value": short, "lo": f"{short}_lo", "hi": f"{short}_hi"}.items():
                found = (values.get((model, main)) for model in table.index)
                table[name] = [getattr(value, end, np.nan) for value in found]
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

    def counted(self, rows: pd.DataFrame, track: str) -> pd.DataFrame:
        """Return the rows of a track's samples that count, with whether there was a reply.

        Under `missing: skip`, missing replies and API errors are left out.
        """
        is_left_out = rows["outcome"].isin(self.design.outcomes_left_out)
        kept = rows[(rows["track"] == track) & ~is_left_out]
        return kept.assign(replied=self.replied(kept))

    def replied(self, rows: pd.DataFrame) -> pd.Series[bool]:
        """Return, for each row of samples, whether the model said anything; a refusal does."""
        return ~rows["outcome"].isin(WITHOUT_REPLY)

    def level_cells(self) -> tuple[Cell, ...]:
        """Return the levels of the suite as cells, then all scenes together."""
        return tuple(Cell(level, level_name(level)) for level in self.design.levels)

    def in_levels(self, rows: pd.DataFrame) -> pd.DataFrame:
        """Repeat rows of samples or scores for each of `level_cells` that their scene is in.

        Levels that the suite does not run are left out; the column `CELL` is added.
        """
        places, levels = self._by_level(rows["sample"])
        columns = {str(name): _taken(rows[name], places) for name in rows if name != CELL}
        return pd.DataFrame({**columns, CELL: levels}, copy=False)

    def scored(self, track: str) -> pd.DataFrame:
        """Return the scores of a track that count, by level, each level under its criterion alone.

        The frame is shared: do not change it.
        """
        key = f"scored {track}"
        if key not in self.made:
            scores = self.counted(self.scores, track)
            places, levels = self._by_level(scores["sample"])
            criteria = {level: self.design.criterion(level) for level in self.design.levels}
            wanted = levels.map(criteria).to_numpy()
            kept = scores["criterion"].to_numpy()[places] == wanted
            columns = {str(name): _taken(scores[name], places[kept]) for name in scores}
            cells = pd.Series(levels.to_numpy()[kept], dtype="object", copy=False)
            items = columns["scene"]
            self.made[key] = pd.DataFrame({**columns, CELL: cells, "item": items}, copy=False)
        return self.made[key]

    def _by_level(
        self, samples: pd.Series[str]
    ) -> tuple[np.ndarray[Any, np.dtype[np.intp]], pd.Series[str]]:
        """Places of the rows of these samples, repeated for each level, and the level of each."""
        kinds: dict[tuple[int, ...], int] = {}
        levels_of = self.records["levels"]
        codes = np.array([kinds.setdefault(held, len(kinds)) for held in levels_of], dtype=np.intp)
        wanted = self.design.levels
        named = [[str(level) for level in held if str(level) in wanted] for held in kinds]
        n_named = np.array([len(levels) for levels in named], dtype=np.intp)
        places = pd.Index(self.records["sample"]).get_indexer(samples)
        kind = codes[places] if len(samples) else codes[:0]
        lengths = n_named[kind]
        first = (np.cumsum(n_named) - n_named)[kind] - (np.cumsum(lengths) - lengths)
        labels = np.array([level for levels in named for level in levels], dtype=object)
        everything = np.arange(len(samples))
        repeated = labels[np.repeat(first, lengths) + np.arange(lengths.sum())]
        levels = np.concatenate([repeated, np.full(len(samples), OVERALL, dtype=object)])
        rows = np.concatenate([np.repeat(everything, lengths), everything])
        return rows, pd.Series(levels, dtype="object", copy=False)


def _taken(column: pd.Series[Any], rows: np.ndarray[Any, np.dtype[np.intp]]) -> pd.Series[Any]:
    """Return rows of a column, in a frame's order, of the same type."""
    return pd.Series(column.array.take(rows), dtype=column.dtype, copy=False)


def load_run(path: str | Path, *, texts: bool = True) -> Run:
    """Read a run folder; without `texts` the replies' texts are left on disk.

    Raises StoreError for a folder that is no run, a broken `run.yaml`, or a line of `records.jsonl`
    that is corrupt, other than an unfinished last one, or of another run.
    """
    folder = Path(path)
    manifest = read_manifest(folder)
    design = design_of(manifest, str(folder / MANIFEST))
    lines = run_records(folder, manifest)
    records = ((record, lines.start_bytes) for _, record in lines)
    return Run(folder, manifest, design, *frames_of(records, design, texts=texts), lines.is_cut)


def frames_of(
    records: Iterable[tuple[Record, int]], design: Design, *, texts: bool = True
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return `Run.records` and `Run.scores` of records and where they begin [bytes].

    A later record of a sample replaces an earlier one.
    """
    columns = Columns(texts=texts)
    for record, start in records:
        columns.add(record, start)
    order = {name: place for place, name in enumerate(design.model_names)}
    return columns.frames(lambda model: order.get(model, len(order)))


def of_models(run: Run, models: Sequence[str]) -> Run:
    """Return the run as if it had these models alone, in its own order; all where none are named.

    Values and intervals of a model stay what they are. Raises SpecError for a model that the run
    has not, or that is named twice.
    """
    if not models:
        return run
    chosen = checked_models(run, models)
    kept = tuple(model for model in run.design.models if model.name in chosen)
    return replace(
        run,
        design=replace(run.design, models=kept),
        records=run.records[run.records["model"].isin(chosen)],
        scores=run.scores[run.scores["model"].isin(chosen)],
    )


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
