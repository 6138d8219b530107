"""Answers that are no reply: what the server said, and which of our errors that is."""

from __future__ import annotations

import email.utils
import math
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from phyblock.errors import (
    ModelError,
    RefusedError,
    RetryableError,
    SampleError,
    UnavailableError,
)
from phyblock.files import load_json
from phyblock.models.http_client import Answer

__all__ = [
    "read_body",
    "refusal",
    "refused_before_sending",
    "refused_for_policy",
    "refuses_seed",
    "retry_after_s",
    "unreadable",
]

_RETRYABLE = (408, 409, 425, 429)
_UNAVAILABLE = (401, 402, 403, 404)
_PASSING = re.compile(r"429|5\d\d")
_POLICY = re.compile(
    r"content_policy_violation|ResponsibleAIPolicyViolation|content management policy"
    r"|data_?inspection_?failed|\bcontent_filter\b|requires moderation",
    re.IGNORECASE,
)
_NEVER = re.compile(
    r"insufficient_quota|billing_hard_limit_reached|model_not_found|invalid_api_key"
    r"|authentication_error|credit balance is too low|API_KEY_INVALID|API key not valid"
    r"|LLM Provider NOT provided|Server is pinned to|Unexpected fields in the request",
    re.IGNORECASE,
)
_LONGEST_WORDS = 20_000
"""Characters of a server's words that are looked at; far fewer are shown."""

_START_BYTES = 2_000


def read_body(answer: Answer) -> object:
    """The decoded body of an answer whose status promises a reply.

    Raises a ModelError for a body that is not whole, is no JSON within bounds, or is an error: some
    servers send those with status 200.
    """
    if answer.fault:
        raise refusal(answer)
    try:
        body = load_json(answer.body)
    except ValueError as error:
        start = answer.body[:_START_BYTES].decode("utf-8", "replace")
        why = f"no JSON that can be read ({error})"
        raise _malformed(answer.status, f"{why}: {start}" if start else "no body") from None
    if isinstance(body, Mapping) and body.get("error"):
        raise refusal(answer)
    return body


def refusal(answer: Answer) -> ModelError:
    """The error of an answer that holds no reply."""
    status, wish_s = answer.status, retry_after_s(answer.headers)
    if answer.fault and answer.is_success:
        return _malformed(status, answer.fault)
    words = answer.fault or error_words(answer.body)
    text = f"HTTP {status}: {words}"
    if answer.is_success:
        return _error_in_success(answer, text, wish_s)
    if status >= 500:
        return RetryableError(text, status=status, retry_after_s=wish_s)
    if _POLICY.search(words):
        return RefusedError(text, status=status)
    if status in _UNAVAILABLE or _NEVER.search(words):
        return UnavailableError(text, status=status)
    if status in _RETRYABLE:
        return RetryableError(text, status=status, retry_after_s=wish_s)
    if 300 <= status < 400:
        return UnavailableError(f"{text} (is api_base the address of the API?)", status=status)
    return SampleError(text, status=status)


def refused_for_policy(answer: Answer) -> RefusedError:
    """The error of an answer that the provider's content policy is known to have made."""
    return RefusedError(f"HTTP {answer.status}: {error_words(answer.body)}", status=answer.status)


def refused_before_sending(words: str) -> UnavailableError:
    """The error of a call that a library gave up before it sent anything.

    A package, a credential or a setting is missing on this machine: no request would fare better,
    and none may count as answered.
    """
    return UnavailableError(words, sent="no")


def unreadable(answer: Answer, why: str) -> RetryableError:
    """The error of a success whose body a library could not make a reply of."""
    return _malformed(answer.status, why)


def error_words(body: bytes) -> str:
    """What an error body says: message and code of the usual forms, else its text."""
    text = body[: 4 * _LONGEST_WORDS].decode("utf-8", "replace")[:_LONGEST_WORDS]
    try:
        raw = load_json(body)
    except ValueError:
        return text
    raw = raw[0] if isinstance(raw, list) and len(raw) == 1 else raw
    error = (raw.get("error") or raw) if isinstance(raw, Mapping) else raw
    if not isinstance(error, Mapping):
        return str(error)[:_LONGEST_WORDS]
    said = [error.get(name) for name in ("message", "detail", "code", "status", "type")]
    return " ".join(str(item) for item in said if item)[:_LONGEST_WORDS] or text


def refuses_seed(status: int | None, message: str) -> bool:
    """Whether an error says that the provider does not take the `seed` parameter."""
    return status in (400, 422) and re.search(r"\bseed\b", message) is not None


def retry_after_s(headers: Mapping[str, str] | None) -> float | None:
    """Seconds that a `Retry-After` header asks for, given as seconds or as an HTTP date."""
    value = next((v for k, v in (headers or {}).items() if k.lower() == "retry-after"), None)
    if value is None:
        return None
    try:
        asked_s = float(value)
    except ValueError:
        return _until(value)
    return max(0.0, asked_s) if math.isfinite(asked_s) else None


def _until(date: str) -> float | None:
    try:
        then = email.utils.parsedate_to_datetime(date)
    except (ValueError, OverflowError):
        return None
    then = then if then.tzinfo else then.replace(tzinfo=UTC)
    return max(0.0, (then - datetime.now(UTC)).total_seconds())


def _error_in_success(answer: Answer, text: str, wish_s: float | None) -> ModelError:
    """The error of an error body that came as a success: its own code says which."""
    codes = _codes(answer.body)
    if _POLICY.search(text):
        return RefusedError(text, status=answer.status)
    if _NEVER.search(text) or any(str(code) in codes for code in _UNAVAILABLE):
        return UnavailableError(text, status=answer.status)
    # A limit that is reached and a fault behind a gateway are no replies that were paid for.
    passing = (int(code) for code in codes if _PASSING.fullmatch(code))
    status = next(passing, answer.status)
    return RetryableError(text, status=status, retry_after_s=wish_s)


def _codes(body: bytes) -> tuple[str, ...]:
    """The codes of an error body, as text: servers write numbers and names in either form."""
    raw: Any = load_json(body)
    error = raw.get("error") if isinstance(raw, Mapping) else None
    named = [error.get(name) for name in ("code", "status")] if isinstance(error, Mapping) else []
    return tuple(str(code) for code in named if isinstance(code, str | int))


def _malformed(status: int, why: str) -> RetryableError:
    return RetryableError(f"HTTP {status}: malformed reply: {why}", status=status)
