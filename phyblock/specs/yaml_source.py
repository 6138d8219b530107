"""YAML read with the place of every key and value, so that errors can point at them.

Scalars follow YAML 1.2's core schema, not PyYAML's 1.1: `on`, `no` and dates are text, `1e-3` is
a number, `010` is ten. Keys are always text, as written. Only plain data is read: no tags beyond
the standard ones, anchors and merge keys (`<<`) yes, a key written twice no.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from phyblock.bounded_yaml import TAG, TooMuchError, compose
from phyblock.errors import Problem, SpecError, reason_of
from phyblock.files import LONGEST_INTEGER, read_bytes
from phyblock.specs.yaml_loader import BOUNDS, CoreLoader
from phyblock.types import QUOTE_HINT

__all__ = ["CoreLoader", "FieldPath", "YamlSource", "dotted", "parse_yaml", "read_yaml"]

FieldPath = tuple[str | int, ...]

LARGEST_YAML_BYTES = 256 * 1024
"""Limit of a file: some fifty times what the largest honest ones hold."""

_LONGEST_KEY = 100
_ALLOWED = f"{LARGEST_YAML_BYTES // 1024} kB at most"


def dotted(path: FieldPath) -> str:
    """A path as people write it: `images.order[1]`."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{_cut(part)}" for part in path)
    return text.removeprefix(".")


def _cut(key: str) -> str:
    return key if len(key) <= _LONGEST_KEY else key[:_LONGEST_KEY] + "..."


@dataclass
class YamlSource:
    """A YAML document: its data and where each part stands.

    `keys` and `values` give a place ("file:line:col", or "--set ...") for each path; `problems`
    is what was wrong with the YAML itself and could be passed over.
    """

    label: str
    data: Any = None
    keys: dict[FieldPath, str] = field(default_factory=dict)
    values: dict[FieldPath, str] = field(default_factory=dict)
    problems: list[Problem] = field(default_factory=list)
    overridden: set[FieldPath] = field(default_factory=set)

    def where(self, path: FieldPath, *, key: bool = False) -> str:
        """Place of the value at `path` (or of its key), else of the nearest thing around it."""
        first, second = (self.keys, self.values) if key else (self.values, self.keys)
        for end in range(len(path), 0, -1):
            place = first.get(path[:end]) or second.get(path[:end])
            if place:
                return place
        return self.values.get((), f"{self.label}:1:1")

    def is_overridden(self, path: FieldPath) -> bool:
        """Whether the value at `path` came from the command line."""
        return any(path[:end] in self.overridden for end in range(1, len(path) + 1))


def read_yaml(path: Path) -> YamlSource:
    """Read a file; SpecError where it cannot be read or is not YAML."""
    try:
        raw = read_bytes(path, LARGEST_YAML_BYTES)
    except OSError as error:
        raise SpecError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    except ValueError as error:
        raise SpecError(Problem(str(path), str(error), allowed=_ALLOWED)) from error
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = raw[: error.start].decode("utf-8")
        where = f"{path}:{_line_col(before)}"
        raise SpecError(
            Problem(where, "is not UTF-8 text", found=f"byte 0x{raw[error.start]:02x}")
        ) from error
    return parse_yaml(text, str(path))


def parse_yaml(text: str, label: str, *, place: str | None = None) -> YamlSource:
    """Read a text.

    Every place is `place` where that is given, else `label:line:col`. Raises SpecError where the
    text is not YAML, or larger, deeper or longer than any honest file.
    """
    source = YamlSource(label)
    reader = _Reader(source, place)
    if len(text) > LARGEST_YAML_BYTES:
        problem = Problem(place or label, "is too long", "", f"{len(text):,} characters", _ALLOWED)
        raise SpecError(problem)
    try:
        node = compose(CoreLoader(text))
        if node is not None:
            source.data = reader.build(node, (), ())
    except yaml.MarkedYAMLError as error:
        raise SpecError(reader.syntax_problem(error)) from error
    except yaml.reader.ReaderError as error:
        where = place or f"{label}:{_line_col(text[: error.position])}"
        found = f"character U+{ord(text[error.position]):04X}"
        raise SpecError(Problem(where, "holds a character YAML does not allow", "", found)) from (
            error
        )
    except TooMuchError as error:
        where = place or f"{label}:{error.mark.line + 1}:{error.mark.column + 1}"
        raise SpecError(Problem(where, error.message, allowed=error.allowed)) from error
    return source


class _Reader:
    """Turns nodes into data, noting places and problems in the source."""

    def __init__(self, source: YamlSource, place: str | None) -> None:
        self._source = source
        self._place = place
        self._count = 0

    def build(self, node: yaml.Node, path: FieldPath, above: tuple[yaml.Node, ...]) -> Any:
        if any(node is other for other in above):
            raise TooMuchError("an anchor holds itself", "", node.start_mark)
        self._count += 1
        if self._count > BOUNDS.values:
            message = f"holds more than {BOUNDS.values:,} values"
            raise TooMuchError(message, "", node.start_mark)
        self._source.values.setdefault(path, self._where(node))
        above = (*above, node)
        kind = node.tag.removeprefix(TAG)
        if isinstance(node, yaml.MappingNode) and kind == "map":
            return self._mapping(node, path, above)
        if isinstance(node, yaml.SequenceNode) and kind == "seq":
            return [self.build(item, (*path, i), above) for i, item in enumerate(node.value)]
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, kind, path)
        self._note(node, path, "has a tag that is not allowed", node.tag)
        return None

    def _mapping(
        self, node: yaml.MappingNode, path: FieldPath, above: tuple[yaml.Node, ...]
    ) -> dict[str, Any]:
        merged = [value for key, value in node.value if key.tag == TAG + "merge"]
        own: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if key_node.tag == TAG + "merge":
                continue
            if not isinstance(key_node, yaml.ScalarNode):
                self._note(key_node, path, "has a key that is not plain text")
                continue
            key = self._text(key_node, path)
            here = (*path, key)
            if key in own:
                first = self._source.keys[here]
                self._note(key_node, here, "is written twice", hint=f"the first is at {first}")
                continue
            self._source.keys.setdefault(here, self._where(key_node))
            own[key] = self.build(value_node, here, above)
        below: dict[str, Any] = {}
        for base in self._merged(merged, path, above):
            for key, value in base.items():
                below.setdefault(key, value)
        return {**below, **own}

    def _merged(
        self, nodes: list[yaml.Node], path: FieldPath, above: tuple[yaml.Node, ...]
    ) -> Iterator[Mapping[str, Any]]:
        for node in nodes:
            for part in node.value if isinstance(node, yaml.SequenceNode) else [node]:
                if isinstance(part, yaml.MappingNode):
                    yield self.build(part, path, above)
                else:
                    self._note(part, path, "merges (<<) something that is not a mapping")

    def _scalar(self, node: yaml.ScalarNode, kind: str, path: FieldPath) -> Any:
        text = self._text(node, path)
        try:
            if kind == "int":
                digits = text.lower()
                base = 8 if digits.startswith("0o") else 16 if digits.startswith("0x") else 10
                return self._integer(node, path, digits, base)
            if kind == "float":
                return float(re.sub(r"\.(?=inf|nan)", "", text.lower()))
        except ValueError:
            self._note(node, path, f"is not a number ({kind})", _cut(text))
            return None
        if kind == "bool":
            return text.lower() == "true"
        if kind in ("null", "str", "merge"):
            return None if kind == "null" else text
        self._note(node, path, "has a tag that is not allowed", node.tag)
        return None

    def _integer(self, node: yaml.Node, path: FieldPath, digits: str, base: int) -> int | None:
        most = f"numbers of {LONGEST_INTEGER} digits at most"
        if len(digits) > LONGEST_INTEGER:
            self._note(node, path, "is too long a number", f"{len(digits):,} digits", allowed=most)
            return None
        # Digits of other bases stand for more than one of ten.
        value = int(digits, base)
        if abs(value) >= 10**LONGEST_INTEGER:
            self._note(node, path, "is too large a number", _cut(digits), allowed=most)
            return None
        return value

    def _text(self, node: yaml.ScalarNode, path: FieldPath) -> str:
        """The node's text with surrogate pairs (JSON's escapes) joined, which PyYAML leaves."""
        try:
            return str(node.value).encode("utf-16", "surrogatepass").decode("utf-16")
        except UnicodeDecodeError:
            self._note(node, path, "holds half of a character (a lone surrogate)")
            return ""

    def syntax_problem(self, error: yaml.MarkedYAMLError) -> Problem:
        """What the parser said, at the place it said it of."""
        mark = error.problem_mark or error.context_mark
        where = self._source.label
        if self._place:
            where = self._place
        elif mark is not None:
            where = f"{where}:{mark.line + 1}:{mark.column + 1}"
        message = (error.problem or error.context or "unreadable").strip()
        hint = ""
        if "\\t" in message:
            hint = "indent with spaces, not with tabs"
        elif "mapping values are not allowed" in message:
            hint = "put text that holds ': ' in quotes, or check the indentation"
        elif "another document" in message:
            hint = "keep one document: remove the line ---"
        elif self._place:
            hint = QUOTE_HINT
        return Problem(where, f"is not YAML: {message}", hint=hint)

    def _where(self, node: yaml.Node) -> str:
        mark = node.start_mark
        return self._place or f"{self._source.label}:{mark.line + 1}:{mark.column + 1}"

    def _note(
        self,
        node: yaml.Node,
        path: FieldPath,
        message: str,
        found: str = "",
        hint: str = "",
        allowed: str = "",
    ) -> None:
        problem = Problem(self._where(node), message, dotted(path), found, allowed, hint)
        self._source.problems.append(problem)


def _line_col(before: str) -> str:
    lines = before.split("\n")
    return f"{len(lines)}:{len(lines[-1]) + 1}"
