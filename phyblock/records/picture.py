"""The pictures of a question: each as what differs from the scene that the question shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    Field,
    StrictInt,
    Tag,
    ValidationInfo,
)
from typing_extensions import Self

from phyblock.domain.blocks import BlockType, Color
from phyblock.domain.question import Mark, QuestionPicture
from phyblock.domain.scene import Block, Scene
from phyblock.records.data_values import Angles, Filled, Position, View, plain, triple
from phyblock.records.decode import shown
from phyblock.records.faults import Fault, fits
from phyblock.records.line import Line
from phyblock.records.scene import MAX_BLOCKS, StoredBlock

__all__ = ["OF_BLOCKS", "About", "Picture", "StoredPicture"]


@dataclass(frozen=True)
class About:
    """What a question is held against: the scene that it names, if it is one of `n_scenes`."""

    scene: Scene | None
    n_scenes: int

    @classmethod
    def named_in(cls, raw: object, scenes: Mapping[str, Scene]) -> Self:
        """The scene that a decoded line names."""
        name = raw.get("scene_id") if isinstance(raw, dict) else None
        return cls(scenes.get(name) if isinstance(name, str) else None, len(scenes))


def _in_scene(find: Callable[[Any, Scene], Iterable[Fault]]) -> AfterValidator:
    """A check that `find` finds nothing, where the scene is known."""

    def found(value: Any, info: ValidationInfo) -> Iterable[Fault]:
        scene = info.context.scene if isinstance(info.context, About) else None
        return () if scene is None else find(value, scene)

    return fits(found)


def _unknown_orders(orders: object, scene: Scene) -> Iterator[Fault]:
    known = [str(block.order) for block in scene.blocks]
    allowed = "orders of the scene: " + ", ".join(known)
    for order in orders if isinstance(orders, dict | tuple) else ():
        if str(order) not in known:
            yield Fault("names no block", allowed, shown(order))


def _known_orders(added: Sequence[StoredBlock], scene: Scene) -> Iterator[Fault]:
    known = [block.order for block in scene.blocks]
    for order in (block.order for block in added):
        if order in known:
            yield Fault("has the order of a block of the scene", found=str(order))


OF_BLOCKS = BeforeValidator(_in_scene(_unknown_orders).func)
"""An object whose names are orders of blocks of the scene."""


class StoredPose(Line, extra="ignore"):
    """Where a block stands in a picture."""

    position: Position
    """As of a block."""
    euler: Angles
    """As of a block."""


class StoredKind(Line, extra="ignore"):
    """What a block is in a picture."""

    type: BlockType
    """Its shape."""
    color: Color
    """Its color."""


class StoredMark(Line, extra="ignore"):
    """A lettered place."""

    letter: Literal["A", "B", "C", "D", "X"]
    """A to D where the places are the options, X where the text speaks of one."""
    position: Position
    """Where it is [m]."""


_Whole = Annotated[Literal[True], Tag("true")]
_Blocks = Annotated[tuple[StoredBlock, ...], Filled(MAX_BLOCKS)]
# The blocks of several outcomes, so that all of their pictures are framed alike.
_Framed = Annotated[tuple[StoredBlock, ...], Filled(4 * MAX_BLOCKS)]


class StoredPicture(Line, extra="forbid"):
    """How a picture differs from the scene, recolored as in `colors`."""

    label: Literal["scene", "block", "A", "B", "C", "D"]
    """What it shows: the scene, the block asked about, or the option of this letter."""
    view: View
    """Azimuth (0 from +x, 90 from +y) and elevation of the camera [degrees]."""
    without: Annotated[
        tuple[StrictInt, ...],
        Filled(MAX_BLOCKS),
        _in_scene(_unknown_orders),
    ] = ()
    """Orders of blocks that are not drawn."""
    poses: Annotated[dict[str, StoredPose], OF_BLOCKS] = Field(default_factory=dict)
    """Where blocks stand that are not at their place, by order."""
    swap: Annotated[dict[str, StoredKind], OF_BLOCKS] = Field(default_factory=dict)
    """What blocks are that differ from the scene, by order."""
    add: Annotated[_Blocks, _in_scene(_known_orders)] = ()
    """Whole blocks that the scene does not have."""
    marks: Annotated[tuple[StoredMark, ...], Filled(MAX_BLOCKS)] = ()
    """Places."""
    framed: Annotated[
        _Whole | Annotated[_Framed, Tag("")],
        Discriminator(lambda value: "true" if value is True else ""),
    ] = ()
    """What the camera is framed on: true, the whole scene; or these blocks. Left out: what is
    drawn."""

    @classmethod
    def of(cls, picture: QuestionPicture, scene: Scene) -> Self:
        """A recipe as it is written."""
        known = {block.order: block for block in scene.blocks}
        drawn = {block.order: block for block in picture.blocks}
        kept = [(known[order], block) for order, block in drawn.items() if order in known]
        recipe: dict[str, Any] = {
            "without": [order for order in known if order not in drawn],
            "poses": {
                str(new.order): {"position": plain(new.position_m), "euler": plain(new.euler_deg)}
                for old, new in kept
                if (old.position_m, old.euler_deg) != (new.position_m, new.euler_deg)
            },
            "swap": {
                str(new.order): {"type": new.type, "color": new.color}
                for old, new in kept
                if old.kind != new.kind
            },
            "add": [StoredBlock.of(block) for order, block in drawn.items() if order not in known],
            "marks": [
                {"letter": mark.letter, "position": plain(mark.position_m)}
                for mark in picture.marks
            ],
            "framed": picture.framed == scene.blocks or [*map(StoredBlock.of, picture.framed)],
        }
        given = {name: part for name, part in recipe.items() if part}
        return cls.model_validate(
            {"label": picture.label, "view": plain(picture.view_deg), **given}
        )

    def picture(self, scene: Scene) -> QuestionPicture:
        """The picture that it makes of a scene."""
        kept = (block for block in scene.blocks if block.order not in self.without)
        added = (stored.block() for stored in self.add)
        azimuth, elevation, _ = triple((*self.view, 0.0))
        framed = scene.blocks if self.framed is True else (b.block() for b in self.framed)
        return QuestionPicture(
            self.label,
            (*map(self._changed, kept), *added),
            (azimuth, elevation),
            tuple(Mark(mark.letter, triple(mark.position)) for mark in self.marks),
            tuple(framed),
        )

    def _changed(self, block: Block) -> Block:
        name = str(block.order)
        if kind := self.swap.get(name):
            block = replace(block, type=kind.type, color=kind.color)
        if pose := self.poses.get(name):
            position_m, euler_deg = triple(pose.position), triple(pose.euler)
            block = replace(block, position_m=position_m, euler_deg=euler_deg)
        return block


def _nothing_drawn(picture: StoredPicture, scene: Scene) -> Iterator[Fault]:
    if not picture.add and len(set(picture.without)) == len(scene):
        yield Fault("draws no blocks", found="")


Picture = Annotated[StoredPicture, _in_scene(_nothing_drawn)]
"""A picture that shows something of its scene."""
