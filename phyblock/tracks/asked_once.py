"""Shared parts of tracks that ask once about an item: pictures, worked examples, one prompt."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Generic, Protocol, TypeVar

from phyblock.data import AssemblyTask
from phyblock.models.request import Image, Request
from phyblock.parsing.structured import AnswerForm
from phyblock.stable import hex_digest
from phyblock.tracks.base import ItemT
from phyblock.tracks.examples import Examples, Shots, WorkedExample
from phyblock.tracks.prompts import Prompt, form_facts, response_format
from phyblock.tracks.showing import Showing, TaskShowing, showing_fields


class _SentPictures(Protocol):
    async def of(self, shown: Any) -> tuple[Image, ...]: ...

    def outline(self, shown: Any) -> tuple[tuple[Image, ...], bool]: ...

    def keys(self, shown: Any) -> tuple[str, ...]: ...

    def close(self) -> None: ...


PicturesT = TypeVar("PicturesT", bound=_SentPictures)


class AskedOnce(ABC, Generic[ItemT, PicturesT]):
    """Asks once about an item, with pictures; how replies are judged is the track's."""

    items: Sequence[ItemT]

    def __init__(
        self,
        prompt: Prompt | None,
        pictures: PicturesT | None,
        examples: Examples[ItemT] | None = None,
    ) -> None:
        """`prompt` and `pictures` are None where every model is a recording; `examples` are in
        the form in which they are shown.
        """
        self.template = "" if prompt is None else prompt.name
        self._prompt = prompt
        self._pictures = pictures
        self._examples: Examples[ItemT] = examples or Examples((), 0)
        self._worked: dict[str, WorkedExample] = {}

    @abstractmethod
    def facts(self, item: ItemT, pictures: tuple[Image, ...]) -> dict[str, object]:
        """Return the variables of templates; nothing in it gives an answer away."""

    @abstractmethod
    def _subject(self, item: ItemT) -> object:
        """Return the subject of baselines."""

    @abstractmethod
    def _form(self, item: ItemT) -> AnswerForm[Any] | None:
        """The form in which an answer is asked for; None where that is text."""

    @abstractmethod
    def _pictured(self, item: ItemT) -> object | None:
        """Return the drawing of an item; None where none is sent."""

    def _pictured_for(self, item: ItemT, _seed: int) -> object | None:
        """Return the drawing that a seed sends: that of the item, unless the track differs."""
        return self._pictured(item)

    def _forms(self) -> Sequence[ItemT]:
        """All items, in every form in which they are shown."""
        return self.items

    def _right_answer(self, item: ItemT) -> str:
        """Return the answer of a worked example; of tracks that show such."""
        raise NotImplementedError(f"there is no worked example of {item.key}")

    def identity(self) -> dict[str, Any]:
        """Name and version of the prompt, a digest of all that decides the pictures, and the worked
        examples where there are any.
        """
        if self._prompt is None or self._pictures is None:
            return {"prompt": None, "pictures": None}
        examples = self._examples.used(self.items)
        pictured = map(self._pictured, (*self._forms(), *examples))
        keys = [self._pictures.keys(shown) for shown in pictured if shown is not None]
        return {
            "prompt": {"name": self._prompt.name, "version": self._prompt.version},
            "pictures": hex_digest(json.dumps(keys)),
            **({"examples": [example.key for example in examples]} if examples else {}),
        }

    async def request(
        self, item: ItemT, seed: int, params: Mapping[str, object], *, with_messages: bool
    ) -> Request:
        """The request of one sample; without messages for models that need none."""
        if not with_messages or self._prompt is None or self._pictures is None:
            return Request(item.key, seed, (), params, "", self._subject(item))
        for one in self._examples.of(item):
            if one.key not in self._worked:
                pictures = await self._images(self._pictures, self._pictured(one))
                self._worked[one.key] = self._example(one, self._prompt, pictures)
        shots = Shots(tuple(self._worked[one.key] for one in self._examples.of(item)))
        pictures = await self._images(self._pictures, self._pictured_for(item, seed))
        return self._request(item, seed, params, self._prompt, pictures, shots)

    def outlines(self, item: ItemT) -> Iterator[tuple[Request, bool]]:
        """The one request, made without rendering, and whether its pictures are the real ones."""
        if self._prompt is None or self._pictures is None:
            yield Request(item.key, 0, (), {}, "", self._subject(item)), True
            return
        examples = []
        pictures, are_real = self._outline(self._pictures, self._pictured_for(item, 0))
        for one in self._examples.of(item):
            its_pictures, is_real = self._outline(self._pictures, self._pictured(one))
            examples.append(self._example(one, self._prompt, its_pictures))
            are_real = are_real and is_real
        shots = Shots(tuple(examples))
        yield self._request(item, 0, {}, self._prompt, pictures, shots), are_real

    def close(self) -> None:
        """Stop the processes that draw pictures and work things out."""
        if self._pictures is not None:
            self._pictures.close()

    async def _images(self, pictures: PicturesT, shown: object | None) -> tuple[Image, ...]:
        return () if shown is None else await pictures.of(shown)

    def _outline(self, pictures: PicturesT, shown: object | None) -> tuple[tuple[Image, ...], bool]:
        return ((), True) if shown is None else pictures.outline(shown)

    def _example(self, item: ItemT, prompt: Prompt, pictures: tuple[Image, ...]) -> WorkedExample:
        *_, question = prompt.messages(pictures, self.facts(item, pictures))
        return WorkedExample(item.key, question, self._right_answer(item))

    def _request(
        self,
        item: ItemT,
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
            response_format(self._form(item)),
            examples=shots.keys,
        )


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
        """Return how the scene is shown, where not as the file has it."""
        return showing_fields(item)

    def facts(self, item: AssemblyTask, pictures: tuple[Image, ...]) -> dict[str, object]:
        """Return the variables of templates; nothing in it gives an answer away."""
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
