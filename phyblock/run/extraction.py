"""Replies that no reader could read, copied into the asked form by another model.

The model is sent the text of the reply and nothing else. What it copies is kept in the record and
read by the same readers, so that `phyblock score` needs to ask nobody.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from phyblock.config.models import ModelConfig
from phyblock.errors import BudgetReachedError, ModelError
from phyblock.models import AskLaterError, HaltedError, Model, Request
from phyblock.models.request import Message
from phyblock.records.record import Extraction, Record
from phyblock.records.reply import Reply
from phyblock.resources import bundled
from phyblock.run.judging import judged_apart
from phyblock.tracks import Item, SingleTrack
from phyblock.tracks.prompts import TemplatePrompt

RULE = "extractor"
"""The rule of a record whose reply was read out of what the model copied."""


def extraction_prompt() -> TemplatePrompt:
    """Return the prompt that extraction models are asked with."""
    return TemplatePrompt(bundled("prompts", "extract.j2"), "extract")


class Extractor:
    """Asks a model what replies say that could not be read."""

    def __init__(self, model: Model, config: ModelConfig) -> None:
        self._model = model
        self._config = config
        self._prompt = extraction_prompt()

    async def read(self, track: SingleTrack[Any], item: Item, record: Record) -> Record:
        """Return a record judged by what the model copied, if nothing was read in its reply.

        Where the model cannot be asked, the record stays as it is: its reply is paid for.
        """
        text = "" if record.reply is None else record.reply.text
        if record.outcome != "parse_failure" or not text.strip():
            return record
        content = self._prompt.text("user", {"track": track.name, "reply": text})
        request = Request(
            f"{track.name}/{item.key}",
            0,
            (Message("user", (content,)),),
            self._config.params,
            self._prompt.version,
            None,
        )
        try:
            reply = await self._model.ask(request)
        except (ModelError, BudgetReachedError, HaltedError, AskLaterError):
            return record
        if reply is None:
            return record
        return await read_extraction(
            track, item, record, Extraction(model=self._model.name, reply=reply.storable())
        )


async def read_extraction(
    track: SingleTrack[Any],
    item: Item,
    record: Record,
    extraction: Extraction,
    earlier: Record | None = None,
) -> Record:
    """Return the record of an unread reply, judged by an extraction where that can be read."""
    given: Mapping[str, Any] = {**record.as_given(), "extraction": extraction}
    again = await judged_apart(track, item, _copied(extraction.reply), given, earlier)
    if again.outcome != "ok":
        return record.model_copy(update={"extraction": extraction})
    return again.model_copy(update={"parse": again.parse.model_copy(update={"rule": RULE})})


def _copied(reply: Reply) -> str:
    return "" if reply.text.strip().strip(".").upper() == "NONE" else reply.text
