"""YAML with the place of every key and value, so that errors can point at them; --set overrides.

Scalars follow YAML 1.2's core schema, not PyYAML's 1.1: `on`, `no` and dates are text, `1e-3` is
a number, `010` is ten. Keys are always text, as written. Only plain data is read: no tags beyond
the standard ones, anchors and merge keys (`<<`) yes, a key written twice no.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import yaml

from phyblock.errors import Problem, SpecError, reason_of
from phyblock.files import read_bytes

FieldPath = tuple[str | int, ...]

LARGEST_YAML_BYTES = 256 * 1024
"""Default limit of a file: some fifty times what the largest honest ones hold."""
_BYTES_A_VALUE = 12
"""A file of the largest size holds at most a value for so many bytes, aliases expanded."""
_DEEPEST = 64
_LONGEST_SHOWN = 80

_TAG = "tag:yaml.org,2002:"
_FORM = "--set KEY=VALUE, for example --set levels=[1,2] or --set dataset.path=FOLDER"
QUOTE_HINT = "quote values with spaces, or write none: --set 'seeds=[0, 1]', --models a,b"
"""A way out where a shell took a value apart."""

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


def looks_secret(text: str) -> bool:
    """True if a text has the form of a provider's key, a token, or a URL with a password."""
    return bool(_SECRET.search(text) or _CREDENTIALS_IN_URL.match(text))


def show(value: object) -> str:
    """Return a value as it would be written in YAML, on one short line; secrets are hidden."""
    if isinstance(value, Mapping):
        keys = ", ".join(str(key) for key in islice(value, _LONGEST_SHOWN))
        text = f"a mapping with {keys}" if value else "an empty mapping"
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(show(item) for item in islice(value, _LONGEST_SHOWN)) + "]"
    elif isinstance(value, str):
        secret = looks_secret(value)
        text = "a text that looks like a key" if secret else json.dumps(value, ensure_ascii=False)
    else:
        text = repr(value) if isinstance(value, float) else json.dumps(value, default=str)
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 3] + "..."


def dotted(path: FieldPath) -> str:
    """Return a path as people write it: `images.order[1]`."""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path)
    return text.removeprefix(".")


def expand(text: str, base: Path) -> Path:
    """Return the absolute path that `text` means, seen from the folder `base`.

    `~` and $VARIABLES are expanded. Raises ValueError, with a message for the user, for a variable
    that is not set, a home folder that is not known, or a name that is not UTF-8.
    """

    def value_of(match: re.Match[str]) -> str:
        name = match[1] or match[2]
        if name not in os.environ:
            raise ValueError(f"the environment variable {name} is not set")
        return os.environ[name]

    try:
        path = Path(re.sub(r"\$(?:(\w+)|\{(\w+)\})", value_of, text)).expanduser()
        str(path).encode()
    except RuntimeError as error:
        raise ValueError("the home folder that ~ stands for is not known") from error
    except UnicodeEncodeError as error:
        raise ValueError("holds a name that is not UTF-8") from error
    return Path(os.path.normpath(base.absolute() / path))


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
    order: dict[str, tuple[int, int]] = field(default_factory=dict)

    def where(self, path: FieldPath, *, key: bool = False) -> str:
        """Return the place of the value at `path` (or of its key), or of the nearest around it."""
        first, second = (self.keys, self.values) if key else (self.values, self.keys)
        for end in range(len(path), 0, -1):
            place = first.get(path[:end]) or second.get(path[:end])
            if place:
                return place
        return self.values.get((), f"{self.label}:1:1")

    def is_overridden(self, path: FieldPath) -> bool:
        """True if the value at `path` came from the command line."""
        return any(path[:end] in self.overridden for end in range(1, len(path) + 1))

    def in_order(self, problems: Iterable[Problem]) -> list[Problem]:
        """Return problems as they stand in the file, those of the command line last."""
        last = (1 << 30, 0)
        return sorted(problems, key=lambda problem: self.order.get(problem.where, last))


class _Loader(yaml.SafeLoader):
    """The scalars of YAML 1.2's core schema."""


class _Dumper(yaml.SafeDumper):
    """Quotes texts that either schema would take for something else; repeats what stands twice."""

    def ignore_aliases(self, _: object) -> bool:
        return True

    def represent_str(self, text: str) -> yaml.ScalarNode:
        # PyYAML would fold other line breaks than its own.
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
    """Return plain data as YAML that `parse_yaml` reads again as it is."""
    text: str = yaml.dump(data, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=100)
    return text


def read_yaml(path: Path) -> YamlSource:
    """Read a file; SpecError where it cannot be read or is not YAML."""
    try:
        raw = read_bytes(path, LARGEST_YAML_BYTES)
    except OSError as error:
        raise SpecError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    except ValueError as error:
        raise SpecError(Problem(str(path), str(error))) from error
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        where = f"{path}:{_line_col(raw[: error.start].decode())}"
        found = f"byte 0x{raw[error.start]:02x}"
        raise SpecError(Problem(where, "is not UTF-8 text", found=found)) from error
    return parse_yaml(text, str(path))


def parse_yaml(
    text: str,
    label: str,
    *,
    place: str | None = None,
    most_bytes: int = LARGEST_YAML_BYTES,
    halves: bool = False,
) -> YamlSource:
    """Read a text.

    Every place is `place` where that is given, else `label:line:col`. With `halves` a text may hold
    lone surrogates, which stand for bytes of a path that is not UTF-8. Raises SpecError where the
    text is not YAML, or larger, deeper or longer than any honest file.
    """
    source = YamlSource(label)
    if len(text) > most_bytes:
        found, allowed = f"{len(text):,} characters", f"{most_bytes // 1024:,} kB at most"
        raise SpecError(Problem(place or label, "is too long", "", found, allowed))
    loader = None
    try:
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is not None:
            walker = _Walker(source, place, most_bytes // _BYTES_A_VALUE, halves)
            source.data = walker.build(node, ())
    except yaml.MarkedYAMLError as error:
        raise SpecError(_syntax_problem(error, label, place)) from error
    except yaml.reader.ReaderError as error:
        where = place or f"{label}:{_line_col(text[: error.position])}"
        found = f"character U+{ord(text[error.position]):04X}"
        problem = Problem(where, "holds a character YAML does not allow", "", found)
        raise SpecError(problem) from error
    except RecursionError as error:
        mark = loader.get_mark() if loader else None
        where = place or (f"{label}:{mark.line + 1}:{mark.column + 1}" if mark else label)
        allowed = f"{_DEEPEST} levels at most"
        raise SpecError(Problem(where, "is nested too deeply", allowed=allowed)) from error
    finally:
        if loader is not None:
            loader.dispose()
    return source


class _Walker:
    """Turns nodes into data, noting places and problems in the source."""

    def __init__(
        self, source: YamlSource, place: str | None, most_values: int, halves: bool
    ) -> None:
        self._source = source
        self._place = place
        self._most_values = most_values
        self._halves = halves
        self._count = 0
        self._above: list[yaml.Node] = []

    def build(self, node: yaml.Node, path: FieldPath) -> Any:
        """Return the data of a node; SpecError where there is more of it than in an honest file."""
        self._count += 1
        if any(node is other for other in self._above):
            raise SpecError(Problem(self._where(node), "an anchor holds itself"))
        if self._count > self._most_values:
            message = f"holds more than {self._most_values:,} values"
            raise SpecError(Problem(self._where(node), message))
        if len(self._above) >= _DEEPEST:
            # Aliases may nest deeper than the text.
            raise SpecError(
                Problem(self._where(node), "is nested too deeply", allowed=f"{_DEEPEST} at most")
            )
        self._source.values.setdefault(path, self._where(node))
        self._above.append(node)
        data: Any = None
        kind = node.tag.removeprefix(_TAG)
        if isinstance(node, yaml.MappingNode) and kind == "map":
            data = self._mapping(node, path)
        elif isinstance(node, yaml.SequenceNode) and kind == "seq":
            data = [self.build(item, (*path, index)) for index, item in enumerate(node.value)]
        elif isinstance(node, yaml.ScalarNode):
            data = self._scalar(node, kind, path)
        else:
            self._note(node, path, "has a tag that is not allowed", node.tag)
        self._above.pop()
        return data

    def _mapping(self, node: yaml.MappingNode, path: FieldPath) -> dict[str, Any]:
        own: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if key_node.tag == _TAG + "merge":
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
            own[key] = self.build(value_node, here)
        below: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if key_node.tag != _TAG + "merge":
                continue
            several = isinstance(value_node, yaml.SequenceNode)
            for part in value_node.value if several else [value_node]:
                if isinstance(part, yaml.MappingNode):
                    below = {**self.build(part, path), **below}
                else:
                    self._note(part, path, "merges (<<) something that is not a mapping")
        return {**below, **own}

    def _scalar(self, node: yaml.ScalarNode, kind: str, path: FieldPath) -> Any:
        text = self._text(node, path)
        lower = text.lower()
        try:
            if kind == "int":
                # Digits of other bases stand for more than one of ten.
                base = 8 if lower.startswith("0o") else 16 if lower.startswith("0x") else 10
                value = int(lower, base) if len(lower) <= 302 else 10**300
                if abs(value) < 10**300:
                    return value
                self._note(node, path, "is too large a number", f"{len(text):,} digits")
                return None
            if kind == "float":
                return float(re.sub(r"\.(?=inf|nan)", "", lower))
        except ValueError:
            self._note(node, path, f"is not a number ({kind})", show(text))
            return None
        if kind == "bool" and lower in ("true", "false"):
            return lower == "true"
        if kind in ("null", "str", "merge"):
            return None if kind == "null" else text
        self._note(node, path, "has a tag that is not allowed", node.tag)
        return None

    def _text(self, node: yaml.ScalarNode, path: FieldPath) -> str:
        """Return the node's text with surrogate pairs (JSON's escapes) joined."""
        data = str(node.value).encode("utf-16", "surrogatepass")
        try:
            return data.decode("utf-16", "surrogatepass" if self._halves else "strict")
        except UnicodeDecodeError:
            self._note(node, path, "holds half of a character (a lone surrogate)")
            return ""

    def _where(self, node: yaml.Node) -> str:
        line, column = node.start_mark.line + 1, node.start_mark.column + 1
        where = self._place or f"{self._source.label}:{line}:{column}"
        if not self._place:
            self._source.order[where] = (line, column)
        return where

    def _note(
        self, node: yaml.Node, path: FieldPath, message: str, found: str = "", hint: str = ""
    ) -> None:
        problem = Problem(self._where(node), message, dotted(path), found, hint=hint)
        self._source.problems.append(problem)


def _syntax_problem(error: yaml.MarkedYAMLError, label: str, place: str | None) -> Problem:
    mark = error.problem_mark or error.context_mark
    where = place or (f"{label}:{mark.line + 1}:{mark.column + 1}" if mark else label)
    message = (error.problem or error.context or "unreadable").strip()
    hint = QUOTE_HINT if place else ""
    if "\\t" in message:
        hint = "indent with spaces, not with tabs"
    elif "mapping values are not allowed" in message:
        hint = "put text that holds ': ' in quotes, or check the indentation"
    elif "another document" in message:
        hint = "keep one document: remove the line ---"
    return Problem(where, f"is not YAML: {message}", hint=hint)


def _line_col(before: str) -> str:
    lines = before.split("\n")
    return f"{len(lines)}:{len(lines[-1]) + 1}"


def apply_overrides(source: YamlSource, overrides: Iterable[str]) -> None:
    """Put each "key=value" into the source's data, as if the file said so.

    Keys are dotted; values are YAML. A later override of the same key wins. A fault in an
    override's own form is added to `source.problems`; key and value are judged with the rest of the
    file, and reported against the --set text.
    """
    for text in overrides:
        try:
            _override(source, text)
        except SpecError as error:
            source.problems.extend(error.problems)


def _override(source: YamlSource, text: str) -> None:
    place = "--set ..." if looks_secret(text) else f"--set {text}"
    key, equals, raw = text.partition("=")
    parts = tuple(part.strip() for part in key.split("."))
    if not equals or not all(parts) or len(parts) > 16:
        raise SpecError(Problem(place, "is not of the form key=value", hint=_FORM))
    try:
        text.encode()
    except UnicodeEncodeError:
        raise SpecError(Problem(place, "is not UTF-8")) from None
    value = parse_yaml(raw, place, place=place)
    if value.problems:
        below = [f"{dotted(parts)}.{p.field}".rstrip(".") for p in value.problems]
        fields = [name.replace(".[", "[") for name in below]
        raise SpecError(replace(p, field=f) for p, f in zip(value.problems, fields, strict=True))
    if source.data is None:
        source.data = {}
    here = source.data
    for end, part in enumerate(parts, 1):
        if not isinstance(here, dict):
            at = dotted(parts[: end - 1]) or "the suite"
            message = f"cannot be set: {at} is not a mapping"
            raise SpecError(Problem(place, message, found=show(here), hint="set the whole value"))
        if end == len(parts):
            here[part] = value.data
        elif here.get(part) is None:
            here[part] = {}
            source.keys[parts[:end]] = place
        here = here[part]
    for table in (source.keys, source.values):
        for path in [path for path in table if path[: len(parts)] == parts]:
            del table[path]
    source.keys[parts] = source.values[parts] = place
    source.overridden.add(parts)
