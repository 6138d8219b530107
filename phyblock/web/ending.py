"""The end of a human baseline: a person's results beside rules and models, with pictures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

from PIL import Image

from phyblock.domain.scene import AssemblyTask
from phyblock.errors import SpecError
from phyblock.records.files import read_records
from phyblock.records.record import Record
from phyblock.results.compare import check_pair, comparable
from phyblock.results.estimates import Headline
from phyblock.results.load import load_run
from phyblock.results.text import number
from phyblock.sim.pictures import Lookout, PictureStyle, to_png
from phyblock.text import counted, one_line
from phyblock.tracks.base import as_recorded, kind_of
from phyblock.web.pack import card_png

_BUILT = re.compile(r"built/(\d{1,9})\.png")
_SIZE_PX, _GAP_PX = 320, 8


class Ending:
    """The page after the end: for each track the means of the person, the rules and the models of
    this run and those `beside` it, and a row for each item.

    A note explains why a run cannot be compared. Pictures are drawn on request.
    """

    def __init__(
        self, folder: Path, person: str, beside: Sequence[Path], tasks: Sequence[AssemblyTask]
    ) -> None:
        self._runs = [load_run(path) for path in (folder, *beside)]
        self._run, self._person = self._runs[0], person
        of_scene = {task.scene.id: task for task in tasks}
        records = [one for one in read_records(folder) if one.model == person]
        self._built = {
            n: (task, record.built(as_recorded(task, record)))
            for n, record in enumerate(records)
            if record.is_correct is None and (task := of_scene.get(record.scene)) is not None
        }
        self._notes: list[str] = []
        tracks = [self._track(name, records) for name in self._run.design.suite.tracks]
        self.shown: Mapping[str, Any] = {
            "tracks": [track for track in tracks if track["rows"]],
            "notes": list(dict.fromkeys(self._notes)),
        }

    def picture(self, name: str) -> bytes | None:
        """Return the card, or the goal beside the built structure; None for other names."""
        if (found := _BUILT.fullmatch(name)) and int(found[1]) in self._built:
            return to_png(self._pair(int(found[1])))
        if name != "card.png" or not self.shown["tracks"]:
            return None
        first = self.shown["tracks"][0]
        said = " · ".join(f"{one} {number(value)}" for one, value in first["line"])
        about = (
            f"{first['title']}: {first['measure']}, {counted(len(first['rows']), first['item'])}"
        )
        pair = self._pair(next(iter(self._built))) if self._built else None
        return card_png("Can you build this?", f"{said}\n{about}", pair)

    def _pair(self, number: int) -> Image.Image:
        """Return a picture of the goal on the left and the built structure on the right."""
        task, built = self._built[number]
        lookout = Lookout(task.scene, PictureStyle(_SIZE_PX))
        pair = Image.new("RGB", (2 * _SIZE_PX + _GAP_PX, _SIZE_PX), "#ffffff")
        for place, blocks in enumerate((task.scene.blocks, built)):
            pair.paste(lookout.image(blocks), (place * (_SIZE_PX + _GAP_PX), 0))
        return pair

    def _track(self, track: str, records: Sequence[Record]) -> dict[str, Any]:
        """Return a track: measure, all means, rows, and the `line` of person, floor, best model."""
        kind, what = kind_of(track), comparable(self._run, track)
        measure, part = what.measure, what.parts[-1]
        # The value of each item, by name.
        others: dict[str, dict[str, float]] = {}
        for other in self._runs:
            if track not in other.design.suite.tracks:
                continue
            try:
                check_pair(other, self._run, [part.cell], track, measure)
            except SpecError as error:
                self._notes.append(f"Left out, as it cannot be compared: {one_line(str(error))}")
                continue
            for model, values in what.values(other, part, self._run.design):
                by_item = values.groupby(level="item").mean()
                found = {str(item): float(mean) for item, mean in by_item.items()}
                others.setdefault(model, found)
        own = others.pop(self._person, {})
        rows = [
            {
                "key": record.item,
                "sample": record.sample,
                "value": own.get(record.item),
                "took_s": None if record.reply is None else record.reply.latency_s,
                "picture": f"built/{n}.png" if n in self._built else None,
                **went(record, self._run.design.matcher),
            }
            for n, record in enumerate(records)
            if record.track == track
        ]
        means = [("You", fmean(own.values()), len(own))] if own else []
        for name, found in others.items():
            if common := [found[row["key"]] for row in rows if row["key"] in found]:
                means.append((name, fmean(common), len(common)))
        means.sort(key=lambda one: one[1], reverse=measure.better == "higher")
        worth = {name: value for name, value, _ in means}
        line = [("You", worth["You"])] if own else []
        if (floor := Headline(self._run, track).floor) is not None:
            line.append((floor.name, worth.get(floor.name, floor.value)))
        rules = {"You"}.union(*(one.design.baselines for one in self._runs))
        line += [(f"best model {name}", worth[name]) for name in worth if name not in rules][:1]
        return {
            "title": kind.title,
            "item": kind.item,
            "measure": measure.heading,
            "unit": measure.unit,
            "line": line,
            "means": means,
            "rows": rows,
        }


def went(record: Record, matcher: str) -> dict[str, Any]:
    """Return the answer, step by step with the reason for wrong ones, or with the right answer."""
    if record.is_correct is not None:
        return {"given": record.said, "right": record.target, "correct": record.is_correct}
    course = record.course(matcher)
    if course is None:
        return {}
    steps = [{"name": name, "why": why} for name, why in course.steps]
    return {"steps": steps, "missing": course.missing}
