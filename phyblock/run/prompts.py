"""`prompts.jsonl`: every prompt as it was sent, once, under its digest.

Pictures stand in it by their labels: what they show is in the data, and their digests are in the
records.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from phyblock.models.request import Image, Message
from phyblock.records.files import PromptLines
from phyblock.records.line import encodable
from phyblock.records.record import PictureMark, Prompt, PromptMessage
from phyblock.run.appending import AppendFile
from phyblock.stable import hex_digest

__all__ = ["PromptFile", "read_prompts"]


class PromptFile:
    """Prompts on their way to disk, each once."""

    def __init__(self, file: AppendFile, known: set[str]) -> None:
        self._file = file
        self._known = known

    def keep(self, messages: Sequence[Message]) -> str:
        """Write a prompt unless it is there; its digest. Raises StoreError as the file does."""
        content = tuple(_content(message) for message in messages)
        fields = [message.fields() for message in content]
        canonical = json.dumps(fields, sort_keys=True, separators=(",", ":"))
        digest = hex_digest(canonical)
        if digest not in self._known:
            self._known.add(digest)
            self._file.append([Prompt(sha256=digest, messages=content).fields()])
        return digest


def read_prompts(folder: Path) -> dict[str, tuple[PromptMessage, ...]]:
    """The messages of every prompt of a run folder, by digest."""
    return {line.sha256: line.messages for _, line in PromptLines(folder)}


def _content(message: Message) -> PromptMessage:
    parts = (
        PictureMark(image=part.label) if isinstance(part, Image) else encodable(part)
        for part in message.parts
    )
    return PromptMessage(role=message.role, parts=tuple(parts))
