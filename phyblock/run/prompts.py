"""`prompts.jsonl`: every prompt as it was sent, once, under its digest.

Pictures stand in it by their labels: what they show is in the data, and their digests are in the
records.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from phyblock.models.base import Image, Message
from phyblock.run.appending import AppendFile
from phyblock.run.reading import Lines

__all__ = ["PROMPTS", "PromptFile", "PromptLines", "read_prompts"]

PROMPTS = "prompts.jsonl"


class PromptLines(Lines):
    """The prompts of a run folder; `digests` are those passed so far."""

    file = PROMPTS
    noun = "prompt"
    hint = "remove this line: reports then show the sample without its prompt"
    fields: ClassVar[Mapping[str, Any]] = {"sha256": str, "messages": list}

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.digests: set[str] = set()

    def __iter__(self) -> Iterator[tuple[str, dict[str, Any]]]:
        for where, line in super().__iter__():
            self.digests.add(line["sha256"])
            yield where, line


class PromptFile:
    """Prompts on their way to disk, each once."""

    def __init__(self, file: AppendFile, known: set[str]) -> None:
        self._file = file
        self._known = known

    def keep(self, messages: Sequence[Message]) -> str:
        """Write a prompt unless it is there; its digest. Raises StoreError as the file does."""
        content = _content(messages)
        canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
        digest = hashlib.sha256(canonical.encode()).hexdigest()
        if digest not in self._known:
            self._known.add(digest)
            self._file.append([{"sha256": digest, "messages": content}])
        return digest


def read_prompts(folder: Path) -> dict[str, list[dict[str, Any]]]:
    """The messages of every prompt of a run folder, by digest.

    A message is `role` and `parts`: a text, or {"image": label}.
    """
    return {line["sha256"]: line["messages"] for _, line in PromptLines(folder)}


def _content(messages: Sequence[Message]) -> list[dict[str, Any]]:
    return [
        {
            "role": message.role,
            "parts": [{"image": p.label} if isinstance(p, Image) else p for p in message.parts],
        }
        for message in messages
    ]
