"""Lines of the other files of a run: turns of episodes, prompts, and what became of batches."""

from __future__ import annotations

from typing import Literal

from phyblock.records.line import Line, Usd, Whole
from phyblock.records.reply import Reply
from phyblock.types import Role

__all__ = ["BatchEvent", "BatchLine", "PictureMark", "Prompt", "PromptMessage", "Turn"]

BatchEvent = Literal["intended", "created", "lost", "ended"]


class Turn(Line):
    """An answered turn of an episode, finished or not."""

    sample: str
    """The sample that it is a turn of."""
    turn: Whole
    """Its place in the episode, from 0."""
    reply: Reply
    """The reply, as in a record."""
    run: str = ""
    """Digest of the run that it belongs to; older turns have none."""
    read_again: bool = False
    """Whether it repeats a turn of earlier readers, with which its cost was counted."""


class PictureMark(Line):
    """Stands where a picture stood."""

    image: str
    """Label of the picture."""


class PromptMessage(Line):
    """One chat message."""

    role: Role
    """Who speaks."""
    parts: tuple[str | PictureMark, ...]
    """Texts and pictures in the order sent."""


class Prompt(Line):
    """A prompt as it was sent."""

    sha256: str
    """Digest of the messages, by which records name it."""
    messages: tuple[PromptMessage, ...]
    """What was sent."""


class BatchLine(Line):
    """What became of a batch of requests; the first line of each is written before it is sent."""

    batch: str
    """Our name for it, which the provider is told, so that it is found there again."""
    model: str
    """Name of the model."""
    event: BatchEvent
    """`intended`: it is about to be sent; `created`: the provider has it; `lost`: it has not, and
    nothing was asked; `ended`: its answers are in `batches/`."""
    time: str
    """When, UTC."""
    id: str = ""
    """The provider's name for it."""
    keys: tuple[str, ...] = ()
    """Requests of an intended batch in their order, by their keys in the reply cache."""
    most_usd: tuple[Usd, ...] = ()
    """What each request of an intended batch can cost; empty where no price is known."""
    seeded: bool = True
    """Whether the requests of an intended batch carry seeds."""
    words: str = ""
    """Why it was lost, or how it ended."""
    is_complete: bool = True
    """False where the provider took back what it had not asked when the batch ended."""
