"""Pictures of samples: drawn once, in the layout asked for, kept by content."""

import asyncio
import io

import pytest
from PIL import Image as PillowImage

from phyblock.config.suite import ImagesSpec
from phyblock.errors import StoreError
from phyblock.sim.pictures import candidates_png
from phyblock.tracks.base import presented
from phyblock.tracks.pictures import Workshop, picture_style, scene_drawings
from tests.fuzz.strategies import png_header

COMPOSITE = ImagesSpec(size_px=128)
GOAL_FIRST = ImagesSpec(size_px=128, layout="separate")
GOAL_LAST = ImagesSpec(size_px=128, layout="separate", order=("candidates", "goal"))


def draw(folder, images, tasks):
    """Pictures of all tasks, asked for at once, and how many were drawn for them."""

    async def ask():
        wanted = (shop.images(scene_drawings(task, images)) for task in tasks)
        return list(await asyncio.gather(*wanted))

    shop = Workshop(1, folder)
    try:
        return asyncio.run(ask()), shop.rendered
    finally:
        shop.close()


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
    assert [picture.label for picture in first[0]] == ["composite"]
    assert (first[0][0].width_px, first[0][0].height_px) == opened(first[0][0]).size
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


def test_keys_follow_content_and_style_alone(tasks):
    larger = ImagesSpec(size_px=256)
    every = (COMPOSITE, larger, GOAL_FIRST, GOAL_LAST)
    assert len({tuple(keys(images, task)) for images in every for task in tasks[:2]}) == 8
    assert set(keys(GOAL_FIRST, tasks[0])) == set(keys(GOAL_LAST, tasks[0]))


@pytest.mark.parametrize("layout", ["separate", "composite"])
def test_pictures_follow_what_is_shown(tasks, layout, shop):
    images = ImagesSpec(size_px=128, layout=layout)
    style = picture_style(images)

    def sent(task):
        return asyncio.run(shop.images(scene_drawings(task, images)))

    plain = sent(tasks[0])
    blind = presented(tasks[0], 1, "shuffled", is_blind=True)
    (grid,) = sent(blind)
    assert grid.data == candidates_png(blind.candidates, style)
    assert shop.outlines(scene_drawings(blind, images)) == (grid,)
    assert [image.label for image in plain] == (
        ["composite"] if layout == "composite" else ["goal", "candidates"]
    )
    assert keys(images, tasks[0]) != keys(images, blind)


@pytest.mark.parametrize("size", [(30_000, 30_000), (1, 1), (0, 9)])
def test_what_is_no_picture_in_the_cache_is_drawn_anew(tasks, tmp_path, size):
    (key,) = keys(COMPOSITE, tasks[0])
    (tmp_path / key[:2]).mkdir()
    (tmp_path / key[:2] / f"{key}.png").write_bytes(png_header(*size))
    (outline,) = Workshop(1, tmp_path).outlines(scene_drawings(tasks[0], COMPOSITE))
    assert outline.data == b""


def test_a_cache_that_cannot_be_written_is_said_so(tasks, tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("mine", encoding="utf-8")
    with pytest.raises(StoreError, match="PHYBLOCK_CACHE"):
        draw(taken, COMPOSITE, tasks[:1])
    assert taken.read_text(encoding="utf-8") == "mine"
