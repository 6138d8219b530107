"""Puts the counting of steps into a template, before it is compiled."""

from __future__ import annotations

from typing import Any

from jinja2 import nodes
from jinja2.visitor import NodeTransformer

__all__ = ["Counting"]

_BODIES = (nodes.For, nodes.Macro, nodes.CallBlock, nodes.Block, nodes.Template)


class Counting(NodeTransformer):
    """Wraps nodes in filters of `template_bounds`.

    `_charged` pays for a value, `_each` for going through one, `_spend` for a body, at its head.
    """

    def visit(self, node: nodes.Node, *args: Any, **kwargs: Any) -> nodes.Node:
        """The node, and all below it, with the counting."""
        if isinstance(node, _BODIES):
            node.body = [_payment(node.body, node.lineno), *node.body]
        self.generic_visit(node, *args, **kwargs)
        if isinstance(node, nodes.For):
            node.iter = _filtered(node.iter, "_each")
        elif isinstance(node, nodes.Compare):
            node.expr = _filtered(node.expr, "_charged")
            for operand in node.ops:
                operand.expr = _filtered(operand.expr, "_charged")
        elif isinstance(node, nodes.Concat):
            parts = nodes.List(node.nodes, lineno=node.lineno)
            return _filtered(_filtered(parts, "_charged"), "_concat")
        return _filtered(node, "_charged") if _makes_a_value(node) else node


def _makes_a_value(node: nodes.Node) -> bool:
    """Whether a node makes something new that no filter, call or operator pays for."""
    if isinstance(node, nodes.Getitem):
        return isinstance(node.arg, nodes.Slice)
    if isinstance(node, nodes.Tuple):
        return node.ctx == "load"
    return isinstance(node, (nodes.List, nodes.Dict))


def _filtered(node: nodes.Node, name: str) -> nodes.Filter:
    return nodes.Filter(node, name, [], [], None, None, lineno=node.lineno)


def _payment(body: list[nodes.Node], line: int) -> nodes.ExprStmt:
    """A statement that pays for one turn of a body: its parts, and the text in it."""
    inside = [part for child in body for part in (child, *child.find_all(nodes.Node))]
    text = sum(len(part.data) for part in inside if isinstance(part, nodes.TemplateData))
    cost = nodes.Const(1 + len(inside) + text, lineno=line)
    return nodes.ExprStmt(_filtered(cost, "_spend"), lineno=line)
