"""Figures for papers: text that is text and never overlaps, captions, and the same numbers."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from itertools import combinations
from pathlib import Path
from typing import Any

import pytest

from phyblock.cli.main import phyblock
from phyblock.errors import SpecError, StoreError
from phyblock.report.compare import compare_models
from phyblock.report.figures import Wanted, of_models, write_paper_figures
from phyblock.report.figures.dots import measure_dots
from phyblock.report.figures.forest import difference_forest
from phyblock.tables.drawing import COLUMN_IN, Look, heading_of, styled
from phyblock.tables.load import Run, load_run
from phyblock.tracks.estimates import track_estimates
from phyblock.tracks.full_planning_results import (
    error_bars,
    f1_by_size,
    f1_radar,
    loss_bars,
    settings_dots,
    stated_size_b,
)
from tests.report.factory import LEVELS, manifest, record, run_of, score, write_run

pytest.importorskip("matplotlib", reason="matplotlib is not installed")
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

NAMES = [f"vision-model-{n}-thinking-{n % 5}.5B" for n in range(20)]
NAMES.append("$x$_<b>&%")
NARROWEST_IN = 60 / 25.4
LONG_NAMES_IN = 3.2
"""What rows with these names and a plot of the least width take."""


def records(models: list[str]) -> Iterator[dict[str, Any]]:
    for place, model in enumerate(models):
        for n, scene in enumerate(LEVELS):
            tp = (place + n) % 5
            scores = [
                score(tp, 4 - tp, 4 - tp, setting=setting, criterion=criterion)
                for setting in "AB"
                for criterion in ("aov", "selection")
            ]
            yield record(model, scene, 0, scores, cost_usd=0.01 * (place + 1), attempts=1)


@pytest.fixture(scope="module")
def run() -> Run:
    return run_of(records(NAMES), manifest(models=NAMES, seeds=[0], matchers=["optimal"]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("paper") / "run"
    facts = manifest(models=NAMES[-3:], seeds=[0], matchers=["optimal"])
    return write_run(path, records(NAMES[-3:]), facts)


def dots(run: Run) -> Figure | None:
    return measure_dots(run, track="full_planning")


def forest(run: Run) -> Figure | None:
    return difference_forest(run, track="full_planning")


@pytest.mark.parametrize(
    ("width_in", "draws"),
    [
        (COLUMN_IN, (dots, forest, f1_radar, settings_dots, loss_bars, f1_by_size)),
        (7.0, (dots, f1_by_size)),
        (NARROWEST_IN, (dots, forest, f1_radar, settings_dots, loss_bars, error_bars)),
    ],
)
def test_no_text_covers_another_or_leaves_the_figure_with_many_models(
    run: Run, width_in: float, draws: tuple[Callable[[Run], Figure | None], ...]
) -> None:
    some = of_models(run, NAMES[-5:]) if width_in == NARROWEST_IN else run
    with styled(Look(width_in)):
        for draw in draws:
            figure = draw(some)
            assert figure is not None
            if width_in >= LONG_NAMES_IN:
                assert figure.get_figwidth() == pytest.approx(width_in)
            else:
                assert width_in <= figure.get_figwidth() <= LONG_NAMES_IN
            figure.draw_without_rendering()
            # Of a label with a line to its point, the label alone.
            boxes = [(t.get_text(), Text.get_window_extent(t)) for t in seen(figure)]
            page = figure.bbox.padded(2)
            name = heading_of(figure).title
            outside = [text for text, box in boxes if not is_within(box, page)]
            assert not outside, (name, outside)
            inner = [(text, box.padded(-0.6)) for text, box in boxes]
            both = [(a[0], b[0]) for a, b in combinations(inner, 2) if a[1].overlaps(b[1])]
            assert not both, (name, both)


def seen(figure: Figure) -> list[Text]:
    """All texts but the labels of ticks beyond the ends of an axis, which are not drawn."""
    beyond = set()
    for ax in figure.axes:
        for axis, ends in ((ax.xaxis, sorted(ax.get_xlim())), (ax.yaxis, sorted(ax.get_ylim()))):
            for tick in axis.get_major_ticks():
                if not ends[0] <= tick.get_loc() <= ends[1]:
                    beyond |= {tick.label1, tick.label2}
    texts = [text for text in figure.findobj(Text) if isinstance(text, Text)]
    return [t for t in texts if t.get_visible() and t.get_text().strip() and t not in beyond]


def is_within(box: Bbox, page: Bbox) -> bool:
    return bool(page.x0 <= box.x0 and box.x1 <= page.x1 and page.y0 <= box.y0 and box.y1 <= page.y1)


def test_text_is_text_in_both_formats_and_the_same_run_gives_the_same_bytes(folder: Path) -> None:
    look, wanted = Look(COLUMN_IN, "serif", titled=False), Wanted(("f1-levels", "kit"))
    files = write_paper_figures(load_run(folder, texts=False), wanted, look).files
    first = {path: path.read_bytes() for path in files}
    again = write_paper_figures(load_run(folder, texts=False), Wanted(("f1-levels",)), look).files
    assert {path: path.read_bytes() for path in again} == {path: first[path] for path in again}
    for path, data in first.items():
        if path.suffix == ".pdf":
            assert b"/FontFile2" in data, path
            assert b"/Type3" not in data, path
            assert b"Date" not in data, path
        elif path.suffix == ".svg":
            assert re.findall(rb"<text[^>]*>([^<]*)</text>", data), path
            assert b"STIXGeneral" in data, path
            assert b"date>" not in data
    shown = (folder / "paper" / "f1-levels.svg").read_text("utf-8")
    for name in ("thinking-4.5B", "$x$_&lt;b&gt;&amp;%"):
        assert name in shown


def test_a_caption_holds_what_a_figure_without_title_leaves_out(folder: Path) -> None:
    run, look = load_run(folder, texts=False), Look(COLUMN_IN, titled=False)
    names = ("settings",)
    write_paper_figures(run, Wanted(names), look, folder / "narrow")
    write_paper_figures(run, Wanted(names), Look(), folder / "wide")
    for name in names:
        bare, titled = ((folder / of / f"{name}.svg").read_text() for of in ("narrow", "wide"))
        caption = (folder / "narrow" / f"{name}.txt").read_text()
        title = caption.partition(".")[0]
        assert title in titled
        assert title not in bare
        assert caption == (folder / "wide" / f"{name}.txt").read_text()
        narrow, wide = ((folder / of / f"{name}.tex").read_text() for of in ("narrow", "wide"))
        assert r"\begin{figure}[t]" in narrow
        assert r"\begin{figure*}[t]" in wide
        assert rf"\includegraphics{{{name}.pdf}}" in narrow


def test_a_figure_that_is_wider_than_was_asked_for_is_named(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = ("error-types", "kit")
    words = [word for name in names for word in ("--only", name)]
    given = ["figures", str(folder), *words, "--width", "60", "--out", str(tmp_path)]
    phyblock(given, standalone_mode=False)
    *files, last = capsys.readouterr().out.splitlines()
    drawn = (tmp_path / "error-types.svg").read_text("utf-8")
    (points,) = re.findall(r'<svg [^>]*?width="([\d.]+)pt"', drawn)
    width = f"{float(points) / 72 * 25.4:.1f}"
    assert float(width) > 60
    told = f"error-types is {width} mm wide instead of 60 mm: its names and numbers need the room."
    assert last == told
    assert len(files) == 10


def test_a_users_file_is_never_written_over(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "kit.tex").write_text("mine")
    with pytest.raises(StoreError, match=r"kit.tex: .*did not make"):
        write_paper_figures(load_run(folder), Wanted(("kit",)), Look(), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["kit.tex"]


def test_some_models_of_a_run_keep_their_numbers(run: Run) -> None:
    chosen = [NAMES[3], NAMES[11], NAMES[20]]
    few = of_models(run, chosen)
    assert few.design.model_names == tuple(chosen)
    of_all = track_estimates(run, "full_planning")
    of_few = track_estimates(few, "full_planning")
    keys = ["measure", "cell", "setting", "matcher", "criterion", "model"]
    expected = of_all[of_all["model"].isin(chosen)].sort_values(keys).reset_index(drop=True)
    found = of_few.sort_values(keys).reset_index(drop=True)
    columns = [*keys, "value", "lo", "hi", "n", "n_clusters"]
    assert found[columns].equals(expected[columns])
    with pytest.raises(SpecError, match="no such model"):
        of_models(run, ["omega"])


def test_a_forest_shows_the_differences_that_compare_finds(run: Run) -> None:
    for models in (NAMES[:7], NAMES[:4], NAMES[:2]):
        some = of_models(run, models)
        figure = difference_forest(some, track="full_planning")
        assert figure is not None
        table = compare_models(some, track="full_planning").table
        known = {round(abs(value), 6) for value in table["difference"]}
        (ax,) = figure.axes
        drawn = [float(x) for line in ax.lines[1:] for x in line.get_xdata()]
        n_rows = {7: 6, 4: 6, 2: len(table)}[len(models)]
        assert len(drawn) == n_rows
        assert {round(abs(value), 6) for value in drawn} <= known


@pytest.mark.parametrize(
    ("name", "size_b"),
    [
        *(("InternVL2.5-4B", 4), ("gemini-1.5-flash-8b", 8), ("llava-qwen2-0.5b-ov", 0.5)),
        *(("Qwen3-VL-235B-A22B-Instruct", 235), ("gpt-4o", None), ("model-8bit", None)),
    ],
)
def test_a_size_is_what_the_name_says(name: str, size_b: float | None) -> None:
    assert stated_size_b(name) == size_b
