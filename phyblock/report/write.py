"""All tables of a run, as files in its folder."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from phyblock.errors import Problem, StoreError
from phyblock.files import atomic_write
from phyblock.report.assembly import assembly_frame, table1_frame
from phyblock.report.comparison import published_frame
from phyblock.report.coverage import coverage_frame
from phyblock.report.errors import errors_frame
from phyblock.report.latex import to_latex
from phyblock.report.load import Run, load_run
from phyblock.report.markdown import to_markdown
from phyblock.report.text_table import TextTable
from phyblock.report.views import coverage_view, errors_view, published_view, table1_view

__all__ = ["TablesWritten", "write_tables"]

_IN_LATEX = ("table1", "errors")
_View = Callable[[pd.DataFrame, Run], TextTable]


@dataclass(frozen=True, eq=False)
class TablesWritten:
    """What `write_tables` made.

    `frames` and `views` (as text, ready to print) go by table name: those of assembly (frame
    only), table1, errors and published that were asked for, and coverage in any case.
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
    frames, views = _tables(run, run.design.suite.tables if tables is None else tables)
    texts = {f"{name}.csv": _csv(frame, name) for name, frame in frames.items()}
    texts |= {f"{name}.md": to_markdown(view) for name, view in views.items()}
    texts |= {
        f"{name}.tex": to_latex(view, f"phyblock-{name}")
        for name, view in views.items()
        if name in _IN_LATEX
    }
    folder = run.path / "tables"
    with _as_store_error(folder):
        folder.mkdir(exist_ok=True)
        for name, text in texts.items():
            atomic_write(folder / name, text)
    return TablesWritten(folder, tuple(folder / name for name in texts), frames, views, run)


_MAKERS: dict[str, tuple[Callable[[Run], pd.DataFrame], _View | None]] = {
    "assembly": (assembly_frame, None),
    "table1": (table1_frame, table1_view),
    "errors": (errors_frame, errors_view),
    "coverage": (coverage_frame, coverage_view),
    "published": (published_frame, published_view),
}


def _tables(run: Run, names: Sequence[str]) -> tuple[dict[str, pd.DataFrame], dict[str, TextTable]]:
    wanted = {"coverage", *names}
    makers = {name: maker for name, maker in _MAKERS.items() if name in wanted}
    frames = {name: frame(run) for name, (frame, _) in makers.items()}
    views = {name: view(frames[name], run) for name, (_, view) in makers.items() if view}
    return frames, views


def _csv(frame: pd.DataFrame, name: str) -> str:
    decimals = "%.1f" if name == "table1" else "%.6f"
    return frame.to_csv(index=False, float_format=decimals, lineterminator="\n")


@contextlib.contextmanager
def _as_store_error(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise StoreError(Problem(str(folder), f"cannot be written: {error.strerror}")) from error
