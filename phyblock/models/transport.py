"""What sends a request once: the contract of the two transports, and how errors are classed."""

from __future__ import annotations

import email.utils
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Any, Protocol

from phyblock.errors import (
    ModelError,
    RefusedError,
    RetryableError,
    SampleError,
    UnavailableError,
)
from phyblock.models.base import Message, Reply

__all__ = ["Call", "SeedRefusedError", "Transport", "classify", "refuses_seed", "retry_after_s"]

_RETRYABLE = (408, 409, 425, 429)
_UNAVAILABLE = (401, 402, 403, 404)
_POLICY = re.compile(
    r"content_policy_violation|ResponsibleAIPolicyViolation|content management policy"
    r"|data_?inspection_?failed|\bcontent_filter\b|requires moderation",
    re.IGNORECASE,
)
_NEVER = re.compile(
    r"insufficient_quota|billing_hard_limit_reached|model_not_found|invalid_api_key"
    r"|credit balance is too low|API_KEY_INVALID|API key not valid|LLM Provider NOT provided",
    re.IGNORECASE,
)
_LONGEST_MESSAGE = 500


@dataclass(frozen=True)
class Call:
    """One request: messages, sampling parameters by their OpenAI names, and the seed or None."""

    messages: tuple[Message, ...]
    params: Mapping[str, Any]
    seed: int | None


class SeedRefusedError(Exception):
    """The provider takes no seed; `sent` is whether a request was spent on finding out."""

    def __init__(self, *, sent: bool) -> None:
        self.sent = sent
        super().__init__("the provider takes no seed")


class Transport(Protocol):
    """Sends one request, once: retries, limits and caches are above."""

    async def send(self, call: Call) -> Reply:
        """The validated reply, its cost not yet known.

        Raises a ModelError by class, with no key in its message, or SeedRefusedError.
        """

    async def aclose(self) -> None:
        """Release connections."""


def classify(status: int | None, message: str, *, retry_after_s: float | None = None) -> ModelError:
    """The error of an answer that is not a reply.

    None as status is a connection that failed, 200 a body that could not be read.
    """
    text = " ".join(message.split())[:_LONGEST_MESSAGE]
    text = text if status is None else f"HTTP {status}: {text}"
    if status is None or status == 200 or status >= 500:
        return RetryableError(text, status=status, retry_after_s=retry_after_s)
    if _POLICY.search(message):
        return RefusedError(text, status=status)
    if status in _UNAVAILABLE or _NEVER.search(message):
        return UnavailableError(text, status=status)
    if status in _RETRYABLE:
        return RetryableError(text, status=status, retry_after_s=retry_after_s)
    if 300 <= status < 400:
        return UnavailableError(f"{text} (is api_base the address of the API?)", status=status)
    return SampleError(text, status=status)


def refuses_seed(status: int | None, message: str) -> bool:
    """Whether an error says that the provider does not take the `seed` parameter."""
    return status in (400, 422) and re.search(r"\bseed\b", message) is not None


def retry_after_s(headers: Mapping[str, str] | None) -> float | None:
    """Seconds that a `Retry-After` header asks for, given as seconds or as an HTTP date."""
    value = next((v for k, v in (headers or {}).items() if k.lower() == "retry-after"), None)
    if value is None:
        return None
    try:
        return max(0.0, float(value))
    except ValueError:
        pass
    try:
        then = email.utils.parsedate_to_datetime(value)
    except ValueError:
        return None
    then = then if then.tzinfo else then.replace(tzinfo=timezone.utc)
    return max(0.0, (then - datetime.now(timezone.utc)).total_seconds())
