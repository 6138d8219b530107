"""Rules between the fields of a suite, kept as data so that each is checked on its own.

They are read from a validated suite and from a raw mapping alike, so that a suite with a typing
error elsewhere still hears of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydantic import BaseModel

__all__ = ["RULES", "Rule", "broken_rules", "read_dotted"]

Get = Callable[[str], Any]


@dataclass(frozen=True)
class Rule:
    """One rule.

    `reads` are the dotted fields it looks at; the first is the one to mend, and the error points
    at the first that is written in the file. `broken` gets a reader of fields.
    """

    reads: tuple[str, ...]
    broken: Callable[[Get], bool]
    message: str
    hint: str

    @property
    def field(self) -> str:
        """The dotted field to mend."""
        return self.reads[0]


def _unofficial(get: Get) -> bool:
    return bool(get("dataset.format") != "official")


def _asks_json(get: Get) -> bool:
    return bool(get("answer_format") == "json_schema")


_SET_OFFICIAL = "set dataset.format to official and dataset.path to a checkout"

RULES = (
    Rule(
        ("dataset.path", "dataset.format"),
        lambda get: get("dataset.format") == "official" and get("dataset.path") is None,
        "the official format needs the folder of a checkout of the official repository",
        "give it on the command line: --set dataset.path=FOLDER",
    ),
    Rule(
        ("models", "dataset.format"),
        lambda get: get("models") == "recorded" and _unofficial(get),
        "recorded replies come with the official data set only",
        _SET_OFFICIAL + ", or list the models",
    ),
    Rule(
        ("prompt", "dataset.format"),
        lambda get: get("prompt") == "official" and _unofficial(get),
        "the official prompt is read out of a checkout of the official repository",
        _SET_OFFICIAL + ", or use prompt: default",
    ),
    Rule(
        ("answer_format", "prompt"),
        lambda get: _asks_json(get) and get("prompt") == "official",
        "the official prompt asks for lines of text",
        "use prompt: default, or answer_format: text",
    ),
    Rule(
        ("answer_format", "models"),
        lambda get: _asks_json(get) and get("models") == "recorded",
        "recorded replies were asked for in text",
        "use answer_format: text, or list the models",
    ),
    Rule(
        ("parser", "answer_format"),
        lambda get: _asks_json(get) and get("parser") == "official",
        "the official expression reads no JSON",
        "use parser: steps, or answer_format: text",
    ),
    Rule(
        ("images.source", "dataset.format"),
        lambda get: get("images.source") == "dataset" and _unofficial(get),
        "only the official data set has pictures of its own",
        _SET_OFFICIAL + ", or use images.source: render",
    ),
    Rule(
        ("candidates.order", "images.source"),
        lambda get: get("candidates.order") == "shuffled" and get("images.source") == "dataset",
        "the data set's own pictures show the candidates in the order of the file",
        "use images.source: render, or candidates.order: file",
    ),
    Rule(
        ("candidates.order", "models"),
        lambda get: get("candidates.order") == "shuffled" and get("models") == "recorded",
        "recorded replies name candidates by the numbers of the file",
        "use candidates.order: file, or list the models",
    ),
    Rule(
        ("tables", "dataset.format"),
        lambda get: "published" in get("tables") and _unofficial(get),
        "published numbers compare with the official data set only",
        _SET_OFFICIAL + ", or leave published out of tables",
    ),
    Rule(
        ("scoring.matchers", "tables"),
        lambda get: "published" in get("tables") and "paper" not in get("scoring.matchers"),
        "the published numbers were made by the paper matcher",
        "add paper to scoring.matchers, or leave published out of tables",
    ),
    Rule(
        ("scoring.level1", "tables", "levels"),
        lambda get: (
            "published" in get("tables")
            and 1 in get("levels")
            and get("scoring.level1") != "membership"
        ),
        "the published Level-1 columns are the membership criterion",
        "use scoring.level1: membership, or leave published out of tables",
    ),
    Rule(
        ("settings", "tables"),
        lambda get: "published" in get("tables") and "A" not in get("settings"),
        "the published numbers are those of setting A",
        "add A to settings, or leave published out of tables",
    ),
)


def broken_rules(get: Get, faulty: tuple[str, ...] = ()) -> list[Rule]:
    """The rules that do not hold; one that reads a field of `faulty` is not judged."""
    return [rule for rule in RULES if not _touches(rule, faulty) and rule.broken(get)]


def read_dotted(spec: BaseModel, dotted: str) -> Any:
    """The value of a dotted field of a validated suite."""
    value: Any = spec
    for key in dotted.split("."):
        value = getattr(value, key)
    return value


def _touches(rule: Rule, faulty: tuple[str, ...]) -> bool:
    return any(
        read == field or read.startswith(field + ".") for read in rule.reads for field in faulty
    )
