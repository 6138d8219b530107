"""What the tracks share that ask once for a whole plan of a scene."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Generic, Protocol, TypeVar

from phyblock.data import AssemblyTask
from phyblock.models.base import Image
from phyblock.parsing.structured import AnswerForm
from phyblock.tracks.asked_once import AskedOnce, PicturesT
from phyblock.tracks.examples import Examples
from phyblock.tracks.prompts import Prompt, form_facts
from phyblock.tracks.showing import Showing, TaskShowing, showing_fields

__all__ = ["AS_IN_FILE", "WholePlanTrack"]

AS_IN_FILE = TaskShowing(Showing())
"""Scenes as the file has them."""


class _Rules(Protocol):
    def form(self, item: AssemblyTask) -> AnswerForm[Any] | None: ...


RulesT = TypeVar("RulesT", bound=_Rules)


class WholePlanTrack(AskedOnce[AssemblyTask, PicturesT], Generic[RulesT, PicturesT]):
    """Asks once about a scene, as a seed shows it."""

    def __init__(
        self,
        rules: RulesT,
        prompt: Prompt | None,
        pictures: PicturesT | None,
        items: Sequence[AssemblyTask],
        showing: TaskShowing,
        examples: Examples[AssemblyTask] | None = None,
    ) -> None:
        """See `AskedOnce`."""
        super().__init__(prompt, pictures, examples)
        self.rules = rules
        self.items = items
        self._showing = showing

    def shown(self, item: AssemblyTask, seed: int) -> AssemblyTask:
        """The scene as a seed shows it."""
        return self._showing.of(item, seed)

    def about(self, item: AssemblyTask) -> dict[str, Any]:
        """How the scene is shown, where not as the file has it."""
        return showing_fields(item)

    def facts(self, item: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """What templates may use; nothing in it gives an answer away."""
        return {
            "pictures": [picture.label for picture in pictures],
            "n_candidates": len(item.candidates),
            "is_blind": self._showing.how.blind,
            **form_facts(self._form(item)),
        }

    def _form(self, item: AssemblyTask) -> AnswerForm[Any] | None:
        return self.rules.form(item)

    def _pictured(self, item: AssemblyTask) -> AssemblyTask:
        return item

    def _forms(self) -> Sequence[AssemblyTask]:
        return [self.shown(task, seed) for seed in self._showing.seeds for task in self.items]
