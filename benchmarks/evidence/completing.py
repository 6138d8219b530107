"""Whether what `phyblock scenes complete` derives from positions is what data sets declare.

    python benchmarks/evidence/completing.py [OFFICIAL_CHECKOUT]

Every scene of phyblock-400, and of the official data where its checkout is given, is stripped to
the types, colors and poses of its blocks and derived again. Of the official scenes it is counted,
too, how many have an overlap or a gap of more than 0.5 mm, for which they would be refused.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from phyblock.datasets import AssemblyTask, read_builtin, read_official
from phyblock.domain.scene import Scene
from phyblock.errors import DataError
from phyblock.making.scenes.candidate_sets import make_candidates
from phyblock.making.scenes.completing import GivenScene, derived
from phyblock.resources import bundled
from phyblock.sim.support import find_gaps, find_overlaps


def stripped(scene: Scene) -> GivenScene:
    """A scene as a person would write it: no more than where its blocks are."""
    blocks = [
        {
            "order": block.order,
            "type": block.type,
            "color": block.color,
            "position": list(block.position_m),
            "euler": list(block.euler_deg),
        }
        for block in scene.blocks
    ]
    about = {"levels": list(scene.levels), "parents": list(scene.parents)}
    return GivenScene.model_validate({"id": scene.id, **about, "blocks": blocks})


def show(name: str, tasks: Sequence[AssemblyTask]) -> None:
    """Print how many scenes, blocks and candidate sets come back."""
    scenes = blocks = layers = depends = sets = refused = circles = 0
    for task in tasks:
        scene = task.scene
        blocks += len(scene)
        refused += bool(find_overlaps(scene.blocks) or find_gaps(scene.blocks))
        try:
            again = derived(scene.id, stripped(scene), scene.id)
        except DataError:
            circles += 1
            continue
        pairs = list(zip(scene.blocks, again.blocks, strict=True))
        same_depend = [set(one.depend) == set(other.depend) for one, other in pairs]
        same_layer = [one.layer == other.layer for one, other in pairs]
        depends, layers = depends + sum(same_depend), layers + sum(same_layer)
        scenes += all(same_depend) and all(same_layer)
        sets += make_candidates(again) == task.candidates
    print(f"{name}: {len(tasks)} scenes, {blocks:,} blocks")
    print(f"  depend and layers of all blocks as declared  {scenes:6,} scenes")
    print(f"  depend as declared                           {depends:6,} blocks")
    print(f"  layer as declared                            {layers:6,} blocks")
    print(f"  candidate set as it is                       {sets:6,} scenes")
    print(f"  contacts run in a circle                     {circles:6,} scenes")
    print(f"  overlap or gap of more than 0.5 mm           {refused:6,} scenes")


def main(words: Sequence[str]) -> None:
    """Print the tables."""
    show("phyblock-400", read_builtin(bundled("benchmarks", "data", "phyblock-400")).tasks)
    for word in words:
        show("official", read_official(Path(word)).tasks)


if __name__ == "__main__":
    main(sys.argv[1:])
