"""Records of samples: the outcome of a request, judged by its track."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from datetime import UTC, datetime
from typing import Any, TypeVar

from phyblock.errors import (
    ModelError,
    RefusedError,
    RetryableError,
    SampleError,
    SimulationError,
)
from phyblock.models.request import Request
from phyblock.records.record import (
    ErrorKind,
    Record,
    Reply,
    SentImage,
    SentPrompt,
    StoredError,
    Usage,
)
from phyblock.text import plain_sum
from phyblock.tracks.base import Episode, Item, Judgement, Track
from phyblock.types import Outcome

_N = TypeVar("_N", int, float)


def begun(
    sample: str, track: str, model: str, item: Item, seed: int, answer: Reply | ModelError | None
) -> dict[str, Any]:
    """Return the fields of a record before judgement; None is a reply missing in a recording."""
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
    facts = {"scene": scene.id, "levels": scene.levels, "parents": scene.parents}
    return {**facts, "n_blocks": len(scene)}


def about_prompt(request: Request, template: str, digest: str) -> SentPrompt:
    """Return the fields of a record about a prompt that is in `prompts.jsonl` under `digest`."""
    images = tuple(
        SentImage(
            label=part.label, sha256=part.sha256, width_px=part.width_px, height_px=part.height_px
        )
        for part in request.images
    )
    version = request.prompt_version
    return SentPrompt(template=template, version=version, messages=digest, images=images)


def judged(track: Track, item: Item, fields: Mapping[str, Any], judgement: Judgement) -> Record:
    """Return the record with its outcome, and the judgement and counts of the track.

    `fields` are those of a record before judgement, or of an earlier record.
    """
    outcome = _outcome(fields["reply"], fields["error"], judgement.is_read)
    found = {**fields, "outcome": outcome, **judgement.fields}
    record = track.record_type().model_validate(found)
    if counts := track.counts(item, record):
        record = record.model_copy(update={"counts": {**record.counts, **counts}})
    return record


def judge_episode(
    track: Track, item: Item, fields: Mapping[str, Any], episode: Episode, replies: Sequence[Reply]
) -> Record:
    """Return the record of an episode so far, with these replies."""
    judgement = episode.judgement()
    if replies:
        first = judgement.fields["turns"][0]["prompt"]
        fields = {**fields, "reply": pooled(replies).storable(), "prompt": first}
    return judged(track, item, fields, judgement)


async def judge_reply(
    track: Track,
    item: Item,
    fields: Mapping[str, Any],
    earlier: Record | None = None,
) -> Record:
    """Return the record of a sample with one request, judged for the first time or again after an
    `earlier` record.

    If no engine could execute the reply, the record says so and can be judged again.
    """
    reply = fields["reply"]
    text = None if reply is None else reply.text
    try:
        return judged(track, item, fields, await track.judge_apart(item, text, earlier))
    except SimulationError as error:
        if text is None:
            raise
        lacking = StoredError(kind="unjudged", message=str(error))
        nothing = await track.judge_apart(item, None, None)
        return judged(track, item, {**fields, "error": lacking}, nothing)


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
    kind: ErrorKind = "unavailable"
    if isinstance(error, RetryableError):
        kind = "retryable"
    elif isinstance(error, SampleError):
        kind = "refused" if isinstance(error, RefusedError) else "sample"
    message, billed_usd = str(error), error.billed_usd
    return StoredError(kind=kind, status=error.status, message=message, billed_usd=billed_usd)


def pooled(replies: Sequence[Reply]) -> Reply:
    """Return the sum of an episode's replies, with the text of the last one.

    It counts as truncated or refused only if all of them are.
    """
    counts = {
        name: _sum(getattr(reply.usage, name) for reply in replies) for name in Usage.model_fields
    }
    billed = [reply.billed_usd for reply in replies if reply.billed_usd is not None]
    ends = {reply.finish for reply in replies}
    return Reply(
        text=replies[-1].text,
        finish=ends.pop() if len(ends) == 1 else "stop",
        usage=Usage(**counts),
        cost_usd=_sum(reply.cost_usd for reply in replies),
        billed_usd=plain_sum(billed) if billed else None,
        latency_s=plain_sum(reply.latency_s for reply in replies),
        provider_model=replies[-1].provider_model,
        attempts=sum(reply.attempts for reply in replies),
        cached=all(reply.cached for reply in replies),
        seed_sent=all(reply.seed_sent for reply in replies),
    )


def _sum(values: Iterable[_N | None]) -> _N | None:
    """Return the sum, or None if any value is unknown."""
    found = list(values)
    known = [value for value in found if value is not None]
    return plain_sum(known) if known and len(known) == len(found) else None
