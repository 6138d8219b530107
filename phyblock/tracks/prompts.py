"""Prompts: Jinja templates with the files that they include, and the official prompt.

Files are read once, before anything is rendered, so that the digest of a prompt is that of what is
sent: an edit of an included file makes another prompt.
"""

from __future__ import annotations

import hashlib
import json
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import jinja2
import jinja2.meta
from jinja2 import nodes
from jinja2.sandbox import ImmutableSandboxedEnvironment

from phyblock.errors import Problem, PromptError, reason_of
from phyblock.files import read_text
from phyblock.models.request import Image, Message
from phyblock.parsing.structured import AnswerForm
from phyblock.resources import bundled
from phyblock.stable import hex_digest
from phyblock.text import did_you_mean

FORM_FACTS = ("answer_schema", "answer_example")
"""The names by which templates say the JSON that is asked for."""

_LARGEST_BYTES = 256 * 1024
_COMMON_BLOCKS = ("system", "user", "caption")
_ALL_BLOCKS = (*_COMMON_BLOCKS, "answer", "turn", "check")
"""Blocks that bundled templates have; nothing would send another."""
_HEAD = (nodes.Assign, nodes.AssignBlock, nodes.FromImport, nodes.Import, nodes.Macro)
"""Statements outside of blocks that the blocks can use."""
_NAMING = (nodes.Extends, nodes.Include, nodes.Import, nodes.FromImport)


def form_facts(form: AnswerForm[Any] | None) -> dict[str, object]:
    """Return what templates may use of the form of the answer; None is text."""
    if form is None:
        return {"answer_format": "text", **dict.fromkeys(FORM_FACTS)}
    facts = (json.dumps(form.schema), form.example)
    return {"answer_format": "json_schema", **dict(zip(FORM_FACTS, facts, strict=True))}


@dataclass(frozen=True)
class OfficialPrompt:
    """The official prompt, read out of the user's own checkout; it has no system part."""

    text: str
    name: str = "official"

    @property
    def version(self) -> str:
        """Hex digest of the text."""
        return hex_digest(self.text)

    def messages(self, pictures: Sequence[Image], _facts: object) -> tuple[Message, ...]:
        """Return one user message; the text is fixed."""
        return (Message("user", (*pictures, self.text)),)


class _Source(NamedTuple):
    path: Path
    text: str
    tree: nodes.Template


class TemplatePrompt:
    """A Jinja template with a block `user` and, if wanted, blocks `system` and `caption`.

    Text outside of the blocks is not sent, but they can use its macros, values and imports. Files
    beside the template, and bundled ones, can be included and imported. It runs in Jinja's
    sandbox. `caption` is rendered for each picture, with its `label` and its `number` from 1, and
    stands before it.

    Raises PromptError, naming file and line, when the template cannot be read, is not valid,
    has no user block or one that says nothing, has a block that nothing uses, or uses a name that
    is not there.
    """

    def __init__(self, path: Path, name: str, like: TemplatePrompt | None = None) -> None:
        """`like` is the template in whose place it stands: it may have the blocks of that one."""
        self.name = name
        self._path = path
        main = _read(path)
        self._sources = {"": main}
        self._read_included((path.parent, bundled("prompts")))
        digest = hashlib.sha256(main.text.encode())
        for inner, source in sorted(self._sources.items())[1:]:
            digest.update(f"\0{inner}\0{hex_digest(source.text)}".encode())
        self.version = digest.hexdigest()
        self._environment = ImmutableSandboxedEnvironment(
            loader=jinja2.FunctionLoader(self._load),
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        # It draws words at random: a prompt is the same whenever it is made.
        del self._environment.globals["lipsum"]
        try:
            self._template = self._compiled(head_alone=False)
            self._head = self._compiled(head_alone=True)
        except Exception as error:
            # Python compiles what Jinja makes of it, and has bounds of its own.
            message = f"is not valid Jinja: {reason_of(error)}"
            raise PromptError(Problem(str(path), message)) from error
        self.require("user", "and, if wanted, a block system")
        known = _ALL_BLOCKS if like is None else tuple({*_COMMON_BLOCKS, *like.blocks})
        for node in main.tree.body:
            if isinstance(node, nodes.Block) and node.name not in known:
                where, hint = f"{path}:{node.lineno}", did_you_mean(node.name, known)
                allowed, message = ", ".join(sorted(known)), "is a block that nothing uses"
                raise PromptError(Problem(where, message, "", node.name, allowed, hint))

    @property
    def blocks(self) -> tuple[str, ...]:
        """The names of its blocks."""
        return tuple(self._template.blocks)

    @property
    def included(self) -> tuple[Path, ...]:
        """Files that it includes or imports."""
        return tuple(source.path for name, source in self._sources.items() if name)

    @property
    def unsent_line(self) -> int | None:
        """The first line with text that stands outside of blocks, and so is sent to nobody."""
        for node in self._sources[""].tree.body:
            for part in node.nodes if isinstance(node, nodes.Output) else ():
                if isinstance(part, nodes.TemplateData) and part.data.strip():
                    before = part.data[: len(part.data) - len(part.data.lstrip())]
                    return part.lineno + before.count("\n")
        return None

    def require(self, block: str, more: str) -> None:
        """Raise PromptError where the template lacks a block; `more` is told of what is allowed."""
        if block not in self._template.blocks:
            found = ", ".join(sorted(self._template.blocks)) or "no block"
            allowed = f"{{% block {block} %}} ... {{% endblock %}} {more}"
            problem = Problem(str(self._path), f"has no {block} block", "", found, allowed)
            raise PromptError(problem)

    def messages(
        self, pictures: Sequence[Image], facts: Mapping[str, object]
    ) -> tuple[Message, ...]:
        """Return a system message, where that block gives text, and one of the user."""
        system, user = self.text("system", facts), self.text("user", facts)
        if not user:
            raise PromptError(Problem(str(self._path), "says nothing", "block user"))
        parts: list[str | Image] = []
        for number, picture in enumerate(pictures, 1):
            about = {**facts, "label": picture.label, "number": number}
            parts += [caption] if (caption := self.text("caption", about)) else []
            parts.append(picture)
        first = (Message("system", (system,)),) if system else ()
        return (*first, Message("user", (*parts, user)))

    def text(self, block: str, facts: Mapping[str, object]) -> str:
        """Render a block of the template, "" for one that it lacks; raises PromptError."""
        if block not in self._template.blocks:
            return ""
        try:
            try:
                return self._render(block, dict(facts)).strip()
            except Exception:
                # Jinja puts the lines of templates in the place of those that it compiled.
                self._environment.handle_exception()
        except Exception as error:
            # A template is a program: what it computes can fail in any way.
            why, known, hint = reason_of(error), "", ""
            if isinstance(error, jinja2.UndefinedError):
                known = "names that are there: " + ", ".join(sorted(facts))
                if any(f"'{fact}' is undefined" in why for fact in facts):
                    hint = "macros of another file see it by {% import ... with context %}"
            files = {str(source.path) for source in self._sources.values()}
            frames = traceback.extract_tb(error.__traceback__)
            places = [f"{one.filename}:{one.lineno}" for one in frames if one.filename in files]
            where, message = [f"{self._path}:1", *places][-1], f"cannot be rendered: {why}"
            problem = Problem(where, message, f"block {block}", "", known, hint)
            raise PromptError(problem) from error

    def _read_included(self, folders: Sequence[Path]) -> None:
        """Read what the template includes or imports, at any depth, by the names it uses."""
        todo = [self._sources[""]]
        while todo:
            source = todo.pop()
            for node in source.tree.find_all(_NAMING):
                for name, path in _named(node, folders, f"{source.path}:{node.lineno}"):
                    if name not in self._sources:
                        self._sources[name] = _read(path)
                        todo.append(self._sources[name])

    def _load(self, name: str) -> tuple[str, str, None] | None:
        source = self._sources.get(name)
        return None if source is None else (source.text, str(source.path), None)

    def _compiled(self, *, head_alone: bool) -> jinja2.Template:
        tree = self._environment.parse(self._sources[""].text)
        if head_alone:
            tree.body = [node for node in tree.body if isinstance(node, _HEAD)]
        code = self._environment.compile(tree, filename=str(self._path))
        known = self._environment.make_globals(None)
        return jinja2.Template.from_code(self._environment, code, known)

    def _render(self, block: str, facts: dict[str, object]) -> str:
        above = self._head.new_context(facts)
        for _ in self._head.root_render_func(above):
            pass
        if taken := sorted(above.vars.keys() & facts.keys()):
            raise ValueError(f"{taken[0]}, set outside of the blocks, is a fact of what is asked")
        context = self._template.new_context({**facts, **above.vars})
        return "".join(self._template.blocks[block](context))


Prompt = OfficialPrompt | TemplatePrompt
"""What turns pictures and facts about a sample into chat messages."""


def _read(path: Path) -> _Source:
    try:
        text = read_text(path, _LARGEST_BYTES)
    except (OSError, ValueError) as error:
        why = reason_of(error) if isinstance(error, OSError) else f"it {error}"
        raise PromptError(Problem(str(path), f"cannot be read: {why}")) from error
    try:
        tree = jinja2.Environment().parse(text)
        # A text may be nested so deep that its tree is parsed and cannot be walked.
        list(tree.find_all(_NAMING))
    except Exception as error:
        line = getattr(error, "lineno", None)
        where = str(path) if line is None else f"{path}:{line}"
        raise PromptError(Problem(where, f"is not valid Jinja: {reason_of(error)}")) from error
    return _Source(path, text, tree)


def _named(node: Any, folders: Sequence[Path], where: str) -> list[tuple[str, Path]]:
    """Return the files that a statement names; PromptError where there is none.

    Beside templates lie other files, which may hold keys: only files that end in .j2 may be sent.
    """
    if isinstance(node, nodes.Extends):
        hint = "use {% include %} or {% import %}"
        raise PromptError(Problem(where, "a prompt cannot extend another", hint=hint))
    names = list(jinja2.meta.find_referenced_templates(nodes.Template([node])))
    if not names or not all(names):
        message = "includes a file that is not named in quotes: what is sent would not be known"
        raise PromptError(Problem(where, message))
    found = []
    for name in filter(None, names):
        inside = PurePosixPath(name)
        path = next((folder / inside for folder in folders if (folder / inside).is_file()), None)
        parts = inside.parts if path is None else (*inside.parts, path.resolve().name)
        is_open = not (inside.is_absolute() or "\\" in name or any(p[0] == "." for p in parts))
        if not is_open or (path is not None and not parts[-1].endswith(".j2")):
            allowed = "a file that ends in .j2, beside the template or below it, no part of whose "
            allowed += "path begins with a dot"
            raise PromptError(Problem(where, "includes what is no template", "", name, allowed))
        if path is not None:
            found.append((name, path))
    if not found and not getattr(node, "ignore_missing", False):
        allowed, missing = f"a file in {' or '.join(map(str, folders))}", ", ".join(map(str, names))
        raise PromptError(Problem(where, "no such file", "", missing, allowed))
    return found
