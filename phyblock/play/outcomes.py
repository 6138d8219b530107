"""How a sitting went, item by item, beside what models of this and other runs did."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from phyblock.errors import SpecError
from phyblock.records.files import read_records
from phyblock.records.record import Record
from phyblock.results.compare import Comparable, Part, check_alike, comparable
from phyblock.results.design import Design
from phyblock.results.load import Run, load_run
from phyblock.text import one_line
from phyblock.tracks.kind import kind_of

__all__ = ["outcomes"]


def outcomes(folder: Path, person: str, beside: Sequence[Path]) -> dict[str, Any]:
    """What a page shows after the end: a part for each track, in it a row for each item in the
    order in which it was shown.

    `beside` are folders of other runs; of one that cannot be compared a note says why.
    """
    run = load_run(folder, texts=False)
    others = [load_run(path, texts=False) for path in beside]
    records = list(read_records(folder))
    notes: list[str] = []
    tracks = [
        _track(run, others, person, [one for one in records if one.track == track], track, notes)
        for track in run.design.suite.tracks
    ]
    return {"tracks": tracks, "notes": list(dict.fromkeys(notes))}


def _track(
    run: Run,
    others: Sequence[Run],
    person: str,
    records: Sequence[Record],
    track: str,
    notes: list[str],
) -> dict[str, Any]:
    what = comparable(run, track)
    part = what.parts[-1]
    values = dict(_values(run, what, part, run.design))
    own = values.pop(person, {})
    rest = list(values.items())
    for other in others:
        if track not in other.design.suite.tracks:
            continue
        try:
            check_alike(other, run, [part.cell], track, what.measure)
        except SpecError as error:
            notes.append(f"Left out, as it cannot be compared: {one_line(str(error))}")
        else:
            rest += _values(other, what, part, run.design)
    return {
        "title": kind_of(track).title,
        "item": kind_of(track).item,
        "measure": what.measure.heading,
        "unit": what.measure.unit,
        "better": what.measure.better,
        "rows": [
            {
                "key": record.item,
                "sample": record.sample,
                "value": own.get(record.item),
                "took_s": None if record.reply is None else record.reply.latency_s,
                "others": [
                    {"name": name, "value": found[record.item]}
                    for name, found in rest
                    if record.item in found
                ],
                **_went(record, run.design),
            }
            for record in records
        ],
    }


def _values(
    run: Run, what: Comparable, part: Part, design: Design
) -> Iterator[tuple[str, dict[str, float]]]:
    """What every model of a run reaches in each item, the mean over its samples [percent]."""
    for model, values in what.values(run, part, design):
        means = values.groupby(level="item").mean()
        yield model, {str(item): float(mean) for item, mean in means.items()}


def _went(record: Record, design: Design) -> dict[str, Any]:
    """What was answered, step by step with why a step is wrong, or with what is right."""
    if record.is_correct is not None:
        return {"given": record.said, "right": record.target, "correct": record.is_correct}
    course = record.course(design.matcher)
    if course is None:
        return {}
    steps = [{"name": name, "why": why} for name, why in course.steps]
    return {"steps": steps, "missing": course.missing}
