"""Prompts: Jinja templates of the project or the user, and the exact official text."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import jinja2
import jinja2.meta
import jinja2.nodes

from phyblock.errors import Problem, PromptError, reason_of
from phyblock.models.base import Image, Message
from phyblock.parsing.structured import AnswerForm
from phyblock.resources import bundled
from phyblock.stable import hex_digest
from phyblock.text import did_you_mean
from phyblock.tracks.template_bounds import BoundedEnvironment, render_block
from phyblock.tracks.template_sources import Sources, read_sources

__all__ = [
    "FORM_FACTS",
    "OfficialPrompt",
    "Prompt",
    "TemplatePrompt",
    "form_facts",
    "response_format",
]

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
