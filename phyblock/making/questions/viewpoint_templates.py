"""The wordings of viewpoint questions: stem -> texts with named slots."""

from __future__ import annotations

from collections.abc import Mapping

__all__ = ["VIEWPOINT_TEMPLATES"]

_STEMS: Mapping[str, tuple[str, ...]] = {
    "vp-match": (
        "The first picture shows a structure. Which of the four pictures shows exactly the same"
        " structure from another viewpoint?",
        "Which of the four pictures shows the very structure of the first picture, seen from"
        " elsewhere? The others differ from it in places or colors, or are mirrored.",
        "The camera has moved around the structure in the first picture. Which of the four pictures"
        " did it take of that structure, with every block unchanged?",
        "Four structures are made of the same blocks. Which one is the one in the first picture,"
        " looked at from another side?",
        "Walk around the structure in the first picture without touching it. Which of the four"
        " pictures can you see then?",
        "Only one of the four structures can be turned to look like the one in the first picture."
        " Which one? A mirror image does not count as turned.",
    ),
    "vp-side": (
        "The first picture shows a structure from the front. Which of the four pictures shows it"
        " from {side_words}?",
        "Looking at the structure in the first picture from the front, imagine walking around it"
        " until you face it from {side_words}. Which of the four pictures do you see then?",
        "If the first picture is the front view of the structure, which of the four pictures is the"
        " view from {side_words}?",
        "The first picture is taken from the front. Which of the four shows the same structure,"
        " neither changed nor mirrored, from {side_words}?",
        "Someone stands where the first picture was taken, in front of the structure; someone else"
        " looks at it from {side_words}. Which of the four pictures does the other one see?",
        "Match the view from {side_words} to the front view in the first picture. Which of the four"
        " pictures is it?",
    ),
}

VIEWPOINT_TEMPLATES: Mapping[str, str] = {
    f"{stem}-{number}": text
    for stem, texts in _STEMS.items()
    for number, text in enumerate(texts, 1)
}
"""An id is a stem and a number: `vp-side-2`."""
