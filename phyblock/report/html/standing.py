"""What a run is not: what is not done, what failed and why, what was limited."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import pandas as pd

from phyblock.records.files import read_stopped
from phyblock.results.design import WITHOUT_REPLY
from phyblock.results.load import Run
from phyblock.results.tables import coverage_frame
from phyblock.tracks.kind import kind_of

__all__ = ["cautions", "samples_done", "shortfalls"]

_MOST_NAMED = 6
_MOST_CHARACTERS = 160


def samples_done(run: Run) -> str:
    """How many samples are answered, of how many where these are not all."""
    table = coverage_frame(run)
    answered = int(table["recorded"].sum() - table[list(WITHOUT_REPLY)].sum().sum())
    expected = int(table["expected"].sum())
    return f"{answered:,}" if answered == expected else f"{answered:,} of {expected:,}"


def cautions(run: Run) -> tuple[str, ...]:
    """What a reader must know before any number, the gravest first; () for a run that is whole."""
    table = coverage_frame(run)
    expected, recorded = int(table["expected"].sum()), int(table["recorded"].sum())
    said = [*_unanswered(run, table)]
    if recorded < expected:
        said.insert(
            0, f"This run is not finished: {recorded:,} of {expected:,} samples have a record."
        )
    if reason := read_stopped(run.path).run:
        said.append(f"The last session was stopped: {_short(reason)}.")
    if run.is_cut:
        said.append("The last line of records.jsonl was cut off and is ignored.")
    return (*said, *_limits(run))


def shortfalls(run: Run, track: str) -> Mapping[str, str]:
    """By model that lacks replies in a track, how many it has and why it has no more."""
    table = coverage_frame(run)
    reasons, stopped = _reasons(run, track), read_stopped(run.path).models
    found = {}
    for row in table[table["track"] == track].to_dict("records"):
        answered = row["recorded"] - sum(row[name] for name in WITHOUT_REPLY)
        if answered < row["expected"]:
            failed = reasons.get(row["model"])
            why = _short(stopped[row["model"]]) if row["model"] in stopped else failed and failed[0]
            ending = f": {why}" if why else ""
            found[str(row["model"])] = f"{answered:,} of {row['expected']:,} answered{ending}"
    return found


def _unanswered(run: Run, table: pd.DataFrame) -> list[str]:
    """Sentences on models that lack replies: those without any first."""
    said: dict[str, tuple[float, str]] = {}
    reasons, stopped = _reasons(run), read_stopped(run.path).models
    counted = "left out of its values" if run.design.outcomes_left_out else "counted as wrong"
    for model, rows in table.groupby("model", sort=False):
        expected, failed = int(rows["expected"].sum()), int(rows["api_error"].sum())
        missing, not_run = int(rows["missing"].sum()), int(rows["not_run"].sum())
        answered = expected - failed - missing - not_run
        if answered == expected:
            continue
        parts = [
            *([f"stopped ({_short(stopped[str(model)])})"] if model in stopped else []),
            *([_failed(failed, answered, reasons.get(str(model)))] if failed else []),
            *([f"{missing:,} of {expected:,} replies are missing, {counted}"] if missing else []),
            *([f"{not_run:,} of {expected:,} samples were not asked"] if not_run else []),
        ]
        said[str(model)] = answered / expected, f"{model}: {'; '.join(parts)}."
    ordered = [text for _, text in sorted(said.values(), key=lambda found: found[0])]
    rest = len(ordered) - _MOST_NAMED
    more = f"And {rest} more models lack replies: see the table of coverage."
    return [*ordered[:_MOST_NAMED], *([more] if rest > 0 else [])]


def _failed(failed: int, answered: int, why: tuple[str, int] | None) -> str:
    many = f"all {failed:,} calls failed" if not answered else f"{failed:,} calls failed"
    if failed == 1:
        many = "the one call failed" if not answered else "1 call failed"
    if why is None:
        return many
    reason, times = why
    return f"{many} ({reason}{'' if times == failed else f', {times:,} times'})"


def _reasons(run: Run, track: str = "") -> Mapping[str, tuple[str, int]]:
    """By model, the most frequent reason of failed calls, and how often it was given."""
    rows = run.records.dropna(subset=["error_kind"])
    rows = rows[rows["track"] == track] if track else rows
    counted: dict[str, Counter[str]] = {}
    for row in rows[["model", "error_kind", "error_status", "error_message"]].to_dict("records"):
        status = row["error_status"]
        message = " ".join(str(row["error_message"] or row["error_kind"]).split())
        if not pd.isna(status) and str(status) not in message:
            message = f"HTTP {status}: {message}"
        counted.setdefault(str(row["model"]), Counter())[_short(message)] += 1
    return {model: reasons.most_common(1)[0] for model, reasons in counted.items()}


def _short(message: str) -> str:
    """In one line that is no paragraph, without the stop at its end."""
    text = " ".join(message.split()).rstrip(".")
    return text if len(text) <= _MOST_CHARACTERS else f"{text[:_MOST_CHARACTERS].rstrip()} …"


def _limits(run: Run) -> list[str]:
    """What a limit kept, where it cut anything off."""
    limit = run.manifest.limit
    items = run.design.items
    cut = [track for track in run.design.suite.tracks if limit and items.get(track, 0) >= limit]
    if not cut:
        return []
    counts = ", ".join(
        f"{items[track]:,} {kind_of(track).item}s of {kind_of(track).title}" for track in cut
    )
    return [f"A limit was set: {counts} were asked about, not all of the suite."]
