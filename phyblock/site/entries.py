"""The rows of a leaderboard: a model in a run, or in several that asked it different things."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

from phyblock.bundle import portable_manifest
from phyblock.records.manifest import ManifestModel
from phyblock.site.runs import SiteRun

__all__ = ["Entry", "entries_of"]

_LABELS = ("published", "size_b", "served_at")
"""What a manifest says of a model that does not decide its replies."""
_DIGITS = 8


@dataclass
class Entry:
    """A row: `runs` has the number of the run that asked each of its tracks. `name` is unique."""

    model: ManifestModel
    runs: dict[str, int] = field(default_factory=dict)
    name: str = ""

    @property
    def numbers(self) -> tuple[int, ...]:
        """The runs that it is of, each once."""
        return tuple(dict.fromkeys(self.runs.values()))


def entries_of(runs: Sequence[SiteRun]) -> tuple[Entry, ...]:
    """Every model of every run.

    A model that two runs asked in different tracks is one row, where it is the same model with the
    same parameters. Asked in the same track it is a row for each run: names are then told apart by
    the date of the run, and by its identity where that is not enough.
    """
    entries: list[tuple[str, Entry]] = []
    for number, one in enumerate(runs):
        tracks = one.run.design.suite.tracks
        # A run stands in the same row as a folder and as a bundle.
        for model in portable_manifest(one.run.manifest).models:
            identity = _identity(model)
            same = (
                entry
                for known, entry in entries
                if known == identity and not set(tracks) & set(entry.runs)
            )
            entry = next(same, None)
            if entry is None:
                entry = Entry(model)
                entries.append((identity, entry))
            entry.runs |= dict.fromkeys(tracks, number)
    found = tuple(entry for _, entry in entries)
    _name(found, runs)
    return found


def _identity(model: ManifestModel) -> str:
    fields = {name: value for name, value in model.fields().items() if name not in _LABELS}
    return json.dumps(fields, sort_keys=True, default=str)


def _name(entries: Sequence[Entry], runs: Sequence[SiteRun]) -> None:
    """Give every entry the shortest name that no other has."""
    forms = (
        lambda entry: entry.model.name,
        lambda entry: f"{entry.model.name} ({runs[entry.numbers[0]].date})",
        lambda entry: f"{entry.model.name} ({_tag(runs[entry.numbers[0]])})",
        lambda entry: (
            f"{entry.model.name} ({_tag(runs[entry.numbers[0]])}, {entry.numbers[0] + 1})"
        ),
    )
    for form in forms:
        named = Counter(entry.name or form(entry) for entry in entries)
        for entry in entries:
            if not entry.name and named[form(entry)] == 1:
                entry.name = form(entry)


def _tag(one: SiteRun) -> str:
    return f"{one.date}, run {one.run.manifest.identity[:_DIGITS]}"
