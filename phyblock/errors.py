"""Every exception that phyblock raises on purpose and lets a caller see."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import ClassVar, Literal

_LONGEST_PART = 2000  # Characters that are shown of each part of a problem.


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with an input, worded so that it can be fixed.

    `where` names the file, with line and column if known (`suite.yaml:3:5`); `field` is dotted.
    """

    where: str
    message: str
    field: str = ""
    found: str = ""
    allowed: str = ""
    hint: str = ""

    def __str__(self) -> str:
        parts = (self.where, self.field, self.message) if self.field else (self.where, self.message)
        lines = [": ".join(map(_plain, parts))]
        details = (("found", self.found), ("allowed", self.allowed), ("hint", self.hint))
        lines += [f"    {name}: {_plain(text)}" for name, text in details if text]
        return "\n".join(lines)


def reason_of(error: BaseException) -> str:
    """Return an exception's message, or its class in plain words where it has none."""
    text = (error.strerror if isinstance(error, OSError) else None) or str(error).strip()
    if isinstance(error, RecursionError):
        return "nested too deeply"
    if isinstance(error, MemoryError):
        return "out of memory"
    return text or re.sub(r"(?<=[a-z])(?=[A-Z])", " ", type(error).__name__).lower()


def _plain(text: str) -> str:
    """Return a text for a terminal: no escape codes, no lone surrogates, bounded in length."""
    if len(text) > _LONGEST_PART:
        text = f"{text[:_LONGEST_PART]}... ({len(text):,} characters)"
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() or c == "\n" else c.encode("unicode_escape").decode() for c in text
    )


class PhyblockError(Exception):
    """Base of every error that phyblock raises on purpose."""


class InputError(PhyblockError):
    """Wrong input of the user (exit code 2); `problems` holds all that was found."""

    def __init__(self, problems: Problem | Iterable[Problem]) -> None:
        self.problems = (problems,) if isinstance(problems, Problem) else tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))

    def __reduce__(self) -> tuple[type[InputError], tuple[tuple[Problem, ...]]]:
        # Pickling would pass on the message, which is not a list of problems.
        return type(self), (self.problems,)


class SpecError(InputError):
    """A suite, a models file or a --set override is not valid."""


class DataError(InputError):
    """A data set, scene, candidate set or recorded reply is broken or missing."""


class PromptError(InputError):
    """A prompt template is broken or an official prompt cannot be read."""


class StoreError(InputError):
    """A run folder, a record, the reply cache or the disk cannot be read or written."""


Sent = Literal["no", "lost", "maybe", "answered"]
"""Progress of a failed call: nothing was sent; the connection was lost; it was sent, or may have
been, but not answered in time; the server answered."""


class ModelError(PhyblockError):
    """A call to a model failed; the message is safe to store (it holds no key).

    `status` is the HTTP status, if the server answered; `sent` the progress of the call, which
    decides about retries and cost; `retry_after_s` what the server asks for; `billed_usd` what a
    run's cost limit counts for all attempts [US dollars], None without a limit. `kind` is its name
    in records.
    """

    kind: ClassVar[str] = "unavailable"

    def __init__(
        self,
        message: str,
        *,
        status: int | None = None,
        sent: Sent | None = None,
        retry_after_s: float | None = None,
    ) -> None:
        self.status = status
        self.sent: Sent = sent or ("maybe" if status is None else "answered")
        self.retry_after_s = retry_after_s
        self.billed_usd: float | None = None
        # A server's text ends up in terminals: no escape codes, no right-to-left marks.
        super().__init__("".join(c if c.isprintable() else " " for c in message))


class RetryableError(ModelError):
    """The call may succeed when sent again: 429, 5xx, connection, timeout, malformed body."""

    kind = "retryable"


class SampleError(ModelError):
    """This request can never succeed (400); other requests to the model may."""

    kind = "sample"


class RefusedError(SampleError):
    """The provider's content policy refused this request."""

    kind = "refused"


class UnavailableError(ModelError):
    """This model cannot answer at all (401, 403, unknown name): no more is asked of it."""


class BudgetReachedError(PhyblockError):
    """The next call could exceed the cost limit; it was not made."""


class SimulationError(PhyblockError):
    """The physics engine could not do what was asked."""
