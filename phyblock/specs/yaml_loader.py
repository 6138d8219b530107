"""PyYAML's loader with the scalars of YAML 1.2's core schema, and bounds on what it composes."""

from __future__ import annotations

import re

import yaml

__all__ = ["MAX_DEPTH", "MAX_VALUES", "TAG", "CoreLoader", "TooMuchError", "compose"]

MAX_VALUES = 20_000
"""Bound on the values of a file, anchors expanded: far above any use, far below a memory bomb."""

MAX_DEPTH = 64
"""Bound on the levels of nesting."""

TAG = "tag:yaml.org,2002:"


class TooMuchError(Exception):
    """A document passes a bound; `message` says which, `mark` where."""

    def __init__(self, message: str, allowed: str, mark: yaml.Mark) -> None:
        self.message = message
        self.allowed = allowed
        self.mark = mark
        super().__init__(message)


class CoreLoader(yaml.SafeLoader):
    """SafeLoader with the scalars of YAML 1.2's core schema, which stops at the bounds."""

    def __init__(self, text: str) -> None:
        self._depth = 0
        self._nodes = 0
        super().__init__(text)

    def fetch_flow_collection_start(self, token_class: type[yaml.Token]) -> None:
        """Scan a bracket or a brace, whose depth PyYAML goes through again at each token."""
        if self.flow_level > MAX_DEPTH:
            mark: yaml.Mark = self.get_mark()
            raise TooMuchError("is nested too deeply", f"{MAX_DEPTH} levels at most", mark)
        super().fetch_flow_collection_start(token_class)

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """The next node with all below it, as PyYAML makes it."""
        self._nodes += 1
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise TooMuchError("is nested too deeply", f"{MAX_DEPTH} levels at most", self._mark())
        # A mapping has a node for each key and each value.
        if self._nodes > 2 * MAX_VALUES:
            raise TooMuchError(f"holds more than {MAX_VALUES:,} values", "", self._mark())
        node: yaml.Node | None = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def _mark(self) -> yaml.Mark:
        mark: yaml.Mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
        return mark


def compose(text: str) -> yaml.Node | None:
    """The one document in a text; None where there is none.

    Raises yaml.YAMLError for what is not YAML, TooMuchError for what passes a bound.
    """
    loader = CoreLoader(text)
    try:
        node: yaml.Node | None = loader.get_single_node()
        return node
    finally:
        loader.dispose()


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
