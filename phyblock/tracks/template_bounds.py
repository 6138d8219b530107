"""A Jinja environment whose templates end soon, whatever they say.

A template is a program of the user's. Jinja's sandbox keeps it from Python's insides; this one also
counts what it does. Each rendering has a number of steps: every value that an expression makes
costs one step for each character or entry in it (what stands in it twice counts twice), every turn
of a loop and every call of a macro costs the size of its body. What would make something huge at
one go, such as `'x' * 10**9`, is refused before it is done.
"""

from __future__ import annotations

import functools
import re
import string
from collections.abc import Callable, ItemsView, Iterable, Iterator, KeysView, ValuesView
from contextvars import ContextVar
from typing import Any

import jinja2
import jinja2.nodes
from jinja2.exceptions import SecurityError
from jinja2.nodes import EvalContext
from jinja2.runtime import Context
from jinja2.sandbox import ImmutableSandboxedEnvironment

from phyblock.tracks.template_counting import Counting

__all__ = ["MOST_STEPS", "MOST_TEXT", "BoundError", "BoundedEnvironment", "render_block"]

MOST_STEPS = 500_000
"""Steps of one rendering; the longest shipped prompt takes a few thousand."""
MOST_TEXT = 200_000
"""Characters of one rendered block."""

_MOST_RANGE = 10_000
_MOST_WIDTH = 1_000
_MOST_PRODUCT = 10_000_000
_MOST_BITS = 1_024
_HEAD = (
    jinja2.nodes.Assign,
    jinja2.nodes.AssignBlock,
    jinja2.nodes.FromImport,
    jinja2.nodes.Import,
    jinja2.nodes.Macro,
)
_GONE = ("lipsum", "cycler", "joiner", "namespace")
_TEXT_METHODS = frozenset({
    "capitalize", "casefold", "center", "count", "endswith", "expandtabs", "find", "format",
    "format_map", "index", "isalnum", "isalpha", "isdecimal", "isdigit", "islower",
    "isnumeric", "isspace", "istitle", "isupper", "join", "ljust", "lower", "lstrip",
    "partition", "removeprefix", "removesuffix", "replace", "rfind", "rindex", "rjust",
    "rpartition", "rsplit", "rstrip", "split", "splitlines", "startswith", "strip",
    "swapcase", "title", "upper", "zfill",
})  # fmt: skip
_METHODS: tuple[tuple[type, frozenset[str]], ...] = (
    (str, _TEXT_METHODS),
    (dict, frozenset({"copy", "get", "items", "keys", "values"})),
    (list, frozenset({"copy", "count", "index"})),
    (tuple, frozenset({"count", "index"})),
    (range, frozenset({"count", "index"})),
)
_NO_VALUES = (Context, EvalContext, jinja2.Environment, jinja2.Undefined)
_WIDTH_METHODS = {"center", "expandtabs", "ljust", "rjust", "zfill"}
_WIDTH_FILTERS = {"batch", "center", "indent", "round", "slice", "tojson"}
_PERCENT = re.compile(r"%(?:\([^)]*\))?[#0\- +]*(\d+|\*)?(?:\.(\d+|\*))?")


class BoundError(Exception):
    """A template does what none may; the text says what."""


class _Meter:
    """What one rendering has left."""

    def __init__(self) -> None:
        self._left = MOST_STEPS

    def spend(self, steps: int) -> None:
        self._left -= steps
        if self._left < 0:
            raise BoundError(f"it takes more than {MOST_STEPS:,} steps")

    def weight(self, value: object) -> int:
        """Characters and entries of a value; BoundError for more than are left."""
        total = 0
        stack = [value]
        while stack:
            one = stack.pop()
            total += 1
            if isinstance(one, (str, bytes, range)):
                total += len(one)
            elif isinstance(one, int):
                total += one.bit_length() // 8
            elif isinstance(one, (list, tuple, set, frozenset)):
                stack.extend(one)
            elif isinstance(one, dict):
                stack.extend(one)
                stack.extend(one.values())
            if total + len(stack) > self._left:
                raise BoundError(f"it takes more than {MOST_STEPS:,} steps")
        return total

    def charge(self, value: Any) -> Any:
        """The value, paid for; one that can be gone through only once becomes a list."""
        if isinstance(value, (Iterator, KeysView, ValuesView, ItemsView)):
            value = [self.charge(one) for one in value]
        self.spend(self.weight(value))
        return value

    def check_product(self, values: Iterable[object]) -> None:
        """Refuse what could repeat one large value as often as another has entries."""
        *_, second, first = sorted((1, 1, *map(self.weight, values)))
        if first * second > _MOST_PRODUCT:
            raise BoundError(f"it puts together more than {_MOST_PRODUCT:,} characters at once")


_METER: ContextVar[_Meter] = ContextVar("meter")


def _meter() -> _Meter:
    """The meter of the rendering under way; outside of one, while compiling, a fresh one."""
    return _METER.get(None) or _Meter()


def render_block(
    template: jinja2.Template, head: jinja2.Template, block: str, facts: dict[str, object]
) -> str:
    """The text of a block; raises BoundError, and whatever the template makes go wrong.

    `head` is what stands outside of the template's blocks; no name in it may be that of a fact.
    """
    token = _METER.set(_Meter())
    try:
        above = head.new_context(facts)
        for _ in head.root_render_func(above):
            pass
        if taken := sorted(above.vars.keys() & facts.keys()):
            raise BoundError(f"{taken[0]}, set outside of the blocks, is a fact of what is asked")
        pieces: list[str] = []
        length = 0
        for piece in template.blocks[block](template.new_context({**facts, **above.vars})):
            pieces.append(piece)
            length += len(piece)
            if length > MOST_TEXT:
                raise BoundError(f"its text is longer than {MOST_TEXT:,} characters")
        return "".join(pieces)
    finally:
        _METER.reset(token)


class BoundedEnvironment(ImmutableSandboxedEnvironment):
    """Sandbox for prompts; templates come from `bounded_template`."""

    intercepted_binops = frozenset(["+", "-", "*", "/", "//", "%", "**"])

    def __init__(self, loader: jinja2.BaseLoader | None = None) -> None:
        super().__init__(
            loader=loader,
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
            finalize=_finalize,
            # A constant expression would be worked out while compiling, where nothing is counted.
            optimized=False,
        )
        for name in _GONE:
            del self.globals[name]
        self.globals["range"] = _range
        tables: tuple[dict[str, Any], ...] = (self.filters, self.tests)
        for table in tables:
            table.update({name: _counted(name, func) for name, func in table.items()})
        self.filters |= {"_charged": _charged, "_each": _each, "_spend": _spend, "_concat": _concat}

    def bounded_template(self, source: str) -> jinja2.Template:
        """Compile a template; raises jinja2.TemplateSyntaxError, and others for what is too deep
        or too large for Python.
        """
        return self._compiled(self.parse(source))

    def head(self, source: str) -> jinja2.Template:
        """What a template says outside of its blocks that they can use: macros, values, imports."""
        tree = self.parse(source)
        tree.body = [node for node in tree.body if isinstance(node, _HEAD)]
        return self._compiled(tree)

    def _compiled(self, tree: jinja2.nodes.Template) -> jinja2.Template:
        tree.set_environment(self)
        return jinja2.Template.from_code(self, self.compile(tree), self.make_globals(None))

    def _parse(self, source: str, name: str | None, filename: str | None) -> jinja2.nodes.Template:
        # Templates that are included are parsed here, too, and are to be counted alike.
        tree = super()._parse(source, name, filename)
        Counting().visit(tree)
        return tree

    def call_binop(self, context: Context, operator: str, left: Any, right: Any) -> Any:
        """The result of an operator, unless it would be huge."""
        meter = _meter()
        if operator == "*":
            _check_times(meter, left, right)
        elif operator == "**" and isinstance(left, int) and isinstance(right, int):
            _check_bits(left.bit_length() * abs(right))
        elif operator == "%" and isinstance(left, str):
            _check_percent(left)
            meter.check_product((left, right))
        return meter.charge(super().call_binop(context, operator, left, right))

    def call(__self, __context: Context, __obj: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: N805
        """The result of a call, unless it is of a method that prompts have no use for."""
        meter = _meter()
        _check_method(meter, getattr(__obj, "__wrapped__", __obj), args, kwargs)
        return meter.charge(super().call(__context, __obj, *args, **kwargs))


def _check_times(meter: _Meter, left: Any, right: Any) -> None:
    for many, times in ((left, right), (right, left)):
        if isinstance(times, int) and isinstance(many, (str, bytes, list, tuple)):
            meter.spend(meter.weight(many) * max(1, times))
    if isinstance(left, int) and isinstance(right, int):
        _check_bits(left.bit_length() + right.bit_length())


def _check_bits(bits: int) -> None:
    if bits > _MOST_BITS:
        raise BoundError(f"it makes a number of more than {_MOST_BITS:,} bits")


def _check_width(width: object) -> None:
    if isinstance(width, int) and abs(width) > _MOST_WIDTH:
        raise BoundError(f"it asks for a width of more than {_MOST_WIDTH:,}")


def _check_percent(form: str) -> None:
    for match in _PERCENT.finditer(form):
        for width in match.groups():
            # The width of a star stands among the values.
            _check_width(
                _MOST_WIDTH + 1 if width == "*" or len(width or "") > 4 else int(width or 0)
            )


def _check_braces(form: str) -> None:
    for _, _, spec, _ in string.Formatter().parse(form):
        for width in re.findall(r"[{]|\d+", spec or ""):
            _check_width(_MOST_WIDTH + 1 if width == "{" or len(width) > 4 else int(width))


def _check_method(meter: _Meter, method: Any, args: Any, kwargs: Any) -> None:
    owner, name = getattr(method, "__self__", None), getattr(method, "__name__", "")
    meter.check_product((owner, *args, *kwargs.values()))
    if owner is None or type(owner).__module__ not in ("builtins", "markupsafe"):
        return
    known = next((names for kind, names in _METHODS if isinstance(owner, kind)), frozenset[str]())
    if name not in known:
        raise SecurityError(f"{name} is not available in prompts")
    if name in _WIDTH_METHODS:
        for width in (*args, *kwargs.values()):
            _check_width(width)
    if name in ("format", "format_map"):
        _check_braces(owner)


def _counted(name: str, func: Callable[..., Any]) -> Callable[..., Any]:
    """A filter or test whose result is paid for, and that makes nothing huge."""

    @functools.wraps(func)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        meter = _meter()
        values = [one for one in args if not isinstance(one, _NO_VALUES)]
        values = [meter.charge(one) if isinstance(one, Iterator) else one for one in values]
        meter.check_product((*values, *kwargs.values()))
        for one in (*values[1:], *kwargs.values()) if name in _WIDTH_FILTERS else ():
            _check_width(one)
        if name == "format" and values and isinstance(values[0], str):
            _check_percent(values[0])
        if name == "sum" and any(
            isinstance(one, (list, tuple)) for one in (*values[1:], *kwargs.values())
        ):
            raise SecurityError("sums of lists are not available in prompts")
        meter.spend(sum(map(meter.weight, values)))
        return meter.charge(func(*args, **kwargs))

    return wrapper


def _range(*args: int) -> range:
    numbers = range(*args)
    if len(numbers) > _MOST_RANGE:
        raise BoundError(f"it has a range of more than {_MOST_RANGE:,} numbers")
    return numbers


@jinja2.pass_context
def _finalize(context: Context, value: Any) -> Any:
    del context
    return _charged(value)


def _charged(value: Any) -> Any:
    return _meter().charge(value)


def _each(values: Iterable[Any]) -> list[Any]:
    meter = _meter()
    taken = []
    for value in values:
        meter.spend(1)
        taken.append(value)
    return taken


def _spend(steps: int) -> None:
    _meter().spend(steps)


def _concat(values: list[object]) -> str:
    return "".join(map(str, values))
