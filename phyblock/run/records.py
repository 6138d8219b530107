"""A sample's stored outcome: what the line of `records.jsonl` holds (docs/results.md)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from datetime import datetime, timezone
from typing import Any

from phyblock.errors import ModelError, RefusedError, RetryableError, SampleError
from phyblock.models.base import Image, Message, Reply, Request
from phyblock.tracks import Item, Outcome

__all__ = ["about_prompt", "is_answered", "is_final", "judged", "paid_usd", "to_record"]


def to_record(
    sample: str,
    track: str,
    model: str,
    item: Item,
    seed: int,
    answer: Reply | ModelError | None,
) -> dict[str, Any]:
    """The record of a sample before it is judged; None is a reply that a recording lacks."""
    reply = answer if isinstance(answer, Reply) else None
    scene = item.scene
    return {
        "sample": sample,
        "track": track,
        "model": model,
        "key": item.key,
        "scene": scene.id,
        "levels": list(scene.levels),
        "parents": list(scene.parents),
        "n_blocks": len(scene),
        "seed": seed,
        "outcome": None,
        "reply": None if reply is None else asdict(reply),
        "error": _error(answer) if isinstance(answer, ModelError) else None,
        "prompt": None,
        "parse": None,
        "scores": [],
        "time": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }


def judged(record: dict[str, Any], is_read: bool, fields: Mapping[str, Any]) -> dict[str, Any]:
    """The record with its outcome and what the track says of it, the first time or anew."""
    return {**record, "outcome": _outcome(record, is_read), **fields}


def about_prompt(request: Request, template: str, digest: str) -> dict[str, Any]:
    """What a record says of a prompt that stands in `prompts.jsonl` under `digest`."""
    return {
        "template": template,
        "version": request.prompt_version,
        "messages": digest,
        "images": [_picture(part) for part in _pictures(request.messages)],
    }


def is_final(record: Mapping[str, Any]) -> bool:
    """Whether asking again would be wrong: answered, or an error that asking cannot mend."""
    return is_answered(record) or record["error"]["kind"] == "sample"


def is_answered(record: Mapping[str, Any]) -> bool:
    """Whether the model answered, if only by refusing; a recording may have no reply to give."""
    error = record["error"]
    return error is None or error["kind"] == "refused"


def paid_usd(record: Mapping[str, Any]) -> float | None:
    """What the run paid for a record's replies [US dollars]; None where a price is not known.

    Replies from the cache were paid for elsewhere; an episode can hold both kinds.
    """
    turns = record.get("turns") or ()
    replies = [turn["reply"] for turn in turns] if turns else [record["reply"]]
    paid = [reply["cost_usd"] for reply in replies if reply is not None and not reply["cached"]]
    return None if None in paid else sum(paid)


def _outcome(record: dict[str, Any], readable: bool) -> Outcome:
    reply, error = record["reply"], record["error"]
    if error is not None:
        return "refusal" if error["kind"] == "refused" else "api_error"
    if reply is None:
        return "missing"
    if reply["finish"] == "refusal":
        return "refusal"
    if reply["finish"] == "length":
        return "truncated"
    return "ok" if readable else "parse_failure"


def _error(error: ModelError) -> dict[str, Any]:
    kind = "unavailable"
    if isinstance(error, RetryableError):
        kind = "retryable"
    elif isinstance(error, SampleError):
        kind = "refused" if isinstance(error, RefusedError) else "sample"
    return {
        "kind": kind,
        "status": error.status,
        "message": str(error),
        "billed_usd": error.billed_usd,
    }


def _pictures(messages: Sequence[Message]) -> Iterator[Image]:
    for message in messages:
        yield from (part for part in message.parts if isinstance(part, Image))


def _picture(picture: Image) -> dict[str, Any]:
    return {
        "label": picture.label,
        "sha256": picture.sha256,
        "width_px": picture.width_px,
        "height_px": picture.height_px,
    }
