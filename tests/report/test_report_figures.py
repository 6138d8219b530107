from __future__ import annotations

import io
import re
from base64 import b64decode
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from PIL import Image

from phyblock.errors import StoreError
from phyblock.report.figures import Wanted, figure_names, write_figures, write_paper_figures
from phyblock.run.store import run_folder
from phyblock.tables.drawing import COLORS, GRID, MUTED, PAGE_LOOK, PALE
from phyblock.tables.load import load_run
from phyblock.tracks.figures import HATCHES, Part, stack
from phyblock.tracks.step_planning_results import step_progress
from phyblock.tracks.vqa_results import accuracy_by_subtask, vqa_heat_map
from tests.report.factory import LEVELS, manifest, record, run_of, score, write_run

matplotlib = pytest.importorskip("matplotlib", reason="matplotlib is not installed")
PLANNING = {"f1-levels", "f1-radar", "settings", "losses", "error-types", "f1-size", "f1-cost"}
PLANNING |= {"scenes"}
XLINK = "http://www.w3.org/1999/xlink"


@pytest.fixture
def _no_window(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """No figure stays open, and no backend is chosen, as all do that open windows.

    A box plot imports pyplot, which does neither by itself.
    """
    from matplotlib import pyplot

    chosen: list[object] = []
    monkeypatch.setattr(pyplot, "_backend_mod", None)
    monkeypatch.setattr(pyplot, "switch_backend", chosen.append)
    yield
    assert pyplot.get_fignums() == []
    assert chosen == []


def planned(model: str, tp: int) -> list[dict[str, Any]]:
    return [
        record(
            model,
            scene,
            0,
            [
                score(tp, 4 - tp, 4 - tp),
                score(min(tp + 1, 4), 0, 1, setting="B"),
                score(tp, 1, 1, criterion="selection"),
                score(tp, 1, 1, criterion="selection", setting="B"),
            ],
            cost_usd=0.01,
            attempts=1,
        )
        for scene in LEVELS
    ]


def folder_of(path: Path, *more: dict[str, Any], **facts: Any) -> Path:
    made = manifest(seeds=[0], matchers=["optimal"], **facts)
    for model, size_b in zip(made["models"], (7.0, None), strict=False):
        model["size_b"] = size_b
    made["suite"]["tracks"] = ["full_planning", "vqa", "step_planning"]
    return write_run(path, [*planned("alpha", 3), *planned("beta", 1), *more], made)


def asked(model: str, subtask: str, *correct: bool) -> list[dict[str, Any]]:
    return [
        record(model, "000")
        | {
            "sample": f"vqa/{model}/{subtask}-{n}/s0",
            "track": "vqa",
            "key": f"{subtask}-{n}",
            "question": {"id": f"{subtask}-{n}", "subtask": subtask, "rotation": 0},
            "answer": {"right": "A", "given": "A" if right else None, "correct": right},
        }
        for n, right in enumerate(correct)
    ]


def episode(model: str, scene: str, *progress: int) -> dict[str, Any]:
    """An episode of a goal of four blocks, so many of which are placed after each step."""
    placed = progress[-1]
    scores = [score(placed, 0, 4 - placed, criterion=name) for name in ("placed", "attempted")]
    more = {"outcomes": ["placed"] * len(progress), "progress": list(progress)}
    sample = f"step_planning/{model}/{scene}/s0"
    return (
        record(model, scene, scores=scores)
        | {"sample": sample, "track": "step_planning", "ending": "done"}
        | more
    )


def test_every_figure_is_drawn_and_drawing_again_gives_the_same_bytes(tmp_path: Path) -> None:
    more = [*asked("alpha", "SH", True, False), *asked("alpha", "OR", False)]
    more += [*asked("beta", "SH", False), *asked("beta", "OR", True)]
    more += [episode("alpha", "000", 1, 2, 3, 4), episode("beta", "000", 0, 1)]
    run = load_run(folder_of(tmp_path / "run", *more), texts=False)
    first = {file: file.read_bytes() for file in write_figures(run)}
    on_request = {"kit", *(f"forest-{name}" for name in ("full-planning", "vqa", "step-planning"))}
    on_request |= {"inference", "inference-steps", "subtask-cards"}
    drawn = [name for name in figure_names(run) if name not in on_request]
    assert [file.name for file in first] == [f"{name}.svg" for name in drawn]
    assert {file: file.read_bytes() for file in write_figures(run)} == first
    for file, data in first.items():
        assert re.search(rb"<svg[^>]*width=\"[\d.]+pt\"", data)
        assert b"<dc:date>" not in data
        # The size of one of the two models is known.
        assert marks(ElementTree.fromstring(data)) >= (1 if file.stem == "f1-size" else 2), (
            file.name
        )


def marks(drawn: ElementTree.Element) -> int:
    """How much an SVG shows beside axes, grids, texts and legend; of a picture, how many colors."""
    count = 0
    for one in drawn:
        tag = one.tag.rpartition("}")[2]
        if tag == "defs" or one.get("id", "").startswith(("matplotlib.axis", "text_", "legend_")):
            continue
        if tag == "image":
            _, _, data = one.get(f"{{{XLINK}}}href", "").partition("base64,")
            with Image.open(io.BytesIO(b64decode(data))) as picture:
                count += len(picture.convert("RGB").getcolors(20000) or [])
        elif tag in ("path", "use"):
            inks = set(re.findall(r"#[0-9a-f]{6}|url", one.get("style", "")))
            count += not inks <= {"#ffffff", MUTED, GRID, PALE}
        count += marks(one)
    return count


@pytest.mark.usefixtures("_no_window")
def test_figures_for_slides_are_asked_for_and_old_ones_stay(tmp_path: Path) -> None:
    run = load_run(folder_of(tmp_path / "run"), texts=False)
    wanted = Wanted(("f1-levels", "losses"))
    files = write_paper_figures(run, wanted, PAGE_LOOK).files
    pictures = [file for file in files if file.suffix == ".png"]
    assert [file.stem for file in pictures] == [*wanted.names]
    for file in pictures:
        with Image.open(file) as picture:
            assert picture.width >= 1200
            assert len(picture.convert("RGB").resize((200, 100)).getcolors(20000) or []) > 20
    (old,) = run_folder(run.path).write({"figures/f1-levels.png": b"by an earlier version"})
    write_figures(run, ["f1-levels"])
    assert old.read_bytes() == b"by an earlier version"


@pytest.mark.usefixtures("_no_window")
def test_what_a_run_has_no_numbers_for_is_not_drawn_and_no_window_is_opened(tmp_path: Path) -> None:
    run = load_run(write_run(tmp_path / "run", [], manifest()), texts=False)
    assert write_figures(run) == ()
    drawn = {file.stem for file in write_figures(load_run(folder_of(tmp_path / "other")))}
    assert drawn == PLANNING


def test_a_figure_takes_no_style_of_the_user_and_leaves_none(tmp_path: Path) -> None:
    run = load_run(folder_of(tmp_path / "run"))
    (file,) = write_figures(run, ["f1-levels"])
    plain = file.read_bytes()
    with matplotlib.rc_context({"font.size": 30, "axes.facecolor": "red"}):
        write_figures(run, ["f1-levels"])
        assert matplotlib.rcParams["font.size"] == 30
    assert file.read_bytes() == plain


def test_accuracy_by_subtask_by_hand(tmp_path: Path) -> None:
    more = [*asked("alpha", "SH", True, True, False, True), *asked("beta", "OR", False)]
    table = accuracy_by_subtask(load_run(folder_of(tmp_path / "run", *more)))
    assert table.loc["alpha", "SH"] == 75
    assert table.loc["beta", "OR"] == 0
    assert table.notna().to_numpy().sum() == 2


def test_an_episode_that_ended_keeps_what_it_built(tmp_path: Path) -> None:
    more = [episode("alpha", "000", 1, 1, 2, 3), episode("alpha", "001", 1)]
    table = step_progress(load_run(folder_of(tmp_path / "run", *more)))
    assert table["alpha"].tolist() == [0, 25, 25, 37.5, 50]


def test_all_parts_of_a_whole_are_drawn_however_many_there_are() -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    n_parts = 2 * len(HATCHES) + 1
    shares = np.full(2, 100 / n_parts)
    parts = [Part(f"{n}", shares, COLORS[n % len(COLORS)], "white") for n in range(n_parts)]
    ax = figure.add_subplot()
    stack(ax, ["a", "b"], parts, 0.7, 10.0)
    assert [bar.get_label() for bar in ax.containers] == [part.name for part in parts]
    ends = [bar.get_x() + bar.get_width() for bar in ax.containers[-1]]
    assert ends == pytest.approx([100, 100])


def test_colors_differ_in_lightness_or_hue_for_readers_who_see_no_red_or_green() -> None:
    # Vienot, Brettel and Mollon 1999: how protanopes and deuteranopes see linear RGB.
    views = {
        "protanope": ((0.11238, 0.88762, 0), (0.11238, 0.88762, 0), (0.00401, -0.00401, 1)),
        "deuteranope": ((0.29275, 0.70725, 0), (0.29275, 0.70725, 0), (-0.02234, 0.02234, 1)),
    }
    linear = [[(int(color[n : n + 2], 16) / 255) ** 2.2 for n in (1, 3, 5)] for color in COLORS]
    for rows in views.values():
        seen = [
            [
                max(0.0, sum(a * b for a, b in zip(row, color, strict=True))) ** (1 / 2.2)
                for row in rows
            ]
            for color in linear
        ]
        for place, one in enumerate(seen):
            for other in seen[place + 1 :]:
                assert max(abs(a - b) for a, b in zip(one, other, strict=True)) > 0.06


def test_a_folder_that_cannot_be_written_is_said_so(tmp_path: Path) -> None:
    run = load_run(folder_of(tmp_path / "run"))
    (run.path / "figures").write_text("in the way")
    with pytest.raises(StoreError, match="cannot be written"):
        write_figures(run)


@pytest.mark.parametrize(
    ("circular", "said"), [(False, "25, in OR 4"), (True, "0.39, in OR 0.0003")]
)
def test_the_heat_map_says_what_guessing_gives(circular: bool, said: str) -> None:
    facts = manifest(models=["alpha"], seeds=[0])
    facts["suite"] |= {"tracks": ["vqa"], "vqa": {"circular": circular}}
    figure = vqa_heat_map(run_of(asked("alpha", "SH", True, False), facts))
    assert figure is not None
    assert any(text.get_text().endswith(f"guessing gives {said}") for text in figure.texts)
