"""Pictures of samples: drawn once, in the layout asked for, kept by content."""

from __future__ import annotations

import asyncio
import io
from collections.abc import Sequence
from pathlib import Path

import pytest
from PIL import Image as PillowImage

from phyblock.data import AssemblyTask, read_builtin
from phyblock.errors import DataError, StoreError
from phyblock.models.request import Image
from phyblock.sim.pictures import PictureStyle
from phyblock.tracks import PicturePolicy, Pictures
from tests.data.broken import write_scenes
from tests.fuzz.strategies import png_header
from tests.workspace import SCENES

STYLE = PictureStyle(size_px=128)
COMPOSITE = PicturePolicy("render", "composite", ("goal", "candidates"), STYLE)
GOAL_FIRST = PicturePolicy("render", "separate", ("goal", "candidates"), STYLE)
GOAL_LAST = PicturePolicy("render", "separate", ("candidates", "goal"), STYLE)


@pytest.fixture(scope="module")
def tasks(tmp_path_factory: pytest.TempPathFactory) -> tuple[AssemblyTask, ...]:
    return read_builtin(write_scenes(tmp_path_factory.mktemp("data"), *SCENES[:2])).tasks


def draw(
    folder: Path, policy: PicturePolicy, tasks: Sequence[AssemblyTask]
) -> tuple[list[tuple[Image, ...]], int]:
    """Pictures of all tasks, asked for at once, and how many were drawn for them."""

    async def ask(pictures: Pictures) -> list[tuple[Image, ...]]:
        return list(await asyncio.gather(*(pictures.of(task) for task in tasks)))

    pictures = Pictures(folder, policy, shop=1)
    try:
        return asyncio.run(ask(pictures)), pictures.rendered
    finally:
        pictures.close()


def opened(image: Image) -> PillowImage.Image:
    with PillowImage.open(io.BytesIO(image.data)) as picture:
        return picture.convert("RGB")


def test_a_picture_is_drawn_once_however_often_and_by_whomever_it_is_asked_for(
    tasks: tuple[AssemblyTask, ...], tmp_path: Path
) -> None:
    first, drawn = draw(tmp_path, COMPOSITE, [*tasks, *tasks, *tasks])
    assert drawn == 2
    assert first[0] == first[2] == first[4] != first[1]
    assert [picture.label for picture in first[0]] == ["composite"]
    assert (first[0][0].width_px, first[0][0].height_px) == opened(first[0][0]).size

    again, drawn = draw(tmp_path, COMPOSITE, tasks)
    assert drawn == 0
    assert again == first[:2]

    # What a power cut left of a file is not sent: it is drawn again, to the same bytes.
    for path in tmp_path.rglob("*.png"):
        path.write_bytes(path.read_bytes()[:-20])
    mended, drawn = draw(tmp_path, COMPOSITE, tasks)
    assert (mended, drawn) == (first[:2], 2)
    assert not list(tmp_path.rglob("*.part"))


def test_layout_and_order_are_those_of_the_policy(
    tasks: tuple[AssemblyTask, ...], tmp_path: Path
) -> None:
    ((goal, grid), (other_goal, other_grid)), drawn = draw(tmp_path, GOAL_FIRST, tasks)
    assert drawn == 3, "both tasks have the same candidates"
    assert (goal.label, grid.label) == ("goal", "candidates")
    assert grid == other_grid
    assert goal.data != other_goal.data

    turned, drawn = draw(tmp_path, GOAL_LAST, tasks)
    assert drawn == 0
    assert turned == [(grid, goal), (grid, other_goal)]

    (((both,)), _), _ = draw(tmp_path, COMPOSITE, tasks)
    whole = opened(both)
    side = goal.width_px
    assert whole.size == (both.width_px, both.height_px)
    assert whole.crop((0, 0, side, side)).tobytes() == opened(goal).tobytes()
    right = whole.crop((both.width_px - side, 0, both.width_px, side))
    assert right.tobytes() == opened(grid).tobytes()


def test_an_outline_draws_nothing_and_has_the_real_sizes(
    tasks: tuple[AssemblyTask, ...], tmp_path: Path
) -> None:
    for policy in (COMPOSITE, GOAL_FIRST):
        pictures = Pictures(tmp_path / policy.layout, policy, shop=1)
        outlined, real = pictures.outline(tasks[0])
        assert not real
        assert {picture.data for picture in outlined} == {b""}
        (made, *_), _ = draw(tmp_path / policy.layout, policy, tasks[:1])
        assert [(p.label, p.height_px) for p in outlined] == [(p.label, p.height_px) for p in made]
        assert pictures.outline(tasks[0]) == (made, True)
        assert pictures.rendered == 0


def test_keys_follow_content_and_style_alone(tasks: tuple[AssemblyTask, ...]) -> None:
    def keys(policy: PicturePolicy, task: AssemblyTask) -> tuple[str, ...]:
        return Pictures(Path("nowhere"), policy, 1).keys(task)

    larger = PicturePolicy("render", "composite", COMPOSITE.order, PictureStyle(size_px=256))
    seen = {keys(p, t) for p in (COMPOSITE, larger, GOAL_FIRST, GOAL_LAST) for t in tasks}
    assert len(seen) == 8
    assert set(keys(GOAL_FIRST, tasks[0])) == set(keys(GOAL_LAST, tasks[0]))


@pytest.fixture
def composite_task(tasks: tuple[AssemblyTask, ...], tmp_path: Path) -> AssemblyTask:
    """A task with a picture of its own: a red half, a gap, a blue half."""
    picture = PillowImage.new("RGB", (514, 256), "white")
    picture.paste("red", (0, 0, 255, 256))
    picture.paste("blue", (259, 0, 514, 256))
    path = tmp_path / "own.png"
    picture.save(path)
    return AssemblyTask(tasks[0].scene, tasks[0].candidates, path)


def test_the_data_sets_picture_is_sent_byte_for_byte(
    composite_task: AssemblyTask, tmp_path: Path
) -> None:
    policy = PicturePolicy("dataset", "composite", COMPOSITE.order, STYLE)
    (((picture,),), drawn) = draw(tmp_path / "cache", policy, [composite_task])
    assert composite_task.composite is not None
    assert picture.data == composite_task.composite.read_bytes()
    assert (picture.label, picture.width_px, picture.height_px, drawn) == ("composite", 514, 256, 0)


@pytest.mark.parametrize("order", [("goal", "candidates"), ("candidates", "goal")])
def test_the_data_sets_picture_is_parted_in_two_halves_in_order(
    composite_task: AssemblyTask, tmp_path: Path, order: tuple[str, ...]
) -> None:
    policy = PicturePolicy("dataset", "separate", order, STYLE)  # type: ignore[arg-type]
    ((pair,), _) = draw(tmp_path / "cache", policy, [composite_task])
    assert tuple(picture.label for picture in pair) == order
    colors = {"goal": (255, 0, 0), "candidates": (0, 0, 255)}
    for picture in pair:
        assert opened(picture).getcolors() == [(255 * 256, colors[picture.label])]


def test_the_key_of_a_data_sets_picture_follows_its_bytes(composite_task: AssemblyTask) -> None:
    policy = PicturePolicy("dataset", "composite", COMPOSITE.order, STYLE)
    before = Pictures(Path("nowhere"), policy, 1).keys(composite_task)
    assert composite_task.composite is not None
    PillowImage.new("RGB", (514, 256), "green").save(composite_task.composite)
    assert Pictures(Path("nowhere"), policy, 1).keys(composite_task) != before


def test_a_data_set_without_the_picture_is_refused(
    tasks: tuple[AssemblyTask, ...], tmp_path: Path
) -> None:
    policy = PicturePolicy("dataset", "composite", COMPOSITE.order, STYLE)
    with pytest.raises(DataError, match="has no picture of it"):
        draw(tmp_path, policy, tasks)


@pytest.mark.parametrize("size", [(30_000, 30_000), (1, 1), (0, 9)])
def test_what_is_no_picture_in_the_cache_is_drawn_anew(
    tasks: tuple[AssemblyTask, ...], tmp_path: Path, size: tuple[int, int]
) -> None:
    pictures = Pictures(tmp_path, COMPOSITE, shop=1)
    (key,) = pictures.keys(tasks[0])
    (tmp_path / key[:2]).mkdir()
    (tmp_path / key[:2] / f"{key}.png").write_bytes(png_header(*size))
    (outline,), are_real = pictures.outline(tasks[0])
    assert (outline.data, are_real) == (b"", False)


def test_a_cache_that_cannot_be_written_is_said_so(
    tasks: tuple[AssemblyTask, ...], tmp_path: Path
) -> None:
    taken = tmp_path / "taken"
    taken.write_text("mine", encoding="utf-8")
    with pytest.raises(StoreError, match="PHYBLOCK_CACHE"):
        draw(taken, COMPOSITE, tasks[:1])
    assert taken.read_text(encoding="utf-8") == "mine"
