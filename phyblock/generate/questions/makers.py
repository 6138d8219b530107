"""The makers of questions, one a subtask."""

from __future__ import annotations

from collections.abc import Mapping

from phyblock.domain.question import Subtask
from phyblock.generate.questions.base import Maker

__all__ = ["MAKERS"]

_MAKERS: tuple[Maker, ...] = ()

MAKERS: Mapping[Subtask, Maker] = {maker.subtask: maker for maker in _MAKERS}
"""By subtask."""
