"""YAML with the place of every key and value, so that errors can point at them; --set overrides."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import yaml

from phyblock.errors import Problem, SpecError, reason_of
from phyblock.files import LONGEST_INTEGER, read_bytes
from phyblock.types import QUOTE_HINT

_LONGEST = 80
"""Characters of a value that are shown, and so the most of its items that can matter."""

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

SECRET_KEYS = frozenset(
    {"api_key", "apikey", "api-key", "token", "secret", "password", "authorization",
     "x-api-key"}
)  # fmt: skip
"""Keys under which only a secret would be written."""


def looks_secret(text: str) -> bool:
    """Whether a text has the form of a provider's key, a token, or a URL with a password."""
    return bool(_SECRET.search(text) or _CREDENTIALS_IN_URL.match(text))


def show(value: object) -> str:
    """A value as it would be written in YAML, on one short line; secrets are not repeated."""
    if isinstance(value, Mapping):
        keys = ", ".join(str(key) for key in islice(value, _LONGEST))
        text = f"a mapping with {keys}" if value else "an empty mapping"
    elif isinstance(value, list | tuple):
        text = "[" + ", ".join(show(item) for item in islice(value, _LONGEST)) + "]"
    elif isinstance(value, str):
        text = "a text that looks like a key" if looks_secret(value) else _quote(value)
    elif isinstance(value, float):
        text = repr(value)
    else:
        text = json.dumps(value, default=str)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def _quote(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)


TAG = "tag:yaml.org,2002:"


@dataclass(frozen=True)
class YamlBounds:
    """What a document may hold: far above any use, far below a memory bomb."""

    values: int
    """Values, aliases expanded."""
    depth: int
    """Levels of nesting."""


class TooMuchError(Exception):
    """A document passes a bound; `message` says which, `mark` where."""

    def __init__(self, message: str, allowed: str, mark: yaml.Mark) -> None:
        self.message = message
        self.allowed = allowed
        self.mark = mark
        super().__init__(message)


class BoundedLoader(yaml.SafeLoader):
    """SafeLoader which stops at the bounds while it composes."""

    def __init__(self, text: str, bounds: YamlBounds) -> None:
        self._bounds = bounds
        self._depth = 0
        self._nodes = 0
        super().__init__(text)

    def fetch_flow_collection_start(self, token_class: type[yaml.Token]) -> None:
        """Scan a bracket or a brace, whose depth PyYAML goes through again at each token."""
        if self.flow_level > self._bounds.depth:
            mark: yaml.Mark = self.get_mark()
            raise _too_deep(self._bounds, mark)
        super().fetch_flow_collection_start(token_class)

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """The next node with all below it, as PyYAML makes it."""
        self._nodes += 1
        self._depth += 1
        if self._depth > self._bounds.depth:
            raise _too_deep(self._bounds, self._mark())
        # A mapping has a node for each key and each value.
        if self._nodes > 2 * self._bounds.values:
            raise _too_many(self._bounds, self._mark())
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def _mark(self) -> yaml.Mark:
        mark: yaml.Mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        return mark


def compose(loader: BoundedLoader) -> yaml.Node | None:
    """The one document that a loader reads; None where there is none.

    Raises yaml.YAMLError for what is not YAML, TooMuchError for what passes a bound.
    """
    try:
        node: yaml.Node | None = loader.get_single_node()
        return node
    finally:
        loader.dispose()


def load_yaml(text: str, bounds: YamlBounds) -> Any:
    """The plain data of what PyYAML's dumper wrote: texts, numbers, truth values, null in mappings
    and lists. Keys are texts or integers.

    Raises as `compose`, and TooMuchError for anything else: other tags, a key written twice.
    """
    loader = BoundedLoader(text, bounds)
    node = compose(loader)
    return None if node is None else _Builder(loader, bounds).build(node, ())


class _Builder:
    def __init__(self, loader: BoundedLoader, bounds: YamlBounds) -> None:
        self._loader = loader
        self._bounds = bounds
        self._count = 0

    def build(self, node: yaml.Node, above: tuple[yaml.Node, ...]) -> Any:
        if any(node is other for other in above):
            raise TooMuchError("an anchor holds itself", "", node.start_mark)
        self._count += 1
        if self._count > self._bounds.values:
            raise _too_many(self._bounds, node.start_mark)
        # Aliases may nest deeper than what is written.
        if len(above) >= self._bounds.depth:
            raise _too_deep(self._bounds, node.start_mark)
        above = (*above, node)
        if isinstance(node, yaml.MappingNode) and node.tag == TAG + "map":
            return self._mapping(node, above)
        if isinstance(node, yaml.SequenceNode) and node.tag == TAG + "seq":
            return [self.build(item, above) for item in node.value]
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node)
        raise TooMuchError("has a tag that is not allowed", "", node.start_mark)

    def _mapping(self, node: yaml.MappingNode, above: tuple[yaml.Node, ...]) -> dict[Any, Any]:
        mapping: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key = self._scalar(key_node) if isinstance(key_node, yaml.ScalarNode) else None
            if not isinstance(key, (str, int)):
                raise TooMuchError("has a key that is no text", "", key_node.start_mark)
            if key in mapping:
                raise TooMuchError("has a key that is written twice", "", key_node.start_mark)
            mapping[key] = self.build(value_node, above)
        return mapping

    def _scalar(self, node: yaml.ScalarNode) -> Any:
        kind = node.tag.removeprefix(TAG)
        loader: Any = self._loader
        try:
            if kind == "str":
                # Pairs are JSON's escapes and are joined; lone ones are bytes of a path.
                return node.value.encode("utf-16", "surrogatepass").decode(
                    "utf-16", "surrogatepass"
                )
            if kind in ("int", "float") and len(node.value) > LONGEST_INTEGER:
                raise ValueError
            if kind == "int":
                return loader.construct_yaml_int(node)
            if kind == "float":
                return loader.construct_yaml_float(node)
            if kind == "bool":
                return loader.construct_yaml_bool(node)
        except (ValueError, OverflowError, KeyError, IndexError):
            # An explicit tag may stand before any text.
            raise TooMuchError(f"is no {kind} that can be read", "", node.start_mark) from None
        if kind == "null":
            return None
        raise TooMuchError("has a tag that is not allowed", "", node.start_mark)


def _too_deep(bounds: YamlBounds, mark: yaml.Mark) -> TooMuchError:
    return TooMuchError("is nested too deeply", f"{bounds.depth} levels at most", mark)


def _too_many(bounds: YamlBounds, mark: yaml.Mark) -> TooMuchError:
    return TooMuchError(f"holds more than {bounds.values:,} values", "", mark)


BOUNDS = YamlBounds(values=20_000, depth=64)


class CoreLoader(BoundedLoader):
    """A loader with the scalars of YAML 1.2's core schema."""

    def __init__(self, text: str) -> None:
        super().__init__(text, BOUNDS)


CoreLoader.yaml_implicit_resolvers = {}

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
    CoreLoader.add_implicit_resolver(TAG + _kind, re.compile(_pattern), _first)


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


_VARIABLE = re.compile(r"\$(?:(\w+)|\{(\w+)\})")
_LONGEST_PATH, _LONGEST_NAME = 4095, 255
"""Limits of Linux [bytes]."""

_PLACE = re.compile(r":(\d+):(\d+)$")


def expand(text: str, base: Path) -> Path:
    """The absolute path that `text` means, seen from the folder `base`.

    Raises ValueError, with a message for the user, for a variable that is not set, a home
    folder that is not known, or what cannot be the name of a file or be written down in a run.
    """

    def value_of(match: re.Match[str]) -> str:
        name = match[1] or match[2]
        if name not in os.environ:
            raise ValueError(f"the environment variable {name} is not set")
        return os.environ[name]

    try:
        path = Path(_VARIABLE.sub(value_of, text)).expanduser()
    except RuntimeError as error:
        raise ValueError("the home folder that ~ stands for is not known") from error
    # What was written must be UTF-8; the folder that it is seen from is named as it is.
    _check_path(str(path))
    whole = os.path.normpath(base.absolute() / path)
    _check_length(os.fsencode(whole))
    return Path(whole)


def _check_path(text: str) -> None:
    """Raise ValueError, with a message for the user, for what cannot be a path of UTF-8 names."""
    if not is_utf8(text):
        raise ValueError("holds a name that is not UTF-8")
    data = text.encode()
    if b"\0" in data:
        raise ValueError("holds a NUL character")
    _check_length(data)


def _check_length(data: bytes) -> None:
    if len(data) > _LONGEST_PATH or any(len(part) > _LONGEST_NAME for part in data.split(b"/")):
        raise ValueError("is longer than a path can be")


def is_utf8(text: str) -> bool:
    """Whether a text from the command line or a file name can be written down as UTF-8."""
    return not any("\ud800" <= character <= "\udfff" for character in text)


def sort_problems(problems: Iterable[Problem]) -> list[Problem]:
    """Problems in the order in which they stand in the file, those of the command line last."""

    def rank(problem: Problem) -> tuple[int, int, int]:
        place = None if problem.where.startswith("--") else _PLACE.search(problem.where)
        return (0, int(place[1]), int(place[2])) if place else (1, 0, 0)

    return sorted(problems, key=rank)


_MOST, _DEEPEST, _LONGEST_SHOWN = 200, 16, 200
_FORM = "--set KEY=VALUE, for example --set levels=[1,2] or --set dataset.path=FOLDER"


def apply_overrides(source: YamlSource, overrides: Iterable[str]) -> None:
    """Put each "key=value" into the source's data, as if the file said so.

    Keys are dotted; values are YAML. A later override of the same key wins. What is wrong with
    an override's own form is added to `source.problems`; whether key and value make sense is
    judged with the rest of the file, and reported against the --set text.
    """
    texts = tuple(overrides)
    if len(texts) > _MOST:
        problem = Problem("--set", "is given too often", "", f"{len(texts):,}", f"{_MOST} at most")
        raise SpecError(problem)
    for text in texts:
        try:
            _apply(source, text)
        except SpecError as error:
            source.problems.extend(error.problems)


def _apply(source: YamlSource, text: str) -> None:
    shown = text if len(text) <= _LONGEST_SHOWN else text[:_LONGEST_SHOWN] + "..."
    place = "--set ..." if looks_secret(text) else f"--set {shown}"
    if not is_utf8(text):
        raise SpecError(Problem(place, "is not UTF-8"))
    key, equals, raw = text.partition("=")
    parts = tuple(part.strip() for part in key.split("."))
    if not equals or not all(parts) or len(parts) > _DEEPEST:
        raise SpecError(Problem(place, "is not of the form key=value", hint=_FORM))
    value = parse_yaml(raw, place, place=place)
    if value.problems:
        raise SpecError(_below(parts, problem) for problem in value.problems)
    section = _section(source, parts[:-1], place)
    section[parts[-1]] = value.data
    for table in (source.keys, source.values):
        for path in [path for path in table if path[: len(parts)] == parts]:
            del table[path]
    source.keys[parts] = source.values[parts] = place
    source.overridden.add(parts)


def _below(parts: FieldPath, problem: Problem) -> Problem:
    """A problem of an override's value, said of the field of the suite that it is in."""
    inner = problem.field
    joint = "." if inner and not inner.startswith("[") else ""
    return replace(problem, field=f"{dotted(parts)}{joint}{inner}")


def _section(source: YamlSource, parts: FieldPath, place: str) -> dict[Any, Any]:
    """The mapping that holds the key, made where it is not there."""
    if source.data is None:
        source.data = {}
    here = source.data
    for end, part in enumerate(parts, 1):
        if not isinstance(here, dict):
            break
        if here.get(part) is None:
            here[part] = {}
            source.keys[parts[:end]] = place
        here = here[part]
    if not isinstance(here, dict):
        at = dotted(parts) or "the suite"
        raise SpecError(
            Problem(place, f"cannot be set: {at} is not a mapping", found=show(here),
                    hint="set the whole value")
        )  # fmt: skip
    return here
