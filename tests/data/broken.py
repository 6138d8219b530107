"""A sound scene and a sound record, and ways to write them down and to break them."""

import copy
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.workspace import Raw, write_lines


def sound_scene() -> Raw:
    """A cube that carries an arch, and three candidates."""
    cube = {"type": "cube", "color": "red", "euler": [0, 0, 0]}
    arch = {"type": "arch", "color": "red", "euler": [0, 0, 90]}
    return {
        "id": "s1",
        "levels": [1, 2],
        "parents": ["s1"],
        "blocks": [
            {"order": 1, "layer": 1, "depend": [0], "position": [0, 0, 0.025], **cube},
            {"order": 2, "layer": 2, "depend": [1], "position": [0, 0, 0.075], **arch},
        ],
        "candidates": [
            {**cube, "required": 1},
            {**arch, "euler": [0, 0, 0], "required": 0},
            {**arch, "required": 1},
        ],
    }


Keys = str | Sequence[str | int]
"""A path in a document; as a text it is dotted: `blocks.1.depend`."""


def with_value(document: Any, path: Keys, *value: object) -> Any:
    """A copy of a document with the value at a path replaced, or left out where there is none."""
    if not path:
        return value[0]
    at, *rest = path.split(".") if isinstance(path, str) else path
    changed = copy.copy(document)
    key = int(at) if isinstance(document, list) else at
    if rest:
        changed[key] = with_value(document[key], rest, *value)
    elif value:
        changed[key] = value[0]
    else:
        del changed[key]
    return changed


def without(document: Any, path: Keys) -> Any:
    """A copy of a document without what stands at a path."""
    return with_value(document, path)


def write_scenes(folder: Path, *scenes: Raw) -> Path:
    """A data set folder with one scene a line."""
    return write_lines(folder / "scenes.jsonl", scenes).parent


def checkout_files(*scenes: Raw) -> dict[str, str]:
    """The files of the scenes in the official layout by path, `levels` becoming `level`."""
    files = {}
    for scene in scenes:
        goal = {"level": max(scene["levels"]), "blocks": scene["blocks"]}
        numbered = [{**one, "position": n} for n, one in enumerate(scene["candidates"], 1)]
        folder, name = "data/SCENEs_400_", scene["id"]
        files[f"{folder}Goal_Jsons/{name}.json"] = json.dumps(goal)
        files[f"{folder}Cand_Jsons/{name}_16_cand_blocks.json"] = json.dumps(numbered)
    return files


def write_checkout(root: Path, *scenes: Raw) -> Path:
    """The scenes in the official layout."""
    for name, text in checkout_files(*scenes).items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text, encoding="utf-8")
    return root


BEFORE = Path(__file__).parents[1] / "records" / "format-1.jsonl"
"""A record of each track as the first version wrote it."""


def lines_before() -> list[bytes]:
    return BEFORE.read_bytes().splitlines()


def plan_record() -> Raw:
    return json.loads(lines_before()[0])


def record_with(at: str, value: object) -> bytes:
    """The record with another value at a dotted place, as a line."""
    return json.dumps(with_value(plan_record(), at, value)).encode()


def with_text(value: str, text: str) -> bytes:
    """The record's line with JSON text in the place of a value that stands in it once."""
    line = json.dumps(plan_record(), separators=(",", ":"))
    assert line.count(value) == 1, value
    return line.replace(value, text).encode()


DAMAGED: dict[str, tuple[bytes, str, str]] = {
    "nan": (with_text('"latency_s":0.0', '"latency_s":NaN'), "", "NaN"),
    "infinity": (with_text('"latency_s":0.0', '"latency_s":-Infinity'), "", "Infinity"),
    "too-large": (with_text('"latency_s":0.0', '"latency_s":1e999'), "", "1e999"),
    "nan-undeclared": (with_text('"seed_sent":true', '"mine":{"x":NaN}'), "", "NaN"),
    "huge-number": (record_with("reply.usage.completion_tokens", 10**30),
        "reply.usage.completion_tokens", "out of range"),
    "many-digits": (with_text('"latency_s":0.0', '"latency_s":' + "9" * 9999), "", "9,999 digits"),
    "deep": (with_text('"latency_s":0.0', '"latency_s":' + "[" * 9999 + "]" * 9999), "", "deep"),
    "text-for-number": (record_with("seed", "0"), "seed", "wrong type"),
    "number-for-text": (record_with("reply.text", 5), "reply.text", "wrong type"),
    "no-cost": (record_with("reply.billed_usd", -5), "reply.billed_usd", "out of range"),
    "word": (record_with("outcome", "fine"), "outcome", "allowed: ok, "),
    "finish": (record_with("reply.finish", "never"), "reply.finish", "allowed: stop, "),
    "truth": (record_with("n_blocks", True), "n_blocks", "wrong type"),
    "score": (record_with("scores.1.tp", 1.5), "scores[1].tp", "wrong type"),
    "parse": (record_with("parse.plan", "1, 2"), "parse.plan", "wrong type"),
    "track": (record_with("track", "singing"), "track", "full_planning"),
    "empty": (b"", "", "not a record"),
    "blank": (b"  \r", "", "not a record"),
    "no-object": (b"[1, 2]", "", "not a record"),
    "not-utf8": (b'{"sample": "\xff"}', "", "UTF-8"),
    "cut": (json.dumps(plan_record()).encode()[:300], "", "not a record"),
    "zeros": (b"\0" * 64, "", "not a record"),
}  # fmt: skip
"""By name: a line, the field that is named, and what else is said."""

YAML_TEXTS: dict[str, str] = {
    "anchors": "[&a [x, x, x, x, x, x, x, x], &b [*a, *a, *a, *a, *a, *a, *a, *a], "
    "&c [*b, *b, *b, *b, *b, *b, *b, *b], &d [*c, *c, *c, *c, *c, *c, *c, *c], "
    "&e [*d, *d, *d, *d, *d, *d, *d, *d], &f [*e, *e, *e, *e, *e, *e, *e, *e], "
    "&g [*f, *f, *f, *f, *f, *f, *f, *f], [*g, *g, *g, *g, *g, *g, *g, *g]]",
    "anchor-of-itself": "&a [*a]",
    "deep": "[" * 2000 + "]" * 2000,
    "binary": "!!binary aGVsbG8=",
    "set": "!!set {a, b}",
    "pairs": "!!pairs [a: 1]",
    "python": "!!python/object/apply:os.getcwd []",
    "hex": "0x" + "f" * 6000,
    "digits": "9" * 6000,
    "no-number": "!!int x",
    "no-truth": "!!bool x",
    "half-a-character": '"\\ud800"',
    "list-as-key": "{[1]: 2}",
}
"""YAML that `phyblock run` never writes, by what is bad about it."""
