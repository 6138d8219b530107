"""The names that the readers give away: written three times, once for each who reads them."""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import phyblock.parsing as parsing


def test_types_homes_and_the_public_names_say_the_same() -> None:
    """A type checker reads the imports, an import of all the list, the interpreter the homes."""
    imported = {
        name.name: str(node.module)
        for node in ast.walk(ast.parse(Path(parsing.__file__).read_text("utf-8")))
        if isinstance(node, ast.ImportFrom) and str(node.module).startswith("phyblock.parsing.")
        for name in node.names
    }
    assert imported == parsing._HOMES
    assert sorted(parsing.__all__) == sorted(imported)
    for name, home in imported.items():
        module = importlib.import_module(home)
        assert getattr(parsing, name) is getattr(module, name)
        assert vars(parsing)[name] is getattr(module, name), "it is looked up once"
