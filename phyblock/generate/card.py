"""The data card: how a data set was made and checked, and what is in it."""

from __future__ import annotations

from collections.abc import Sequence

from phyblock.domain.candidates import CandidateSet
from phyblock.domain.scene import Scene
from phyblock.generate.acceptance import LEVEL_LIMITS
from phyblock.sim.stability import DEFAULT_TRIAL
from phyblock.sim.support import FIT_TOLERANCE_M

__all__ = ["FILE_TEXT", "card"]

_TEXT = """# {name}

{count} block structures for assembly planning, with their candidate blocks:
{levels}.
{shared} scenes count in level 1 and in level 2.

## How it was made

Every structure was designed by hand for this project, as a list of blocks let down one after
another onto a grid of 2.5 cm (`phyblock/generate/*_designs.py`). A block's height follows from
what it lands on. `depend` comes from the contacts of the finished structure and `layer` from the
longest path in that graph; neither is written by hand. Blocks are those of the official kit:
eight shapes in twelve pairs of type and color.

Each scene has at most 16 candidates: every look that it needs, and distractors that differ from a
needed block by one attribute, orientation before color before type. No two candidates look the
same. They are grouped by type and color, so that a number tells nothing about being needed.

## How it was checked

A scene is in the set only when

* no two blocks overlap, and none hangs above its support, by more than {fit_mm:g} mm;
* the finished structure stands for {duration:g} s of simulated time: no block moves more than
  {limit_mm:g} mm or turns more than {limit_deg:g} degrees, at time steps of
  {settings};
* so does every intermediate structure when blocks are placed in the stored order (at the first
  setting);
* it keeps the limits of its levels:

{limits}

Files and checks are made anew, byte for byte, by

    python -m phyblock.generate {name_path}

## What is in it

| level | scenes | blocks, mean | blocks, most | layers, mean | layers, most | types | colors |
|---|---|---|---|---|---|---|---|
{rows}

Types and colors are means over scenes. The candidate sets hold {candidates}.

"""
FILE_TEXT = """## The file

`scenes.jsonl` holds one scene a line, sorted by `id`:

| field | meaning |
|---|---|
| `id`, `levels`, `parents` | name; levels it counts in; base scenes it was made from (itself) |
| `blocks[].order` | number of the block, from 1, in an order that can be built |
| `blocks[].type`, `color` | shape and color |
| `blocks[].position` | origin of the block's own frame, x, y, z with z up, in meters |
| `blocks[].euler` | extrinsic x-y-z angles in degrees: R = Rz Ry Rx |
| `blocks[].depend`, `layer` | blocks it rests on, 0 the ground; longest path, from 1 |
| `candidates[]` | `type`, `color`, `euler`, and `required`: whether the scene needs it |
"""
"""How a scene stands in the file, which is the same in every data set."""


def card(name: str, scenes: Sequence[Scene], candidates: Sequence[CandidateSet]) -> str:
    """Markdown text of the card of a data set called `name`."""
    levels = sorted({level for scene in scenes for level in scene.levels})
    by_level = {level: [s for s in scenes if level in s.levels] for level in levels}
    sizes = [len(one) for one in candidates]
    settings = " and at ".join(
        f"1/{round(1 / physics.time_step_s)} s ({physics.iterations} solver iterations)"
        for physics in DEFAULT_TRIAL.physics
    )
    text = _TEXT.format(
        name=name,
        name_path=f"benchmarks/data/{name}",
        count=len(scenes),
        levels=", ".join(f"{len(found)} of level {level}" for level, found in by_level.items()),
        shared=sum(len(scene.levels) > 1 for scene in scenes),
        fit_mm=FIT_TOLERANCE_M * 1000,
        duration=DEFAULT_TRIAL.duration_s,
        settings=settings,
        limit_mm=DEFAULT_TRIAL.limit_m * 1000,
        limit_deg=DEFAULT_TRIAL.limit_deg,
        limits="\n".join(_limit(level) for level in levels),
        rows="\n".join(_row(level, found) for level, found in by_level.items()),
        candidates=" to ".join(str(size) for size in sorted({min(sizes), max(sizes)})),
    )
    return text + FILE_TEXT


def _limit(level: int) -> str:
    limits = LEVEL_LIMITS[level]
    blocks = f"{limits.least_blocks} to {limits.most_blocks} blocks"
    return f"    level {level}: {blocks}, up to {limits.most_layers} layers"


def _row(level: int, scenes: Sequence[Scene]) -> str:
    blocks = [len(scene) for scene in scenes]
    layers = [max(scene.graph.layers) for scene in scenes]
    types = [len({block.type for block in scene.blocks}) for scene in scenes]
    colors = [len({block.color for block in scene.blocks}) for scene in scenes]
    cells = [level, len(scenes), _mean(blocks), max(blocks), _mean(layers), max(layers)]
    return f"| {' | '.join(str(cell) for cell in [*cells, _mean(types), _mean(colors)])} |"


def _mean(numbers: Sequence[int]) -> str:
    return f"{sum(numbers) / len(numbers):.1f}"
