"""Prompts: Jinja templates with the files that they include, and the official prompt.

Files are read once, before anything is rendered, so that the digest of a prompt covers everything
that is sent: an edit of an included file makes another prompt.
"""

from __future__ import annotations

import hashlib
import re
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
import jinja2.meta
from jinja2 import nodes
from jinja2.sandbox import ImmutableSandboxedEnvironment

from phyblock.errors import Problem, PromptError, reason_of
from phyblock.files import bundled, read_text
from phyblock.models.request import Image, Message
from phyblock.text import did_you_mean, hex_digest

_LARGEST_BYTES = 256 * 1024
_BLOCKS = ("system", "user", "caption", "answer")
"""Blocks that templates may have; no other would be sent."""
_TEMPLATE = re.compile(r"(?:[^./\\][^/\\]*/)*[^./\\][^/\\]*\.j2")
_NAMING = (nodes.Extends, nodes.Include, nodes.Import, nodes.FromImport)
_names = jinja2.meta.find_referenced_templates


@dataclass(frozen=True)
class OfficialPrompt:
    """The official prompt, read from the user's own checkout; it has no system part."""

    text: str
    name: str = "official"

    @property
    def version(self) -> str:
        """Hex digest of the text."""
        return hex_digest(self.text)

    def messages(self, pictures: Sequence[Image], _facts: object) -> tuple[Message, ...]:
        """Return one user message; the text is fixed."""
        return (Message("user", (*pictures, self.text)),)


class TemplatePrompt:
    """A Jinja template with a block `user` and, if wanted, blocks `system` and `caption`.

    Blocks can use macros, values and imports outside of them. Templates beside it, and bundled
    ones, can be included and imported. It runs in Jinja's sandbox. `caption` is rendered before
    each picture, with its `label` and its `number` from 1; `answer` is the form of the answer.

    Raises PromptError, naming file and line, when the template cannot be read, is not valid, has no
    user block or an empty one, has text or a block that is not sent, or uses an unknown name.
    """

    def __init__(self, path: Path, name: str) -> None:
        self.name = name
        self._path = path
        self._files: dict[str, tuple[Path, str]] = {}
        self._environment = ImmutableSandboxedEnvironment(
            loader=jinja2.FunctionLoader(self._source),
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        # It draws random words, but a prompt must always be the same.
        del self._environment.globals["lipsum"]
        tree = self._read("", path)
        digest = hashlib.sha256(self._files[""][1].encode())
        for inner, (_, part) in sorted(self._files.items())[1:]:
            digest.update(f"\0{inner}\0{hex_digest(part)}".encode())
        self.version = digest.hexdigest()
        self._template = self._environment.get_template("")
        if "user" not in self._template.blocks:
            found = ", ".join(sorted(self._template.blocks)) or "no block"
            allowed = "{% block user %} ... {% endblock %} and, if wanted, a block system"
            raise PromptError(Problem(str(path), "has no user block", "", found, allowed))
        allowed = ", ".join(_BLOCKS)
        for node in tree.body:
            where = f"{path}:{node.lineno}"
            if isinstance(node, nodes.Block) and node.name not in _BLOCKS:
                hint, message = did_you_mean(node.name, _BLOCKS), "is a block that nothing uses"
                raise PromptError(Problem(where, message, "", node.name, allowed, hint))
            data = node.find_all(nodes.TemplateData) if isinstance(node, nodes.Output) else ()
            if lost := "".join(part.data for part in data).strip():
                message, hint = "is outside of the blocks that are sent", "write {# a note #}"
                raise PromptError(Problem(where, message, "", lost, allowed, hint))

    def messages(
        self, pictures: Sequence[Image], facts: Mapping[str, object]
    ) -> tuple[Message, ...]:
        """Return a system message, if that block gives text, and a user message."""
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
        """Render a block of the template, "" if it has no such block. Raises PromptError."""
        if block not in self._template.blocks:
            return ""
        try:
            try:
                context = self._template.new_context(dict(facts))
                blocks = context.blocks
                # Text outside of the blocks is run first, with the blocks empty.
                context.blocks = {name: [lambda _: iter(())] for name in blocks}
                for _ in self._template.root_render_func(context):
                    pass
                context.blocks = blocks
                return "".join(self._template.blocks[block](context)).strip()
            except Exception:
                # Jinja rewrites tracebacks to the lines of templates.
                self._environment.handle_exception()
        except Exception as error:
            # A template is a program, which can fail in any way.
            is_unknown = isinstance(error, jinja2.UndefinedError)
            known = f"names that are there: {', '.join(sorted(facts))}" if is_unknown else ""
            files = {str(path) for path, _ in self._files.values()}
            frames = traceback.extract_tb(error.__traceback__)
            places = [f"{one.filename}:{one.lineno}" for one in frames if one.filename in files]
            where = [f"{self._path}:1", *places][-1]
            message = f"cannot be rendered: {reason_of(error)}"
            raise PromptError(Problem(where, message, f"block {block}", "", known)) from error

    def _source(self, name: str) -> tuple[str, str, None] | None:
        """Return the text of a template that was read, and its file, as Jinja's loaders do."""
        path, text = self._files.get(name, (None, ""))
        return None if path is None else (text, str(path), None)

    def _read(self, name: str, path: Path) -> nodes.Template:
        """Read a template, and what it includes or imports, at any depth."""
        try:
            text = read_text(path, _LARGEST_BYTES)
        except (OSError, ValueError) as error:
            why = reason_of(error) if isinstance(error, OSError) else f"it {error}"
            raise PromptError(Problem(str(path), f"cannot be read: {why}")) from error
        self._files[name] = path, text
        try:
            tree = self._environment.parse(text)
            named = list(tree.find_all(_NAMING))
            self._environment.get_template(name)
        except Exception as error:
            # A text may be too deeply nested to be walked, and Python compiles Jinja's output.
            line = getattr(error, "lineno", None)
            where = str(path) if line is None else f"{path}:{line}"
            raise PromptError(Problem(where, f"is not valid Jinja: {reason_of(error)}")) from error
        folders = (self._path.parent, bundled("prompts"))
        for node in named:
            where, names = f"{path}:{node.lineno}", list(_names(nodes.Template([node])))
            if isinstance(node, nodes.Extends) or not names or not all(names):
                message = "a prompt names the files that it includes in quotes, and extends none"
                raise PromptError(Problem(where, message))
            found = {inner: _included(inner, folders) for inner in filter(None, names)}
            if not any(found.values()) and not getattr(node, "ignore_missing", False):
                allowed = f"a file that ends in .j2 in {' or '.join(map(str, folders))}, or below, "
                allowed += "no part of whose path begins with a dot"
                message, wanted = "includes what is not a template", ", ".join(found)
                raise PromptError(Problem(where, message, "", wanted, allowed))
            for inner, file in found.items():
                if file is not None and inner not in self._files:
                    self._read(inner, file)
        return tree


Prompt = OfficialPrompt | TemplatePrompt
"""A prompt, which turns pictures and facts about a sample into chat messages."""


def _included(name: str, folders: Sequence[Path]) -> Path | None:
    """Return the template of a name in the first folder that has it, or None.

    Other files may hold keys, which must not be sent: not even by a link.
    """
    paths = [folder / name for folder in folders] if _TEMPLATE.fullmatch(name) else []
    found = (one for one in paths if one.is_file() and _TEMPLATE.fullmatch(one.resolve().name))
    return next(found, None)
