"""Prompts: Jinja templates of the project or the user, and the exact official text."""

from __future__ import annotations

import hashlib
import json
import traceback
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import jinja2
import jinja2.meta
import jinja2.nodes

from phyblock.bounded import read_text
from phyblock.errors import Problem, PromptError, said
from phyblock.models.base import Image, Message
from phyblock.parsing import AnswerForm
from phyblock.specs import did_you_mean
from phyblock.tracks.template_bounds import BoundedEnvironment, render_block

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
_ALL_BLOCKS = (*_BLOCKS, "caption", "answer", "turn", "check")
"""Blocks that bundled templates have; another would say its text to nobody."""
_LARGEST_BYTES = 256 * 1024


def form_facts(form: AnswerForm[Any] | None) -> dict[str, object]:
    """What templates may use of the form of the answer; None is a form of their own, in text."""
    if form is None:
        return {"answer_format": "text", **dict.fromkeys(FORM_FACTS)}
    told = (json.dumps(form.schema), form.example)
    return {"answer_format": "json_schema", **dict(zip(FORM_FACTS, told, strict=True))}


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


@dataclass(frozen=True)
class OfficialPrompt:
    """The official prompt, read out of the user's own checkout; it has no system part."""

    text: str
    name: str = "official"

    @property
    def version(self) -> str:
        """Hex digest of the text."""
        return _digest(self.text)

    def messages(
        self, pictures: Sequence[Image], facts: Mapping[str, object]
    ) -> tuple[Message, ...]:
        """One user message; `facts` are not used, the text is fixed."""
        del facts
        return (Message("user", (*pictures, self.text)),)


class TemplatePrompt:
    """A Jinja template with a block `user` and, if wanted, blocks `system` and `caption`.

    `caption` is rendered for each picture, with its `label` and its `number` from 1, and stands
    before it.

    Raises PromptError, naming file and line, when the template cannot be read, is not valid,
    has no user block or one that says nothing, has a block that nothing uses, or uses a name that
    is not there.
    """

    def __init__(self, path: Path, name: str) -> None:
        self.name = name
        self._path = path
        try:
            source = read_text(path, _LARGEST_BYTES)
        except OSError as error:
            raise PromptError(Problem(str(path), f"cannot be read: {said(error)}")) from error
        except ValueError as error:
            raise PromptError(Problem(str(path), f"cannot be read: it {error}")) from error
        self.version = _digest(source)
        self._source = source
        try:
            self._template = BoundedEnvironment().bounded_template(source)
        except jinja2.TemplateSyntaxError as error:
            where = f"{path}:{error.lineno}"
            raise PromptError(Problem(where, f"is not valid Jinja: {error.message}")) from error
        except Exception as error:
            # Python compiles what Jinja makes of it, and has bounds of its own.
            raise PromptError(Problem(str(path), f"is not valid Jinja: {said(error)}")) from error
        self.require("user", "and, if wanted, a block system")
        self._check_blocks(source)

    @property
    def says_form(self) -> bool:
        """Whether it uses a name that tells the JSON that is asked for."""
        names = jinja2.meta.find_undeclared_variables(jinja2.Environment().parse(self._source))
        return not names.isdisjoint(FORM_FACTS)

    def require(self, block: str, more: str) -> None:
        """Raise PromptError where the template lacks a block; `more` is told of what is allowed."""
        if block not in self._template.blocks:
            found = ", ".join(sorted(self._template.blocks)) or "no block"
            allowed = f"{{% block {block} %}} ... {{% endblock %}} {more}"
            problem = Problem(str(self._path), f"has no {block} block", "", found, allowed)
            raise PromptError(problem)

    def _check_blocks(self, source: str) -> None:
        """Raise PromptError for a block that no other is around and that nothing would say."""
        for node in jinja2.Environment().parse(source).body:
            if isinstance(node, jinja2.nodes.Block) and node.name not in _ALL_BLOCKS:
                where, hint = f"{self._path}:{node.lineno}", did_you_mean(node.name, _ALL_BLOCKS)
                allowed, message = ", ".join(_ALL_BLOCKS), "is a block that nothing uses"
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
            return render_block(self._template, block, dict(facts)).strip()
        except Exception as error:
            # A template is a program: what it computes can fail in any way.
            is_name = isinstance(error, jinja2.UndefinedError)
            known = "names that are there: " + ", ".join(sorted(facts)) if is_name else ""
            message = f"cannot be rendered: {said(error)}"
            where = f"{self._path}:{self._line_of(error)}"
            raise PromptError(Problem(where, message, f"block {block}", "", known)) from error

    def _line_of(self, error: Exception) -> int:
        """The template's line at which rendering failed."""
        frames = traceback.extract_tb(error.__traceback__)
        compiled = [frame.lineno or 1 for frame in frames if frame.filename == "<template>"]
        return self._template.get_corresponding_lineno(compiled[-1]) if compiled else 1


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
