"""Blocks that a picture does not show and that are sure to be there all the same."""

from __future__ import annotations

from phyblock.domain.question import QuestionPicture
from phyblock.making.questions.picture_view import COUNTED, NAMED, shares
from phyblock.making.questions.question_draft import UnfairError
from phyblock.sim.support import support_graph

__all__ = ["sure_blocks"]


def sure_blocks(picture: QuestionPicture) -> int:
    """How many blocks there have to be at the least, going by what the picture shows.

    Every block shows at least `COUNTED` of itself, but one at the most that shows less. That
    one is sure to be there, whatever it is, where a block that shows `NAMED` of itself rests on it
    alone: without it, that block would float. One is enough, for one is there. UnfairError where
    more are hidden, or nothing tells of it.
    """
    seen = shares(picture)
    hidden = [order for order, share in seen.items() if share < COUNTED]
    if len(hidden) > 1:
        raise UnfairError("several blocks are hidden")
    below = support_graph(picture.blocks)
    for order in hidden:
        if not any(seen[o] >= NAMED and below[o] == {order} for o in below):
            raise UnfairError(f"nothing that can be seen rests on block {order} alone")
    return len(picture.blocks)
