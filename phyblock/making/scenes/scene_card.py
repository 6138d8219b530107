"""The data card of a set that the generator made: how it was made and checked, what is in it."""

from __future__ import annotations

from phyblock.making.checks.tolerances import FINISHED_REST, LEVEL_LIMITS
from phyblock.making.scenes.scene_files import QUANTITIES, SET_VERSION, LevelStatistics, SetWriter
from phyblock.sim.registry import other_simulators
from phyblock.sim.stability import DEFAULT_TRIAL
from phyblock.sim.steps import DEFAULT_REST
from phyblock.sim.support import FIT_TOLERANCE_M
from phyblock.sim.visibility import LEAST_SHARE, LEAST_SHOWN

_TEXT = """# {name}

{count} block structures for assembly planning, with their candidate blocks:
{levels}.
{shared} scenes count in level 1 and in level 2.
{base} are base scenes, {varied} are made from them.

Version {version} (also in `VERSION`): results on different versions of a set are never mixed.

## How it was made

    {command}

makes these files anew, byte for byte, with any number of processes{simulators}.

**Base scenes** come from a grammar of motifs (`phyblock/making/scenes/`): columns, piers, decks,
crowns and flanks make towers, gates, houses, bridges, arcades, walls, pyramids, stairs, courts,
animals, figures, cars, ships, rockets, furniture; parts side by side make streets and trains. A
seeded choice picks the rules, and most structures are mirror-symmetric. Blocks are let down one
after another onto a grid of 2.5 cm; a block's height follows from what it lands on.

**Variations** are base scenes in other colors, and two base scenes side by side; each is turned
by quarter turns and mirrored at random. `parents` names the base scenes that a scene was made from
(its own id for a base scene): scenes that share a parent are not independent, and intervals should
cluster by it. Scenes that differ by turning, mirroring or shifting alone count as the same.

`depend` comes from the contacts of the finished structure and `layer` from the longest path in
that graph; neither is written by hand. Colors: {palette}.

Each scene has at most 16 candidates: every look that it needs, and distractors drawn by a seed as
often as goals need them, so that every look is needed in the same share of the sets that offer it:
neither type, color, pose, number of poses nor place tells what is needed. No two candidates look
the same. Types that goals have low are listed first, the rest of the order is drawn.

## How it was checked

A scene is in the set only when

* no two blocks overlap, and none hangs above its support, by more than {fit_mm:g} mm;
* the finished structure stands, for {duration:g} s of simulated time: no block moves more than
  {limit_mm:g} mm or turns more than {limit_deg:g} degrees, at time steps of
  {settings},
  until no corner was faster than {speed:g} mm/s for {finished_quiet:g} s (`verify` watches it for
  the whole {duration:g} s);
* so does every intermediate structure when blocks are placed in the stored order, at the first
  setting; a step ends early once no corner was faster than {speed:g} mm/s for {quiet:g} s;
* every block shows in the goal picture: on {pixels:g} of 512 by 512 pixels at least, and with at
  least {shown:.0%} of the outline that it has when it is drawn alone;
* no other scene in the set is the same but for turning, mirroring or shifting;
* it keeps the limits of its levels:

{limits}

`phyblock scenes verify FOLDER` derives all of it again from the stored blocks.

## What is in it

Mean and most, over the scenes of a level:

| level | scenes | base | {heads} |
|---|---|---|{rules}|
{rows}

The candidate sets hold {candidates}.

"""
_FILE_TEXT = """## The file

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


def card(name: str, written: SetWriter, command: str, palette_text: str) -> str:
    """Return the Markdown card, after all scenes were added; `command` is what made them."""
    levels = dict(sorted(written.levels.items()))
    settings = " and at ".join(
        f"1/{round(1 / physics.time_step_s)} s ({physics.iterations} solver iterations)"
        for physics in DEFAULT_TRIAL.physics
    )
    text = _TEXT.format(
        name=name,
        count=written.count,
        levels=", ".join(f"{one.scenes} of level {level}" for level, one in levels.items()),
        shared=written.shared,
        base=written.base,
        varied=written.count - written.base,
        command=command,
        simulators="".join(f", by {one}" for one in other_simulators()),
        palette=palette_text,
        fit_mm=FIT_TOLERANCE_M * 1000,
        duration=DEFAULT_TRIAL.duration_s,
        settings=settings,
        limit_mm=DEFAULT_TRIAL.limit_m * 1000,
        limit_deg=DEFAULT_TRIAL.limit_deg,
        speed=DEFAULT_REST.speed_m_s * 1000,
        finished_quiet=FINISHED_REST.quiet_s,
        quiet=DEFAULT_REST.quiet_s,
        pixels=LEAST_SHARE * 512**2,
        shown=LEAST_SHOWN,
        version=SET_VERSION,
        limits="\n".join(_limit(level) for level in levels),
        heads=" | ".join(f"{quantity}, mean | most" for quantity in QUANTITIES),
        rules="|".join("---|---" for _ in QUANTITIES),
        rows="\n".join(_row(level, one) for level, one in levels.items()),
        candidates=" to ".join(
            str(size) for size in sorted({min(written.sizes), max(written.sizes)})
        ),
    )
    return text + _FILE_TEXT


_COMPLETED = """# {name}

{count} block structures for assembly planning, with their candidate blocks, completed by

    {command}

from the types, colors and poses of their blocks. `depend` comes from the contacts of the finished
structure and `layer` from the longest path in that graph. Candidates that were not given are
every look that a scene needs, and distractors drawn by its id as often as goals need them. No
block overlaps another or hangs above its support by more than {fit_mm:g} mm, and the structure
stands when it is finished and at every step of the stored order.

"""


def completed_card(name: str, count: int, command: str) -> str:
    """Markdown text of the card of scenes that were given by their positions."""
    fit_mm = FIT_TOLERANCE_M * 1000
    return _COMPLETED.format(name=name, count=count, command=command, fit_mm=fit_mm) + _FILE_TEXT


def _limit(level: int) -> str:
    limits = LEVEL_LIMITS[level]
    blocks = f"{limits.least_blocks} to {limits.most_blocks} blocks"
    return f"    level {level}: {blocks}, up to {limits.most_layers} layers"


def _row(level: int, one: LevelStatistics) -> str:
    cells = [str(level), str(one.scenes), str(one.base)]
    for quantity in QUANTITIES:
        cells += [f"{one.total[quantity] / one.scenes:.1f}", str(one.most[quantity])]
    return f"| {' | '.join(cells)} |"
