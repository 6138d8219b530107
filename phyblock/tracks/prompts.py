"""Prompts: Jinja templates, and the official prompt."""

from __future__ import annotations

import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import jinja2
from jinja2 import nodes
from jinja2.sandbox import ImmutableSandboxedEnvironment

from phyblock.errors import Problem, PromptError, reason_of
from phyblock.files import read_text
from phyblock.models.request import Image, Message
from phyblock.text import did_you_mean, hex_digest

_LARGEST_BYTES = 256 * 1024
_BLOCKS = ("system", "user", "caption", "answer")
"""Blocks that templates may have; no other would be sent."""


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

    It is one file and runs in Jinja's sandbox, so that nothing else can be sent. Blocks can use
    macros and values outside of them. `caption` is rendered before each picture, with its `label`
    and its `number` from 1; `answer` is the form of the answer.

    Raises PromptError, naming file and line, when the template cannot be read, is not valid, has no
    user block or an empty one, has text or a block that is not sent, or uses an unknown name.
    """

    def __init__(self, path: Path, name: str) -> None:
        self.name = name
        self._path = path
        try:
            text = read_text(path, _LARGEST_BYTES)
        except (OSError, ValueError) as error:
            why = reason_of(error) if isinstance(error, OSError) else f"it {error}"
            raise PromptError(Problem(str(path), f"cannot be read: {why}")) from error
        self.version = hex_digest(text)
        self._environment = ImmutableSandboxedEnvironment(
            loader=jinja2.FunctionLoader(lambda _: (text, str(path), None)),
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        # It draws random words, but a prompt must always be the same.
        del self._environment.globals["lipsum"]
        try:
            tree = self._environment.parse(text)
            others = [
                *tree.find_all((nodes.Extends, nodes.Include, nodes.Import, nodes.FromImport))
            ]
            self._template = self._environment.get_template(name)
        except Exception as error:
            # A text may be too deeply nested to be walked, and Python compiles Jinja's output.
            line = getattr(error, "lineno", None)
            where = str(path) if line is None else f"{path}:{line}"
            raise PromptError(Problem(where, f"is not valid Jinja: {reason_of(error)}")) from error
        if others:
            message = "a prompt is one file: it includes, imports and extends none"
            raise PromptError(Problem(f"{path}:{others[0].lineno}", message))
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
            frames = traceback.extract_tb(error.__traceback__)
            own = str(self._path)
            places = [f"{own}:{one.lineno}" for one in frames if one.filename == own]
            where = [f"{self._path}:1", *places][-1]
            message = f"cannot be rendered: {reason_of(error)}"
            raise PromptError(Problem(where, message, f"block {block}", "", known)) from error


Prompt = OfficialPrompt | TemplatePrompt
"""A prompt, which turns pictures and facts about a sample into chat messages."""
