"""The files that a template is made of: its own, and those that it includes or imports.

They are read once, before anything is rendered, so that the digest of a prompt is that of what is
sent: an edit of a file that is included makes another prompt.
"""

from __future__ import annotations

import graphlib
import hashlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath, PurePosixPath

import jinja2
from jinja2 import nodes

from phyblock.errors import Problem, PromptError, reason_of
from phyblock.files import read_text
from phyblock.stable import hex_digest

__all__ = ["Source", "Sources", "read_sources"]

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
