"""Making records: what came of a sample, in the form in which it is stored."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from phyblock.errors import ModelError, RefusedError, RetryableError, SampleError
from phyblock.models.request import Image, Message, Request
from phyblock.records.files import known_records
from phyblock.records.record import Record, SentImage, SentPrompt
from phyblock.records.reply import Reply, StoredError
from phyblock.tracks import Episode, Item, Judgement
from phyblock.tracks.base import count_sample
from phyblock.types import Outcome

__all__ = ["about_item", "about_prompt", "begun", "judged"]


def begun(
    sample: str,
    track: str,
    model: str,
    item: Item,
    seed: int,
    answer: Reply | ModelError | None,
) -> dict[str, Any]:
    """The fields of a record before it is judged; None is a reply that a recording lacks."""
    return {
        "sample": sample,
        "track": track,
        "model": model,
        "key": item.key,
        **about_item(item),
        "seed": seed,
        "reply": answer.storable() if isinstance(answer, Reply) else None,
        "error": _error(answer) if isinstance(answer, ModelError) else None,
        "prompt": None,
        "parse": None,
        "scores": (),
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def about_item(item: Item) -> dict[str, Any]:
    """Return the fields of a record about the scene of its item."""
    scene = item.scene
    return {
        "scene": scene.id,
        "levels": scene.levels,
        "parents": scene.parents,
        "n_blocks": len(scene),
    }


def judged(
    fields: Mapping[str, Any],
    item: Item,
    judgement: Judgement | Episode,
    more: Mapping[str, Any] | None = None,
) -> Record:
    """The record with its outcome and what the track says and counts of it, for the first time or
    anew.

    `fields` are those of a record that was begun, or of one that was judged before; `more` replaces
    some of what the judgement says.
    """
    outcome = _outcome(fields["reply"], fields["error"], judgement.is_read)
    told = {**fields, "outcome": outcome, **judgement.fields(), **(more or {})}
    if counts := count_sample(fields["track"], item, judgement):
        told["counts"] = {**fields.get("counts", {}), **counts}
    return known_records().validate_python(told)


def about_prompt(request: Request, template: str, digest: str) -> SentPrompt:
    """Return the fields of a record about a prompt that is in `prompts.jsonl` under `digest`."""
    images = tuple(_picture(part) for part in _pictures(request.messages))
    examples: dict[str, Any] = {"examples": request.examples} if request.examples else {}
    return SentPrompt(
        template=template,
        version=request.prompt_version,
        messages=digest,
        images=images,
        **examples,
    )


def _outcome(reply: Reply | None, error: StoredError | None, readable: bool) -> Outcome:
    if error is not None:
        return "refusal" if error.kind == "refused" else "api_error"
    if reply is None:
        return "missing"
    if reply.finish == "refusal":
        return "refusal"
    if reply.finish == "length":
        return "truncated"
    return "ok" if readable else "parse_failure"


def _error(error: ModelError) -> StoredError:
    kind = "unavailable"
    if isinstance(error, RetryableError):
        kind = "retryable"
    elif isinstance(error, SampleError):
        kind = "refused" if isinstance(error, RefusedError) else "sample"
    return StoredError.model_validate(
        {
            "kind": kind,
            "status": error.status,
            "message": str(error),
            "billed_usd": error.billed_usd,
        }
    )


def _pictures(messages: Sequence[Message]) -> Iterator[Image]:
    for message in messages:
        yield from (part for part in message.parts if isinstance(part, Image))


def _picture(picture: Image) -> SentImage:
    return SentImage(
        label=picture.label,
        sha256=picture.sha256,
        width_px=picture.width_px,
        height_px=picture.height_px,
    )
