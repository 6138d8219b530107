"""What `mkdocs` adds to the pages: files of the repository beside docs/, and tables of YAML fields.

Pages link to files outside docs/ as they stand in the repository, so that links work there as well;
on the site those files lie in project/, and links are turned to them.
"""

from __future__ import annotations

import json
import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[1]

BESIDE = {
    "CHANGELOG.md": "project/CHANGELOG.md",
    "CITATION.cff": "project/CITATION.cff",
    "CONTRIBUTING.md": "project/CONTRIBUTING.md",
    "SECURITY.md": "project/SECURITY.md",
    "benchmarks/data/phyblock-400/README.md": "project/phyblock-400.md",
    **{
        f"benchmarks/schemas/{path.name}": f"project/schemas/{path.name}"
        for path in (ROOT / "benchmarks" / "schemas").glob("*.json")
    },
}
"""Where on the site the files of the repository lie that pages link to."""

INSTEAD = {"README.md": "index.md", "benchmarks/schemas": "reference/suites.md"}
"""Pages that stand for something of the repository."""

FIELDS = {"reference/suites.md": "suite", "reference/models.md": "models"}
"""Pages whose line `{{ fields }}` becomes tables of all fields of a schema."""

_LINK = re.compile(r"(\]\()([^)#\s]+)(#[^)\s]*)?(\))")
_SCHEME = re.compile(r"[a-z]+:")

Schema = dict[str, Any]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the files that lie outside docs/."""
    for source, target in BESIDE.items():
        files.append(File.generated(config, target, content=_text(source)))
    return files


def on_page_markdown(markdown: str, page: Page, **_: object) -> str:
    """Turn links to files outside docs/ to where they lie on the site, and fill in tables."""
    here = page.file.src_uri
    if name := FIELDS.get(here):
        schema = json.loads(_text(f"benchmarks/schemas/{name}.schema.json"))
        markdown = markdown.replace("{{ fields }}", field_tables(schema))
    sources = {target: source for source, target in BESIDE.items()}
    folder = posixpath.dirname(sources.get(here, f"docs/{here}"))

    def turned(link: re.Match[str]) -> str:
        opening, address, anchor, closing = link.groups()
        if _SCHEME.match(address):
            return link.group()
        source = posixpath.normpath(posixpath.join(folder, address))
        target = {**BESIDE, **INSTEAD}.get(source) or source.removeprefix("docs/")
        relative = posixpath.relpath(target, posixpath.dirname(here))
        return f"{opening}{relative}{anchor or ''}{closing}"

    return _LINK.sub(turned, markdown)


def field_tables(schema: Schema) -> str:
    """Give a table of the fields of a schema, and one of each of its parts that has fields."""
    parts = {name: part for name, part in schema.get("$defs", {}).items() if "properties" in part}
    tables = [_table(schema["properties"])] if "properties" in schema else []
    for name, part in parts.items():
        about, table = part.get("description", ""), _table(part["properties"])
        tables.append(f"## {_title(name)}\n\n{about}\n\n{table}")
    return "\n\n".join(tables)


def _text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def _table(fields: dict[str, Schema]) -> str:
    lines = ["| field | holds | when left out | what it does |", "|---|---|---|---|"]
    for name, field in fields.items():
        default = "" if "default" not in field else f"`{json.dumps(field['default'])}`"
        text = " ".join(field.get("description", "").split()).replace("|", "\\|")
        lines.append(f"| `{name}` | {_kind(field)} | {default} | {text} |")
    return "\n".join(lines)


def _kind(field: Schema) -> str:
    """What a field may hold, in words."""
    if "$ref" in field:
        name = field["$ref"].rsplit("/", 1)[-1]
        return f"[{_title(name)}](#{_title(name).lower().replace(' ', '-')})"
    for key in ("anyOf", "oneOf", "allOf"):
        if key in field:
            return " or ".join(dict.fromkeys(_kind(choice) for choice in field[key]))
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{value}`" for value in field["enum"])
    if field.get("type") == "array":
        return f"list of {_kind(field.get('items', {}))}"
    bounds = [f"≥ {field['minimum']:,}"] if "minimum" in field else []
    bounds += [f"≤ {field['maximum']:,}"] if "maximum" in field else []
    kind = field.get("type", "any").replace("object", "mapping")
    return " ".join([kind, ", ".join(bounds)]).strip()


def _title(name: str) -> str:
    """`LimitsSpec` as a heading."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.removesuffix("Spec")).split()
    return " ".join([words[0], *(word.lower() for word in words[1:])])
