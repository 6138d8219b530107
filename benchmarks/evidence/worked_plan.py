"""The worked plan of docs/scoring.md: what phyblock makes of it, and its picture.

    python -m benchmarks.evidence.worked_plan [--picture FILE]

One plan for one built-in scene goes the way of every reply: read, judged, stored as a record, made
into tables, under both settings and both matchers in turn. Prints the tables that stand in
docs/scoring.md; with --picture, draws the picture too, which there is
docs/images/pictures/worked-plan.png.
"""

from __future__ import annotations

import argparse
import functools
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import pandas as pd

from phyblock.config.suite import load_suite
from phyblock.datasets import AssemblyTask, Dataset, read_builtin
from phyblock.domain import Scene
from phyblock.domain.scene import Oriented
from phyblock.models.base import Reply
from phyblock.records import Manifest, Record
from phyblock.report.measure_table import measures_frame
from phyblock.resources import bundled
from phyblock.run.records import begun, judged
from phyblock.scoring.plan import BLOCK_OUTCOMES, ERROR_TYPES
from phyblock.sim import PictureStyle, candidates_png, composite_png, goal_png
from phyblock.tables.cells import METRICS
from phyblock.tables.design import OVERALL, read_design
from phyblock.tables.load import Run, frames_of
from phyblock.tables.markdown import to_markdown
from phyblock.tables.text_table import Column, TextTable, number
from phyblock.tracks import SingleTrack, open_tracks
from phyblock.tracks.full_planning.assembly import assembly_frame
from phyblock.tracks.full_planning.errors import errors_frame
from phyblock.tracks.full_planning.losses import losses_frame
from phyblock.tracks.kind import Opening

SCENE, MODEL, TRACK = "l3-052-stair", "reply", "full_planning"
PLAN = (7, 16, 6, 12, 1)
REPLY = "\n".join(f"Step{n}: Move block with index {index}" for n, index in enumerate(PLAN, 1))
WAYS = tuple(product(("A", "B"), ("optimal", "paper")))
"""Settings and matchers, in the order of the columns."""
SIZE_PX = 320
_NAMED = (Column("What it is", is_text=True), Column("Turned (degrees)", is_text=True))


def run_of(setting: str, matcher: str) -> tuple[AssemblyTask, Record, Run]:
    """The scene, the record of the plan, and a run that holds it alone, scored in one way."""
    sets = [f"settings=[{setting}]", f"scoring.matchers=[{matcher}]", "levels=[3]", "seeds=[0]"]
    data = bundled("benchmarks", "data")
    suite = load_suite(bundled("benchmarks", "quick.yaml"), sets, data_dir=data)
    dataset = _scene_alone(suite.files.dataset)
    (track,) = open_tracks(Opening(suite, dataset, None, with_prompts=False), [TRACK])
    assert isinstance(track, SingleTrack)
    (task,) = track.items
    fields = begun(f"{TRACK}/{MODEL}/{SCENE}/s0", TRACK, MODEL, task, 0, Reply(REPLY))
    record = judged({**fields, **track.about(task)}, task, track.judge(task, REPLY))
    written = {**suite.model_dump(mode="json"), "name": ""}
    facts = {
        "identity": "the worked plan",
        "suite": written,
        "models": [{"name": MODEL}],
        "items": {TRACK: 1},
        "scenes": 1,
        "scenes_by_level": {3: 1},
    }
    design = read_design(facts)
    frames = frames_of([record], design, texts=False)
    return task, record, Run(Path("worked"), Manifest.model_validate(facts), design, *frames)


@functools.cache
def _scene_alone(folder: Path) -> Dataset:
    dataset = read_builtin(folder)
    return replace(dataset, tasks=tuple(task for task in dataset.tasks if task.key == SCENE))


def steps_table(task: AssemblyTask, records: list[Record]) -> TextTable:
    """A row a step: what was moved, and in every way the block that it placed or its error type."""
    rows = []
    for place, index in enumerate(PLAN):
        candidate = task.candidates[index]
        cells = [_what(_score(record), place, task.scene) for record in records]
        rows.append((str(place + 1), str(index), *_named(candidate), *cells))
    columns = (Column("Step"), Column("Candidate"), *_NAMED)
    return TextTable("What each step does", (*columns, *_columns(is_text=True)), tuple(rows))


def goal_table(scene: Scene) -> TextTable:
    """A row a block of the goal."""
    rows = tuple(
        (
            str(block.order),
            *_named(block),
            ", ".join(map(str, block.depend)) or "the ground",
        )
        for block in scene.blocks
    )
    columns = (Column("Block"), *_NAMED, Column("Rests on", is_text=True))
    return TextTable("The goal", columns, rows)


def numbers_table(runs: list[Run]) -> TextTable:
    """A row a number out of the tables of a run, a column a way of scoring."""
    columns = [_numbers(run) for run in runs]
    rows = tuple((*key, *(one[key] for one in columns)) for key in columns[0])
    texts = (Column("Table", is_text=True), Column("Number", is_text=True))
    return TextTable("What stands in the tables", (*texts, *_columns(is_text=False)), rows)


def _named(one: Oriented) -> tuple[str, str]:
    """What it is, and how it is turned."""
    return f"{one.color} {one.type}", ", ".join(f"{angle:g}" for angle in one.euler_deg)


def _columns(*, is_text: bool) -> list[Column]:
    return [Column(matcher, setting, is_text) for setting, matcher in WAYS]


def _score(record: Record) -> Any:
    (score,) = (one for one in record.scores if one.criterion == "aov")
    return score


def _what(score: Any, place: int, scene: Scene) -> str:
    vertex = score.placed[place]
    return score.why[place] if vertex is None else f"places block {scene.blocks[vertex].order}"


def _numbers(run: Run) -> dict[tuple[str, str], str]:
    """What tables say of the plan, by table and number."""
    (counted,) = _overall(assembly_frame(run), "level")
    (errors,) = _overall(errors_frame(run), "level")
    losses = {row["outcome"]: row["value"] for row in _overall(losses_frame(run), "level")}
    further = {row["measure"]: row["value"] for row in _overall(measures_frame(run), "cell")}
    found = {("assembly", name): str(counted[name]) for name in ("tp", "fp", "fn")}
    found |= {("assembly", name): number(100 * counted[name]) for name in METRICS}
    found |= {("errors", name): str(errors[name]) for name in ERROR_TYPES}
    found |= {("losses", name): number(losses[name]) for name in (*BLOCK_OUTCOMES, "support")}
    names = ("success", "macro_f1", "distance")
    return found | {("measures", name): number(further[name]) for name in names}


def _overall(frame: pd.DataFrame, cell: str) -> list[dict[Any, Any]]:
    return frame[frame[cell] == OVERALL].to_dict("records")


def tables() -> list[str]:
    """The tables of docs/scoring.md, as Markdown."""
    made = [run_of(*way) for way in WAYS]
    task, records, runs = made[0][0], [record for _, record, _ in made], [run for *_, run in made]
    views = [goal_table(task.scene), steps_table(task, records), numbers_table(runs)]
    return [to_markdown(view) for view in views]


def picture() -> bytes:
    """PNG of the goal and the numbered candidates, as models are shown them."""
    task, style = run_of(*WAYS[0])[0], PictureStyle(SIZE_PX)
    return composite_png(goal_png(task.scene, style), candidates_png(task.candidates, style))


def main() -> None:
    """Print the tables; draw the picture where one is asked for."""
    arguments = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    arguments.add_argument("--picture", type=Path)
    given = arguments.parse_args()
    print("\n".join(tables()))
    if given.picture is not None:
        given.picture.write_bytes(picture())


if __name__ == "__main__":
    main()
