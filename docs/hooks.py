"""Hooks of `mkdocs`: files of the repository beside docs/, and tables of fields made from schemas.

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
"""Places on the site of the files of the repository that pages link to."""

INSTEAD = {"README.md": "index.md", "benchmarks/schemas": "suites.md"}
"""Pages that stand for something of the repository."""

_FIELDS = re.compile(r"{{ fields: (\w+) }}")
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
    shown: set[str] = set()
    markdown = _FIELDS.sub(lambda name: field_tables(name[1], shown), markdown)
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


def field_tables(name: str, shown: set[str]) -> str:
    """Return a table of the fields of a schema, and one of each part that is not shown yet."""
    schema = json.loads(_text(f"benchmarks/schemas/{name}.schema.json"))
    tables = [_table(schema["properties"])] if "properties" in schema else []
    for part, fields in schema.get("$defs", {}).items():
        if "properties" in fields and part not in shown:
            shown.add(part)
            about, table = fields.get("description", ""), _table(fields["properties"])
            tables.append(f"### {_title(part)}\n\n{about}\n\n{table}")
    return "\n\n".join(tables)


def _text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def _table(fields: dict[str, Schema]) -> str:
    lines = ["| field | type | default | meaning |", "|---|---|---|---|"]
    for name, field in fields.items():
        # The defaults of a section stand in its own table.
        is_plain = "default" in field and "$ref" not in field
        default = f"`{json.dumps(field['default'])}`" if is_plain else ""
        text = " ".join(field.get("description", "").split()).replace("|", "\\|")
        lines.append(f"| `{name}` | {_kind(field)} | {default} | {text} |")
    return "\n".join(lines)


def _kind(field: Schema) -> str:
    """Return the type of a field in words."""
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
    """Return a class name as a heading: `LimitsSpec` is "Limits"."""
    words = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name.removesuffix("Spec")).split()
    return " ".join([words[0], *(word.lower() for word in words[1:])])
