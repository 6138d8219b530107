"""The wordings of the subtasks that count over a whole scene: stem -> texts with named slots."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["COUNTING_TEMPLATES"]

_LAYERS = (
    "A block on the ground is in layer 1, any other block is one layer above the highest block it"
    " rests on."
)
_ONE_MORE = (
    "Count a block's layer as one more than that of the highest block under it, and blocks on the"
    " ground as layer 1."
)
_TYPES = "Blocks of the same shape and size are of one type, whatever their color."
_SHAPES = (
    "Cube, rectangular prism of any length, triangular prism, cylinder, half cylinder and arch are"
    " the shapes."
)
_HIDDEN = (
    "A block may be wholly hidden behind others; it is sure to be there where something that can be"
    " seen would else rest on nothing."
)

_STEMS: Mapping[str, tuple[str, ...]] = {
    "oc-all": (
        "How many blocks are there in all?",
        "How many blocks is the structure made of?",
        "Count all the blocks in the picture. How many are there?",
        "What is the total number of blocks?",
    ),
    "oc-hidden": (
        f"{_HIDDEN} How many blocks does the structure have at the least, with those?",
        f"{_HIDDEN} Counting every block that is sure to be there, how many are there?",
        "Not every block need show: some may only be known by what rests on them. How many blocks"
        " have to be there at the least?",
    ),
    "oc-ground": (
        "How many blocks stand or lie on the ground?",
        "How many of the blocks touch the floor?",
        "Count the blocks that rest on the ground itself. How many are there?",
    ),
    "oc-raised": (
        "How many blocks do not touch the ground?",
        "How many blocks rest on other blocks alone, not on the floor?",
        "Leave out all blocks that stand on the floor. How many are left?",
    ),
    "oc-other": (
        "How many blocks are not {color}?",
        "If all {color} blocks were taken out of the picture, how many would be left to count?",
        "Count the blocks of every color but {color}. How many are there?",
    ),
    "oc-pair": (
        "How many blocks are {color} or {other}?",
        "Count the {color} blocks and the {other} blocks together. How many are there?",
        "How many blocks have one of the colors {color} and {other}?",
    ),
    "lc-all": (
        f"{_LAYERS} How many layers does the structure have?",
        "How many layers are there, when a block counts one layer more than the highest block under"
        " it, starting with 1 on the ground?",
        "Counting upward from the ground, how many blocks are in the longest chain in which each"
        " block rests on the one before?",
        f"{_ONE_MORE} What is the number of the highest layer?",
    ),
    "lc-block": (
        f"{_LAYERS} In which layer is the {{block}}?",
        f"{_ONE_MORE} What is the layer of the {{block}}?",
        "Going up from the ground to the {block} from block to block, each resting on the one"
        " before, how many blocks does the longest way count, the {block} included?",
    ),
    "lc-in": (
        f"{_LAYERS} How many blocks are in layer {{layer}}?",
        f"{_ONE_MORE} How many blocks does layer {{layer}} hold?",
        f"{_LAYERS} Count the blocks of layer {{layer}}. How many are there?",
    ),
    "lc-above": (
        f"{_LAYERS} How many blocks are above layer {{layer}}?",
        f"{_ONE_MORE} How many blocks are in a layer higher than {{layer}}?",
        f"{_LAYERS} If all blocks up to layer {{layer}} are left out, how many remain?",
    ),
    "tc-all": (
        f"{_TYPES} How many types are there in the picture?",
        "How many different types of blocks does the structure use, if types differ in shape or"
        " size, not in color?",
        "How many different block types (by shape and size, not color) can you count?",
    ),
    "tc-shapes": (
        f"{_SHAPES} How many different shapes does the structure use?",
        f"{_SHAPES} How many of these six shapes can be seen?",
        "Rectangular prisms count as one shape, however long they are. How many different shapes"
        " are there in the picture?",
    ),
    "tc-once": (
        f"{_TYPES} Of how many types is there just one block?",
        f"{_TYPES} How many types occur only once?",
        "How many blocks are the only ones of their shape and size, whatever the color?",
    ),
    "tc-ground": (
        f"{_TYPES} How many types are there among the blocks that touch the ground?",
        f"{_TYPES} Look at the blocks on the floor alone. Of how many types are they?",
        "How many different types of blocks, by shape and size, not color, rest on the ground?",
    ),
    "tc-kinds": (
        "Two blocks are of one kind if shape, size and color are the same. How many kinds of blocks"
        " are there?",
        "How many different kinds of blocks can be told apart by shape, size and color together?",
        "If blocks that look alike in shape, size and color are put into one box, how many boxes"
        " are needed?",
    ),
}

COUNTING_TEMPLATES: Mapping[str, str] = {
    f"{stem}-{number}": text
    for stem, texts in _STEMS.items()
    for number, text in enumerate(texts, 1)
}
"""An id is a stem and a number: `oc-hidden-2`."""
