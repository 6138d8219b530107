"""Reader of picture recipes: how a picture differs from the scene that a question shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

from phyblock.datasets.checks import MAX_BLOCKS, SceneReader
from phyblock.datasets.raw import MISSING
from phyblock.domain import (
    BLOCK_TYPES,
    COLORS,
    LETTERS,
    Block,
    BlockType,
    Color,
    Mark,
    QuestionPicture,
    Scene,
)
from phyblock.words import Background

__all__ = ["LABELS", "RecipeReader"]

LABELS = ("scene", "block", *LETTERS)
MARK_LETTERS = (*LETTERS, "X")
"""Places are marked A to D where they are the options, X where the text speaks of one."""
_RECIPE_FIELDS = ("label", "view", "without", "poses", "swap", "add", "marks", "framed")


class RecipeReader(SceneReader):
    """Reads recipes against a scene, and collects what is wrong with them."""

    def recolored(self, raw: Any, scene: Scene, field: str) -> Scene:
        """The scene with the colors of `raw`: block order -> color."""
        colors = {
            order: self.choice(color, f"{field}.{order}", COLORS)
            for order, color in self._by_order(raw, scene, field).items()
        }
        blocks = tuple(
            replace(block, color=cast(Color, colors.get(block.order) or block.color))
            for block in scene.blocks
        )
        return replace(scene, blocks=blocks)

    def pictures(
        self, raw: Any, scene: Scene, background: Background | None
    ) -> tuple[QuestionPicture, ...]:
        """All pictures of a question, whose labels differ, on one background."""
        read = [self._picture(one, scene, f"pictures[{i}]") for i, one in enumerate(raw)]
        found = [replace(picture, background=background) for picture in read]
        labels = [picture.label for picture in found]
        for i, label in enumerate(labels):
            if label and label in labels[:i]:
                self.complain(f"pictures[{i}].label", "is used twice", label)
        return tuple(found)

    def _picture(self, entry: Any, scene: Scene, at: str) -> QuestionPicture:
        raw = self.mapping(entry, at)
        label = self.choice(self.get(raw, "label", f"{at}."), f"{at}.label", LABELS) or ""
        view = self._view(self.get(raw, "view", f"{at}."), f"{at}.view")
        if raw is MISSING:
            return QuestionPicture(label, (), view)
        for name in raw:
            if name not in _RECIPE_FIELDS:
                self.complain(f"{at}.{name}", "is not known", allowed=", ".join(_RECIPE_FIELDS))
        blocks = self._drawn(raw, scene, at)
        marks = tuple(
            self._mark(one, f"{at}.marks[{i}]")
            for i, one in enumerate(self._optional(raw, "marks", at))
        )
        framed = self._framed(raw.get("framed"), scene, f"{at}.framed")
        if not blocks:
            self.complain(at, "draws no blocks")
        return QuestionPicture(label, blocks, view, marks, framed)

    def _drawn(self, raw: Any, scene: Scene, at: str) -> tuple[Block, ...]:
        without = self._optional(raw, "without", at)
        known = [block.order for block in scene.blocks]
        for order in without:
            if order not in known:
                self.complain(f"{at}.without", "names no block", order, _orders(scene))
        swaps = self._by_order(raw.get("swap", {}), scene, f"{at}.swap")
        poses = self._by_order(raw.get("poses", {}), scene, f"{at}.poses")
        blocks = [block for block in scene.blocks if block.order not in without]
        blocks = [self._swapped(block, swaps.get(block.order), f"{at}.swap") for block in blocks]
        blocks = [self._moved(block, poses.get(block.order), f"{at}.poses") for block in blocks]
        added = self._added(raw.get("add"), f"{at}.add")
        for block in added:
            if block.order in known:
                self.complain(f"{at}.add", "has the order of a block of the scene", block.order)
        return (*blocks, *added)

    def _swapped(self, block: Block, raw: Any, at: str) -> Block:
        if raw is None:
            return block
        at = f"{at}.{block.order}"
        raw = self.mapping(raw, at)
        kind = self.choice(self.get(raw, "type", f"{at}."), f"{at}.type", BLOCK_TYPES)
        color = self.choice(self.get(raw, "color", f"{at}."), f"{at}.color", COLORS)
        if kind is None or color is None:
            return block
        return replace(block, type=cast(BlockType, kind), color=cast(Color, color))

    def _moved(self, block: Block, raw: Any, at: str) -> Block:
        if raw is None:
            return block
        at = f"{at}.{block.order}"
        raw = self.mapping(raw, at)
        position = self.position(self.get(raw, "position", f"{at}."), f"{at}.position")
        euler = self.angles(self.get(raw, "euler", f"{at}."), f"{at}.euler")
        if position is None or euler is None:
            return block
        return replace(block, position_m=position, euler_deg=euler)

    def _added(self, raw: Any, at: str) -> tuple[Block, ...]:
        if raw is None:
            return ()
        entries = self.items(raw, at, MAX_BLOCKS)
        found = [self.block(entry, f"{at}[{i}]") for i, entry in enumerate(entries)]
        return tuple(block for block in found if block is not None)

    def _framed(self, raw: Any, scene: Scene, at: str) -> tuple[Block, ...]:
        """The whole scene for true; else the blocks given."""
        return scene.blocks if raw is True else self._added(raw, at)

    def _optional(self, raw: Any, name: str, at: str) -> list[Any]:
        """The entries of a list that may be left out."""
        return self.items(raw[name], f"{at}.{name}", MAX_BLOCKS) if name in raw else []

    def _mark(self, entry: Any, at: str) -> Mark:
        raw = self.mapping(entry, at)
        letter = self.choice(self.get(raw, "letter", f"{at}."), f"{at}.letter", MARK_LETTERS)
        place = self.position(self.get(raw, "position", f"{at}."), f"{at}.position")
        return Mark(letter or "", place or (0.0, 0.0, 0.0))

    def _view(self, raw: Any, at: str) -> tuple[float, float]:
        is_pair = isinstance(raw, list) and len(raw) == 2
        whole = self.angles([*raw, 0.0], at) if is_pair else None
        if not is_pair and raw is not MISSING:
            self.complain(at, "is no view", raw, "azimuth and elevation [degrees]")
        if whole is None:
            return (0.0, 1.0)
        if not 1 <= whole[1] <= 90:
            self.complain(at, "has an elevation out of range", raw, "azimuth, elevation 1 to 90")
        return whole[:2]

    def _by_order(self, raw: Any, scene: Scene, at: str) -> Mapping[int, Any]:
        """An object whose names are orders of blocks of the scene."""
        known = {str(block.order): block.order for block in scene.blocks}
        found = {}
        entries = self.mapping(raw, at)
        for name, value in () if entries is MISSING else entries.items():
            if name in known:
                found[known[name]] = value
            else:
                self.complain(at, "names no block", name, _orders(scene))
        return found


def _orders(scene: Scene) -> str:
    return "orders of the scene: " + ", ".join(str(block.order) for block in scene.blocks)
