"""Rows and a reward for the trainers of TRL, such as `GRPOTrainer`.

tasks = phyblock.tasks("full_planning", split="train", limit=500)
GRPOTrainer(model, reward_funcs=reward(tasks), train_dataset=dataset(tasks), ...)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from datasets import Dataset, Features, List, Value
from datasets import Image as Picture

from phyblock.api import Tasks

_PART = {"type": Value("string"), "text": Value("string")}
_FEATURES = {
    "key": Value("string"),
    "prompt": List({"role": Value("string"), "content": List(_PART)}),
    "images": List(Picture()),
}


def dataset(tasks: Tasks) -> Dataset:
    """Return a finite set as rows: `prompt`, `images` in the order of its picture parts, `key`.

    ValueError for a stream and for episodes, which TRL's trainers do not take.
    """
    if tasks.is_endless or any(task.plays for task in tasks):
        raise ValueError(f"{tasks!r} cannot be rows: a finite set of what is asked once can")

    def rows() -> Iterator[dict[str, Any]]:
        for task in tasks:
            prompt = [
                {"role": one["role"], "content": _parts(one["content"])} for one in task.messages()
            ]
            yield {"key": task.key, "prompt": prompt, "images": list(task.pictures.values())}

    return Dataset.from_list(list(rows()), features=Features(_FEATURES))


def _parts(content: str | Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    if isinstance(content, str):
        return [{"type": "text", "text": content}]
    return [one if one["type"] == "text" else {"type": "image", "text": None} for one in content]


def reward(tasks: Tasks) -> Callable[..., list[float]]:
    """Return the reward function: the headline measure of each completion, by its row's key."""

    def phyblock(completions: Sequence[Any], key: Sequence[str], **_: Any) -> list[float]:
        return [
            tasks[name].score(_text(one)).value for one, name in zip(completions, key, strict=True)
        ]

    return phyblock


def _text(completion: Any) -> str:
    """Return the text of a completion: a string, or the messages of a conversation."""
    if isinstance(completion, str):
        return completion
    content = completion[-1]["content"]
    return (
        content if isinstance(content, str) else "".join(one.get("text") or "" for one in content)
    )
