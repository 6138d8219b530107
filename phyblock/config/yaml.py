"""YAML with the place of every key and value, so that errors can point at them; --set overrides.

Scalars follow YAML 1.2's core schema, not PyYAML's 1.1: `on`, `no` and dates are text, `1e-3` is
a number, `010` is ten. Keys are always text, as written. Only plain data is read: anchors, but no
merge keys (`<<`), no tags beyond the standard ones, no duplicate keys, no infinity.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from phyblock.errors import Problem, SpecError, reason_of
from phyblock.files import read_text
from phyblock.types import QUOTE_HINT

FieldPath = tuple[str | int, ...]

LARGEST_YAML_BYTES = 256 * 1024
"""Default limit of a file: about fifty times the largest legitimate one."""
_BYTES_A_VALUE = 12
"""A file holds at most one value per this many bytes of the size limit, with aliases expanded."""
_DEEPEST = 64
_LONGEST_NUMBER = 300
_TOO_DEEP = f"is nested more than {_DEEPEST} levels deep"
_LONGEST_SHOWN = 80
_TAG = "tag:yaml.org,2002:"
_FORM = "--set KEY=VALUE, for example --set levels=[1,2] or --set dataset.path=FOLDER"

_HINTS = {
    "\\t": "indent with spaces, not with tabs",
    "mapping values": "put text that holds ': ' in quotes, or check the indentation",
    "another document": "keep one document: remove the line ---",
}
"""Hints for PyYAML's messages, by words in them."""

_SECRET = re.compile(
    r"""(?<![A-Za-z0-9])(?:
        sk-[A-Za-z0-9_-]{8,}            # OpenAI, Anthropic, OpenRouter, DashScope
      | (?:AIza|ya29\.)[A-Za-z0-9_-]{16,}  # Google
      | (?:hf|gsk|pplx|xai|nvapi|r8|ghp|fw)[_-][A-Za-z0-9_-]{16,}
      | AKIA[A-Z0-9]{12,}               # AWS
      | eyJ[A-Za-z0-9_-]{10,300}\.[A-Za-z0-9_-]{10,}
      | [Bb]earer\s+[A-Za-z0-9._-]{8,}
    )""",
    re.VERBOSE,
)
_CREDENTIALS_IN_URL = re.compile(r"^[a-z][a-z0-9+.-]*://[^/@\s:]*:[^/@\s]*@", re.IGNORECASE)
_SECRET_KEYS = ("api_key", "apikey", "api-key", "token", "secret", "password", "authorization",
                "x-api-key")  # fmt: skip
"""Keys under which only a secret would be written."""
_ENCODER = json.JSONEncoder(ensure_ascii=False, default=str)


def looks_secret(text: str) -> bool:
    """True if a text has the form of a provider's key, a token, or a URL with a password."""
    return bool(_SECRET.search(text) or _CREDENTIALS_IN_URL.match(text))


def shown(value: object) -> str:
    """Return any value as JSON for messages, cut if it is long; secrets are hidden."""
    text = ""
    try:
        for part in _ENCODER.iterencode(value):
            text += part
            if len(text) > 1000:
                break
    except (TypeError, ValueError, RecursionError):
        text += "..." if text else type(value).__name__
    if looks_secret(text) or (isinstance(value, str) and looks_secret(value)):
        return "a text that looks like a key"
    text = text.encode("utf-8", "replace").decode()
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 3] + "..."


def dotted(path: FieldPath) -> str:
    """Return a path in dotted form: `images.order[1]`."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


class Place(NamedTuple):
    """The places of a key and of its value in a file, or of the override that set it."""

    key: str
    value: str
    is_override: bool = False


@dataclass
class YamlSource:
    """A YAML document: its data, and the places of its parts in file order, overrides last."""

    label: str
    data: Any = None
    places: dict[FieldPath, Place] = field(default_factory=dict)

    def place(self, path: FieldPath) -> Place:
        """Return the place of the value at `path`, or of the nearest around it."""
        ends = (path[:end] for end in range(len(path), -1, -1))
        nearest = (self.places[end] for end in ends if end in self.places)
        return next(nearest, Place(self.label, self.label))

    def where(self, path: FieldPath, *, key: bool = False) -> str:
        """Return the place of the value at `path` (or of its key) as text, or the nearest."""
        place = self.place(path)
        return place.key if key else place.value

    def file(self, text: str, path: FieldPath) -> Path:
        """Return the absolute path that the text at `path` names.

        It is relative to the file's folder, in an override to the working directory; `~` and
        $VARIABLES are expanded. Raises SpecError if a variable is not set or a name is not UTF-8.
        """
        expanded = os.path.expandvars(os.path.expanduser(text))
        base = Path() if self.place(path).is_override else Path(self.label).parent
        found = Path(os.path.normpath(base.absolute() / expanded))
        message = ""
        if unset := re.search(r"\$\{?(\w+)", expanded):
            message = f"the environment variable {unset[1]} is not set"
        elif re.search("[\ud800-\udfff]", str(found)):
            message = "is in a folder whose name is not UTF-8"
        if message:
            raise SpecError(Problem(self.where(path), message, dotted(path), text))
        return found

    def in_order(self, problems: Iterable[Problem]) -> list[Problem]:
        """Return problems in the order of the file, those of the command line last."""
        texts = dict.fromkeys(text for place in self.places.values() for text in place[:2])
        order = {text: n for n, text in enumerate(texts)}
        return sorted(problems, key=lambda problem: order.get(problem.where, len(order)))


def _at(label: str, mark: yaml.Mark | None) -> str:
    return label if mark is None else f"{label}:{mark.line + 1}:{mark.column + 1}"


class _Loader(yaml.SafeLoader):
    """The scalars of YAML 1.2's core schema."""


class _Dumper(yaml.SafeDumper):
    """Quotes texts that either schema would misread; writes repeated values without aliases."""

    def ignore_aliases(self, _: object) -> bool:
        return True

    def represent_str(self, text: str) -> yaml.ScalarNode:
        # PyYAML would fold other line breaks than newlines.
        style = '"' if re.search("[\x85\u2028\u2029]", text) else None
        return self.represent_scalar(_TAG + "str", text, style)


_Dumper.add_representer(str, _Dumper.represent_str)
_Loader.yaml_implicit_resolvers = {}
for _kind, _pattern, _first in (
    ("null", r"^(?:~|null|Null|NULL|)$", ["~", "n", "N", ""]),
    ("bool", r"^(?:true|True|TRUE|false|False|FALSE)$", list("tTfF")),
    ("int", r"^(?:[-+]?[0-9]+|0o[0-7]+|0x[0-9a-fA-F]+)$", list("-+0123456789")),
    (
        "float",
        r"^(?:[-+]?(?:\.[0-9]+|[0-9]+(?:\.[0-9]*)?)(?:[eE][-+]?[0-9]+)?"
        r"|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN))$",
        list("-+.0123456789"),
    ),
    ("merge", r"^<<$", ["<"]),
):
    for _class in (_Loader, _Dumper):
        _class.add_implicit_resolver(_TAG + _kind, re.compile(_pattern), _first)


def dump_yaml(data: object) -> str:
    """Return plain data as YAML that `parse_yaml` reads back unchanged."""
    text: str = yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)
    return text


def read_yaml(
    path: Path, most_bytes: int = LARGEST_YAML_BYTES, *, may_hold_keys: bool = False
) -> YamlSource:
    """Read a file as `parse_yaml` does. Raises SpecError if it cannot be read or is not YAML."""
    try:
        text = read_text(path, most_bytes)
    except (OSError, ValueError) as error:
        raise SpecError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    return parse_yaml(text, str(path), most_bytes, may_hold_keys=may_hold_keys)


def parse_yaml(
    text: str,
    label: str,
    most_bytes: int = LARGEST_YAML_BYTES,
    base: FieldPath = (),
    *,
    may_hold_keys: bool = False,
) -> YamlSource:
    """Read a text, whose data belongs at `base`.

    Raises SpecError if it is not YAML, holds more than plain data, or is larger or deeper than any
    legitimate file. What looks like an API key is refused without being shown, so that none reaches
    a run folder; with `may_hold_keys` it is text, as in paths and names of scenes.
    """
    if len(text) > most_bytes:
        found, allowed = f"{len(text):,} characters", f"{most_bytes // 1024:,} kB at most"
        raise SpecError(Problem(label, "is too long", dotted(base), found, allowed))
    walker = _Walker(label, most_bytes // _BYTES_A_VALUE, may_hold_keys)
    hint, loader = "", None
    try:
        loader = _Loader(text)
        if (node := loader.get_single_node()) is not None:
            walker.source.data = walker.build(node, node, base)
        return walker.source
    except yaml.MarkedYAMLError as error:
        reason = (error.problem or error.context or "unreadable").strip()
        message, found = f"is not YAML: {reason}", ""
        hint = next((hint for words, hint in _HINTS.items() if words in reason), "")
        where = _at(label, error.problem_mark or error.context_mark)
    except yaml.reader.ReaderError as error:
        *lines, last = text[: error.position].split("\n")
        message, found = "is not allowed in YAML", f"character U+{ord(text[error.position]):04X}"
        where = f"{label}:{len(lines) + 1}:{len(last) + 1}"
    except RecursionError:
        message, found = _TOO_DEEP, ""
        where = _at(label, loader.get_mark() if loader else None)
    finally:
        if loader is not None:
            loader.dispose()
    raise SpecError(Problem(where, message, dotted(base), found, hint=hint))


class _Walker:
    """Turns nodes into data, noting the place of each in `source`."""

    def __init__(self, label: str, most_values: int, may_hold_keys: bool) -> None:
        self.source = YamlSource(label)
        self._may_hold_keys = may_hold_keys
        self._most_values = self._left = most_values

    def build(self, node: yaml.Node, key: yaml.Node, path: FieldPath) -> Any:
        """Return the data of a node."""
        label = self.source.label
        self.source.places[path] = Place(_at(label, key.start_mark), _at(label, node.start_mark))
        self._left -= 1
        if self._left < 0:
            raise self._error(node, path, f"is one of more than {self._most_values:,} values")
        if len(path) > _DEEPEST:
            # Aliases may nest deeper than the text, and contain themselves.
            raise self._error(node, path[:2], _TOO_DEEP)
        kind = node.tag.removeprefix(_TAG)
        if isinstance(node, yaml.MappingNode) and kind == "map":
            data: dict[str, Any] = {}
            for key_node, value_node in node.value:
                if not isinstance(key_node, yaml.ScalarNode):
                    raise self._error(key_node, path, "has a key that is not plain text")
                name = self._text(key_node, path)
                here = (*path, name)
                if key_node.tag == _TAG + "merge":
                    hint = "repeat the keys, or name the whole mapping with *NAME"
                    raise self._error(key_node, here, "is not supported", hint=hint)
                if name in data:
                    hint = f"the first is at {self.source.where(here, key=True)}"
                    raise self._error(key_node, here, "is written twice", hint=hint)
                data[name] = self.build(value_node, key_node, here)
            return data
        if isinstance(node, yaml.SequenceNode) and kind == "seq":
            return [self.build(item, item, (*path, n)) for n, item in enumerate(node.value)]
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, kind, path)
        raise self._error(node, path, "has a tag that is not allowed", node.tag)

    def _scalar(self, node: yaml.ScalarNode, kind: str, path: FieldPath) -> Any:
        text = self._text(node, path)
        lower = text.lower()
        if kind in ("int", "float"):
            if len(text) > _LONGEST_NUMBER:
                found = f"{len(text):,} digits"
                raise self._error(node, path, "is a number that is too large", found)
            with contextlib.suppress(ValueError):
                if kind == "int":
                    return int(lower, {"0o": 8, "0x": 16}.get(lower[:2], 10))
                # Infinity and NaN (`.inf`, `.nan` in YAML) are not allowed.
                if math.isfinite(number := float(lower)):
                    return number
            raise self._error(node, path, "is not a finite number", shown(text))
        if kind == "bool" and lower in ("true", "false"):
            return lower == "true"
        if kind == "null":
            return None
        if kind in ("str", "merge"):
            is_named = len(path) > 1 and str(path[-1]).lower() in _SECRET_KEYS
            if not self._may_hold_keys and (is_named or looks_secret(text)):
                message = "looks like a key, which must not be in a file"
                hint = "name an environment variable with api_key_env, and keep the key in it"
                raise self._error(node, path, message, hint=hint)
            return text
        raise self._error(node, path, "has a tag that is not allowed", node.tag)

    def _text(self, node: yaml.ScalarNode, path: FieldPath) -> str:
        """Return the node's text with surrogate pairs (from JSON escapes) joined."""
        try:
            return str(node.value).encode("utf-16", "surrogatepass").decode("utf-16")
        except UnicodeDecodeError:
            message = "holds half of a character (a lone surrogate)"
            raise self._error(node, path, message) from None

    def _error(
        self, node: yaml.Node, path: FieldPath, message: str, found: str = "", hint: str = ""
    ) -> SpecError:
        where = _at(self.source.label, node.start_mark)
        return SpecError(Problem(where, message, dotted(path), found, hint=hint))


def apply_overrides(source: YamlSource, overrides: Iterable[str]) -> None:
    """Set each "key=value" in the source's data, as if it were in the file.

    Keys are dotted; values are YAML. A later override of the same key wins. Raises SpecError for a
    malformed override; keys and values are validated with the rest of the file.
    """
    for text in overrides:
        where = "--set ..." if looks_secret(text) else f"--set {text}"
        key, equals, raw = text.partition("=")
        path = tuple(part.strip() for part in key.split("."))
        if not (equals and all(path) and len(path) < _DEEPEST):
            raise SpecError(Problem(where, "is not of the form key=value", hint=_FORM))
        try:
            value = parse_yaml(raw, where, base=path).data
        except SpecError as error:
            raise SpecError(
                replace(one, where=where, hint=one.hint or QUOTE_HINT) for one in error.problems
            ) from None
        source.data = {} if source.data is None else source.data
        here, place = source.data, Place(where, where, is_override=True)
        for end, part in enumerate(path[:-1], 1):
            if isinstance(here, dict) and here.get(part) is None:
                here[part] = {}
                source.places[path[:end]] = place
            here = here.get(part) if isinstance(here, dict) else here
        if not isinstance(here, dict):
            message = "cannot be set: it is inside a value that is not a mapping"
            raise SpecError(Problem(where, message, dotted(path), shown(here)))
        here[path[-1]] = value
        others = ((one, at) for one, at in source.places.items() if one[: len(path)] != path)
        source.places = {**dict(others), path: place}
