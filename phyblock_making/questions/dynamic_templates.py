"""The wordings of the subtasks with simulation and several pictures: id -> template."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["DYNAMIC_TEMPLATES"]

_BUILD = (
    "The four pictures show stages of building one structure, block by block, with no block ever"
    " taken away. Put them in the order of building, earliest stage first.",
    "A structure is built from the ground up. In which order were these four pictures taken, from"
    " the earliest to the latest?",
    "Sort the four pictures of one assembly by time: the first stage first, the most complete"
    " stage last.",
)
_APART = (
    "A structure is taken apart, block by block, and no block is ever put back. Put the four"
    " pictures in the order in which they were taken, earliest first.",
    "The four pictures show one structure while its blocks are removed one after another. In which"
    " order were the pictures taken, from the earliest to the latest?",
    "Sort the four pictures of one disassembly by time: the most complete stage first, the one"
    " with the fewest blocks last.",
)
_COUNT = (
    "What happens to the other blocks if the block marked X is removed?",
    "Suppose the block marked X is taken away at once. What happens to the rest of the structure?",
    "How will the structure change if the block marked X is taken out?",
    "The block marked X disappears. How many other blocks move or fall?",
)
_WHICH = (
    "If the block marked X is removed, at which of the marked places A to D does the block there"
    " move or fall?",
    "Suppose the block marked X is taken out. Exactly one of the blocks at the places A, B, C and D"
    " does not stay where it is. At which place?",
    "The block marked X is taken away. Which of the marked places A to D is on a block that moves"
    " or falls?",
)
_GONE = (
    "What is likely to happen if the {block} is taken away? Choose the picture that shows the"
    " scene after everything has come to rest.",
    "How will the scene change if the {block} is removed? Which picture shows it once it has come"
    " to rest?",
    "Suppose the {block} is taken out. Which of the four pictures shows the result?",
    "Which picture shows what follows the removal of the {block}?",
)
_NEXT = (
    "The first picture shows an unfinished structure. Which of the four pictures can be the next"
    " step, with one more block in place that stays where it is put?",
    "An assembly has come as far as the first picture shows. In which of the four pictures was the"
    " next block added so that it stays put?",
    "Which picture can come next in this assembly? The added block must stay where it is once it"
    " is let go.",
)
_PUSHED = (
    "A finger slowly pushes the block marked X {direction} by 4.4 cm, a little less than the"
    " side of a cube, as seen in the picture. Which picture shows the scene after everything has"
    " come to rest?",
    "The block marked X is slid slowly {direction} by 4.4 cm, a little less than the side of a"
    " cube, as seen in the picture. Which of the four pictures shows the result?",
    "What does the scene look like after the block marked X was pushed slowly {direction}, as seen"
    " in the picture, by 4.4 cm, a little less than the side of a cube?",
)
_STAYS = (
    "The block in the second picture is put down on the structure in the first, turned as it is"
    " shown, with its middle straight above one of the marked places. At which place does it stay,"
    " with nothing moving or falling?",
    "At which of the places A to D can the block in the second picture be set down so that"
    " everything stays as it is? Its middle goes straight above the place, and it is not turned.",
    "Four places are marked. The block in the second picture is lowered, as it is turned there,"
    " with its middle over one of them, and let go. At which place does it come to rest safely?",
)
_TARGET = " The small target of a mark lies on the block that is meant."
_MARKED_STEMS = ("cf-count", "cf-which", "pd-push")
_STEMS: Mapping[str, tuple[str, ...]] = {
    "or-build": _BUILD,
    "or-apart": _APART,
    "cf-count": _COUNT,
    "cf-which": _WHICH,
    "cf-picture": _GONE,
    "pd-next": _NEXT,
    "pd-push": _PUSHED,
    "ad-place": _STAYS,
}

DYNAMIC_TEMPLATES: Mapping[str, str] = {
    f"{stem}-{number}": text + (_TARGET if stem in _MARKED_STEMS else "")
    for stem, texts in _STEMS.items()
    for number, text in enumerate(texts, 1)
}
"""Named as those of the static subtasks: `cf-count-2`, `pd-push-1`."""
