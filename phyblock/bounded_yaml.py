"""Read YAML within bounds: aliases that multiply, deep nesting, numbers of thousands of digits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import yaml

from phyblock.files import LONGEST_INTEGER

__all__ = ["TAG", "BoundedLoader", "TooMuchError", "YamlBounds", "compose", "load_yaml"]

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
