"""Questions as lines of JSON: scene by name, and pictures as what differs from the scene."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

from phyblock.domain.question import Question, QuestionPicture
from phyblock.domain.scene import Block, Scene

__all__ = ["question_line"]


def question_line(question: Question, original: Scene) -> str:
    """A question as one line of JSON, no newline at its end; `original` is the scene as stored."""
    colors = {
        str(block.order): block.color
        for block, before in zip(question.scene.blocks, original.blocks, strict=True)
        if block.color != before.color
    }
    record: dict[str, Any] = {
        "id": question.id,
        "subtask": question.subtask,
        "category": question.category,
        "scene_id": question.scene.id,
        "wording": question.wording,
        "question": question.text,
        "options": list(question.options),
        "answer": question.answer_letters,
    }
    if colors:
        record["colors"] = colors
    if question.pictures and question.pictures[0].background is not None:
        record["background"] = question.pictures[0].background
    record["pictures"] = [_picture(one, question.scene) for one in question.pictures]
    record["evidence"] = question.evidence
    return json.dumps(record, allow_nan=False)


def _picture(picture: QuestionPicture, scene: Scene) -> dict[str, Any]:
    known = {block.order: block for block in scene.blocks}
    drawn = {block.order: block for block in picture.blocks}
    kept = [(known[order], block) for order, block in drawn.items() if order in known]
    parts: dict[str, Any] = {
        "without": [order for order in known if order not in drawn],
        "poses": {
            str(new.order): {"position": _plain(new.position_m), "euler": _plain(new.euler_deg)}
            for old, new in kept
            if (old.position_m, old.euler_deg) != (new.position_m, new.euler_deg)
        },
        "swap": {
            str(new.order): {"type": new.type, "color": new.color}
            for old, new in kept
            if old.kind != new.kind
        },
        "add": _blocks(block for order, block in drawn.items() if order not in known),
        "marks": [
            {"letter": mark.letter, "position": _plain(mark.position_m)} for mark in picture.marks
        ],
        "framed": True if picture.framed == scene.blocks else _blocks(picture.framed),
    }
    given = {name: part for name, part in parts.items() if part}
    return {"label": picture.label, "view": _plain(picture.view_deg), **given}


def _blocks(blocks: Iterable[Block]) -> list[Mapping[str, Any]]:
    return [
        {
            "order": block.order,
            "type": block.type,
            "color": block.color,
            "layer": block.layer,
            "depend": list(block.depend) or [0],
            "position": _plain(block.position_m),
            "euler": _plain(block.euler_deg),
        }
        for block in blocks
    ]


def _plain(numbers: Iterable[float]) -> list[float | int]:
    """Whole numbers as integers, which read better in a file."""
    return [int(number) if float(number).is_integer() else number for number in numbers]
