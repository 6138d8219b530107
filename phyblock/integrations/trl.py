"""Rows and a reward for the trainers of TRL, such as `GRPOTrainer`.

tasks = phyblock.tasks("full_planning", split="train", limit=500)
GRPOTrainer(model, reward_funcs=reward(tasks), train_dataset=dataset(tasks), ...)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
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

    Raises ValueError for streams and episodes, which TRL's trainers do not accept.
    """
    if tasks.is_endless or any(task.plays for task in tasks):
        raise ValueError(f"{tasks!r} cannot be rows: use a finite set without episodes")

    def parts(content: str | Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
        if isinstance(content, str):
            return [{"type": "text", "text": content}]
        image = {"type": "image", "text": None}
        return [one if one["type"] == "text" else image for one in content]

    rows = []
    for task in tasks:
        prompt = [{**one, "content": parts(one["content"])} for one in task.messages()]
        rows.append({"key": task.key, "prompt": prompt, "images": list(task.pictures.values())})
    return Dataset.from_list(rows, features=Features(_FEATURES))


def reward(tasks: Tasks) -> Callable[..., list[float]]:
    """Return the reward function: the headline measure of each completion, by its row's key."""

    def text(completion: Any) -> str:
        content = completion if isinstance(completion, str) else completion[-1]["content"]
        if isinstance(content, str):
            return content
        return "".join(one.get("text") or "" for one in content)

    def phyblock(completions: Sequence[Any], key: Sequence[str], **_: Any) -> list[float]:
        pairs = zip(completions, key, strict=True)
        return [tasks[name].score(text(one)).value for one, name in pairs]

    return phyblock
