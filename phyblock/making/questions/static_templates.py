"""The wordings of the static subtasks: id -> template with named slots."""

from __future__ import annotations

from collections.abc import Mapping

from phyblock.making.questions.counting_templates import COUNTING_TEMPLATES
from phyblock.making.questions.viewpoint_templates import VIEWPOINT_TEMPLATES

__all__ = ["TEMPLATES"]

TEMPLATES: Mapping[str, str] = {
    "sh-1": "What is the shape of the {block}?",
    "sh-2": "Which shape does the {block} have?",
    "sh-3": "The {block} in the picture is of which shape?",
    "sh-4": "Look at the {block}. What kind of block is it?",
    "co-1": "What is the color of the {block}?",
    "co-2": "Which color does the {block} have?",
    "co-3": "The {block} in the picture is of which color?",
    "co-4": "Look at the {block}. What color is it?",
    "si-height-1": (
        "Which of these blocks is the {comparison}, measured from its lowest to its highest point?"
    ),
    "si-height-2": (
        "Compare the heights of these blocks themselves, not how high they stand. "
        "Which one is the {comparison}?"
    ),
    "si-height-3": "As it stands in the picture, which of these blocks is itself the {comparison}?",
    "si-length-1": "Which of these blocks is the {comparison}, however it lies?",
    "si-length-2": "Compare the longest sides of these blocks. Which block is the {comparison}?",
    "si-length-3": "Of these blocks, which is the {comparison}, measured along its longest side?",
    "si-volume-1": "Which of these blocks is the {comparison} by volume?",
    "si-volume-2": "Compare how much space these blocks take up. Which one is the {comparison}?",
    "si-volume-3": "Of these blocks, which one is the {comparison} in volume?",
    "si-times-1": "How tall is the {block} itself, compared with the {other}?",
    "si-times-2": (
        "From its lowest to its highest point, how does the {block} compare with the {other}?"
    ),
    "si-times-3": "Next to the {other}, how tall is the {block} as a block of its own?",
    "nu-1": "How many {what} are there in the picture?",
    "nu-2": "How many {what} does the structure have?",
    "nu-3": "Count the {what}. How many are there?",
    "nu-4": "What is the number of {what} in this structure?",
    "rp-corner-1": "Seen from the camera, where along the floor is the {block} from the {other}?",
    "rp-corner-2": (
        "Leave heights aside. As seen in the picture, where is the {block} relative to the {other}?"
    ),
    "rp-corner-3": (
        "By left and right, front and back in the picture, where is the {block} from the {other}?"
    ),
    "rp-upright-1": "As seen in the picture, where is the {block} relative to the {other}?",
    "rp-upright-2": "Starting from the {other}, where do you find the {block}?",
    "rp-upright-3": "What is the position of the {block} with respect to the {other}?",
    "rp-extreme-1": "Which of these blocks is {extreme} in the picture?",
    "rp-extreme-2": "In the picture, which of these four blocks is {extreme}?",
    "rp-highest-1": "Which of these blocks reaches highest above the ground?",
    "rp-highest-2": "Of these four blocks, which one has its top the farthest above the ground?",
    "rp-highest-3": "Whose highest point is the highest above the ground?",
    "rp-lowest-1": "Which of these blocks has its top nearest to the ground?",
    "rp-lowest-2": "Whose highest point is the lowest above the ground?",
    "rp-front-1": "Which of these blocks is nearest to the viewer, measured along the floor?",
    "rp-front-2": "Of these four blocks, which one stands farthest to the front?",
    "rp-back-1": "Which of these blocks is farthest from the viewer, measured along the floor?",
    "rp-back-2": "Of these four blocks, which one stands farthest to the back?",
    "rp-nearest-1": "Which of these blocks is nearest to the {other}, from middle to middle?",
    "rp-nearest-2": "Whose middle is the closest to the middle of the {other}?",
    "ap-top-1": "If {scale}, how high above the ground is the top of the {block}?",
    "ap-top-2": "Take as scale that {scale}. At what height is the highest point of the {block}?",
    "ap-bottom-1": "If {scale}, how high above the ground is the lowest point of the {block}?",
    "ap-bottom-2": "Take as scale that {scale}. At what height is the lowest point of the {block}?",
    "ap-apart-1": (
        "If {scale}, how far apart are the middles of the {block} and the {other}, "
        "measured along the ground?"
    ),
    "ap-apart-2": (
        "Take as scale that {scale}. Seen straight from above, what is the distance between "
        "the middles of the {block} and the {other}?"
    ),
    "ap-rise-1": (
        "If {scale}, by how much do the tops of the {block} and the {other} differ in height?"
    ),
    "ap-rise-2": (
        "Take as scale that {scale}. What is the difference in height between the highest points "
        "of the {block} and the {other}?"
    ),
    "ap-gap-1": "If {scale}, how wide is the gap between the {block} and the {other}?",
    "ap-gap-2": (
        "Take as scale that {scale}. How much room is there between the {block} and the {other},"
        " from side to side?"
    ),
    "ap-place-1": (
        "If {scale}, how far along the length of the {other}, and how far across it, is the middle "
        "of the {block} from its middle, seen straight from above?"
    ),
    "ap-place-2": (
        "Take as scale that {scale}. Starting from the middle of the {other}, go along its length "
        "and then square to it until you are over or under the middle of the {block}. How far is "
        "each way?"
    ),
    "rd-on-1": "Which of these blocks rests directly on the {block}?",
    "rd-on-2": "Which block is directly supported by the {block}?",
    "rd-on-3": "On the {block} stands one of these blocks. Which one?",
    "rd-under-1": "Which of these blocks directly supports the {block}?",
    "rd-under-2": "The {block} rests directly on one of these blocks. Which one?",
    "rd-under-3": "Which block lies directly under the {block} and carries it?",
    "rd-needed-1": "Which of these blocks has to be in place before the {block} can be put there?",
    "rd-needed-2": "The {block} depends, directly or through others, on which of these blocks?",
    "rd-carried-1": "Which of these blocks can be put in place only after the {block}?",
    "rd-carried-2": "Which of these blocks depends, directly or through others, on the {block}?",
    "rr-angle-1": (
        "By how much is the {block} turned about the vertical, compared with the {other}?"
    ),
    "rr-angle-2": (
        "Seen from above, what is the least turn that brings the {block} into the orientation of "
        "the {other}?"
    ),
    "rr-angle-3": (
        "What is the angle between the orientations of the {block} and the {other}, "
        "about a vertical axis?"
    ),
    "rr-turn-1": ("Seen from above, by how much is the {block} turned, compared with the {other}?"),
    "rr-turn-2": (
        "Seen from above, which turn takes the orientation of the {other} to that of the {block}?"
    ),
    "rr-turn-3": (
        "The {other} is turned on the spot until it is oriented like the {block}. "
        "Seen from above, what is that turn?"
    ),
    "rr-axis-1": (
        "The {other} is to be oriented like the {block}. Which turn does that, if its length is "
        "its longest side?"
    ),
    "rr-axis-2": (
        "Take the length of a block as its longest side. Which turn of the {other} would give it "
        "the orientation of the {block}?"
    ),
    "rr-axis-3": (
        "How would the {other} have to be turned to be oriented as the {block} is? Its length is "
        "its longest side."
    ),
    **COUNTING_TEMPLATES,
    **VIEWPOINT_TEMPLATES,
}
"""An id is the subtask, a kind where there are several, and a number: `rp-corner-2`."""
