"""The wordings of the subtasks with simulation and several pictures: id -> template."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["DYNAMIC_TEMPLATES"]

_BUILD = (
    "The four pictures show the same finished structure, which was built in four stages. In each"
    " picture the blocks of one stage are {color}, and all the others {other}. A block can only be"
    " put down when all that it rests on is in place. In which order were the stages built,"
    " earliest first?",
    "Four teams built this structure one after another, each finishing before the next began. Each"
    " picture shows the blocks of one team in {color}, and those of the others in {other}. Nothing"
    " was ever put in place from below. Order the pictures from the first team to the last.",
    "A structure was put together from four subassemblies, one after the other. In every picture"
    " one of them is {color} and the rest of the finished structure {other}. In which order,"
    " from the first to the last, were they put together if every block needs what it rests on to"
    " be there already?",
    "Each picture marks in {color} the blocks that were added on one of four days; blocks of the"
    " other days are {other}. Blocks were only ever set down on what already stood. Sort the"
    " pictures from the first day to the last.",
    "In what sequence were the {color} parts of these four pictures of one structure assembled, if"
    " no block can be placed before the blocks under it? All that is not of the stage shown is"
    " {other}. Give the earliest stage first.",
    "Building this structure took four steps. What one step added is {color} in one of the"
    " pictures, and everything else, earlier or later, is {other}. Put the pictures in the order of"
    " the steps, the first step first, remembering that a block goes in after all those that carry"
    " it.",
)
_APART = (
    "The four pictures show the same structure before it is taken apart in four stages. In each"
    " picture the blocks removed in one stage are {color}, and all the others {other}. A block can"
    " only be lifted off when nothing rests on it any more. In which order do the stages follow,"
    " earliest first?",
    "Four teams dismantle this structure one after another. Each picture shows the blocks that one"
    " team takes away in {color}, and the others in {other}. No block is pulled out from under"
    " another. Order the pictures from the first team to the last.",
    "This structure is cleared in four steps. What one step clears is {color} in one of the"
    " pictures, and everything else, cleared earlier or later, is {other}. Blocks that carry"
    " others have to wait. Put the pictures in the order of the steps, the first step first.",
    "Each picture marks in {color} the blocks that are taken down on one of four days; blocks of"
    " the other days are {other}. Only blocks that carry nothing are ever taken. Sort the pictures"
    " from the first day to the last.",
    "In what sequence can the {color} parts of these four pictures be removed from the structure,"
    " if a block has to stay as long as anything rests on it? All that is not of the stage shown is"
    " {other}. Give the part that goes first, first.",
    "A structure is divided into four subassemblies that are taken away one after the other. In"
    " every picture one of them is {color} and the rest {other}. In which order, from the"
    " first to the last, are they taken away if nothing may be removed from below what it carries?",
)
_COUNT = (
    "What happens to the other blocks if the block marked X is removed?",
    "Suppose the block marked X is taken away at once. What happens to the rest of the structure?",
    "How will the structure change if the block marked X is taken out?",
    "The block marked X disappears. How many other blocks move or fall?",
    "Imagine the same scene without the block marked X, everything else let go where it is now."
    " What follows?",
    "Somebody lifts the block marked X away without touching the others. How many of the others"
    " move or fall?",
)
_COLORED = (
    "The block marked X in the first picture is taken away. Each of the other four pictures shows"
    " the structure before that, with X in {taken}, every block that will move or fall in {color},"
    " and every block that will stay in {other}. Which picture colors them rightly?",
    "What follows if the block marked X is removed? Four pictures color the same structure: X"
    " itself is {taken}, {color} are the blocks said to move or fall, {other} those said to stay"
    " where they are. Which one is right?",
    "Suppose the block marked X is taken out and everything else is let go. In which of the four"
    " pictures, where X is {taken}, are just those blocks {color} that do not stay where they are,"
    " and all the others {other}?",
    "Four people guess what the removal of the block marked X leads to. Each has colored X"
    " {taken}, what moves or falls {color}, and what stays in place {other}. Whose picture is"
    " right?",
    "The block marked X, {taken} in the pictures of the options, disappears. Choose the picture in"
    " which {color} marks all blocks that then move or fall, and {other} all that stay. A picture"
    " without {color} says that nothing moves.",
)
_NEXT = (
    "The first picture shows an unfinished structure. Which of the four pictures can be the next"
    " step, with one more block put down so that everything stays where it is?",
    "An assembly has come as far as the first picture shows. In which of the four pictures was the"
    " next block added so that nothing moves once it is let go?",
    "Which picture can come next in this assembly? The added block, and all others, must stay where"
    " they are once it is let go.",
    "One more block is about to be let go on the structure in the first picture, in four different"
    " places. In which picture will it stay put, and all else with it?",
    "Three of the four pictures show the moment before something falls. Which one shows a next step"
    " that holds?",
    "The assembly in the first picture goes on with one block. Which of the four ways of adding it"
    " does not end in a fall?",
)
_PUSHED = (
    "A finger slowly pushes the block marked X {direction} by 4.4 cm, a little less than the"
    " side of a cube, as seen in the picture. Which picture shows the scene after everything has"
    " come to rest?",
    "The block marked X is slid slowly {direction} by 4.4 cm, a little less than the side of a"
    " cube, as seen in the picture. Which of the four pictures shows the result?",
    "What does the scene look like after the block marked X was pushed slowly {direction}, as seen"
    " in the picture, by 4.4 cm, a little less than the side of a cube?",
    "Each of the four pictures shows what a slow push of one block by 4.4 cm, a little less than"
    " the side of a cube, led to. Which one follows when the block marked X is pushed {direction},"
    " as seen in the first picture?",
    "Seen from here, the block marked X is moved {direction} by 4.4 cm, slowly, nearly the side of"
    " a cube. Which picture was taken after that?",
)
_STAYS = (
    "The block in the second picture is lowered onto the structure in the first, turned as it is"
    " shown, with its middle straight above one of the marked places, and let go where it first"
    " touches something. At which place does it stay, with nothing moving or falling?",
    "At which of the places A to D can the block in the second picture be set down so that"
    " everything stays as it is? Its middle goes straight above the place, it is not turned, and it"
    " comes down until it touches something.",
    "Four places are marked. The block in the second picture is lowered, as it is turned there,"
    " with its middle over one of them until it touches something, and let go. At which place does"
    " it come to rest safely?",
    "Three of the places A to D are wrong for the block in the second picture: lowered there,"
    " turned as shown and with its middle over the mark, it would fall or tip something over as"
    " soon as it is let go. Which place is right?",
    "You hold the block in the second picture as it is turned there and let it down with its middle"
    " over A, B, C or D until it meets the structure. Where can you let go without anything"
    " falling?",
    "Which of the places A to D bears the block in the second picture? It is let down straight,"
    " turned as shown, its middle over the mark, and released at the first touch.",
)
_SIZE = " As it is turned there it measures {size}; the side of a cube is 5 cm."
_TARGET = " The small target of a mark lies on the block that is meant."
_MARKED_STEMS = ("cf-count", "cf-color", "pd-push")
_STEMS: Mapping[str, tuple[str, ...]] = {
    "or-build": _BUILD,
    "or-apart": _APART,
    "cf-count": _COUNT,
    "cf-color": _COLORED,
    "pd-next": _NEXT,
    "pd-push": _PUSHED,
    "ad-place": tuple(text + _SIZE for text in _STAYS),
}

DYNAMIC_TEMPLATES: Mapping[str, str] = {
    f"{stem}-{number}": text + (_TARGET if stem in _MARKED_STEMS else "")
    for stem, texts in _STEMS.items()
    for number, text in enumerate(texts, 1)
}
"""Named as those of the static subtasks: `cf-count-2`, `pd-push-1`."""
