"""A sample's stored outcome: what the line of `records.jsonl` holds (docs/results.md)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from datetime import datetime, timezone
from typing import Any

from phyblock.datasets import AssemblyTask
from phyblock.errors import ModelError, RefusedError, RetryableError, SampleError
from phyblock.models.base import Image, Reply, Request
from phyblock.scoring import Score
from phyblock.tasks import Judgement, Outcome

__all__ = ["is_answered", "is_final", "judged", "to_record"]


def to_record(
    sample: str,
    track: str,
    model: str,
    task: AssemblyTask,
    request: Request,
    answer: Reply | ModelError | None,
    template: str,
) -> dict[str, Any]:
    """The record of a sample before it is judged; None is a reply that a recording lacks."""
    reply = answer if isinstance(answer, Reply) else None
    scene = task.scene
    return {
        "sample": sample,
        "track": track,
        "model": model,
        "scene": scene.id,
        "levels": list(scene.levels),
        "parents": list(scene.parents),
        "n_blocks": len(scene),
        "seed": request.seed,
        "outcome": None,
        "reply": None if reply is None else asdict(reply),
        "error": _error(answer) if isinstance(answer, ModelError) else None,
        "prompt": _prompt(request, template) if request.messages else None,
        "parse": None,
        "scores": [],
        "time": datetime.now(timezone.utc).isoformat(timespec="seconds"),
    }


def judged(record: dict[str, Any], judgement: Judgement, parser: str) -> dict[str, Any]:
    """The record with its outcome, parse and scores, whether they are its first or new ones."""
    parsed = judgement.parsed
    return {
        **record,
        "outcome": _outcome(record, parsed.rule is not None),
        "parse": {
            "parser": parser,
            "rule": parsed.rule,
            "plan": list(parsed.plan.steps),
            "dropped": list(parsed.dropped),
        },
        "scores": [_score(score) for score in judgement.scores],
    }


def is_final(record: Mapping[str, Any]) -> bool:
    """Whether asking again would be wrong: answered, or an error that asking cannot mend."""
    return is_answered(record) or record["error"]["kind"] == "sample"


def is_answered(record: Mapping[str, Any]) -> bool:
    """Whether the model answered, if only by refusing; a recording may have no reply to give."""
    error = record["error"]
    return error is None or error["kind"] == "refused"


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


def _prompt(request: Request, template: str) -> dict[str, Any]:
    images = [part for message in request.messages for part in message.parts]
    return {
        "template": template,
        "version": request.prompt_version,
        "images": [
            {
                "label": part.label,
                "sha256": part.sha256,
                "width_px": part.width_px,
                "height_px": part.height_px,
            }
            for part in images
            if isinstance(part, Image)
        ],
    }


def _score(score: Score) -> dict[str, Any]:
    return {
        "criterion": score.criterion,
        "matcher": score.matcher,
        "setting": score.setting,
        "tp": score.counts.tp,
        "fp": score.counts.fp,
        "fn": score.counts.fn,
        "errors": score.errors,
        "placed": None if score.vertices is None else list(score.vertices),
        "why": None if score.step_errors is None else list(score.step_errors),
    }
