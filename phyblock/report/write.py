"""All tables of a run, as files in its folder."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from phyblock.errors import Problem, StoreError
from phyblock.files import atomic_write
from phyblock.report.track_intervals import (
    step_intervals,
    track_intervals_view,
    vqa_intervals,
)
from phyblock.tables.cost import cost_frame, cost_view
from phyblock.tables.coverage import coverage_frame
from phyblock.tables.latex import to_latex
from phyblock.tables.load import Run, load_run
from phyblock.tables.markdown import to_markdown
from phyblock.tables.text_table import TextTable
from phyblock.tracks.full_planning.assembly import assembly_frame, table1_frame
from phyblock.tracks.full_planning.errors import errors_frame
from phyblock.tracks.full_planning.published import published_frame
from phyblock.tracks.full_planning.seeds import (
    intervals_table,
    intervals_view,
    table5_frame,
    table5_view,
)
from phyblock.tracks.full_planning.settings import settings_frame, settings_view
from phyblock.tracks.full_planning.views import (
    coverage_view,
    errors_view,
    published_view,
    table1_view,
)
from phyblock.tracks.step_planning.episodes import endings_frame, moves_frame, progress_frame
from phyblock.tracks.step_planning.table3 import (
    endings_view,
    moves_view,
    progress_view,
    step_scores_frame,
    table3_frame,
    table3_view,
)
from phyblock.tracks.vqa.answers import letters_frame, questions_frame
from phyblock.tracks.vqa.table2 import letters_view, table2_frame, table2_view

__all__ = ["TablesWritten", "make_tables", "table_names", "write_tables"]

_View = Callable[[pd.DataFrame, Run], TextTable]


@dataclass(frozen=True, eq=False)
class TablesWritten:
    """What `write_tables` made.

    `frames` and `views` (as text, ready to print) go by table name: those of assembly (frame
    only), table1, errors and published that were asked for, and coverage in any case; with table1
    come intervals, table5 (of several seeds) and settings (of both settings), with coverage cost.
    """

    folder: Path
    files: tuple[Path, ...]
    frames: Mapping[str, pd.DataFrame]
    views: Mapping[str, TextTable]
    run: Run


def write_tables(path: str | Path, tables: Sequence[str] | None = None) -> TablesWritten:
    """Rebuild `tables/` of a run folder from its records; each file appears whole or not at all.

    `tables` names those to write; None is what the suite in `run.yaml` asks for. Raises StoreError
    for a broken run (see `load_run`) or a folder that cannot be written.
    """
    run = load_run(path, texts=False)
    frames, views = make_tables(run, run.design.suite.tables if tables is None else tables)
    texts = {f"{name}.csv": _csv(frame, name) for name, frame in frames.items()}
    texts |= {f"{name}.md": to_markdown(view) for name, view in views.items()}
    texts |= {f"{name}.tex": to_latex(view, f"phyblock-{name}") for name, view in views.items()}
    folder = run.path / "tables"
    with _as_store_error(folder):
        folder.mkdir(exist_ok=True)
        for name, text in texts.items():
            atomic_write(folder / name, text)
    return TablesWritten(folder, tuple(folder / name for name in texts), frames, views, run)


@dataclass(frozen=True)
class _Maker:
    """How a table is made; `track` is the one it needs, "" where it takes any.

    `comes_with` names the table that it accompanies, where it has rows at all.
    """

    frame: Callable[[Run], pd.DataFrame]
    view: _View | None
    track: str = ""
    comes_with: str = ""


_MAKERS: dict[str, _Maker] = {
    "assembly": _Maker(assembly_frame, None, "full_planning"),
    "table1": _Maker(table1_frame, table1_view, "full_planning"),
    "intervals": _Maker(intervals_table, intervals_view, "full_planning", "table1"),
    "table5": _Maker(table5_frame, table5_view, "full_planning", "table1"),
    "settings": _Maker(settings_frame, settings_view, "full_planning", "table1"),
    "table2": _Maker(table2_frame, table2_view, "vqa"),
    "vqa_intervals": _Maker(vqa_intervals, track_intervals_view, "vqa", "table2"),
    "letters": _Maker(letters_frame, letters_view, "vqa", "table2"),
    "questions": _Maker(questions_frame, None, "vqa", "table2"),
    "table3": _Maker(table3_frame, table3_view, "step_planning"),
    "step_intervals": _Maker(step_intervals, track_intervals_view, "step_planning", "table3"),
    "step_scores": _Maker(step_scores_frame, None, "step_planning", "table3"),
    "endings": _Maker(endings_frame, endings_view, "step_planning"),
    "moves": _Maker(moves_frame, moves_view, "step_planning", "endings"),
    "progress": _Maker(progress_frame, progress_view, "step_planning"),
    "errors": _Maker(errors_frame, errors_view, "full_planning"),
    "coverage": _Maker(coverage_frame, coverage_view),
    "cost": _Maker(cost_frame, cost_view, "", "coverage"),
    "published": _Maker(published_frame, published_view, "full_planning"),
}


def table_names(run: Run) -> tuple[str, ...]:
    """Tables that the tracks of a run have."""
    tracks = ("", *run.design.suite.tracks)
    return tuple(name for name, maker in _MAKERS.items() if maker.track in tracks)


def make_tables(
    run: Run, names: Sequence[str]
) -> tuple[dict[str, pd.DataFrame], dict[str, TextTable]]:
    """Frames and views by name: of `names`, of what comes with them, and of coverage."""
    wanted = {"coverage", *names}
    tracks = ("", *run.design.suite.tracks)
    makers = {
        name: maker
        for name, maker in _MAKERS.items()
        if maker.track in tracks and (name in wanted or maker.comes_with in wanted)
    }
    frames = {name: maker.frame(run) for name, maker in makers.items()}
    frames = {name: frame for name, frame in frames.items() if name in wanted or len(frame)}
    views = {
        name: maker.view(frames[name], run)
        for name, maker in makers.items()
        if maker.view and name in frames
    }
    return frames, views


def _csv(frame: pd.DataFrame, name: str) -> str:
    decimals = "%.1f" if name in ("table1", "table2", "table3") else "%.6f"
    return frame.to_csv(index=False, float_format=decimals, lineterminator="\n")


@contextlib.contextmanager
def _as_store_error(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StoreError(Problem(str(folder), f"cannot be written: {error.strerror}")) from error
