"""Prompts: Jinja templates with the files that they include, and the official prompt.

Files are read once, before anything is rendered, so that the digest of a prompt covers everything
that is sent: an edit of an included file makes another prompt.
"""

from __future__ import annotations

import hashlib
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import jinja2
import jinja2.meta
from jinja2 import nodes
from jinja2.sandbox import ImmutableSandboxedEnvironment

from phyblock.errors import Problem, PromptError, reason_of
from phyblock.files import bundled, read_text
from phyblock.models.request import Image, Message
from phyblock.text import did_you_mean, hex_digest

_LARGEST_BYTES = 256 * 1024
_COMMON_BLOCKS = ("system", "user", "caption")
_ALL_BLOCKS = (*_COMMON_BLOCKS, "answer")
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

    Text outside of the blocks is not sent, but they can use its macros, values and imports. Files
    beside the template, and bundled ones, can be included and imported. It runs in Jinja's
    sandbox. `caption` is rendered before each picture, with its `label` and its `number` from 1.
    `included` are the files that it includes or imports.

    Raises PromptError, naming file and line, when the template cannot be read, is not valid, has no
    user block or an empty one, has a block that is not used, or uses an unknown name.
    """

    def __init__(self, path: Path, name: str, like: TemplatePrompt | None = None) -> None:
        """`like` is the template that this one replaces, whose blocks it may have."""
        self.name = name
        self._path = path
        text, self._tree = _read(path)
        self._sources = sources = {"": (path, text)}
        self._read_included(path, self._tree)
        self.included = tuple(file for inner, (file, _) in self._sources.items() if inner)
        digest = hashlib.sha256(text.encode())
        for inner, (_, part) in sorted(self._sources.items())[1:]:
            digest.update(f"\0{inner}\0{hex_digest(part)}".encode())
        self.version = digest.hexdigest()
        self._environment = ImmutableSandboxedEnvironment(
            loader=jinja2.FunctionLoader(
                lambda one: (source := sources.get(one)) and (source[1], str(source[0]), None)
            ),
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        # It draws random words, but a prompt must always be the same.
        del self._environment.globals["lipsum"]
        try:
            self._template = self._environment.get_template("")
        except Exception as error:
            # Python compiles Jinja's output, and has its own limits.
            raise PromptError(_invalid(path, error)) from error
        self.blocks = tuple(self._template.blocks)
        if "user" not in self.blocks:
            found = ", ".join(sorted(self.blocks)) or "no block"
            allowed = "{% block user %} ... {% endblock %} and, if wanted, a block system"
            raise PromptError(Problem(str(path), "has no user block", "", found, allowed))
        known = _ALL_BLOCKS if like is None else tuple({*_COMMON_BLOCKS, *like.blocks})
        for node in self._tree.body:
            if isinstance(node, nodes.Block) and node.name not in known:
                where, hint = f"{path}:{node.lineno}", did_you_mean(node.name, known)
                allowed, message = ", ".join(sorted(known)), "is a block that nothing uses"
                raise PromptError(Problem(where, message, "", node.name, allowed, hint))

    @property
    def unsent_line(self) -> int | None:
        """The first line with text outside of all blocks, which is never sent."""
        for node in self._tree.body:
            for part in node.nodes if isinstance(node, nodes.Output) else ():
                if isinstance(part, nodes.TemplateData) and part.data.strip():
                    before = part.data[: len(part.data) - len(part.data.lstrip())]
                    return part.lineno + before.count("\n")
        return None

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
        if block not in self.blocks:
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
            files = {str(path) for path, _ in self._sources.values()}
            frames = traceback.extract_tb(error.__traceback__)
            places = [f"{one.filename}:{one.lineno}" for one in frames if one.filename in files]
            where = [f"{self._path}:1", *places][-1]
            message = f"cannot be rendered: {reason_of(error)}"
            raise PromptError(Problem(where, message, f"block {block}", "", known)) from error

    def _read_included(self, path: Path, tree: nodes.Template) -> None:
        """Read what a template includes or imports, at any depth, by the names it uses.

        Other files beside templates may hold keys: only files that end in .j2 may be sent, and
        their names must be known from the text.
        """
        for node in tree.find_all((nodes.Extends, nodes.Include, nodes.Import, nodes.FromImport)):
            where = f"{path}:{node.lineno}"
            names = list(jinja2.meta.find_referenced_templates(nodes.Template([node])))
            if isinstance(node, nodes.Extends) or not names or not all(names):
                message = "a prompt names the files that it includes in quotes, and extends none"
                raise PromptError(Problem(where, message))
            folders = (self._path.parent, bundled("prompts"))
            found = {name: _included(name, folders, where) for name in filter(None, names)}
            there = {name: file for name, file in found.items() if file is not None}
            if not there and not getattr(node, "ignore_missing", False):
                allowed = f"a file in {' or '.join(map(str, folders))}"
                raise PromptError(Problem(where, "no such file", "", ", ".join(found), allowed))
            for name, file in there.items():
                if name not in self._sources:
                    text, inner = _read(file)
                    self._sources[name] = (file, text)
                    self._read_included(file, inner)


Prompt = OfficialPrompt | TemplatePrompt
"""A prompt, which turns pictures and facts about a sample into chat messages."""


def _included(name: str, folders: Sequence[Path], where: str) -> Path | None:
    """Return the file of a name in the first folder that has it. Raises PromptError if it is not a
    template.
    """
    inside = PurePosixPath(name)
    path = next((folder / inside for folder in folders if (folder / inside).is_file()), None)
    parts = inside.parts if path is None else (*inside.parts, path.resolve().name)
    is_open = not (inside.is_absolute() or "\\" in name or any(p[0] == "." for p in parts))
    if not is_open or (path is not None and not parts[-1].endswith(".j2")):
        allowed = "a file that ends in .j2, beside the template or below it, no part of whose path "
        allowed += "begins with a dot"
        raise PromptError(Problem(where, "includes what is not a template", "", name, allowed))
    return path


def _read(path: Path) -> tuple[str, nodes.Template]:
    try:
        text = read_text(path, _LARGEST_BYTES)
    except (OSError, ValueError) as error:
        why = reason_of(error) if isinstance(error, OSError) else f"it {error}"
        raise PromptError(Problem(str(path), f"cannot be read: {why}")) from error
    try:
        tree = jinja2.Environment().parse(text)
        # A text may be nested so deeply that its tree can be parsed but not walked.
        list(tree.find_all(nodes.Include))
    except Exception as error:
        raise PromptError(_invalid(path, error)) from error
    return text, tree


def _invalid(path: Path, error: Exception) -> Problem:
    line = getattr(error, "lineno", None)
    where = str(path) if line is None else f"{path}:{line}"
    return Problem(where, f"is not valid Jinja: {reason_of(error)}")
