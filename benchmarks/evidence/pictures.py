"""The contact sheets of README.md, docs/pictures.md and docs/scenes.md, drawn anew.

    python benchmarks/evidence/pictures.py [--data NAME] [--out FOLDER]

NAME is a bundled data set or a folder with scenes.jsonl; FOLDER is docs/images/pictures unless
named. The same data give the same bytes.
"""

from __future__ import annotations

import argparse
import io
from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

from phyblock.datasets import AssemblyTask, read_builtin
from phyblock.domain import Scene
from phyblock.resources import bundled
from phyblock.sim import PictureStyle, candidates_png, composite_png, goal_png
from phyblock.sim.assembly import filmstrip_png
from phyblock.sim.camera import VIEWS
from phyblock.sim.exploded import exploded_png
from phyblock.types import BACKGROUNDS

OUT = Path(__file__).parents[2] / "docs" / "images" / "pictures"
CELL_PX, CAPTION_PX, GAP_PX = 240, 24, 4
PER_LEVEL = 8
WALL_PX, WALL_COLUMNS, PER_WALL = 150, 10, 60
Cell = tuple[str, bytes]
"""A caption and a PNG."""


def sheet(cells: Sequence[Cell], columns: int) -> Image.Image:
    """Pictures in rows, each below its caption."""
    images = [(caption, Image.open(io.BytesIO(data))) for caption, data in cells]
    wide, high = images[0][1].width + GAP_PX, images[0][1].height + CAPTION_PX + GAP_PX
    rows = -(-len(images) // columns)
    whole = Image.new("RGB", (columns * wide - GAP_PX, rows * high - GAP_PX), "white")
    draw, font = ImageDraw.Draw(whole), ImageFont.load_default(size=14)
    for place, (caption, image) in enumerate(images):
        left, top = place % columns * wide, place // columns * high
        middle = (left + image.width / 2, top + CAPTION_PX / 2)
        draw.text(middle, caption, (20, 24, 32), font, anchor="mm")
        whole.paste(image, (left, top + CAPTION_PX))
    return whole


def spread(items: Sequence[AssemblyTask], count: int) -> list[AssemblyTask]:
    """Up to `count` items, evenly over the sequence."""
    step = max(len(items) / count, 1.0)
    return [items[int(i * step)] for i in range(min(count, len(items)))]


def levels(tasks: Sequence[AssemblyTask]) -> dict[str, Image.Image]:
    """A sheet a level, scenes picked evenly."""
    sheets = {}
    for level in (1, 2, 3, 4):
        style = PictureStyle(CELL_PX)
        chosen = spread([task for task in tasks if level in task.scene.levels], PER_LEVEL)
        cells = [(task.scene.id, goal_png(task.scene, style)) for task in chosen]
        sheets[f"level-{level}"] = sheet(cells, 4)
    return sheets


def walls(tasks: Sequence[AssemblyTask]) -> dict[str, Image.Image]:
    """Many scenes of each level, small and without captions, picked evenly."""
    found, style = {}, PictureStyle(WALL_PX, "white")
    for level in (1, 2, 3, 4):
        chosen = spread([task for task in tasks if level in task.scene.levels], PER_WALL)
        rows = -(-len(chosen) // WALL_COLUMNS)
        wall = Image.new("RGB", (WALL_COLUMNS * WALL_PX, rows * WALL_PX), "white")
        for place, task in enumerate(chosen):
            row, column = divmod(place, WALL_COLUMNS)
            data = goal_png(task.scene, style)
            wall.paste(Image.open(io.BytesIO(data)), (column * WALL_PX, row * WALL_PX))
        found[f"scenes-level-{level}"] = wall
    return found


def looks(scene: Scene) -> dict[str, Image.Image]:
    """One scene before every background, from every view, and pulled apart."""
    behind = [(b, goal_png(scene, PictureStyle(CELL_PX, b))) for b in BACKGROUNDS]
    views = [
        (view, goal_png(scene, PictureStyle.from_view(view, CELL_PX, "light-wood")))
        for view in VIEWS
    ]
    style = PictureStyle(2 * CELL_PX, "white")
    apart = [("assembled", goal_png(scene, style)), ("exploded", exploded_png(scene, style))]
    return {
        "backgrounds": sheet(behind, 3),
        "views": sheet(views, 4),
        "exploded": sheet(apart, 2),
    }


def composite(task: AssemblyTask) -> Image.Image:
    """What a model is shown: goal and candidates."""
    style = PictureStyle(2 * CELL_PX, "concrete")
    both = composite_png(goal_png(task.scene, style), candidates_png(task.candidates, style))
    return Image.open(io.BytesIO(both))


def filmstrip(scene: Scene) -> Image.Image:
    """All steps of one scene."""
    return Image.open(io.BytesIO(filmstrip_png(scene, PictureStyle(CELL_PX * 3 // 4, "white"))))


def main() -> None:
    """Draw and write all sheets."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", default="phyblock-400")
    parser.add_argument("--out", type=Path, default=OUT)
    options = parser.parse_args()
    folder = Path(options.data)
    inside = bundled("benchmarks", "data", options.data)
    tasks = read_builtin(folder if folder.is_dir() else inside).tasks
    large = [task for task in tasks if task.scene.level == 4][1]
    medium = [task for task in tasks if task.scene.level == 3][-4]
    sheets = {
        **levels(tasks),
        **walls(tasks),
        **looks(large.scene),
        "composite": composite(medium),
        "filmstrip": filmstrip(medium.scene),
    }
    options.out.mkdir(parents=True, exist_ok=True)
    for name, image in sheets.items():
        path = options.out / f"{name}.png"
        image.quantize(256, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE).save(
            path, optimize=True
        )
        print(f"{path.stat().st_size / 1000:6.0f} KB  {path}")


if __name__ == "__main__":
    main()
