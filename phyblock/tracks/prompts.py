"""The files that a template is made of: its own, and those that it includes or imports.

They are read once, before anything is rendered, so that the digest of a prompt is that of what is
sent: an edit of a file that is included makes another prompt.
"""

from __future__ import annotations

import functools
import graphlib
import hashlib
import json
import os
import re
import string
import traceback
from collections.abc import (
    Callable,
    ItemsView,
    Iterable,
    Iterator,
    KeysView,
    Mapping,
    Sequence,
    ValuesView,
)
from contextvars import ContextVar
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath
from typing import Any, Protocol

import jinja2
import jinja2.meta
import jinja2.nodes
from jinja2 import nodes
from jinja2.exceptions import SecurityError
from jinja2.nodes import EvalContext
from jinja2.runtime import Context
from jinja2.sandbox import ImmutableSandboxedEnvironment
from jinja2.visitor import NodeTransformer

from phyblock.errors import Problem, PromptError, reason_of
from phyblock.files import read_text
from phyblock.models.request import Image, Message
from phyblock.parsing.structured import AnswerForm
from phyblock.resources import bundled
from phyblock.stable import hex_digest
from phyblock.text import did_you_mean

_LARGEST_BYTES = 256 * 1024
_MOST_FILES = 32
_TEMPLATES = "a file that ends in .j2, of which no part begins with a dot"
_Naming = nodes.Extends | nodes.Include | nodes.Import | nodes.FromImport
_NAMING = (nodes.Extends, nodes.Include, nodes.Import, nodes.FromImport)


@dataclass(frozen=True)
class Source:
    """A file, its text, what Jinja reads in it, and the statements that name other files."""

    path: Path
    text: str
    tree: nodes.Template
    naming: tuple[_Naming, ...]


@dataclass(frozen=True)
class Sources:
    """A template's own file, and by name those that it includes or imports, at any depth."""

    main: Source
    included: Mapping[str, Source]

    @property
    def version(self) -> str:
        """Hex digest of the text, with those of what is included."""
        digest = hashlib.sha256(self.main.text.encode())
        for name, source in sorted(self.included.items()):
            inner = hex_digest(source.text)
            digest.update(f"\0{name}\0{inner}".encode())
        return digest.hexdigest()

    @property
    def circle(self) -> str:
        """Files that include one another in a circle, as `a.j2 -> b.j2 -> a.j2`; "" for none."""
        includes = {
            name: [inner for node in source.naming for inner in _names(node.template, name)]
            for name, source in self.included.items()
        }
        try:
            graphlib.TopologicalSorter(includes).prepare()
        except graphlib.CycleError as error:
            return " -> ".join(reversed(error.args[1]))
        return ""

    @property
    def all(self) -> tuple[Source, ...]:
        """Every file, its own first."""
        return (self.main, *self.included.values())


def read_sources(path: Path, folders: Sequence[Path]) -> Sources:
    """Read a template and what it includes, which is looked for in `folders` in turn.

    Raises PromptError, naming file and line, for what cannot be read, is no template, lies outside
    of its folder, or is not named in so many words.
    """
    main = _read(path)
    included: dict[str, Source] = {}
    todo = [main]
    while todo:
        source = todo.pop()
        for name, file in _named_in(source, folders):
            if name not in included:
                if len(included) == _MOST_FILES:
                    message = f"includes more than {_MOST_FILES} files"
                    raise PromptError(Problem(str(path), message, "", name))
                included[name] = _read(file)
                todo.append(included[name])
    return Sources(main, included)


def _read(path: Path) -> Source:
    try:
        text = read_text(path, _LARGEST_BYTES)
    except OSError as error:
        raise PromptError(Problem(str(path), f"cannot be read: {reason_of(error)}")) from error
    except ValueError as error:
        raise PromptError(Problem(str(path), f"cannot be read: it {error}")) from error
    try:
        tree = jinja2.Environment().parse(text)
        return Source(path, text, tree, tuple(tree.find_all(_NAMING)))
    except jinja2.TemplateSyntaxError as error:
        where = f"{path}:{error.lineno}"
        raise PromptError(Problem(where, f"is not valid Jinja: {error.message}")) from error
    except Exception as error:
        # Python has bounds of its own on how deep a text may be nested.
        raise PromptError(Problem(str(path), f"is not valid Jinja: {reason_of(error)}")) from error


def _named_in(source: Source, folders: Sequence[Path]) -> Iterator[tuple[str, Path]]:
    """What a file includes or imports, by the names it uses."""
    for node in source.naming:
        where = f"{source.path}:{node.lineno}"
        if isinstance(node, nodes.Extends):
            hint = "take up its parts with {% include %} or {% import %}"
            raise PromptError(Problem(where, "a prompt cannot extend another", hint=hint))
        names = _names(node.template, where)
        named = [(name, path) for name in names if (path := _find(name, folders, where))]
        if not named and not getattr(node, "ignore_missing", False):
            allowed = f"a file in {' or '.join(map(str, folders))}"
            raise PromptError(Problem(where, "no such file", "", ", ".join(names), allowed))
        yield from named


def _names(node: nodes.Expr, where: str) -> list[str]:
    """The names of files in a statement, of which any may be meant."""
    parts = node.items if isinstance(node, (nodes.List, nodes.Tuple)) else [node]
    names = [part.value for part in parts if isinstance(part, nodes.Const)]
    texts = [name for name in names if isinstance(name, str) and name]
    if len(texts) != len(parts) or not texts:
        message = "includes a file that is not named in quotes: what is sent would not be known"
        raise PromptError(Problem(where, message))
    return texts


def _find(name: str, folders: Sequence[Path], where: str) -> Path | None:
    """The first file of a name in the folders."""
    inside = PurePosixPath(name)
    if inside.is_absolute() or ".." in inside.parts or "\\" in name:
        allowed = "a file beside the template, or below it"
        raise PromptError(Problem(where, "includes a file of another folder", "", name, allowed))
    for folder in folders:
        path = folder / inside
        if not os.path.isfile(path):
            continue
        if not _is_template(inside):
            message = "includes what is no template"
            raise PromptError(Problem(where, message, "", name, _TEMPLATES))
        real, real_folder = Path(os.path.realpath(path)), Path(os.path.realpath(folder))
        if not real.is_relative_to(real_folder):
            message = f"includes {name}, a link that leads out of its folder"
            raise PromptError(Problem(where, message, "", str(real), str(folder)))
        if not _is_template(real.relative_to(real_folder)):
            message = f"includes {name}, a link to what is no template"
            raise PromptError(Problem(where, message, "", str(real), _TEMPLATES))
        return path
    return None


def _is_template(inside: PurePath) -> bool:
    """Whether a file may be sent: beside templates lie others, which may hold keys."""
    return inside.suffix == ".j2" and not any(part.startswith(".") for part in inside.parts)


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


FORM_FACTS = ("answer_schema", "answer_example")
"""The names by which templates say the JSON that is asked for."""

_BLOCKS = ("system", "user")
_COMMON_BLOCKS = (*_BLOCKS, "caption")
_ALL_BLOCKS = (*_COMMON_BLOCKS, "answer", "turn", "check")
"""Blocks that bundled templates have; another would say its text to nobody."""


def form_facts(form: AnswerForm[Any] | None) -> dict[str, object]:
    """What templates may use of the form of the answer; None is a form of their own, in text."""
    if form is None:
        return {"answer_format": "text", **dict.fromkeys(FORM_FACTS)}
    facts = (json.dumps(form.schema), form.example)
    return {"answer_format": "json_schema", **dict(zip(FORM_FACTS, facts, strict=True))}


def response_format(form: AnswerForm[Any] | None) -> Mapping[str, object] | None:
    """What a request says of the form of the answer; nothing for text."""
    return None if form is None else form.response_format


class Prompt(Protocol):
    """Turns pictures and facts about a sample into chat messages."""

    @property
    def name(self) -> str:
        """What records call it."""

    @property
    def version(self) -> str:
        """Hex digest of the text it is made from."""

    def messages(
        self, pictures: Sequence[Image], facts: Mapping[str, object]
    ) -> tuple[Message, ...]:
        """The messages to send; pictures stand before the text, in the order given."""


class _Known(jinja2.BaseLoader):
    """Gives the files that were read, and no others."""

    def __init__(self, sources: Sources) -> None:
        self._sources = sources

    def get_source(
        self, environment: jinja2.Environment, template: str
    ) -> tuple[str, str | None, Callable[[], bool] | None]:
        """The text and path of a file; TemplateNotFound for one that is not there."""
        del environment
        if template not in self._sources.included:
            raise jinja2.TemplateNotFound(template)
        source = self._sources.included[template]
        return source.text, str(source.path), None


@dataclass(frozen=True)
class OfficialPrompt:
    """The official prompt, read out of the user's own checkout; it has no system part."""

    text: str
    name: str = "official"

    @property
    def version(self) -> str:
        """Hex digest of the text."""
        return hex_digest(self.text)

    def messages(
        self, pictures: Sequence[Image], facts: Mapping[str, object]
    ) -> tuple[Message, ...]:
        """One user message; `facts` are not used, the text is fixed."""
        del facts
        return (Message("user", (*pictures, self.text)),)


class TemplatePrompt:
    """A Jinja template with a block `user` and, if wanted, blocks `system` and `caption`.

    What stands outside of the blocks is not sent, but they can use macros, values and imports in
    it. Files beside the template, and bundled ones, can be included and imported.

    `caption` is rendered for each picture, with its `label` and its `number` from 1, and stands
    before it.

    Raises PromptError, naming file and line, when the template cannot be read, is not valid,
    has no user block or one that says nothing, has a block that nothing uses, or uses a name that
    is not there.
    """

    def __init__(self, path: Path, name: str, like: TemplatePrompt | None = None) -> None:
        """`like` is the template in whose place it stands: it may have the blocks of that one."""
        self.name = name
        self._path = path
        self._sources = read_sources(path, (path.parent, bundled("prompts")))
        self.version = self._sources.version
        self._environment = BoundedEnvironment(_Known(self._sources))
        try:
            self._template = self._environment.bounded_template(self._sources.main.text)
            self._head = self._environment.head(self._sources.main.text)
        except Exception as error:
            # Python compiles what Jinja makes of it, and has bounds of its own.
            raise PromptError(
                Problem(str(path), f"is not valid Jinja: {reason_of(error)}")
            ) from error
        self.require("user", "and, if wanted, a block system")
        self._check_blocks(_ALL_BLOCKS if like is None else (*_COMMON_BLOCKS, *like.blocks))

    @property
    def blocks(self) -> tuple[str, ...]:
        """The names of its blocks."""
        return tuple(self._template.blocks)

    @property
    def included(self) -> tuple[Path, ...]:
        """Files that it includes or imports."""
        return tuple(source.path for source in self._sources.included.values())

    @property
    def unsent_line(self) -> int | None:
        """The first line with text that stands outside of blocks, and so is sent to nobody."""
        for node in self._sources.main.tree.body:
            parts = node.nodes if isinstance(node, jinja2.nodes.Output) else []
            for part in parts:
                if isinstance(part, jinja2.nodes.TemplateData) and part.data.strip():
                    before = len(part.data) - len(part.data.lstrip())
                    return part.lineno + part.data[:before].count("\n")
        return None

    @property
    def says_form(self) -> bool:
        """Whether it uses a name that tells the JSON that is asked for."""
        find = jinja2.meta.find_undeclared_variables
        return any(not find(one.tree).isdisjoint(FORM_FACTS) for one in self._sources.all)

    def require(self, block: str, more: str) -> None:
        """Raise PromptError where the template lacks a block; `more` is told of what is allowed."""
        if block not in self._template.blocks:
            found = ", ".join(sorted(self._template.blocks)) or "no block"
            allowed = f"{{% block {block} %}} ... {{% endblock %}} {more}"
            problem = Problem(str(self._path), f"has no {block} block", "", found, allowed)
            raise PromptError(problem)

    def _check_blocks(self, used: Iterable[str]) -> None:
        """Raise PromptError for a block that no other is around and that nothing would say."""
        known = tuple(dict.fromkeys(used))
        for node in self._sources.main.tree.body:
            if isinstance(node, jinja2.nodes.Block) and node.name not in known:
                where, hint = f"{self._path}:{node.lineno}", did_you_mean(node.name, known)
                allowed, message = ", ".join(known), "is a block that nothing uses"
                raise PromptError(Problem(where, message, "", node.name, allowed, hint))

    def messages(
        self, pictures: Sequence[Image], facts: Mapping[str, object]
    ) -> tuple[Message, ...]:
        """A system message, when that block gives text, and a user message with the pictures."""
        texts = {name: self.text(name, facts) for name in _BLOCKS}
        if not texts["user"]:
            raise PromptError(Problem(str(self._path), "says nothing", "block user"))
        system = (Message("system", (texts["system"],)),) if texts["system"] else ()
        return (*system, Message("user", (*self._captioned(pictures, facts), texts["user"])))

    def _captioned(
        self, pictures: Sequence[Image], facts: Mapping[str, object]
    ) -> Iterator[str | Image]:
        for number, picture in enumerate(pictures, 1):
            about = {**facts, "label": picture.label, "number": number}
            if caption := self.text("caption", about):
                yield caption
            yield picture

    def text(self, block: str, facts: Mapping[str, object]) -> str:
        """What a block of the template says, "" for one that it lacks; raises PromptError."""
        if block not in self._template.blocks:
            return ""
        try:
            return render_block(self._template, self._head, block, dict(facts)).strip()
        except Exception as error:
            # A template is a program: what it computes can fail in any way.
            is_name = isinstance(error, jinja2.UndefinedError)
            known = "names that are there: " + ", ".join(sorted(facts)) if is_name else ""
            circle = self._sources.circle if isinstance(error, RecursionError) else ""
            why = (
                f"files include one another without an end, {circle}"
                if circle
                else reason_of(error)
            )
            message, hint = f"cannot be rendered: {why}", ""
            if is_name and any(f"'{fact}' is undefined" in why for fact in facts):
                hint = "macros of another file see it by {% import ... with context %}"
            where, field = self._place_of(error), f"block {block}"
            raise PromptError(Problem(where, message, field, "", known, hint)) from error

    def _place_of(self, error: Exception) -> str:
        """The file and line at which rendering failed."""
        names = {str(one.path): name for name, one in self._sources.included.items()}
        frames = traceback.extract_tb(error.__traceback__)
        of_templates = [one for one in frames if one.filename in ("<template>", *names)]
        if not of_templates:
            return f"{self._path}:1"
        file, line = of_templates[-1].filename, of_templates[-1].lineno or 1
        if file in names:
            included = self._environment.get_template(names[file])
            return f"{file}:{included.get_corresponding_lineno(line)}"
        is_head = of_templates[-1].name == "root"
        compiled = self._head if is_head else self._template
        return f"{self._path}:{compiled.get_corresponding_lineno(line)}"
