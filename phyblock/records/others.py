"""Lines of the other files of a run: turns of episodes, and prompts."""

from __future__ import annotations

from phyblock.records.line import Line, Whole
from phyblock.records.reply import StoredReply
from phyblock.words import Role

__all__ = ["PictureMark", "Prompt", "PromptMessage", "Turn"]


class Turn(Line):
    """An answered turn of an episode, finished or not."""

    sample: str
    """The sample that it is a turn of."""
    turn: Whole
    """Its place in the episode, from 0."""
    reply: StoredReply
    """The reply, as in a record."""
    run: str = ""
    """Digest of the run that it belongs to; older turns have none."""


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
