"""Pictures of samples: drawn once, in the layout asked for, kept by content."""

import asyncio
import contextlib
import io
from dataclasses import replace

import pytest
from PIL import Image as PillowImage

from phyblock.config.suite import ImagesSpec
from phyblock.domain.scene import AssemblyTask
from phyblock.errors import DataError
from phyblock.models.request import Image
from phyblock.sim.pictures import candidates_png
from phyblock.tracks.base import presented
from phyblock.tracks.pictures import Workshop, picture_style, scene_drawings
from tests.fuzz.strategies import png_header

COMPOSITE = ImagesSpec(size_px=128)
GOAL_FIRST = ImagesSpec(size_px=128, layout="separate")
GOAL_LAST = ImagesSpec(size_px=128, layout="separate", order=("candidates", "goal"))
OWN = ImagesSpec(source="dataset")


def draw(folder, images, tasks):
    """Pictures of all tasks, asked for at once, and how many were drawn for them."""

    async def ask():
        wanted = (shop.images(scene_drawings(task, images)) for task in tasks)
        return list(await asyncio.gather(*wanted))

    with contextlib.closing(Workshop(1, folder)) as shop:
        return asyncio.run(ask()), shop.rendered


def keys(images, task):
    return [drawing.key for drawing in scene_drawings(task, images)]


def opened(image):
    with PillowImage.open(io.BytesIO(image.data)) as picture:
        return picture.convert("RGB")


def test_a_picture_is_drawn_once_however_often_and_by_whomever_it_is_asked_for(tasks, tmp_path):
    tasks = tasks[:2]
    first, drawn = draw(tmp_path, COMPOSITE, [*tasks, *tasks, *tasks])
    assert drawn == 2
    assert first[0] == first[2] == first[4] != first[1]
    (one,) = first[0]
    assert (one.label, one.width_px, one.height_px) == ("composite", *opened(one).size)
    assert draw(tmp_path, COMPOSITE, tasks) == (first[:2], 0)
    # What a power cut left of a file is not sent: it is drawn again, to the same bytes.
    for path in tmp_path.rglob("*.png"):
        path.write_bytes(path.read_bytes()[:-20])
    assert draw(tmp_path, COMPOSITE, tasks) == (first[:2], 2)
    assert not list(tmp_path.rglob("*.part"))


def test_an_outline_draws_nothing_and_has_the_real_sizes(tasks, tmp_path):
    for images in (COMPOSITE, GOAL_FIRST):
        shop = Workshop(1, tmp_path / images.layout)
        drawings = scene_drawings(tasks[0], images)
        outlined = shop.outlines(drawings)
        assert {picture.data for picture in outlined} == {b""}
        (made, *_), _ = draw(tmp_path / images.layout, images, tasks[:1])
        assert [(p.label, p.height_px) for p in outlined] == [(p.label, p.height_px) for p in made]
        assert shop.outlines(drawings) == made
        assert shop.rendered == 0


@pytest.mark.parametrize("layout", ["separate", "composite"])
def test_pictures_and_their_keys_follow_what_is_shown(tasks, layout, shop):
    images = ImagesSpec(size_px=128, layout=layout)
    plain, blind = tasks[0], presented(tasks[0], 1, "shuffled", is_blind=True)
    both, (grid,) = (
        asyncio.run(shop.images(scene_drawings(task, images))) for task in (plain, blind)
    )
    assert grid.data == candidates_png(blind.candidates, picture_style(images))
    assert shop.outlines(scene_drawings(blind, images)) == (grid,)
    labels = ["composite"] if layout == "composite" else ["goal", "candidates"]
    assert [image.label for image in both] == labels
    every = (COMPOSITE, ImagesSpec(size_px=256), GOAL_FIRST, GOAL_LAST)
    shown = (*tasks[:2], blind)
    assert len({tuple(keys(one, task)) for one in every for task in shown}) == 8 + 2
    assert set(keys(GOAL_FIRST, plain)) == set(keys(GOAL_LAST, plain))


@pytest.fixture
def composite_task(tasks, tmp_path):
    """A task with a picture of its own: a red half, a gap, a blue half."""
    picture = PillowImage.new("RGB", (514, 256), "white")
    picture.paste("red", (0, 0, 255, 256))
    picture.paste("blue", (259, 0, 514, 256))
    path = tmp_path / "own.png"
    picture.save(path)
    return AssemblyTask(tasks[0].scene, tasks[0].candidates, path)


@pytest.mark.parametrize("order", [("goal", "candidates"), ("candidates", "goal")])
def test_the_data_sets_picture_is_sent_byte_for_byte_or_parted_in_two_halves(
    composite_task, tmp_path, order
):
    found, drawn = draw(tmp_path / "cache", OWN, [composite_task])
    whole = Image(composite_task.composite.read_bytes(), "composite", 514, 256)
    assert (found, drawn) == ([(whole,)], 0)
    apart = ImagesSpec(source="dataset", layout="separate", order=order)
    ((pair,), _) = draw(tmp_path / "cache", apart, [composite_task])
    assert tuple(picture.label for picture in pair) == order
    colors = {"goal": (255, 0, 0), "candidates": (0, 0, 255)}
    for picture in pair:
        assert opened(picture).getcolors() == [(255 * 256, colors[picture.label])]
    blind = presented(composite_task, 0, "file", is_blind=True)
    ((grid,),), _ = draw(tmp_path / "cache", OWN, [blind])
    assert grid in pair
    before = keys(OWN, composite_task)
    PillowImage.new("RGB", (514, 256), "green").save(composite_task.composite)
    assert keys(OWN, composite_task) != before
    with pytest.raises(DataError, match="has no picture of it"):
        draw(tmp_path, OWN, [replace(composite_task, composite=None)])


@pytest.mark.parametrize("size", [(30_000, 30_000), (1, 1), (0, 9)])
def test_what_is_no_picture_in_the_cache_is_drawn_anew(tasks, tmp_path, size):
    (key,) = keys(COMPOSITE, tasks[0])
    (tmp_path / key[:2]).mkdir()
    (tmp_path / key[:2] / f"{key}.png").write_bytes(png_header(*size))
    (outline,) = Workshop(1, tmp_path).outlines(scene_drawings(tasks[0], COMPOSITE))
    assert outline.data == b""
