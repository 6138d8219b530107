"""What the tracks share that ask once for a whole plan of a scene."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar

from phyblock import parsing
from phyblock.datasets import AssemblyTask
from phyblock.digests import hex_digest
from phyblock.models.base import Image, Request
from phyblock.tracks.examples import Shots
from phyblock.tracks.prompts import Prompt, form_facts, response_format
from phyblock.tracks.showing import Showing, TaskShowing, showing_fields

__all__ = ["AS_IN_FILE", "WholePlanTrack"]

AS_IN_FILE = TaskShowing(Showing())
"""Scenes as the file has them."""


class _TaskPictures(Protocol):
    async def of(self, task: AssemblyTask) -> tuple[Image, ...]: ...

    def outline(self, task: AssemblyTask) -> tuple[tuple[Image, ...], bool]: ...

    def keys(self, task: AssemblyTask) -> tuple[str, ...]: ...

    def close(self) -> None: ...


class _Rules(Protocol):
    def form(self, item: AssemblyTask) -> parsing.AnswerForm[Any] | None: ...


RulesT = TypeVar("RulesT", bound=_Rules)
PicturesT = TypeVar("PicturesT", bound=_TaskPictures)


class WholePlanTrack(ABC, Generic[RulesT, PicturesT]):
    """Asks once about a scene, with its pictures; how replies are judged is the track's."""

    def __init__(
        self,
        rules: RulesT,
        prompt: Prompt | None,
        pictures: PicturesT | None,
        items: Sequence[AssemblyTask],
        showing: TaskShowing,
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording."""
        self.rules = rules
        self.items = items
        self.template = "" if prompt is None else prompt.name
        self._prompt = prompt
        self._pictures = pictures
        self._showing = showing

    @abstractmethod
    def _subject(self, item: AssemblyTask) -> object:
        """What baselines answer about."""

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
            **form_facts(self.rules.form(item)),
        }

    def identity(self) -> dict[str, Any]:
        """Name and version of the prompt, and a digest of all that decides the pictures."""
        if self._prompt is None or self._pictures is None:
            return {"prompt": None, "pictures": None}
        keys = [self._pictures.keys(task) for task in self._pictured()]
        return {
            "prompt": {"name": self._prompt.name, "version": self._prompt.version},
            "pictures": hex_digest(json.dumps(keys)),
        }

    async def request(
        self, item: AssemblyTask, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """The request of one sample; without messages for models that need none."""
        if not with_messages or self._prompt is None or self._pictures is None:
            return Request(item.key, seed, (), params, "", self._subject(item))
        shots = await self._shots(item, self._prompt, self._pictures)
        pictures = await self._pictures.of(item)
        return self._request(item, seed, params, self._prompt, pictures, shots)

    def outlines(self, item: AssemblyTask) -> Iterator[tuple[Request, bool]]:
        """The one request, made without rendering, and whether its pictures are the real ones."""
        if self._prompt is None or self._pictures is None:
            yield Request(item.key, 0, (), {}, "", self._subject(item)), True
            return
        pictures, real = self._pictures.outline(item)
        shots, are_real = self._outlined_shots(item, self._prompt, self._pictures)
        yield self._request(item, 0, {}, self._prompt, pictures, shots), real and are_real

    def close(self) -> None:
        """Stop the processes that draw pictures and work things out."""
        if self._pictures is not None:
            self._pictures.close()

    def _pictured(self) -> list[AssemblyTask]:
        """All scenes of which pictures are sent, in every form in which they are shown."""
        return [self.shown(task, seed) for seed in self._showing.seeds for task in self.items]

    async def _shots(self, _item: AssemblyTask, _prompt: Prompt, _pictures: PicturesT) -> Shots:
        """The worked examples of a scene; none, unless the track has some."""
        return Shots()

    def _outlined_shots(
        self, _item: AssemblyTask, _prompt: Prompt, _pictures: PicturesT
    ) -> tuple[Shots, bool]:
        """The same made without rendering, and whether all pictures are the real ones."""
        return Shots(), True

    def _request(
        self,
        item: AssemblyTask,
        seed: int,
        params: Mapping[str, object],
        prompt: Prompt,
        pictures: tuple[Image, ...],
        shots: Shots,
    ) -> Request:
        messages = prompt.messages(pictures, self.facts(item, pictures))
        return Request(
            item.key,
            seed,
            shots.before(messages),
            params,
            prompt.version,
            self._subject(item),
            response_format(self.rules.form(item)),
            examples=shots.keys,
        )
